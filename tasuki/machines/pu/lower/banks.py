"""In which bank the scalar variables of a body live: that of the vectors from whose components they come.

A scalar that is computed from x components alone can stay in bank X, where FPPX computes while the other units work on
theirs; most others belong to bank S, which alone reaches the tables. A variable lives in a bank where everything that
is assigned to it is at home.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from tasuki.ir import nodes as ir
from tasuki.ir.types import F32, Vector
from tasuki.machines.pu.lower.parts import BANK_OF

ANYWHERE = ""
"""The bank of a number, which every unit can have as its literal."""
STAYING = ("add", "subtract", "multiply", "fma", "minimum", "maximum", "negate", "absolute", "floor", "copysign")
"""Primitives whose result is in the bank of the operands."""


def banks_of_variables(function: ir.Function, parameters: Mapping[str, str]) -> dict[str, str]:
    """The bank of each variable of type f32; `parameters` gives those of such parameters."""
    names = [name for name, type_ in function.variables.items() if type_ == F32]
    assigned: list[tuple[str, ir.Expression | None]] = [
        (name, value) for name, value in _assignments(function.body) if name in names
    ]
    banks = dict(parameters) | dict.fromkeys(names, ANYWHERE)
    changed = True
    while changed:
        changed = False
        for name, value in assigned:
            met = _meet((banks[name], "s" if value is None else _bank(value, banks)))
            changed = changed or met != banks[name]
            banks[name] = met
    return {name: banks[name] or "s" for name in names}


def _assignments(statements: Iterable[ir.Statement]) -> Iterator[tuple[str, ir.Expression | None]]:
    """(variable, what it becomes); None for the result of a call."""
    for statement in statements:
        match statement:
            case ir.Assign(target, value):
                yield target, value
            case ir.Call(target) if target is not None:
                yield target, None
            case ir.If(_, then, orelse):
                yield from _assignments((*then, *orelse))
            case ir.Loop(_, body, setup, step):
                yield from _assignments((*setup, *body, *step))


def _bank(value: ir.Expression, banks: Mapping[str, str]) -> str:
    """Where a scalar is made."""
    match value:
        case ir.Constant():
            return ANYWHERE
        case ir.Local(name):
            return banks.get(name, "s")
        case ir.Member(base, name) if isinstance(base.type, Vector) and not isinstance(base, ir.Load | ir.Element):
            return BANK_OF[name]
        case ir.Operate("select", (_, *arguments)):
            return _meet(_bank(one, banks) for one in arguments)
        case ir.Operate(operation, arguments) if operation in STAYING:
            return _meet(_bank(one, banks) for one in arguments)
    return "s"


def _meet(banks: Iterable[str]) -> str:
    """The one bank of all, or S."""
    found = {bank for bank in banks if bank != ANYWHERE}
    return ANYWHERE if not found else found.pop() if len(found) == 1 else "s"
