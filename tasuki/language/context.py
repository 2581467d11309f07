"""What all of checking shares: errors, types of variables, the statements made so far, and values fitted to types."""

from __future__ import annotations

import ast
import builtins
import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from tasuki.diagnostics import Diagnostic, Note, Span
from tasuki.ir.nodes import Assign, Atomic, Call, Constant, Construct, Expression, Local, Statement
from tasuki.ir.types import F32, I32, VOID, Table, Tuple, Type
from tasuki.language.effects import changes_memory, reads_memory
from tasuki.language.flow import Flow

if TYPE_CHECKING:
    from tasuki.language.declare import Module, Socket


class Unknown(Type):
    """The type of what has been found wrong already. Whatever meets it says nothing more."""

    def __str__(self) -> str:
        return "unknown"


UNKNOWN = Unknown()
POISON = Constant(0, UNKNOWN)


@dataclass(frozen=True)
class Literal(Constant):
    """An integer as the user wrote it: it becomes an f32 where one is wanted. Never part of finished IR."""


@dataclass(frozen=True)
class Variable:
    """A parameter or variable, and where its type was fixed."""

    type: Type
    span: Span


MISSING = object()
"""What a name stands for that stands for nothing."""


class Context:
    """The state of checking one module.

    `block` takes the statements in order; expressions put the calls that they need there before they are used.
    """

    def __init__(self, module: Module) -> None:
        self.module = module
        self.source, self.definition = module.parsed
        self.names = module.names
        self.local_names = {*module.function.__code__.co_varnames, *module.function.__code__.co_cellvars}
        self.variables: dict[str, Variable] = {}
        self.temporaries: dict[str, Type] = {}
        self.temporaries_made = 0
        self.loop_variables: set[str] = set()
        self.block: list[Statement] = []
        self.flow = Flow()
        self.diagnostics: list[Diagnostic] = []
        self.calls: dict[str, Module | Socket] = {}
        self.tables: dict[str, Any] = {}
        self.constants: dict[tuple[str, str], float | int | bool] = {}
        self.resolved: dict[str, Any] = {}

    # --- errors -------------------------------------------------------------------------------------------------------

    def span(self, node: ast.AST) -> Span:
        return self.source.span(node)

    def error(
        self,
        place: ast.AST | Span,
        message: str,
        *,
        expected: str | None = None,
        found: str | None = None,
        hint: str | None = None,
        notes: tuple[Note, ...] = (),
    ) -> Constant:
        """Notes an error, and gives an expression of unknown type to go on with."""
        span = place if isinstance(place, Span) else self.span(place)
        self.diagnostics.append(Diagnostic(message, span, expected, found, hint, notes, self.source.text))
        return POISON

    def not_in_language(self, node: ast.AST, what: str, hint: str | None = None) -> Constant:
        return self.error(node, f"{what} is not part of the language", hint=hint)

    # --- names --------------------------------------------------------------------------------------------------------

    def lookup(self, node: ast.expr) -> Any:
        """What a global name, or a name inside a Python module (`math.pi`), stands for; MISSING for anything else."""
        if isinstance(node, ast.Name) and node.id not in self.local_names:
            found = self.names.get(node.id, getattr(builtins, node.id, MISSING))
            self.resolved[node.id] = found
            return found
        if isinstance(node, ast.Attribute):
            base = self.lookup(node.value)
            if isinstance(base, ModuleType):
                return getattr(base, node.attr, MISSING)
        return MISSING

    def suggestion(self, name: str, candidates: Iterable[str]) -> str | None:
        """A hint where `name` looks like a slip of one of `candidates`."""
        close = difflib.get_close_matches(name, list(candidates), n=1)
        return f"did you mean `{close[0]}`?" if close else None

    # --- statements made so far ---------------------------------------------------------------------------------------

    def emit(self, statement: Statement) -> None:
        self.block.append(statement)

    @contextmanager
    def nested_block(self) -> Iterator[list[Statement]]:
        """While the context lasts, statements go to a block of their own."""
        outer, self.block = self.block, []
        try:
            yield self.block
        finally:
            self.block = outer

    def temporary(self, type: Type) -> str:
        """A new variable; its name cannot clash with a user's."""
        self.temporaries_made += 1
        name = f"${self.temporaries_made}"
        self.temporaries[name] = type
        return name

    def bind(self, value: Expression) -> Expression:
        """`value`, evaluated once and now: it may be used several times, and what comes later cannot change it."""
        if isinstance(value, Constant) or (isinstance(value, Local) and value.name in self.temporaries):
            return value
        name = self.temporary(value.type)
        self.emit(Assign(name, value, span=value.span))
        return Local(name, value.type, span=value.span)

    def protect(self, value: Expression, start: int) -> Expression:
        """`value` as it was before the statements from `start` on, which were made after it but run before its use."""
        if not changes_memory(self.block[start:]) or not reads_memory(value):
            return value
        name = self.temporary(value.type)
        self.block.insert(start, Assign(name, value, span=value.span))
        return Local(name, value.type, span=value.span)

    def take_result(self, value: Expression) -> Call | Atomic | None:
        """The call that has just put its result into the temporary `value`, so that it can go elsewhere at once."""
        last = self.block[-1] if self.block else None
        if not isinstance(last, Call | Atomic) or not isinstance(value, Local) or last.target != value.name:
            return None
        return last if value.name in self.temporaries else None

    # --- values of the wanted type ------------------------------------------------------------------------------------

    def settle(self, value: Expression) -> Expression:
        """`value` as finished IR: an integer literal that nobody wanted as f32 is an i32."""
        return Constant(value.value, I32, span=value.span) if isinstance(value, Literal) else value

    def as_f32(self, value: Expression) -> Expression:
        """An integer literal as f32; anything else as it is."""
        return Constant(float(np.float32(value.value)), F32, span=value.span) if isinstance(value, Literal) else value

    def fit(
        self, value: Expression, wanted: Type, node: ast.AST, what: str, notes: tuple[Note, ...] = ()
    ) -> Expression:
        """`value` as a `wanted`, which `what` needs; only literals are converted."""
        if UNKNOWN in (value.type, wanted):
            return POISON
        if wanted == F32:
            value = self.as_f32(value)
        if value.type == wanted:
            return self.settle(value)
        hint = conversion_hint(wanted, value.type, value)
        expected, found = describe(wanted), describe(value.type)
        return self.error(node, f"{what} has the wrong type", expected=expected, found=found, hint=hint, notes=notes)

    def tuple_of(self, values: list[Expression], wanted: Type | None, span: Span) -> Expression:
        """A tuple; literals take the types of the `wanted` tuple's items."""
        if isinstance(wanted, Tuple) and len(wanted.items) == len(values):
            values = [self.as_f32(v) if item == F32 else v for v, item in zip(values, wanted.items, strict=True)]
        settled = tuple(map(self.settle, values))
        if any(value.type == UNKNOWN for value in settled):
            return POISON
        if any(isinstance(value.type, Table) for value in settled):
            return self.error(span, "a table cannot be part of a tuple")
        return Construct(settled, Tuple(tuple(value.type for value in settled)), span=span)


def describe(type: Type) -> str:
    """A type in the words of a message."""
    if type == VOID:
        return "nothing"
    return f"the table {type}" if isinstance(type, Table) else str(type)


def conversion_hint(wanted: Type, found: Type, value: Expression) -> str | None:
    """How the user can convert, where that is what was forgotten."""
    if wanted == F32 and found == I32:
        return "convert it: f32(...)"
    if wanted == I32 and found == F32:
        return "write it without a point" if isinstance(value, Constant) else "convert it: i32(...) truncates"
    return None
