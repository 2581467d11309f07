"""The entry of a compiled program: threads take chunks of items, and each chunk runs packet by packet.

`void launch(ptr context)` may be called by several threads at once. A parameter of the entry module is bound in one of
three ways (`Binding`): an array with an element for each item, one value for all items, or the item's own number.
Arrays hold one leaf each (structure of arrays) and are padded to whole packets, so that packets load and store whole
vectors.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from tasuki.ir import nodes as ir
from tasuki.ir.types import Table
from tasuki.machines.cpu.checks import REPORT, AccessSite
from tasuki.machines.cpu.context import ARGUMENTS, CHUNK, COUNTER, ITEMS, STOP
from tasuki.machines.cpu.emit import STORED, Declarations, Emitter, Leaf, result_type
from tasuki.machines.cpu.lower import Lowered, lower_program, named_tables
from tasuki.machines.cpu.variance import Pattern

Binding = Literal["items", "same", "number"]


@dataclass(frozen=True)
class Kernel:
    """LLVM text of a whole program, and its metadata."""

    text: str
    sites: list[AccessSite]
    profiled: list[tuple[str, str]]


def emit_kernel(
    program: ir.Program, bindings: Sequence[Binding], width: int, *, checked: bool, profile: bool
) -> Kernel:
    """The LLVM module of `program` for packets of `width` lanes, its entry's parameters bound as `bindings` says."""
    function = program.functions[program.entry]
    lowered = lower_program(program, pattern(function, bindings, width), width, checked=checked, profile=profile)
    launch = _Launch(function, bindings, sorted_tables(program), lowered, width).emit()
    parts = [*lowered.declarations.lines.values(), "", REPORT if checked else "", launch, *lowered.functions]
    return Kernel("\n".join(parts), lowered.sites, lowered.profiled)


def pattern(function: ir.Function, bindings: Sequence[Binding], width: int) -> Pattern:
    """Which leaves vary: those of parameters bound to items. With one lane nothing does."""
    return tuple(
        () if isinstance(p.type, Table) else (binding != "same" and width > 1,) * len(p.type.leaves)
        for p, binding in zip(function.parameters, bindings, strict=True)
    )


def sorted_tables(program: ir.Program) -> list[str]:
    """The named tables that the entry reaches, in the order in which the context holds them."""
    return list(named_tables(program)[program.entry])


class _Launch:
    def __init__(
        self,
        function: ir.Function,
        bindings: Sequence[Binding],
        tables: Sequence[str],
        lowered: Lowered,
        width: int,
    ) -> None:
        self.function = function
        self.bindings = bindings
        self.tables = tables
        self.lowered = lowered
        self.width = width
        self.e = Emitter(width, Declarations())
        self.words: Iterator[int] = iter(range(ARGUMENTS, 1 << 16))

    def emit(self) -> str:
        e = self.e
        arguments = [self.prepare(p, b) for p, b in zip(self.function.parameters, self.bindings, strict=True)]
        tables = [self.table_words() for _ in self.tables]
        results = [self.pointer() for _ in self.function.result.leaves]
        items, chunk = self.word(ITEMS), self.word(CHUNK)
        counter, stop = self.address(COUNTER), self.address(STOP)
        item, end = e.slot("i64", 8), e.slot("i64", 8)
        e.label("take")
        halted = e.value(f"load volatile i64, ptr {stop}, align 8")
        e.branch(e.value(f"icmp eq i64 {halted}, 0"), "next", "done")
        e.label("next")
        taken = e.value(f"atomicrmw add ptr {counter}, i64 1 monotonic")
        first = e.value(f"mul i64 {taken}, {chunk}")
        e.line(f"store i64 {first}, ptr {item}")
        past = e.value(f"add i64 {first}, {chunk}")
        smaller = e.value(f"icmp ult i64 {past}, {items}")
        e.line(f"store i64 {e.value(f'select i1 {smaller}, i64 {past}, i64 {items}')}, ptr {end}")
        e.branch(e.value(f"icmp ult i64 {first}, {items}"), "packet", "done")
        e.label("packet")
        now = e.value(f"load i64, ptr {item}")
        self.packet(now, e.value(f"load i64, ptr {end}"), arguments, tables, results)
        after = e.value(f"add i64 {now}, {self.width}")
        e.line(f"store i64 {after}, ptr {item}")
        limit = e.value(f"load i64, ptr {end}")
        e.branch(e.value(f"icmp ult i64 {after}, {limit}"), "packet", "take")
        e.label("done")
        e.line("ret void")
        return "\n".join(["define void @launch(ptr %context) {", "entry:", *e.slots, *e.body, "}", ""])

    # --- what the context holds ---------------------------------------------------------------------------------------

    def address(self, word: int) -> str:
        return self.e.value(f"getelementptr i64, ptr %context, i64 {word}")

    def word(self, word: int) -> str:
        return self.e.value(f"load i64, ptr {self.address(word)}, align 8")

    def pointer(self) -> str:
        return self.e.value(f"load ptr, ptr {self.address(next(self.words))}, align 8")

    def table_words(self) -> list[str]:
        base = self.pointer()
        count = self.e.value(f"trunc i64 {self.word(next(self.words))} to i32")
        return [f"ptr {base}", f"i32 {count}"]

    def prepare(self, parameter: ir.Parameter, binding: Binding) -> list[str] | list[Leaf]:
        """What is read from the context once: pointers to arrays, the value for all items, or a table."""
        e = self.e
        if isinstance(parameter.type, Table):
            return self.table_words()
        if binding == "number":
            return []
        leaves: list[Leaf] = []
        for scalar in parameter.type.leaves:
            pointer = self.pointer()
            if binding == "items":
                leaves.append(Leaf(scalar, True, pointer))
            else:
                text = e.value(f"load {STORED[scalar]}, ptr {pointer}, align 4")
                leaves.append(e.from_stored(scalar, False, text))
        return leaves

    # --- a packet -----------------------------------------------------------------------------------------------------

    def packet(
        self, now: str, end: str, arguments: Sequence[Sequence], tables: Sequence[Sequence[str]], results: Sequence[str]
    ) -> None:
        e = self.e
        call = ["ptr %context", f"{e.mask_type} {self.active(now, end)}"]
        for parameter, binding, prepared in zip(self.function.parameters, self.bindings, arguments, strict=True):
            if isinstance(parameter.type, Table):
                call += prepared
            elif binding == "number":
                call.append(e.typed(self.numbers(now)))
            else:
                call += [e.typed(leaf if binding == "same" else self.item(leaf, now)) for leaf in prepared]
        call += [text for table in tables for text in table]
        self.store_results(now, f"@{self.lowered.entry}({', '.join(call)})", results)

    def active(self, now: str, end: str) -> str:
        """The mask of lanes whose item exists."""
        e = self.e
        left = e.value(f"sub i64 {end}, {now}")
        whole = e.value(f"icmp uge i64 {left}, {self.width}")
        bound = e.value(f"select i1 {whole}, i64 {self.width}, i64 {left}")
        count = e.broadcast(Leaf("i32", False, e.value(f"trunc i64 {bound} to i32")))
        return e.value(f"icmp ult <{self.width} x i32> {e.lane_numbers()}, {count.text}")

    def numbers(self, now: str) -> Leaf:
        e = self.e
        first = Leaf("i32", False, e.value(f"trunc i64 {now} to i32"))
        if self.width == 1:
            return first
        return Leaf("i32", True, e.value(f"add {e.typed(e.broadcast(first))}, {e.lane_numbers()}"))

    def item(self, leaf: Leaf, now: str) -> Leaf:
        e = self.e
        varying = self.width > 1
        place = e.value(f"getelementptr inbounds i32, ptr {leaf.text}, i64 {now}")
        text = e.value(f"load {e.stored_type(leaf.scalar, varying)}, ptr {place}, align 4")
        return e.from_stored(leaf.scalar, varying, text)

    def store_results(self, now: str, call: str, results: Sequence[str]) -> None:
        e = self.e
        shape = list(zip(self.function.result.leaves, self.lowered.result_varying, strict=True))
        if not shape:
            e.line(f"call void {call}")
            return
        type_ = result_type(e, shape)
        returned = e.value(f"call {type_} {call}")
        for i, (scalar, varying) in enumerate(shape):
            leaf = Leaf(scalar, varying, e.value(f"extractvalue {type_} {returned}, {i}"))
            if self.width > 1:
                leaf = e.broadcast(leaf)
            place = e.value(f"getelementptr inbounds i32, ptr {results[i]}, i64 {now}")
            e.line(f"store {e.stored_type(scalar, leaf.varying)} {e.to_stored(leaf)}, ptr {place}, align 4")
