"""The nodes of the IR: pure expressions, statements with effects, functions, sockets, programs.

Frozen, typed, and with the span of the source that they come from (spans never take part in equality). Structured: no
jumps but `Break`, `Continue` and `Return`; variables are mutable and belong to their function. See
`tasuki/ir/__init__.py` for what they mean and `verify` for what must hold.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal as OneOf

from tasuki.diagnostics import Span
from tasuki.ir.types import VOID, Record, Table, Type


@dataclass(frozen=True, kw_only=True)
class Node:
    span: Span | None = field(default=None, compare=False, repr=False)


# --- expressions: evaluating one changes nothing ----------------------------------------------------------------------


@dataclass(frozen=True)
class Constant(Node):
    """A scalar. `value` is exactly representable in `type`: an f32 has been rounded already."""

    value: float | int | bool
    type: Type


@dataclass(frozen=True)
class Local(Node):
    """The value of a parameter or variable (of table type: the table itself)."""

    name: str
    type: Type


@dataclass(frozen=True)
class NamedTable(Node):
    """A table that the program is given by name when it is run."""

    name: str
    type: Table


@dataclass(frozen=True)
class Operate(Node):
    """An operation of `ops.OPERATIONS`, by name. Every argument is evaluated."""

    operation: str
    arguments: tuple[Expression, ...]
    type: Type


@dataclass(frozen=True)
class Member(Node):
    """A field of a record, a component of a vector ("x"), an item of a tuple ("0"), a column of a matrix ("0")."""

    base: Expression
    name: str
    type: Type


@dataclass(frozen=True)
class Element(Node):
    """An element of the local array `array`; the index is clamped to it."""

    array: str
    index: Expression
    type: Type


@dataclass(frozen=True)
class Construct(Node):
    """A vector, matrix (from columns), record or tuple from its members; one scalar for a vector is given to all."""

    arguments: tuple[Expression, ...]
    type: Type


@dataclass(frozen=True)
class Load(Node):
    """The record at `index` of a table, or the member of it that `path` leads to."""

    table: Local | NamedTable
    index: Expression
    path: tuple[str, ...]
    type: Type


@dataclass(frozen=True)
class Length(Node):
    """How many records a table has."""

    table: Local | NamedTable
    type: Type


Expression = Constant | Local | NamedTable | Operate | Member | Element | Construct | Load | Length

# --- statements -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Assign(Node):
    """`target` (or the member of it at `path`) becomes `value`."""

    target: str
    value: Expression
    path: tuple[str, ...] = ()


@dataclass(frozen=True)
class SetElement(Node):
    """Element `index` (clamped) of local array `array`, or the member of it at `path`, becomes `value`."""

    array: str
    index: Expression
    value: Expression
    path: tuple[str, ...] = ()


@dataclass(frozen=True)
class Clear(Node):
    """The local array begins its life here: every element is zero."""

    array: str


@dataclass(frozen=True)
class Store(Node):
    """The record at `index` of a table, or the member of it at `path`, becomes `value`. No two lanes write one row."""

    table: Local | NamedTable
    index: Expression
    value: Expression
    path: tuple[str, ...] = ()


AtomicOperation = OneOf["add", "minimum", "maximum"]


@dataclass(frozen=True)
class Atomic(Node):
    """In one indivisible step for each active lane: an i32 field of a record becomes operation(field, value).

    `target` (an i32 variable, or None) receives the value from before. The order among lanes is not defined.
    """

    target: str | None
    operation: AtomicOperation
    table: Local | NamedTable
    index: Expression
    value: Expression
    path: tuple[str, ...]


@dataclass(frozen=True)
class Call(Node):
    """`target` (or nothing) becomes the result of `function` (a key of `Program.functions`, or a socket not yet
    linked).
    """

    target: str | None
    function: str
    arguments: tuple[Expression, ...]


@dataclass(frozen=True)
class If(Node):
    test: Expression
    then: tuple[Statement, ...]
    orelse: tuple[Statement, ...] = ()


@dataclass(frozen=True)
class Loop(Node):
    """`while`: (setup; if not test: leave; body; step) again and again. `Continue` goes on with step, `Break` leaves.
    """

    test: Expression
    body: tuple[Statement, ...]
    setup: tuple[Statement, ...] = ()
    step: tuple[Statement, ...] = ()


@dataclass(frozen=True)
class Break(Node):
    pass


@dataclass(frozen=True)
class Continue(Node):
    pass


@dataclass(frozen=True)
class Return(Node):
    value: Expression | None = None


Statement = Assign | SetElement | Clear | Store | Atomic | Call | If | Loop | Break | Continue | Return

# --- functions and programs -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Parameter(Node):
    name: str
    type: Type


@dataclass(frozen=True)
class Function(Node):
    """A module after checking. `variables` are its locals, arrays included, parameters excluded."""

    name: str
    parameters: tuple[Parameter, ...]
    result: Type
    variables: Mapping[str, Type]
    body: tuple[Statement, ...]

    @property
    def signature(self) -> Signature:
        return Signature(tuple(p.type for p in self.parameters), self.result)


@dataclass(frozen=True)
class Signature:
    parameters: tuple[Type, ...]
    result: Type = VOID

    def __str__(self) -> str:
        result = "" if self.result == VOID else f" -> {self.result}"
        return f"({', '.join(map(str, self.parameters))}){result}"


@dataclass(frozen=True)
class Program:
    """Functions that call only one another, the one that is run, and the tables that they name."""

    functions: Mapping[str, Function]
    entry: str
    tables: Mapping[str, Record]
