"""Simulators of the processor unit: `plain` is the definition, `fast` native code that agrees with it.

`run` runs an assembled program to its halt and gives the state and the counters. `start` makes the state that a program
begins in, for those who want to fill registers before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TextIO

from tasuki.diagnostics import MachineError
from tasuki.machines.pu import isa
from tasuki.machines.pu.simulate.counters import Counters, count, count_labels, report
from tasuki.machines.pu.simulate.fast import Fast
from tasuki.machines.pu.simulate.plain import Plain, Step
from tasuki.machines.pu.simulate.state import Memory, State, start
from tasuki.machines.pu.simulate.trace import TraceWriter
from tasuki.machines.pu.simulate.traps import Trap
from tasuki.machines.pu.simulate.vcd import VcdWriter

__all__ = ["Counters", "Fast", "Machine", "Memory", "Outcome", "Plain", "State", "Step", "Trap", "run", "start"]

Machine = Literal["fast", "plain"]
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
    machine: Machine = "fast",
    trace: TextIO | None = None,
    vcd: TextIO | None = None,
) -> Outcome:
    """Run `program` until it halts.

    `memory` is put into data memory over the program's own data. `state` is where to begin in place of `start(program,
    memory)`; it is changed. Raises Trap (a MachineError) where the machine stops before the halt, and where it would
    make more than `limit` steps.

    `trace` takes a table with a line for each step, `vcd` a value change dump; with either the plain simulator runs,
    whatever `machine` says, and what was written before a trap stays.
    """
    if state is not None and memory is not None:
        raise MachineError("a run takes an initial memory or an initial state, not both")
    now = start(program, memory) if state is None else state
    steps = ENDLESS if limit is None else limit
    simulator: Plain | Fast
    if trace or vcd:
        simulator = Plain(program, now)
        _observe(simulator, steps, trace, vcd)
    else:
        simulator = Plain(program, now) if machine == "plain" else Fast(program, now)
        simulator.advance(steps)
    if not now.halted:
        raise Trap("limit", f"no halt within {limit} steps", program, now)
    return Outcome(program, now, simulator.executions)


def _observe(simulator: Plain, steps: int, trace: TextIO | None, vcd: TextIO | None) -> None:
    """Make up to `steps` steps, writing each down."""
    state = simulator.state
    table = TraceWriter(trace, simulator.program) if trace else None
    dump = VcdWriter(vcd) if vcd else None
    if dump:
        dump.sample(state)
    last = state.steps + steps
    try:
        while not state.halted and state.steps < last:
            step = simulator.step()
            if table:
                table.add(step, state)
            if dump:
                dump.sample(state)
    finally:
        if table:
            table.finish()
