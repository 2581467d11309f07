"""The canonical text of a program, and its digest: what a cache of compiled code is keyed by.

Programs that differ only in spans, in the names of functions, parameters, variables, records and fields, in the order
of functions, in functions that the entry does not reach, or in variables that nothing mentions, have one canonical
text. What a caller can see stays: the entry's parameters and the tables, in their order, and the names of the tables,
which are bound when the program is run. (A machine must therefore not build other names, or spans, into what it keeps.)

The text is in the form of `text`, with every name replaced by a letter and a number: functions in the order of their
first call from the entry, variables in the order in which the body mentions them. It does not say what operations mean:
a cache that outlives a version of the package keeps the version beside the digest.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence

from tasuki.ir.nodes import Call, Function, If, Loop, Program, Statement
from tasuki.ir.text import Names, Printer
from tasuki.ir.types import Record, Type


def canonical_text(program: Program) -> str:
    """The text of `program` with names replaced by numbers. KeyError where it calls what it does not hold."""
    functions = reachable(program)
    return Printer(_Numbers(functions)).program(program, functions)


def digest(program: Program) -> str:
    """SHA-256 of the canonical text: 64 hexadecimal digits."""
    return hashlib.sha256(canonical_text(program).encode()).hexdigest()


def reachable(program: Program) -> list[Function]:
    """The entry and the functions that it reaches, in the order of their first call."""
    found: dict[str, Function] = {}

    def visit(name: str) -> None:
        if name not in found:
            found[name] = program.functions[name]
            for callee in callees(found[name].body):
                visit(callee)

    visit(program.entry)
    return list(found.values())


def callees(statements: Sequence[Statement]) -> Iterator[str]:
    """The functions that these statements call, in the order in which they stand."""
    for statement in statements:
        if isinstance(statement, Call):
            yield statement.function
        elif isinstance(statement, If):
            yield from callees((*statement.then, *statement.orelse))
        elif isinstance(statement, Loop):
            yield from callees((*statement.setup, *statement.body, *statement.step))


class _Numbers(Names):
    """Names by number. Records are all called `r`; the printer tells them apart in the order in which they appear."""

    def __init__(self, functions: Sequence[Function]) -> None:
        super().__init__()
        self._functions = {function.name: f"f{position}" for position, function in enumerate(functions)}
        self._locals: dict[str, str] = {}

    def enter(self, function: Function) -> None:
        self._locals = {parameter.name: f"p{position}" for position, parameter in enumerate(function.parameters)}

    def local(self, name: str) -> str:
        return self._locals.setdefault(name, f"v{len(self._locals)}")

    def variables(self, function: Function) -> list[str]:
        return [name for name in self._locals if name in function.variables]

    def function(self, name: str) -> str:
        return self._functions[name]

    def member(self, base: Type | None, name: str) -> str:
        if not isinstance(base, Record):
            return name
        return f"m{[field for field, _ in base.fields].index(name)}"

    def record_name(self, record: Record) -> str:
        return "r"
