"""Traps: a program stopped before a step that the machine cannot make."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping

from tasuki.diagnostics import Diagnostic, MachineError, Note, Span
from tasuki.machines.pu import isa
from tasuki.machines.pu.simulate.state import State, register_name, shown


class Trap(MachineError):
    """The machine stopped. `state` is its state before the step that it could not make; `kind` one of

    "undefined", "conflict", "memory", "display", "call stack", "loop stack", "end" (beyond the program), "limit".
    """

    def __init__(
        self,
        kind: str,
        message: str,
        program: isa.Program,
        state: State,
        *,
        expected: str | None = None,
        found: str | None = None,
    ) -> None:
        self.kind = kind
        self.state = state
        self.span = source_span(program, state.address)
        notes = [Note(f"at step {state.steps + 1}, {place(program, state.address)}")]
        if state.came_from is not None:
            came_from = f"control came from {place(program, state.came_from)}"
            notes.append(Note(came_from, source_span(program, state.came_from) if kind == "end" else None))
        text = str(Diagnostic(message, self.span, expected=expected, found=found, notes=tuple(notes)))
        super().__init__(f"{text}\n{described(state)}")


def source_span(program: isa.Program, address: int) -> Span | None:
    """Where the microinstruction at `address` was written, if that is known."""
    return program.spans[address] if address < len(program.spans) else None


def label_of(labels: Mapping[str, int], address: int) -> str:
    """The address as label + distance, by the nearest label at or before it; "" where there is none."""
    before = [(at, name) for name, at in labels.items() if at <= address]
    if not before:
        return ""
    nearest = max(at for at, _ in before)
    name = min(name for at, name in before if at == nearest)
    return name if nearest == address else f"{name}+{address - nearest}"


def place(program: isa.Program, address: int) -> str:
    label = label_of(program.labels, address)
    return f"address {address} ({label})" if label else f"address {address}"


def described(state: State) -> str:
    """The parts of the state that explain a trap, as lines of text."""
    lines = ["  state:"]
    for unit, word in state.output.items():
        flags = " ".join(name for name, value in state.flags.get(unit, {}).items() if value)
        flags = "special" if unit == "table" and state.special else flags
        lines.append(f"    {unit:5} output {shown(word)}" + (f"  flags {flags}" if flags else ""))
    latches = "  ".join(f"{bank} {shown(word)}" for bank, word in state.latch.items())
    lines.append(f"    latches {latches}")
    lines += _registers(state)
    lines.append(f"    row {state.row}  call stack {state.call_stack}  loop stack {state.loop_stack}")
    return "\n".join(lines)


def _registers(state: State) -> list[str]:
    """The registers that are not 0, in hexadecimal."""
    words = [
        f"{register_name(file, number)}={word:x}"
        for file, registers in state.registers.items()
        for number, word in enumerate(registers)
        if word
    ]
    if not words:
        return ["    registers: all are 0"]
    text = f"registers (hexadecimal; the others are 0): {' '.join(words)}"
    return textwrap.wrap(text, 116, initial_indent="    ", subsequent_indent="      ")
