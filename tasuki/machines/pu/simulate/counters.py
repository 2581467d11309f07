"""What a run cost, counted: steps, busy units, memory rows, bus transfers, as a whole and for each label.

A simulator counts one thing only, how often each microinstruction ran. Everything else follows, because what a
microinstruction keeps busy and moves does not depend on the state (`instruction.cost`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from tasuki.machines.pu import isa
from tasuki.machines.pu.simulate.instruction import FPP, cost, instruction

UNITS = (*FPP, "alu", "tab", "ag", "mem", "disp")
"""Units that can be busy: FPPs, ALU, tables, address calculator, data memory, display port."""


@dataclass
class Counters:
    """Sums over steps.

    `busy[unit]` counts the steps in which a unit had an operation, `transfers[driver, listener]` the operands that
    crossed from an FPP to another; rows and words are those of the data memory, pixels those sent to the display.
    """

    steps: int = 0
    busy: dict[str, int] = field(default_factory=lambda: dict.fromkeys(UNITS, 0))
    rows_read: int = 0
    rows_written: int = 0
    words_read: int = 0
    words_written: int = 0
    transfers: dict[tuple[str, str], int] = field(default_factory=dict)
    pixels: int = 0

    def busy_share(self, unit: str) -> float:
        """The share of steps, 0 to 1, in which `unit` was busy."""
        return self.busy[unit] / self.steps if self.steps else 0.0

    @property
    def bus_transfers(self) -> int:
        """All operands that crossed from one FPP to another."""
        return sum(self.transfers.values())

    def add(self, word: isa.Word, times: int) -> None:
        """Count `times` executions of a microinstruction."""
        once = cost(instruction(word))
        self.steps += times
        for unit in once.busy:
            self.busy[unit] += times
        self.rows_read += times * once.rows_read
        self.rows_written += times * once.rows_written
        self.words_read += times * once.words_read
        self.words_written += times * once.words_written
        self.pixels += times * once.pixels
        for pair, operands in once.transfers:
            self.transfers[pair] = self.transfers.get(pair, 0) + times * operands


def count(program: isa.Program, executions: Sequence[int]) -> Counters:
    """The counters of a run in which word i was executed `executions[i]` times."""
    counters = Counters()
    for word, times in zip(program.words, executions, strict=True):
        if times:
            counters.add(word, times)
    return counters


def count_labels(program: isa.Program, executions: Sequence[int]) -> dict[str, Counters]:
    """The same for each label that was reached, in order of addresses.

    A microinstruction belongs to the nearest label at or before it; those before the first label to "". Of several
    labels at one address the alphabetically first stands for all.
    """
    names = _first_names(program.labels)
    found: dict[str, Counters] = {}
    label = ""
    for address, (word, times) in enumerate(zip(program.words, executions, strict=True)):
        label = names.get(address, label)
        if times:
            found.setdefault(label, Counters()).add(word, times)
    return found


def _first_names(labels: Mapping[str, int]) -> dict[int, str]:
    names: dict[int, str] = {}
    for name in sorted(labels):
        names.setdefault(labels[name], name)
    return names


def report(counters: Counters, labels: Mapping[str, Counters]) -> str:
    """The counters as text for a terminal: totals, then a line for each label; "-" is what stands before the first."""
    lines = [
        f"steps          {counters.steps:>14,}",
        f"memory rows    {counters.rows_read:>14,} read  {counters.rows_written:>14,} written",
        f"memory words   {counters.words_read:>14,} read  {counters.words_written:>14,} written",
        f"bus transfers  {counters.bus_transfers:>14,}",
        f"pixels         {counters.pixels:>14,}",
        "",
    ]
    width = max([len("label"), *(len(name) for name in labels)])
    lines.append("  ".join([f"{'label':<{width}}", f"{'steps':>14}", *(f"{unit:>6}" for unit in UNITS)]) + "   busy, %")
    for name, part in [*labels.items(), ("all", counters)]:
        shares = [f"{100 * part.busy_share(unit):6.1f}" for unit in UNITS]
        lines.append("  ".join([f"{name or '-':<{width}}", f"{part.steps:>14,}", *shares]))
    return "\n".join(lines)
