"""Simulators of the processor unit: `plain` is the definition, `fast` native code that agrees with it.

`run` runs an assembled program to its halt and gives the state and the counters. `start` makes the state that a program
begins in, for those who want to fill registers before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from tasuki.diagnostics import MachineError
from tasuki.machines.pu import isa
from tasuki.machines.pu.simulate.counters import Counters, count, count_labels, report
from tasuki.machines.pu.simulate.fast import Fast
from tasuki.machines.pu.simulate.plain import Plain, Step
from tasuki.machines.pu.simulate.state import Memory, State, start
from tasuki.machines.pu.simulate.traps import Trap

__all__ = ["Counters", "Fast", "Memory", "Outcome", "Plain", "State", "Step", "Trap", "run", "start"]

ENDLESS = 1 << 62
"""More steps than anyone will wait for."""


@dataclass(frozen=True)
class Outcome:
    """A run that came to its halt. `executions[i]` says how often word i of the program ran."""

    program: isa.Program
    state: State
    executions: Sequence[int]

    @cached_property
    def counters(self) -> Counters:
        """Steps, busy units, memory rows, bus transfers."""
        return count(self.program, self.executions)

    @cached_property
    def labels(self) -> dict[str, Counters]:
        """The same for each label."""
        return count_labels(self.program, self.executions)

    def report(self) -> str:
        """The counters as text."""
        return report(self.counters, self.labels)


def run(
    program: isa.Program,
    *,
    memory: Memory | None = None,
    state: State | None = None,
    limit: int | None = None,
    machine: Literal["fast", "plain"] = "fast",
) -> Outcome:
    """Run `program` until it halts.

    `memory` is put into data memory over the program's own data. `state` is where to begin in place of `start(program,
    memory)`; it is changed. Raises Trap (a MachineError) where the machine stops before the halt, and where it would
    make more than `limit` steps.
    """
    if state is not None and memory is not None:
        raise MachineError("a run takes an initial memory or an initial state, not both")
    now = start(program, memory) if state is None else state
    simulator: Plain | Fast = Plain(program, now) if machine == "plain" else Fast(program, now)
    simulator.advance(ENDLESS if limit is None else limit)
    if not now.halted:
        raise Trap("limit", f"no halt within {limit} steps", program, now)
    return Outcome(program, now, simulator.executions)
