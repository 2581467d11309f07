"""Tables in the data memory as the interpreter sees them: gather and scatter by `Record.layout`, checked.

The memory holds float32 words. A run in float64 widens what it loads and narrows what it stores, so that a value that
went through memory has float32 precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tasuki.diagnostics import Diagnostic, MachineError, Span
from tasuki.ir.nodes import AtomicOperation
from tasuki.ir.types import BANKS, Record

Value = list[np.ndarray]
"""The leaves of a value in the order of `Type.leaves`: arrays of shape (lanes,), of float32 or float64, int32, bool."""


@dataclass(frozen=True)
class MemoryTable:
    """`count` records from row `base` on of `memory`, a C-contiguous float32 array of shape (rows, 4).

    Integers and booleans stand in the same words, seen as int32. MachineError where `memory` is of another shape.
    """

    memory: np.ndarray
    base: int
    count: int

    def __post_init__(self) -> None:
        memory = self.memory
        fits = memory.ndim == 2 and memory.shape[1] == BANKS and memory.dtype == np.float32
        if not (fits and memory.flags.c_contiguous):
            found = f"{memory.dtype} of shape {memory.shape}"
            raise MachineError(f"a memory is a C-contiguous float32 array of shape (rows, {BANKS}), not {found}")

    @cached_property
    def words(self) -> np.ndarray:
        """The same memory as int32."""
        return self.memory.view(np.int32)


@dataclass(frozen=True)
class Access:
    """Who touches a table, for which lanes, and where that stands in the source. `active` has shape (lanes,)."""

    function: str
    active: np.ndarray
    first_lane: int
    checked: bool
    span: Span | None

    def fault(self, message: str, expected: str, found: str) -> MachineError:
        return MachineError(str(Diagnostic(f"{message} in `{self.function}`", self.span, expected, found)))


@dataclass(frozen=True)
class BoundTable:
    """A memory table with the name and the record that a program knows it by."""

    name: str
    record: Record
    view: MemoryTable

    def __post_init__(self) -> None:
        end, rows = self.view.base + self.view.count * self.record.rows, len(self.view.memory)
        if self.view.base < 0 or self.view.count < 0 or end > rows:
            extent = f"rows {self.view.base} to {end}"
            raise MachineError(f"table `{self.name}` takes {extent} of a memory that has {rows}")

    def gather(self, index: np.ndarray, leaves: range, dtypes: Sequence[np.dtype], access: Access) -> Value:
        """The leaves `leaves` of record `index[lane]` for each active lane; zero in the others."""
        first_rows = self._first_rows(index, access)
        results = []
        for leaf, dtype in zip(leaves, dtypes, strict=True):
            row, bank = self.record.layout[leaf]
            source = self.view.memory if dtype.kind == "f" else self.view.words
            result = np.zeros(len(index), dtype)
            # To bool, astype is "not 0": as the meaning demands.
            result[access.active] = source[first_rows + row, bank].astype(dtype)
            results.append(result)
        return results

    def scatter(self, index: np.ndarray, leaves: range, value: Value, access: Access) -> None:
        """Stores `value` in the leaves `leaves` of record `index[lane]`, for each active lane."""
        first_rows = self._first_rows(index, access)
        self._require_writable(access)
        for leaf, part in zip(leaves, value, strict=True):
            row, bank = self.record.layout[leaf]
            target = self.view.memory if part.dtype.kind == "f" else self.view.words
            target[first_rows + row, bank] = part[access.active].astype(target.dtype)

    def update(
        self, index: np.ndarray, leaf: int, operation: AtomicOperation, value: np.ndarray, access: Access
    ) -> np.ndarray:
        """Lane by lane, in order: an i32 word becomes operation(word, value). Returns the words from before."""
        first_rows = self._first_rows(index, access)
        self._require_writable(access)
        row, bank = self.record.layout[leaf]
        before = np.zeros(len(index), np.int32)
        # One-element arrays, not NumPy scalars: array arithmetic wraps in silence.
        for lane, first_row in zip(np.flatnonzero(access.active), first_rows, strict=True):
            word = self.view.words[first_row + row, bank : bank + 1]
            before[lane] = word[0]
            word[:] = _ATOMIC[operation](word, value[lane : lane + 1])
        return before

    def _first_rows(self, index: np.ndarray, access: Access) -> np.ndarray:
        """The first row of each active lane's record, in lane order, after the check that it lies in the table.

        Unchecked, an index outside is not defined: here it reaches whatever the memory holds there, and is an error
        only where the memory itself ends.
        """
        wanted = index[access.active].astype(np.int64)
        first_rows = self.view.base + wanted * self.record.rows
        if access.checked:
            outside = (wanted < 0) | (wanted >= self.view.count)
        else:
            outside = (first_rows < 0) | (first_rows + self.record.rows > len(self.view.memory))
        if outside.any():
            position = int(np.argmax(outside))
            lane = access.first_lane + int(np.flatnonzero(access.active)[position])
            raise access.fault(
                f"index outside table `{self.name}`",
                f"an index from 0 to {self.view.count - 1}" if self.view.count else "no access: the table is empty",
                f"{wanted[position]}, in lane {lane}; the table has {self.view.count} records",
            )
        return first_rows

    def _require_writable(self, access: Access) -> None:
        if not self.view.memory.flags.writeable:
            raise access.fault(f"store to table `{self.name}`", "a memory that may be written", "a read-only one")


_ATOMIC = {"add": np.add, "minimum": np.minimum, "maximum": np.maximum}
