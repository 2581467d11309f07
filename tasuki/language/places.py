"""Places: what can be read and also assigned to.

A variable, an element of a local array, a record in a table, or a member of one of these.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from tasuki.diagnostics import Span
from tasuki.ir.nodes import Assign, Element, Expression, Load, Local, Member, NamedTable, SetElement, Statement, Store
from tasuki.ir.types import Type


@dataclass(frozen=True)
class Place:
    """Where something of `type` stands: inside something of type `whole`, at `path`."""

    whole: Type
    type: Type
    path: tuple[str, ...]
    span: Span

    def member(self, name: str, span: Span) -> Any:
        """The place of member `name`, which exists."""
        type = self.type.member(name)
        assert type is not None
        return replace(self, type=type, path=(*self.path, name), span=span)

    def _descend(self, expression: Expression) -> Expression:
        """The member of `expression`, a value of the whole, at `path`."""
        type = self.whole
        for name in self.path:
            found = type.member(name)
            assert found is not None
            type = found
            expression = Member(expression, name, type, span=self.span)
        return expression

    def read(self) -> Expression:
        raise NotImplementedError

    def write(self, value: Expression, span: Span) -> Statement:
        raise NotImplementedError


@dataclass(frozen=True)
class VariablePlace(Place):
    name: str

    def read(self) -> Expression:
        return self._descend(Local(self.name, self.whole, span=self.span))

    def write(self, value: Expression, span: Span) -> Statement:
        return Assign(self.name, value, self.path, span=span)


@dataclass(frozen=True)
class ElementPlace(Place):
    array: str
    index: Expression

    def read(self) -> Expression:
        return self._descend(Element(self.array, self.index, self.whole, span=self.span))

    def write(self, value: Expression, span: Span) -> Statement:
        return SetElement(self.array, self.index, value, self.path, span=span)


@dataclass(frozen=True)
class RowPlace(Place):
    table: Local | NamedTable
    index: Expression

    def read(self) -> Expression:
        return Load(self.table, self.index, self.path, self.type, span=self.span)

    def write(self, value: Expression, span: Span) -> Statement:
        return Store(self.table, self.index, value, self.path, span=span)
