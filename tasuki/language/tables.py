"""Tables: records in the data memory, and how one record lies there."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from tasuki.diagnostics import Diagnostic, SourceError, Span
from tasuki.ir import types as ir
from tasuki.language.annotations import TableType, is_record_class

WORD = 4
"""Bytes of one word of the data memory."""
ROW = WORD * ir.BANKS
"""Bytes of one row: four banks."""

SCALAR_DTYPES = {"f32": "<f4", "i32": "<i4", "bool": "<i4"}


class Table:
    """`quadrics = Table(Quadric)`: a table that every program finds in memory under the name of the variable.

    `Table[Quadric]` is the type of a table, for parameters. As plain Python, a table is read and written where
    `tasuki.language.plain.tables` has bound it to memory. `SourceError` for a table of anything but records.
    """

    def __init__(self, record: Any, *, name: str | None = None) -> None:
        caller = sys._getframe(1)
        if not is_record_class(record):
            place = Span(caller.f_code.co_filename, caller.f_lineno)
            raise SourceError([Diagnostic("a table is a table of records", place, "Table(Record)", repr(record))])
        self.record = record
        self._name = name
        # Where the table was made: its name is the variable there, even if another module imports it under an alias.
        self._globals = caller.f_globals

    def __class_getitem__(cls, record: Any) -> TableType:
        return TableType(record)

    @property
    def name(self) -> str | None:
        """The name of the global variable that holds the table; None while no variable does."""
        if self._name is None:
            self._name = next((name for name, value in self._globals.items() if value is self), None)
        return self._name

    def named(self, name: str) -> str:
        """The table's name; `name`, that of the variable by which it was met, where it has none yet."""
        if self.name is None:
            self._name = name
        return self.name or name

    @property
    def declared_in(self) -> str:
        """The name of the Python module that made the table."""
        return str(self._globals.get("__name__"))

    @property
    def type(self) -> ir.Table:
        return ir.Table(self.record.ir)

    def __getitem__(self, index: Any) -> Any:
        return self._bound()[index]

    def __setitem__(self, index: Any, value: Any) -> None:
        self._bound()[index] = value

    def __len__(self) -> int:
        return len(self._bound())

    def __iter__(self) -> Iterator[Any]:
        return iter(self._bound())

    def __bool__(self) -> bool:
        return True

    def _bound(self) -> Any:
        from tasuki.language.plain import bound

        return bound(self)

    def __repr__(self) -> str:
        return f"<table {self.name or '?'} of {self.record.__name__}>"


def record_dtype(record: ir.Record) -> np.dtype:
    """One record in memory as a structured dtype of `record.rows` rows; the gaps of the layout are padding."""
    places = [row * ROW + bank * WORD for row, bank in record.layout]
    return _struct(record, places, 0, record.rows * ROW)


def _struct(record: ir.Record, places: Sequence[int], base: int, size: int) -> np.dtype:
    """The dtype of a record whose leaves stand at the byte offsets `places`, itself at `base`, taking `size` bytes."""
    names, formats, offsets = [], [], []
    for name, member in record.fields:
        inner = [places[leaf] for leaf in record.leaf_range(name)]
        names.append(name)
        formats.append(_member_dtype(member, inner))
        offsets.append(inner[0] - base)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size})


def _member_dtype(member: ir.Type, places: Sequence[int]) -> Any:
    if isinstance(member, ir.Record):
        return _struct(member, places, places[0], places[-1] + WORD - places[0])
    if isinstance(member, ir.Scalar):
        return SCALAR_DTYPES[member.name]
    shape = (member.size,) if isinstance(member, ir.Vector) else (ir.BANKS, ir.BANKS)
    return (SCALAR_DTYPES["f32"], shape)
