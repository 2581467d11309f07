"""The readable trace: a table with a line for each step, as Figure 5 of the paper shows the normalisation.

Columns: the step and its address; what X, Y, Z, S, the table and the ALU did and gave; the buses that carried a word;
memory; the registers that were written; the sequencer. Columns in which nothing happened are left out.
"""

from __future__ import annotations

from typing import TextIO

from tasuki.machines.pu import isa
from tasuki.machines.pu.simulate.arithmetic import signed
from tasuki.machines.pu.simulate.instruction import FPP, Instruction
from tasuki.machines.pu.simulate.plain import Step
from tasuki.machines.pu.simulate.state import State, as_float, register_name
from tasuki.machines.pu.simulate.traps import label_of

PAGE = 500
"""Lines that are held back to find how wide the columns must be; then follows a new head."""
COLUMNS = ("step", "address", "X", "Y", "Z", "S", "table", "ALU", "buses", "memory", "writes", "sequencer")
_ALWAYS = ("step", "address")
_FLOATS = (*FPP, "table")


class TraceWriter:
    """Writes the table to an open text file. `add` each step, then `finish`."""

    def __init__(self, file: TextIO, program: isa.Program) -> None:
        self._file = file
        self._program = program
        self._lines: list[dict[str, str]] = []

    def add(self, step: Step, state: State) -> None:
        """A step that was made, and the state after it."""
        self._lines.append(_cells(step, state, self._program))
        if len(self._lines) == PAGE:
            self.finish()

    def finish(self) -> None:
        """Write what has been held back."""
        shown = [column for column in COLUMNS if column in _ALWAYS or any(line[column] for line in self._lines)]
        if not self._lines:
            return
        table = [{column: column for column in shown}, *self._lines]
        widths = {column: max(len(line[column]) for line in table) for column in shown}
        for line in table:
            text = "  ".join(line[column].ljust(widths[column]) for column in shown)
            self._file.write(text.rstrip() + "\n")
        self._lines.clear()


def _cells(step: Step, state: State, program: isa.Program) -> dict[str, str]:
    one = step.instruction
    label = label_of(program.labels, step.address)
    cells = {
        "step": str(step.number),
        "address": f"{step.address} {label}".rstrip(),
        "table": _table(step),
        "ALU": _operation(step, "alu"),
        "buses": " ".join(f"{driver}->{listener}" for driver, listener in isa.transfers(one.number)),
        "memory": _memory(step, state),
        "writes": " ".join(f"{register_name(*key)}={_shown(key[0], word)}" for key, word in step.written.items()),
        "sequencer": _sequencer(one, program),
    }
    return cells | {unit.upper(): _operation(step, unit) for unit in FPP}


def _shown(unit: str, word: int) -> str:
    """A word as its unit takes it: a float, or an integer."""
    return f"{as_float(word):.7g}" if unit in _FLOATS else str(signed(word))


def _source(one: Instruction, unit: str, operand: str) -> str:
    source = one.name[f"{unit}.{operand}"]
    if source == "reg":
        return register_name(unit, one.number[f"{unit}.r{operand}"]).removeprefix(f"{unit.upper()}.")
    if source == "port":
        return register_name("s", one.number["s.ra"])
    if source == "lit":
        return _shown(unit, one.number["lit"])
    return register_name(source, one.number[f"ag.{source}"]) if source in ("br", "ir", "ar") else source


def _operation(step: Step, unit: str) -> str:
    """What an FPP or the ALU did: "mul R1,R1 = 9", "cmp R1,R2: lt"."""
    one = step.instruction
    operation = isa.DEFAULT.by_name[f"{unit}.op"].by_code[one.number[f"{unit}.op"]]
    if operation.name == "nop":
        return ""
    text = f"{operation.name} {','.join(_source(one, unit, operand) for operand in operation.reads)}".rstrip()
    if unit in step.flags:
        return f"{text}: {' '.join(flag for flag, value in step.flags[unit].items() if value) or 'none'}"
    return f"{text} = {_shown(unit, step.results[unit])}"


def _table(step: Step) -> str:
    one = step.instruction
    if one.name["tab.op"] == "none":
        return ""
    source = register_name("s", one.number["s.ra"]) if one.name["tab.in"] == "port" else one.name["tab.in"]
    return f"{one.name['tab.op']} {source} = {_shown('table', step.results['table'])}"


def _memory(step: Step, state: State) -> str:
    """The access and its words: "read xyz 12: 1 2 3"."""
    one = step.instruction
    parts = []
    if one.accesses_memory:
        latched = one.name["mem.op"] == "read"
        columns = ["xyzs".index(bank) for bank in one.banks]
        words = [state.latch[bank] for bank in one.banks] if latched else state.memory[step.row, columns].tolist()
        shown = " ".join(_shown("x", word) for word in words)
        parts.append(f"{one.name['mem.op']} {''.join(one.banks)} {step.row}: {shown}")
    if one.accesses_display:
        parts.append(f"pixel {step.row}: {' '.join(_shown('x', word) for word in state.display[step.row].tolist())}")
    elif one.name["disp.op"] == "frame":
        parts.append("frame")
    return "; ".join(parts)


def _sequencer(one: Instruction, program: isa.Program) -> str:
    """What the sequencer was told: "jump 4 (loop) if x.lt"."""
    operation = one.name["seq.op"]
    if operation == "next":
        return ""
    text = operation
    if operation in ("jump", "call", "loop"):
        label = label_of(program.labels, one.number["seq.to"])
        text += f" {one.number['seq.to']}" + (f" ({label})" if label else "")
    elif operation == "count":
        text += f" {one.number['lit']}"
    conditional = operation not in ("count", "count_alu", "loop", "drop")
    if conditional and (one.name["seq.cond"], one.name["seq.not"]) != ("true", "no"):
        text += f" if {'not ' if one.name['seq.not'] == 'yes' else ''}{one.name['seq.cond']}"
    return text
