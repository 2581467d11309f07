"""The state of a processor unit between two steps: everything that a microinstruction can read or change."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from tasuki.diagnostics import MachineError
from tasuki.machines.pu import isa
from tasuki.machines.pu.simulate.instruction import BANKS, FPP
from tasuki.native.buffers import aligned_zeros

Rows = npt.NDArray[np.uint32]
"""Words of memory, of shape (rows, 4): a row for each address, a column for each bank."""
Memory = Mapping[int, isa.Row] | npt.NDArray
"""What to put into data memory: words of some rows, or an array of shape (rows, 4) of 32-bit numbers, from row 0 on."""

FPP_FLAGS = ("lt", "eq", "un")
ALU_FLAGS = ("lt", "eq", "ult")


def _registers() -> dict[str, list[int]]:
    return {file: [0] * count for file, count in isa.DEFAULT.register_counts.items()}


def _flags() -> dict[str, dict[str, bool]]:
    return {unit: dict.fromkeys(ALU_FLAGS if unit == "alu" else FPP_FLAGS, False) for unit in (*FPP, "alu")}


@dataclass
class State:
    """A processor unit. All words are numbers from 0 to 2**32 - 1; `steps` counts the steps that were made.

    `registers[file]` with the files x, y, z, s, alu, br, ir, ar; `output[unit]` with the units x, y, z, s, alu and
    table; `flags[unit][flag]`; `latch[bank]` is the data latch of a memory bank; `row` the row register; `address` that
    of the next microinstruction; `came_from` that of the one before it (None at the start).
    """

    memory: Rows
    display: Rows
    registers: dict[str, list[int]] = field(default_factory=_registers)
    output: dict[str, int] = field(default_factory=lambda: dict.fromkeys((*FPP, "alu", "table"), 0))
    flags: dict[str, dict[str, bool]] = field(default_factory=_flags)
    special: bool = False
    latch: dict[str, int] = field(default_factory=lambda: dict.fromkeys(BANKS, 0))
    row: int = 0
    frames: int = 0
    call_stack: list[int] = field(default_factory=list)
    loop_stack: list[int] = field(default_factory=list)
    address: int = 0
    came_from: int | None = None
    halted: bool = False
    steps: int = 0

    def copy(self) -> State:
        """The same state, sharing nothing."""
        return copy.deepcopy(self)

    def differences(self, other: State) -> list[str]:
        """What differs between two states, as lines to read: nothing where they are equal, word for word."""
        found = []
        for name, mine in vars(self).items():
            theirs = getattr(other, name)
            if isinstance(mine, np.ndarray):
                rows = np.unique(np.nonzero(mine != theirs)[0]).tolist()
                found += [f"{name}[{row}]: {mine[row].tolist()} and {theirs[row].tolist()}" for row in rows]
            elif mine != theirs:
                found.append(f"{name}: {mine} and {theirs}")
        return found


def start(program: isa.Program, memory: Memory | None = None) -> State:
    """The state in which `program` begins: everything 0, but for the program's data and then `memory` in data memory.

    Raises MachineError where these do not fit the memory.
    """
    state = State(
        memory=aligned_zeros((program.memory_rows, 4), np.uint32),
        display=aligned_zeros((program.display_rows, 4), np.uint32),
    )
    _put(state.memory, program.memory)
    if isinstance(memory, np.ndarray):
        _put_array(state.memory, memory)
    elif memory is not None:
        _put(state.memory, memory)
    return state


def _put(rows: Rows, content: Mapping[int, isa.Row]) -> None:
    for row, words in content.items():
        if not 0 <= row < len(rows):
            raise MachineError(f"initial data for row {row}, but data memory has the rows 0 to {len(rows) - 1}")
        rows[row] = words


def _put_array(rows: Rows, content: npt.NDArray) -> None:
    if content.ndim != 2 or content.shape[1] != 4 or content.dtype.itemsize != 4:
        raise MachineError(
            f"initial memory is an array of shape (rows, 4) of 32-bit numbers; found {content.shape} of {content.dtype}"
        )
    if len(content) > len(rows):
        raise MachineError(f"initial memory has {len(content)} rows, but data memory has {len(rows)}")
    rows[: len(content)] = np.ascontiguousarray(content).view(np.uint32)


def register_name(file: str, number: int) -> str:
    """As the assemblers name it, with the bank where there are several: X.R3, I0, BR5."""
    if file in FPP:
        return f"{file.upper()}.R{number}"
    return f"I{number}" if file == "alu" else f"{file.upper()}{number}"


def as_float(word: int) -> np.float32:
    """The word as a binary32 number."""
    return np.uint32(word).view(np.float32)


def shown(word: int) -> str:
    """A word for people: its bits, and the float that they are."""
    return f"{word:08x} ({as_float(word):.9g})"
