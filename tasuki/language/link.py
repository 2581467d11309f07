"""Linking: an entry module, all that it calls, and what fills its sockets become one program."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from tasuki.diagnostics import Diagnostic, LinkError, Note, SourceError, Span
from tasuki.ir.nodes import (
    Assign,
    Call,
    Constant,
    Construct,
    Expression,
    Function,
    If,
    Load,
    Local,
    Loop,
    NamedTable,
    Operate,
    Parameter,
    Program,
    Return,
    Signature,
    Statement,
)
from tasuki.ir.types import BOOL, F32, I32, VOID, Record, Scalar, Type
from tasuki.language.declare import Case, Module, Socket
from tasuki.language.source import source_order
from tasuki.language.tables import Table

if TYPE_CHECKING:
    from tasuki.language.check import Checked

Filler = Module | Sequence[Case]


def link(entry: Module, fillers: Mapping[str, Filler] | None = None) -> Program:
    """The program that runs `entry`; `fillers` says, by socket name, which module (or cases, by kind) fills it.

    Only what the entry reaches is checked and linked; fillers of other sockets are left out. Raises `SourceError` with
    all that is wrong in any module, and `LinkError` where the modules are right but do not fit together.
    """
    return _Linker(fillers or {}).link(entry)


def mismatch(module: Module, socket: Socket, record: Record | None = None) -> Diagnostic | None:
    """Why `module` cannot fill `socket`, or None. As a case of a dispatch socket it takes a record (`record`) first."""
    found, expected = module.signature, socket.signature
    if socket.dispatch:
        first = found.parameters[:1]
        given = record or (first[0] if first and isinstance(first[0], Record) else None)
        wanted = ((given,) if given else ()) + expected.parameters[2:]
        text = str(Signature(((given or Scalar("record")), *expected.parameters[2:]), expected.result))
        fits = given is not None and found == Signature(wanted, expected.result)
    else:
        text = str(expected)
        fits = found == expected
    if fits:
        return None
    message = f"`{module.name}` cannot fill socket `{socket.name}`"
    notes = (Note("the socket is declared here", socket.place),)
    return Diagnostic(message, module.place, expected=text, found=str(found), notes=notes)


def compatible(module: Module, socket: Socket) -> bool:
    """Whether `module` can fill `socket` (of a dispatch socket: one of its cases)."""
    return mismatch(module, socket) is None


def reached_sockets(entry: Module, fillers: Mapping[str, Filler]) -> dict[str, Socket]:
    """The sockets that `entry`, all that it calls, and what fills those sockets reach, by name.

    A filler that does not fit its socket is not looked into. Raises `SourceError`.
    """
    sockets: dict[str, Socket] = {}
    seen: set[Module] = set()
    waiting = [entry]
    while waiting:
        module = waiting.pop()
        if module in seen:
            continue
        seen.add(module)
        for callee in module.check().calls.values():
            if isinstance(callee, Module):
                waiting.append(callee)
                continue
            sockets[callee.name] = callee
            filler = fillers.get(callee.name, ())
            given = [filler] if isinstance(filler, Module) else [case.module for case in filler]
            waiting += [one for one in given if compatible(one, callee)]
    return sockets


@dataclass
class _Linker:
    fillers: Mapping[str, Filler]
    functions: dict[str, Function] = field(default_factory=dict)
    names: dict[Module | Socket, str] = field(default_factory=dict)
    tables: dict[str, Table] = field(default_factory=dict)
    source_problems: list[Diagnostic] = field(default_factory=list)
    link_problems: list[Diagnostic] = field(default_factory=list)
    waiting: list[Module] = field(default_factory=list)

    def link(self, entry: Module) -> Program:
        name = self.name_of(entry)
        while self.waiting:
            self.add(self.waiting.pop(0))
        if not self.source_problems:
            self.source_problems += find_recursion(self.functions, name)
        if self.source_problems:
            problems = dict.fromkeys([*self.source_problems, *self.link_problems])
            raise SourceError(sorted(problems, key=source_order))
        if self.link_problems:
            raise LinkError("\n\n".join(map(str, dict.fromkeys(self.link_problems))))
        tables = {table_name: table.record.ir for table_name, table in self.tables.items()}
        return Program(self.functions, name, tables)

    def name_of(self, module: Module) -> str:
        """The function's name in the program; a module that is met for the first time waits to be added."""
        if module not in self.names:
            self.names[module] = self.unique(module.qualified_name)
            self.waiting.append(module)
        return self.names[module]

    def unique(self, name: str) -> str:
        """`name`, told apart from other declarations of that name (made by a function, or by a cell run again)."""
        taken, candidate, count = set(self.names.values()), name, 1
        while candidate in taken:
            count += 1
            candidate = f"{name}#{count}"
        return candidate

    def add(self, module: Module) -> None:
        checked = module.examine()
        self.source_problems += checked.diagnostics
        targets = {key: self.target(callee, module, checked, key) for key, callee in checked.calls.items()}
        for name, table in checked.named_tables.items():
            self.add_table(name, table, module.place)
        function = checked.function
        name = self.names[module]
        self.functions[name] = replace(function, name=name, body=rename_calls(function.body, targets))

    def add_table(self, name: str, table: Table, place: Span) -> None:
        other = self.tables.setdefault(name, table)
        if other is not table:
            self.link_problems.append(Diagnostic(f"two different tables are called `{name}`", place))

    def target(self, callee: Module | Socket, caller: Module, checked: Checked, key: str) -> str:
        """The name, in the program, of the function that a call of `callee` runs."""
        if isinstance(callee, Module):
            return self.name_of(callee)
        if callee in self.names:
            return self.names[callee]
        if callee.name not in self.fillers:
            span = next((call.span for call in calls(checked.function.body) if call.function == key), None)
            message = f"socket `{callee.name}`, which `{caller.name}` calls, is not filled"
            hint = f"a module {callee.signature} can fill it"
            self.link_problems.append(Diagnostic(message, span, hint=hint))
            return key
        self.names[callee] = self.fill(callee, self.fillers[callee.name])
        return self.names[callee]

    def fill(self, socket: Socket, filler: Filler) -> str:
        """The name of the function that stands for `socket`."""
        problems = [*self.declaration_problems(socket)]
        if isinstance(filler, Module):
            if socket.dispatch:
                message = f"socket `{socket.name}` is filled by cases, one for each kind"
                problems.append(Diagnostic(message, filler.place))
            else:
                problems += filter(None, [mismatch(filler, socket)])
        elif socket.dispatch:
            found = [mismatch(case.module, socket, case.table.record.ir) for case in filler]
            problems += filter(None, found)
        else:
            problems.append(Diagnostic(f"socket `{socket.name}` is filled by one module, not by cases", socket.place))
        self.link_problems += problems
        if problems:
            return socket.qualified_name
        if isinstance(filler, Module):
            return self.name_of(filler)
        name = self.unique(socket.qualified_name)
        self.functions[name] = self.dispatcher(socket, name, filler)
        return name

    def declaration_problems(self, socket: Socket) -> Iterator[Diagnostic]:
        source, definition = socket.parsed
        for statement in definition.body:
            if not (isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)):
                message = f"socket `{socket.name}` has a body: what fills it is said when a program is linked"
                yield Diagnostic(message, source.span(statement), expected="...", source=source.text)
                break
        if socket.dispatch and socket.signature.parameters[:2] != (I32, I32):
            expected = "(i32, i32, ...): the kind and the index"
            message = f"dispatch socket `{socket.name}` does not begin with a kind and an index"
            yield Diagnostic(message, socket.place, expected, str(socket.signature))

    def dispatcher(self, socket: Socket, name: str, cases: Sequence[Case]) -> Function:
        """The function of a dispatch socket: the record of the kind's table goes to the kind's module."""
        signature, span = socket.signature, socket.place
        parameters = tuple(map(Parameter, socket.parameters, signature.parameters))
        kind, index, *rest = (Local(parameter.name, parameter.type, span=span) for parameter in parameters)
        body: list[Statement] = []
        variables: dict[str, Type] = {} if signature.result == VOID else {"$result": signature.result}
        for position, case in enumerate(cases):
            self.add_table(case.table_name, case.table, socket.place)
            record = case.table.record.ir
            variables[f"$record{position}"] = record
            row = Load(NamedTable(case.table_name, case.table.type), index, (), record, span=span)
            load = Assign(f"$record{position}", row, span=span)
            arguments = (Local(f"$record{position}", record, span=span), *rest)
            branch = (load, *_call_and_return(self.name_of(case.module), arguments, signature.result, span))
            if position == len(cases) - 1:
                body += branch
            else:
                test = Operate("equal", (kind, Constant(case.number, I32, span=span)), BOOL, span=span)
                body.append(If(test, branch, span=span))
        if not cases:
            body.append(Return(zero(signature.result) if signature.result != VOID else None, span=span))
            variables = {}
        return Function(name, parameters, signature.result, variables, tuple(body), span=span)


def _call_and_return(
    function: str, arguments: tuple[Expression, ...], result: Type, span: Span
) -> tuple[Statement, ...]:
    if result == VOID:
        return Call(None, function, arguments, span=span), Return(span=span)
    return Call("$result", function, arguments, span=span), Return(Local("$result", result, span=span), span=span)


def zero(type: Type) -> Expression:
    """The value of `type` whose leaves are 0 and False."""
    if isinstance(type, Scalar):
        return Constant({F32: 0.0, I32: 0, BOOL: False}[type], type)
    return Construct(tuple(zero(member) for _, member in type.members), type)


def calls(statements: Sequence[Statement]) -> Iterator[Call]:
    """Every call among `statements`, in order."""
    for statement in statements:
        if isinstance(statement, Call):
            yield statement
        elif isinstance(statement, If):
            yield from calls((*statement.then, *statement.orelse))
        elif isinstance(statement, Loop):
            yield from calls((*statement.setup, *statement.body, *statement.step))


def rename_calls(statements: Sequence[Statement], names: Mapping[str, str]) -> tuple[Statement, ...]:
    """The statements, with every call of `names[...]` instead."""

    def renamed(statement: Statement) -> Statement:
        if isinstance(statement, Call):
            return replace(statement, function=names[statement.function])
        if isinstance(statement, If):
            then, orelse = rename_calls(statement.then, names), rename_calls(statement.orelse, names)
            return replace(statement, then=then, orelse=orelse)
        if isinstance(statement, Loop):
            setup, body = rename_calls(statement.setup, names), rename_calls(statement.body, names)
            return replace(statement, setup=setup, body=body, step=rename_calls(statement.step, names))
        return statement

    return tuple(map(renamed, statements))


def find_recursion(functions: Mapping[str, Function], entry: str) -> list[Diagnostic]:
    """One diagnostic for every call that closes a cycle, naming the cycle."""
    found: list[Diagnostic] = []
    finished: set[str] = set()

    def visit(name: str, path: list[str]) -> None:
        path = [*path, name]
        for call in calls(functions[name].body) if name in functions else ():
            if call.function in path:
                cycle = [*path[path.index(call.function) :], call.function]
                hint = "write a loop, with what is still to do in a local array"
                short = " -> ".join(member.rpartition(":")[2] for member in cycle)
                found.append(Diagnostic(f"recursion is not part of the language: {short}", call.span, hint=hint))
            elif call.function not in finished:
                visit(call.function, path)
        finished.add(name)

    visit(entry, [])
    return found
