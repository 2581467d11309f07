"""The state as native code sees it: an array of 32-bit words, a place for each register, output, latch and flag."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tasuki.machines.pu import isa
from tasuki.machines.pu.simulate.instruction import BANKS, FILES, FPP
from tasuki.machines.pu.simulate.state import ALU_FLAGS, FPP_FLAGS, State

Words = npt.NDArray[np.uint32]
NOWHERE = 0xFFFFFFFF
"""`came_from` at the start."""


@dataclass(frozen=True)
class Slot:
    """A variable of native code: its place among the words, and its type in LLVM: float, i32 or i1.

    An i1 is stored in the first byte of its word, the others being 0: right for little-endian processors, as all are
    for which `tasuki.native` compiles.
    """

    name: str
    place: int
    type: str


def _named() -> Iterator[tuple[str, str]]:
    """(name, type) of every slot. Words that FPPs work on are floats: moving a float keeps its bits, NaN or not."""
    for file in FILES:
        type_ = "float" if file in FPP else "i32"
        yield from ((register_slot(file, number), type_) for number in range(isa.DEFAULT.register_counts[file]))
    for unit in (*FPP, "table", "alu"):
        yield f"{unit}.output", "i32" if unit == "alu" else "float"
    for bank in BANKS:
        yield f"{bank}.latch", "float"
    for unit in (*FPP, "alu"):
        yield from ((f"{unit}.{flag}", "i1") for flag in (ALU_FLAGS if unit == "alu" else FPP_FLAGS))
    yield "special", "i1"
    yield "halted", "i1"
    for name in ("row", "frames", "address", "came_from", "calls", "loops"):
        yield name, "i32"


def register_slot(file: str, number: int) -> str:
    return f"{file}.{number}"


SLOTS = {name: Slot(name, place, type_) for place, (name, type_) in enumerate(_named())}
CALL_STACK = len(SLOTS)
"""Where the call stack begins; slot `calls` holds how many addresses are on it."""
LOOP_STACK = CALL_STACK + isa.CALL_DEPTH
"""Where the loop stack begins; slot `loops` holds how many counts are on it."""
SIZE = LOOP_STACK + isa.LOOP_DEPTH


def _scalars(state: State) -> Iterator[tuple[str, int]]:
    """Slot name -> word, for all but the stacks."""
    for file, registers in state.registers.items():
        yield from ((register_slot(file, number), word) for number, word in enumerate(registers))
    yield from ((f"{unit}.output", word) for unit, word in state.output.items())
    yield from ((f"{bank}.latch", word) for bank, word in state.latch.items())
    for unit, flags in state.flags.items():
        yield from ((f"{unit}.{flag}", int(value)) for flag, value in flags.items())
    yield "special", int(state.special)
    yield "halted", int(state.halted)
    yield "came_from", NOWHERE if state.came_from is None else state.came_from
    yield from (("row", state.row), ("frames", state.frames), ("address", state.address))
    yield from (("calls", len(state.call_stack)), ("loops", len(state.loop_stack)))


def pack(state: State) -> Words:
    """The words of `state`. Memory, display and the number of steps are not among them."""
    words = np.zeros(SIZE, np.uint32)
    for name, word in _scalars(state):
        words[SLOTS[name].place] = word
    words[CALL_STACK : CALL_STACK + len(state.call_stack)] = state.call_stack
    words[LOOP_STACK : LOOP_STACK + len(state.loop_stack)] = state.loop_stack
    return words


def unpack(words: Words, state: State) -> None:
    """Put `words` back into `state`."""
    values = words.tolist()

    def word(name: str) -> int:
        return values[SLOTS[name].place]

    for file, registers in state.registers.items():
        registers[:] = [word(register_slot(file, number)) for number in range(len(registers))]
    state.output = {unit: word(f"{unit}.output") for unit in state.output}
    state.latch = {bank: word(f"{bank}.latch") for bank in state.latch}
    state.flags = {unit: {flag: bool(word(f"{unit}.{flag}")) for flag in flags} for unit, flags in state.flags.items()}
    state.special, state.halted = bool(word("special")), bool(word("halted"))
    state.row, state.frames, state.address = word("row"), word("frames"), word("address")
    state.came_from = None if word("came_from") == NOWHERE else word("came_from")
    state.call_stack = values[CALL_STACK : CALL_STACK + word("calls")]
    state.loop_stack = values[LOOP_STACK : LOOP_STACK + word("loops")]
