"""What a caller hands to the interpreter, checked and brought into its form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tasuki.diagnostics import MachineError
from tasuki.ir.memory import BoundTable, MemoryTable, Value
from tasuki.ir.nodes import Function, Program
from tasuki.ir.types import Table

Argument = Sequence[Any] | MemoryTable
"""The leaves of a value, each of shape (lanes,) or (); or a table."""


def dtype_of(leaf: str, precision: np.dtype) -> np.dtype:
    """The NumPy type that the interpreter holds a leaf in; `precision` is that of f32."""
    return {"f32": precision, "i32": np.dtype(np.int32), "bool": np.dtype(bool)}[leaf]


def bind_tables(program: Program, tables: Mapping[str, MemoryTable]) -> dict[str, BoundTable]:
    """The program's named tables, or MachineError that names all that are missing."""
    missing = [f"`{name}`" for name in program.tables if name not in tables]
    if missing:
        raise MachineError(f"the program needs tables that it was not given: {', '.join(missing)}")
    return {name: BoundTable(name, record, tables[name]) for name, record in program.tables.items()}


def bind_arguments(
    entry: Function, arguments: Sequence[Argument], lanes: int, precision: np.dtype
) -> list[Value | BoundTable]:
    """What the entry's parameters become: leaves of shape (lanes,), or a table. MachineError where one does not fit."""
    if len(arguments) != len(entry.parameters):
        wanted = ", ".join(f"{p.name}: {p.type}" for p in entry.parameters)
        raise MachineError(f"`{entry.name}` takes {len(entry.parameters)} arguments ({wanted}), not {len(arguments)}")
    bound: list[Value | BoundTable] = []
    for parameter, argument in zip(entry.parameters, arguments, strict=True):
        what = f"argument `{parameter.name}` of `{entry.name}`"
        if isinstance(parameter.type, Table) != isinstance(argument, MemoryTable):
            raise MachineError(f"{what} is a {parameter.type}, not a {type(argument).__name__}")
        if isinstance(argument, MemoryTable):
            assert isinstance(parameter.type, Table)
            bound.append(BoundTable(parameter.name, parameter.type.record, argument))
        elif len(argument) != len(parameter.type.leaves):
            raise MachineError(f"{what} has {len(parameter.type.leaves)} leaves, not {len(argument)}")
        else:
            names = parameter.type.leaves
            bound.append([_bind_leaf(what, *pair, lanes, precision) for pair in zip(names, argument, strict=True)])
    return bound


def _bind_leaf(what: str, leaf: str, given: Any, lanes: int, precision: np.dtype) -> np.ndarray:
    values = np.asarray(given)
    accepted = {"f32": "f", "i32": "iu", "bool": "b"}[leaf]
    if values.dtype.kind not in accepted or values.shape not in ((), (lanes,)):
        found = f"{values.dtype} of shape {values.shape}"
        raise MachineError(f"a leaf of {what} is {leaf} of shape ({lanes},) or (), not {found}")
    limits = np.iinfo(np.int32)
    if leaf == "i32" and values.size and not (limits.min <= values.min() and values.max() <= limits.max):
        raise MachineError(f"a leaf of {what} has a value outside i32")
    with np.errstate(all="ignore"):
        return np.broadcast_to(values.astype(dtype_of(leaf, precision)), (lanes,))
