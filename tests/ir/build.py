"""Short words with which tests write IR: `add(local("x", F32), f(1.0))`."""

from __future__ import annotations

from typing import Any

import numpy as np

from tasuki.ir import nodes as n
from tasuki.ir.ops import OPERATIONS
from tasuki.ir.paths import at_path
from tasuki.ir.types import BOOL, F32, I32, VOID, Array, Record, Table, Tuple, Type


def f(value: float) -> n.Constant:
    return n.Constant(float(np.float32(value)), F32)


def i(value: int) -> n.Constant:
    return n.Constant(value, I32)


def b(value: bool) -> n.Constant:
    return n.Constant(value, BOOL)


def local(name: str, kind: Type) -> n.Local:
    return n.Local(name, kind)


def op(name: str, *arguments: Any) -> n.Operate:
    """An operation of the table; its type follows from the arguments."""
    result = OPERATIONS[name].result([argument.type for argument in arguments])
    assert result is not None, f"{name} of {', '.join(str(argument.type) for argument in arguments)}"
    return n.Operate(name, arguments, result)


def member(base: Any, *path: str) -> Any:
    for name in path:
        base = n.Member(base, name, base.type.member(name))
    return base


def construct(kind: Type, *arguments: Any) -> n.Construct:
    return n.Construct(arguments, kind)


def pair(*arguments: Any) -> n.Construct:
    return n.Construct(arguments, Tuple(tuple(argument.type for argument in arguments)))


def load(table: n.Local | n.NamedTable, index: Any, *path: str) -> n.Load:
    assert isinstance(table.type, Table)
    return n.Load(table, index, path, at_path(table.type.record, path)[0])


def element(array: str, kind: Array, index: Any) -> n.Element:
    return n.Element(array, index, kind.item)


def function(
    body: list[Any],
    parameters: dict[str, Type] | None = None,
    result: Type = VOID,
    variables: dict[str, Type] | None = None,
    name: str = "main",
) -> n.Function:
    given = tuple(n.Parameter(name, kind) for name, kind in (parameters or {}).items())
    return n.Function(name, given, result, variables or {}, tuple(body))


def program(*functions: n.Function, tables: dict[str, Record] | None = None) -> n.Program:
    """The first function is the entry."""
    return n.Program({item.name: item for item in functions}, functions[0].name, tables or {})
