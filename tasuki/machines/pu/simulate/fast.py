"""The fast simulator: microcode as native code. It agrees with the plain one in every word of the state and counter.

`translate` makes LLVM of the program, `tasuki.native` object code, which is kept in the cache on disk. Steps that the
native code cannot make, among them those that trap, are made by the plain simulator, on the same state.
"""

from __future__ import annotations

import ctypes
import hashlib
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from tasuki.diagnostics import MachineError
from tasuki.machines.pu import isa
from tasuki.machines.pu.simulate.blocks import blocks
from tasuki.machines.pu.simulate.layout import SLOTS, Words, pack, unpack
from tasuki.machines.pu.simulate.plain import Plain
from tasuki.machines.pu.simulate.state import State
from tasuki.machines.pu.simulate.translate import BUDGET, CONTROL_WORDS, PART_START, PART_STEPS, translate
from tasuki.native import cache
from tasuki.native.compile import Library, compile_object, host

SLICE = 50_000_000
"""Steps in one call of native code, which Ctrl-C cannot interrupt: less than a second."""

_HALTED, _ADDRESS = SLOTS["halted"].place, SLOTS["address"].place


class Native:
    """The native code of a program. May be run any number of times."""

    def __init__(self, program: isa.Program) -> None:
        self.program = program
        self.blocks = blocks(program)
        self._library = Library(_object_code(translate(program)))
        self._run = self._library.function("run", *[ctypes.c_void_p] * 5)


class Fast:
    """A processor unit with a program, as `plain.Plain` has it, but for many steps at a time."""

    def __init__(self, program: isa.Program, state: State) -> None:
        for name, rows, size in (
            ("memory", state.memory, program.memory_rows),
            ("display", state.display, program.display_rows),
        ):
            if rows.shape != (size, 4) or rows.dtype != np.uint32 or not rows.flags.c_contiguous:
                raise MachineError(
                    f"the program's {name} has {size} rows of four 32-bit words, the state's {rows.shape}"
                )
        self.program = program
        self.state = state
        self._native = native(program)
        self._plain = Plain(program, state)
        self._counts = np.zeros(len(self._native.blocks), np.int64)
        self._parts = np.zeros(len(program.words), np.int64)

    def advance(self, steps: int) -> None:
        """Make `steps` steps, or fewer where the machine halts. Raises Trap where it cannot go on."""
        state, last = self.state, self.state.steps + steps
        while not state.halted and state.steps < last:
            self._advance_natively(min(SLICE, last - state.steps))
            if not state.halted and state.steps < last:
                self._plain.step()

    def repeat(self, address: int, times: int, limit: int, home: int) -> npt.NDArray[np.int64]:
        """Go on at `address` until the halt at `home`, so many times; the steps of each.

        After one that halts elsewhere, or that has not halted within `limit` steps, nothing more is run. Raises Trap
        where a step cannot be made.
        """
        steps = np.zeros(times, np.int64)
        words = pack(self.state)
        for turn in range(times):
            before = self.state.steps
            words[_HALTED], words[_ADDRESS] = 0, address
            self._call(words, min(SLICE, limit))
            if not words[_HALTED]:
                unpack(words, self.state)
                self.advance(limit - (self.state.steps - before))
                words = pack(self.state)
            steps[turn] = self.state.steps - before
            if not words[_HALTED] or words[_ADDRESS] != home:
                break
        unpack(words, self.state)
        return steps

    def _advance_natively(self, budget: int) -> None:
        words = pack(self.state)
        self._call(words, budget)
        unpack(words, self.state)

    def _call(self, words: Words, budget: int) -> None:
        """Up to `budget` steps of native code on the packed state."""
        control = np.zeros(CONTROL_WORDS, np.int64)
        control[BUDGET] = budget
        arrays = (words, self.state.memory, self.state.display, control, self._counts)
        self._native._run(*(array.ctypes.data for array in arrays))
        start, steps = int(control[PART_START]), int(control[PART_STEPS])
        self._parts[start : start + steps] += 1
        self.state.steps += budget - int(control[BUDGET])

    @property
    def executions(self) -> Sequence[int]:
        """How often each microinstruction ran."""
        sums = self._parts + np.array(self._plain.executions, np.int64)
        for block, times in zip(self._native.blocks, self._counts, strict=True):
            sums[block.start : block.end] += times
        return sums.tolist()


def native(program: isa.Program) -> Native:
    """The native code of `program`, made once for programs of the same words, labels and sizes."""
    labels = tuple(sorted(set(program.labels.values())))
    return _native(program.words, labels, program.memory_rows, program.display_rows)


@lru_cache(maxsize=64)
def _native(words: tuple[isa.Word, ...], labels: tuple[int, ...], memory_rows: int, display_rows: int) -> Native:
    named = {str(address): address for address in labels}
    return Native(isa.Program(words, labels=named, memory_rows=memory_rows, display_rows=display_rows))


def _object_code(text: str) -> bytes:
    """Object code of LLVM text, from the cache where it is there."""
    here = host()
    parts = ("pu", here.llvm, here.triple, here.cpu, here.features, text)
    key = "pu-" + hashlib.sha256("\0".join(parts).encode()).hexdigest()
    data = cache.read(key)
    if data is None:
        data = compile_object(text)
        cache.write(key, data)
    return data
