"""Cycle counting for `--profile`: modules stay calls, and every call is timed by the processor's counter.

For each edge (caller, callee) of the call graph three 64-bit words: calls, active lanes, cycles. A module's own cycles
are those of the edges into it less those of the edges out of it. A profiled program runs on one thread. With packets of
one lane calls are counted, not timed: LLVM cannot pass vectors of one bit between functions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from tasuki.machines.cpu.context import PROFILE
from tasuki.machines.cpu.emit import Emitter

WORDS = 3
"""Words of an edge: calls, lanes, cycles."""


@dataclass
class Timing:
    edge: int
    started: str | None
    lanes: str


class ProfileCounters:
    """Emits the counting of calls, or nothing when not `enabled`. Calls that are not `timed` are inlined."""

    def __init__(self, enabled: bool, *, timed: bool = True) -> None:
        self.enabled = enabled
        self.timed = timed
        self.edges: list[tuple[str, str]] = []

    @property
    def attributes(self) -> str:
        return "noinline" if self.enabled and self.timed else "alwaysinline"

    def begin(self, e: Emitter, caller: str, callee: str, mask: Callable[[], str]) -> Timing | None:
        if not self.enabled:
            return None
        edge = (caller, callee)
        if edge not in self.edges:
            self.edges.append(edge)
        lanes = e.value(f"zext i32 {e.count_lanes(mask())} to i64")
        started = e.intrinsic("llvm.readcyclecounter", "i64", []) if self.timed else None
        return Timing(self.edges.index(edge), started, lanes)

    def end(self, e: Emitter, timing: Timing | None) -> None:
        if timing is None:
            return
        amounts = ["1", timing.lanes]
        if timing.started:
            amounts.append(e.value(f"sub i64 {e.intrinsic('llvm.readcyclecounter', 'i64', [])}, {timing.started}"))
        slot = e.value(f"getelementptr i64, ptr %context, i64 {PROFILE}")
        counters = e.value(f"load ptr, ptr {slot}, align 8")
        for word, amount in enumerate(amounts):
            pointer = e.value(f"getelementptr i64, ptr {counters}, i64 {WORDS * timing.edge + word}")
            total = e.value(f"add i64 {e.value(f'load i64, ptr {pointer}, align 8')}, {amount}")
            e.line(f"store i64 {total}, ptr {pointer}, align 8")
