"""The data memory: rows of four 32-bit words, in which named tables stand.

`MemoryBuilder` collects tables, contents or sizes, and allocates once, so that nothing is copied twice. A table begins
at a multiple of four rows, and the memory at a multiple of 64 bytes: a cache line, and a vector of sixteen lanes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tasuki.diagnostics import Diagnostic, SceneError

BANKS = 4
ROW_BYTES = 16
ALIGNMENT = 64
TABLE_ROWS = ALIGNMENT // ROW_BYTES
"""Tables begin at a multiple of this many rows."""

MOST_ROWS = 2**29
"""The number of a word must fit an i32."""


@dataclass(frozen=True)
class TablePlace:
    """Where a table stands: its first row, how many records it has, and how one of them lies in rows."""

    base: int
    count: int
    dtype: np.dtype

    @property
    def stride(self) -> int:
        """Rows that one record takes."""
        return self.dtype.itemsize // ROW_BYTES

    @property
    def rows(self) -> int:
        return self.count * self.stride


@dataclass(frozen=True)
class Memory:
    """`rows` (n, 4) float32, C-contiguous; `tables` by name."""

    rows: np.ndarray
    tables: Mapping[str, TablePlace]

    @property
    def words(self) -> np.ndarray:
        """The same rows as int32."""
        return self.rows.view(np.int32)

    def table(self, name: str) -> np.ndarray:
        """The records of table `name` as a structured array: a view, so writing to it writes to the memory."""
        place = self.tables[name]
        return self.rows[place.base : place.base + place.rows].reshape(-1).view(place.dtype)


class MemoryBuilder:
    """Collects tables, then builds the memory that holds them all.

    After `build` more tables may be added; they are in the memory that the next `build` makes.
    """

    def __init__(self) -> None:
        self._places: dict[str, TablePlace] = {}
        self._contents: dict[str, np.ndarray] = {}
        self._rows = 0

    def add(self, name: str, contents: np.ndarray | tuple[Any, int]) -> TablePlace:
        """Append the table `name`: a structured array of records, or (record type, count) for a table of zeros.

        SceneError where the memory would get more than `MOST_ROWS` rows; ValueError where the name is taken already.
        """
        if name in self._places:
            raise ValueError(f"there is a table {name!r} already")
        if isinstance(contents, np.ndarray):
            dtype, count = contents.dtype, len(contents)
        else:
            record, count = contents
            dtype = record.numpy_dtype()
        if dtype.itemsize % ROW_BYTES or count < 0:
            raise ValueError(f"table {name!r}: {count} records of {dtype.itemsize} bytes do not fill rows")
        place = TablePlace(self._rows, count, dtype)
        end = place.base + -(-place.rows // TABLE_ROWS) * TABLE_ROWS
        if end > MOST_ROWS:
            raise self._too_large(name, place)
        self._places[name] = place
        self._rows = end
        if isinstance(contents, np.ndarray):
            self._contents[name] = contents
        return place

    def build(self) -> Memory:
        """The memory: every table in its place, zeros elsewhere. SceneError where the computer has not enough."""
        try:
            # Never empty, so that its address is always good; zero pages cost nothing until they are touched.
            storage = np.zeros(max(self._rows, TABLE_ROWS) * ROW_BYTES + ALIGNMENT, np.uint8)
        except MemoryError:
            problem = Diagnostic(f"the scene needs {_gib(self._rows)} of memory", None, "less", "more than there is")
            raise SceneError(str(problem)) from None
        start = -storage.ctypes.data % ALIGNMENT
        rows = storage[start : start + self._rows * ROW_BYTES].view(np.float32).reshape(-1, BANKS)
        memory = Memory(rows, dict(self._places))
        for name, contents in self._contents.items():
            memory.table(name)[:] = contents
        return memory

    def _too_large(self, name: str, place: TablePlace) -> SceneError:
        message = (
            f"table {name!r} needs {_gib(place.rows)} of memory, beside {_gib(self._rows)} for the tables before it"
        )
        limit = f"at most {_gib(MOST_ROWS)} in all: the number of a word has 31 bits"
        return SceneError(str(Diagnostic(message, None, limit, f"{place.count} records of {place.stride} rows")))


def _gib(rows: int) -> str:
    return f"{rows * ROW_BYTES / 2**30:.3g} GiB"
