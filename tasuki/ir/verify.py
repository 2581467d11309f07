"""The verifier: what holds of every program that reaches a machine. A machine may refuse such a program, never crash.

Of the program
  P1  The entry is a function of the program; every function stands under its own name.
  P2  Every call names a function of the program, with arguments of its parameters' types; no function reaches itself.
  P3  A named table is declared, with one record; records have fields, of distinct names, without arrays and tables.
Of a function
  F1  Parameters and variables have distinct names. Only parameters may be tables; only variables may be arrays, with
      at least one element.
  F2  Parameters and the result, like every value, are neither arrays nor (but for parameters) tables.
  F3  Every path of a function with a result ends in `Return` with a value of its type; without a result, no `Return`
      has a value.
Of statements
  S1  What is assigned is a parameter or variable that is no table, arrays element by element; the value's type is that
      of the target at its path.
  S2  The test of `If` and `Loop` is a bool. `Break` and `Continue` stand in the body of a loop (not its setup or step).
  S3  `Store` and `Atomic` address an existing path of a table's record; that of `Atomic` leads to an i32, and so do its
      value and target.
Of expressions
  E1  A node's type is that which its parts give: by the operation's row in the table, the member, the path, the
      declared variable. A construction has all its members, or for a vector one scalar.
  E2  Constants are scalars whose value their type represents exactly.
  E3  Indices are i32. Arrays are read by element only; tables only by `Load`, `Length`, or as a call's argument.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import get_args

import numpy as np

from tasuki.diagnostics import VerifyError
from tasuki.ir.canonical import callees
from tasuki.ir.nodes import (
    Assign,
    Atomic,
    AtomicOperation,
    Break,
    Call,
    Clear,
    Constant,
    Construct,
    Continue,
    Element,
    Expression,
    Function,
    If,
    Length,
    Load,
    Local,
    Loop,
    Member,
    NamedTable,
    Operate,
    Program,
    Return,
    SetElement,
    Statement,
    Store,
)
from tasuki.ir.ops import OPERATIONS
from tasuki.ir.paths import at_path
from tasuki.ir.types import BOOL, F32, I32, VOID, Array, Record, Scalar, Table, Tuple, Type, Vector


def verify(program: Program) -> None:
    """Raises VerifyError with every invariant that `program` breaks: function, statement, and what is wrong there."""
    violations = list(_of_program(program))
    for function in program.functions.values():
        violations += _FunctionVerifier(program, function).violations()
    if violations:
        raise VerifyError("\n".join(violations))


# --- the program ------------------------------------------------------------------------------------------------------


def _of_program(program: Program) -> Iterator[str]:
    if program.entry not in program.functions:
        yield f"program: the entry `{program.entry}` is no function of the program"
    for key, function in program.functions.items():
        if key != function.name:
            yield f"program: function `{function.name}` stands under the name `{key}`"
    for name, record in program.tables.items():
        for fault in _faults_of_type(record):
            yield f"program: table `{name}`: {fault}"
    cycle = _cycle(program)
    if cycle:
        yield f"program: functions call themselves: {' -> '.join(cycle)}"


def _faults_of_type(kind: Type) -> Iterator[str]:
    """What is wrong with a type that values have."""
    if isinstance(kind, Array | Table):
        yield f"{kind} is not the type of a value"
        return
    names = [name for name, _ in kind.members]
    if isinstance(kind, Record) and not names:
        yield f"record {kind} has no fields"
    if len(set(names)) < len(names):
        yield f"{kind} has two members of one name"
    for _, inner in kind.members:
        yield from _faults_of_type(inner)


def _cycle(program: Program) -> list[str]:
    """The names of functions that call one another in a circle, or none."""
    finished: set[str] = set()

    def visit(name: str, path: list[str]) -> list[str]:
        if name in path:
            return [*path[path.index(name) :], name]
        if name in finished or name not in program.functions:
            return []
        for callee in callees(program.functions[name].body):
            cycle = visit(callee, [*path, name])
            if cycle:
                return cycle
        finished.add(name)
        return []

    return next((cycle for name in program.functions if (cycle := visit(name, []))), [])


# --- does control reach the end of a block? ---------------------------------------------------------------------------


def _falls_through(statements: Sequence[Statement]) -> bool:
    """Whether control may reach the end of these statements."""
    for statement in statements:
        match statement:
            case Return() | Break() | Continue():
                return False
            case If():
                if not _falls_through(statement.then) and not _falls_through(statement.orelse):
                    return False
            case Loop():
                endless = isinstance(statement.test, Constant) and statement.test.value is True
                if endless and not _breaks(statement.body):
                    return False
    return True


def _breaks(statements: Sequence[Statement]) -> bool:
    """Whether a `Break` among these leaves the loop that they are the body of."""
    for statement in statements:
        if isinstance(statement, Break):
            return True
        if isinstance(statement, If) and (_breaks(statement.then) or _breaks(statement.orelse)):
            return True
    return False


# --- a function -------------------------------------------------------------------------------------------------------


class _FunctionVerifier:
    """Walks one function and collects what is wrong. `_path` is where it stands: ["body[2]", "then[0]"]."""

    def __init__(self, program: Program, function: Function) -> None:
        self.program = program
        self.function = function
        self.parameters = {parameter.name: parameter.type for parameter in function.parameters}
        self.types: dict[str, Type] = {**self.parameters, **function.variables}
        self._found: list[str] = []
        self._path: list[str] = []
        self._within_loop = False

    def violations(self) -> list[str]:
        self._declarations()
        self._block("body", self.function.body)
        if self.function.result != VOID and _falls_through(self.function.body):
            self._say("a path ends without Return")
        return self._found

    def _say(self, message: str) -> None:
        self._found.append(": ".join([self.function.name, *([".".join(self._path)] if self._path else []), message]))

    def _expect(self, holds: bool, message: str) -> None:
        if not holds:
            self._say(message)

    @contextmanager
    def _at(self, place: str) -> Iterator[None]:
        self._path.append(place)
        yield
        self._path.pop()

    def _declarations(self) -> None:
        names = [parameter.name for parameter in self.function.parameters] + list(self.function.variables)
        for name in sorted({name for name in names if names.count(name) > 1}):
            self._say(f"`{name}` is declared twice")
        for parameter in self.function.parameters:
            kind = parameter.type.record if isinstance(parameter.type, Table) else parameter.type
            self._declared_type(f"parameter `{parameter.name}`", kind)
        for name, variable in self.function.variables.items():
            if isinstance(variable, Array):
                self._expect(variable.length >= 1, f"array `{name}` has length {variable.length}")
            self._declared_type(f"variable `{name}`", variable.item if isinstance(variable, Array) else variable)
        self._declared_type("the result", self.function.result)

    def _declared_type(self, what: str, kind: Type) -> None:
        for fault in _faults_of_type(kind):
            self._say(f"{what}: {fault}")

    # --- statements

    def _block(self, name: str, statements: Sequence[Statement]) -> None:
        for position, statement in enumerate(statements):
            with self._at(f"{name}[{position}]"):
                self._statement(statement)

    def _statement(self, node: Statement) -> None:
        match node:
            case Assign():
                kind = self._type_at(self._assignable(node.target), node.path)
                self._same(f"`{node.target}`", kind, self._value(node.value))
            case SetElement():
                kind = self._type_at(self._array(node.array), node.path)
                self._index(node.index)
                self._same(f"the element of `{node.array}`", kind, self._value(node.value))
            case Clear():
                self._array(node.array)
            case Store():
                kind = self._type_at(self._record(node.table), node.path)
                self._index(node.index)
                self._same("the record at this path", kind, self._value(node.value))
            case Atomic():
                self._atomic(node)
            case Call():
                self._call(node)
            case If():
                self._same("the test", BOOL, self._value(node.test))
                self._block("then", node.then)
                self._block("orelse", node.orelse)
            case Loop():
                self._loop(node)
            case Break() | Continue():
                self._expect(self._within_loop, f"{type(node).__name__} outside the body of a loop")
            case Return():
                self._return(node)
            case _:
                self._say(f"{type(node).__name__} is not a statement")

    def _loop(self, node: Loop) -> None:
        outside = self._within_loop
        self._within_loop = False
        self._block("setup", node.setup)
        self._block("step", node.step)
        self._within_loop = True
        self._same("the test", BOOL, self._value(node.test))
        self._block("body", node.body)
        self._within_loop = outside

    def _return(self, node: Return) -> None:
        if node.value is None:
            self._expect(self.function.result == VOID, "Return without a value from a function with a result")
        elif self.function.result == VOID:
            self._say("Return with a value from a function without a result")
        else:
            self._same("the result", self.function.result, self._value(node.value))

    def _atomic(self, node: Atomic) -> None:
        self._expect(node.operation in get_args(AtomicOperation), f"`{node.operation}` is no atomic operation")
        kind = self._type_at(self._record(node.table), node.path)
        self._same("an atomic's field", I32, kind)
        self._index(node.index)
        self._same("an atomic's value", I32, self._value(node.value))
        if node.target is not None:
            self._same(f"`{node.target}`", self._assignable(node.target), I32)

    def _call(self, node: Call) -> None:
        arguments = [self._argument(argument) for argument in node.arguments]
        callee = self.program.functions.get(node.function)
        if callee is None:
            self._say(f"`{node.function}` is called, but is no function of the program")
            return
        if len(arguments) != len(callee.parameters):
            self._say(f"`{node.function}` takes {len(callee.parameters)} arguments, not {len(arguments)}")
        for parameter, argument in zip(callee.parameters, arguments, strict=False):
            self._same(f"parameter `{parameter.name}` of `{node.function}`", parameter.type, argument)
        if node.target is not None:
            self._same(f"`{node.target}`", self._assignable(node.target), callee.result)

    def _assignable(self, name: str) -> Type | None:
        kind = self.types.get(name)
        if kind is None:
            self._say(f"`{name}` is not declared")
        elif isinstance(kind, Array | Table):
            self._say(f"`{name}` is assigned, but is a {kind}")
        return None if isinstance(kind, Array | Table) else kind

    # --- expressions: each gives its type, or None after a complaint, so that one mistake is named once

    def _value(self, node: Expression) -> Type | None:
        kind = self._expected_type(node)
        if kind is not None and kind != node.type:
            self._say(f"{_name(node)} has the type {node.type}; its parts give {kind}")
            return None
        return kind

    def _expected_type(self, node: Expression) -> Type | None:
        match node:
            case Constant():
                return self._constant(node)
            case Local():
                return self._local(node)
            case Operate():
                return self._operate(node)
            case Member():
                base = self._value(node.base)
                return None if base is None else self._type_at(base, (node.name,))
            case Element():
                self._index(node.index)
                return self._array(node.array)
            case Construct():
                return self._construct(node)
            case Load():
                self._index(node.index)
                return self._type_at(self._record(node.table), node.path)
            case Length():
                self._record(node.table)
                return I32
            case NamedTable():
                self._say(f"table `{node.name}` is read whole")
                return None
        self._say(f"{type(node).__name__} is not an expression")
        return None

    def _constant(self, node: Constant) -> Type | None:
        value, kind = node.value, node.type
        if not isinstance(kind, Scalar):
            self._say(f"a constant of type {kind}")
            return None
        is_exact = {F32: _is_float32, I32: _is_int32, BOOL: _is_bool}.get(kind)
        if is_exact is None or not is_exact(value):
            self._say(f"{value!r} is not exactly a value of {kind}")
            return None
        return kind

    def _local(self, node: Local) -> Type | None:
        kind = self.types.get(node.name)
        if kind is None:
            self._say(f"`{node.name}` is not declared")
        elif isinstance(kind, Array | Table):
            self._say(f"`{node.name}`, a {kind}, is read whole")
            return None
        return kind

    def _operate(self, node: Operate) -> Type | None:
        types = [self._value(argument) for argument in node.arguments]
        operation = OPERATIONS.get(node.operation)
        if operation is None:
            self._say(f"`{node.operation}` is no operation")
            return None
        known = [kind for kind in types if kind is not None]
        if len(known) < len(types):
            return None
        result = operation.result(known)
        self._expect(result is not None, f"`{node.operation}` does not take ({', '.join(map(str, known))})")
        return result

    def _construct(self, node: Construct) -> Type | None:
        types = [self._value(argument) for argument in node.arguments]
        if not isinstance(node.type, Vector | Record | Tuple) and not node.type.members:
            self._say(f"a {node.type} is constructed")
            return None
        wanted = [member for _, member in node.type.members]
        if isinstance(node.type, Vector) and len(types) == 1:
            wanted = [F32]
        if len(types) != len(wanted):
            self._say(f"a {node.type} is constructed from {len(types)} members; it has {len(wanted)}")
        for position, (member, kind) in enumerate(zip(wanted, types, strict=False)):
            self._same(f"member {position} of {node.type}", member, kind)
        return node.type

    def _argument(self, node: Expression) -> Type | None:
        """An argument of a call: a value, or a table."""
        is_table = isinstance(node, NamedTable) or (
            isinstance(node, Local) and isinstance(self.types.get(node.name), Table)
        )
        if not is_table:
            return self._value(node)
        record = self._record(node)
        return Table(record) if record else None

    def _record(self, node: Expression) -> Record | None:
        """The record of a table expression."""
        if isinstance(node, NamedTable):
            declared: Type | None = Table(self.program.tables[node.name]) if node.name in self.program.tables else None
        elif isinstance(node, Local):
            declared = self.types.get(node.name)
        else:
            self._say(f"{type(node).__name__} is not a table")
            return None
        if not isinstance(declared, Table):
            self._say(f"`{node.name}` is not declared as a table")
            return None
        if node.type != declared:
            self._say(f"table `{node.name}` is {declared}, not {node.type}")
            return None
        return declared.record

    def _array(self, name: str) -> Type | None:
        """The type of an array's elements."""
        kind = self.types.get(name)
        if not isinstance(kind, Array):
            self._say(f"`{name}` is not declared as an array")
            return None
        return kind.item

    def _index(self, node: Expression) -> None:
        self._same("an index", I32, self._value(node))

    def _type_at(self, base: Type | None, path: Sequence[str]) -> Type | None:
        if base is None:
            return None
        try:
            return at_path(base, path)[0]
        except KeyError as missing:
            self._say(f"{base} has no `{'.'.join(path)}`: no member {missing}")
            return None

    def _same(self, what: str, wanted: Type | None, found: Type | None) -> None:
        if wanted is not None and found is not None and wanted != found:
            self._say(f"{what} is {wanted}, not {found}")


def _name(node: Expression) -> str:
    return f"`{node.operation}`" if isinstance(node, Operate) else type(node).__name__


def _is_float32(value: object) -> bool:
    if type(value) is not float:
        return False
    with np.errstate(all="ignore"):
        return value != value or float(np.float32(value)) == value


def _is_int32(value: object) -> bool:
    return type(value) is int and -(2**31) <= value < 2**31


def _is_bool(value: object) -> bool:
    return type(value) is bool
