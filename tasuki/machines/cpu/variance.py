"""What varies over the lanes of a packet, and why: the fixpoint that decides scalar or vector for every leaf.

A leaf is *uniform* where all active lanes of a packet are sure to hold one value; then one scalar register serves them
all. The analysis runs once for each *specialisation* of a function: its name and which leaves of its arguments vary.
For every leaf it keeps `None` (uniform) or the `Reason` why it varies; `tasuki explain` and the error of a
`same_lanes` that does not hold print the chain of reasons.

A variable's *home* is the innermost block that holds all of its occurrences. An assignment must blend with the old
value only where lanes may have parted between the home and the assignment; there the variable also varies, whatever its
value. Lanes that returned never see a variable again, so a varying `return` makes no variable vary, only the result.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from tasuki.diagnostics import Diagnostic, Note, SourceError, Span
from tasuki.ir import nodes as ir
from tasuki.ir.ops import OPERATIONS
from tasuki.ir.paths import at_path
from tasuki.ir.types import Array, Table, Type

BlockPath = tuple[tuple[int, str], ...]
"""Where a block stands: for each construct around it the index of the statement, and which of its blocks."""
ConstructPath = tuple[BlockPath, int]
TEMPORARY = "$"
"""Begins the names of variables that the language's front end made: nothing that a user knows."""
Pattern = tuple[tuple[bool, ...], ...]
"""For each parameter, which of its leaves vary (a table: nothing)."""


@dataclass(frozen=True)
class Reason:
    """Why a leaf varies; `cause` is the reason behind it."""

    message: str
    span: Span | None = None
    cause: Reason | None = None

    def chain(self) -> Iterator[Reason]:
        reason: Reason | None = self
        while reason is not None:
            yield reason
            reason = reason.cause


Leaves = list[Reason | None]


@dataclass
class Variance:
    """What varies in one specialisation of a function."""

    function: ir.Function
    variables: dict[str, Leaves]
    """For each parameter and variable its leaves; for an array the leaves of an element; nothing for a table."""
    result: Leaves
    parted: dict[ConstructPath, Reason] = field(default_factory=dict)
    """Branches and loops in which lanes may part."""
    homes: dict[str, BlockPath] = field(default_factory=dict)
    parting_returns: bool = False
    """Whether some return leaves other lanes behind, so that results must be blended."""

    def parts(self, home: BlockPath, path: BlockPath) -> Reason | None:
        """Why lanes may have parted on the way from block `home` into block `path` inside it."""
        for depth in range(len(home), len(path)):
            reason = self.parted.get((path[:depth], path[depth][0]))
            if reason is not None:
                return reason
        return None


class VarianceAnalysis:
    """The analysis of a program; specialisations are analysed once and kept."""

    def __init__(self, program: ir.Program) -> None:
        self.program = program
        self.known: dict[tuple[str, Pattern], Variance] = {}

    def analyse(self, name: str, pattern: Pattern, why: Sequence[Leaves] | None = None) -> Variance:
        """The variance of function `name` when the argument leaves that `pattern` marks vary (because of `why`)."""
        key = (name, pattern)
        if key not in self.known:
            self.known[key] = _Fixpoint(self, self.program.functions[name], pattern, why).run()
        return self.known[key]


class _Fixpoint:
    """Grows the set of varying leaves of one specialisation until nothing changes."""

    def __init__(
        self, analysis: VarianceAnalysis, function: ir.Function, pattern: Pattern, why: Sequence[Leaves] | None
    ) -> None:
        self.analysis = analysis
        self.function = function
        variables: dict[str, Leaves] = {}
        for i, (parameter, leaves) in enumerate(zip(function.parameters, pattern, strict=True)):
            given = why[i] if why else [None] * len(leaves)
            variables[parameter.name] = [
                Reason(f"parameter `{parameter.name}` varies", parameter.span, cause) if varies else None
                for varies, cause in zip(leaves, given, strict=True)
            ]
        for name, type_ in function.variables.items():
            variables[name] = [None] * leaf_count(type_)
        self.out = Variance(function, variables, [None] * len(function.result.leaves))
        self.out.homes = find_homes(function)
        self.errors: list[Diagnostic] = []
        self.changed = True

    def run(self) -> Variance:
        while self.changed:
            self.changed = False
            self.errors = []
            self.block(self.function.body, ())
        if self.errors:
            raise SourceError(self.errors)
        return self.out

    # --- statements ---------------------------------------------------------------------------------------------------

    def block(self, statements: Sequence[ir.Statement], path: BlockPath) -> None:
        for index, statement in enumerate(statements):
            self.statement(statement, path, index)

    def statement(self, statement: ir.Statement, path: BlockPath, index: int) -> None:
        match statement:
            case ir.Assign(target, value, member_path):
                leaves = self.expression(value)
                self.assign(target, member_path, leaves, path, statement.span)
            case ir.SetElement(array, at, value, member_path):
                index_reason = first(self.expression(at))
                leaves = [r or because("written at an index that varies", at.span, index_reason)
                          for r in self.expression(value)]  # fmt: skip
                self.assign(array, member_path, leaves, path, statement.span)
            case ir.Store():
                self.expression(statement.index)
                self.expression(statement.value)
            case ir.Atomic():
                self.expression(statement.index)
                self.expression(statement.value)
                if statement.target:
                    reason = Reason("each lane receives its own value from an atomic operation", statement.span)
                    self.assign(statement.target, (), [reason], path, statement.span)
            case ir.Call():
                self.call(statement, path)
            case ir.If(test, then, orelse):
                self.part(path, index, "the condition varies", test.span, first(self.expression(test)))
                self.block(then, (*path, (index, "then")))
                self.block(orelse, (*path, (index, "else")))
            case ir.Loop():
                self.loop(statement, path, index)
            case ir.Return(value):
                self.returned(statement, value, path)
            case ir.Break() | ir.Continue():
                self.jump(statement, path)
            case ir.Clear(array):
                zeros: Leaves = [None] * len(self.out.variables[array])
                self.assign(array, (), zeros, path, statement.span)

    def loop(self, loop: ir.Loop, path: BlockPath, index: int) -> None:
        inside: BlockPath = (*path, (index, "loop"))
        self.block(loop.setup, inside)
        self.part(path, index, "the loop's condition varies", loop.test.span, first(self.expression(loop.test)))
        self.block(loop.body, (*inside, (0, "body")))
        self.block(loop.step, inside)

    def part(self, path: BlockPath, index: int, message: str, span: Span | None, cause: Reason | None) -> None:
        if cause is not None and (path, index) not in self.out.parted:
            self.out.parted[path, index] = Reason(message, span, cause)
            self.changed = True

    def jump(self, statement: ir.Break | ir.Continue, path: BlockPath) -> None:
        """A jump that only some lanes take makes lanes part in its loop."""
        body = max(depth for depth, (_, arm) in enumerate(path) if arm == "body") + 1
        cause = self.out.parts(path[:body], path)
        if cause is None:
            return
        word = "break" if isinstance(statement, ir.Break) else "continue"
        outside, (index, _) = path[: body - 2], path[body - 2]
        self.part(outside, index, f"only some lanes `{word}` here", statement.span, cause)
        # Lanes that went on with the next step are missing from the rest of the body.
        self.part(path[: body - 1], 0, f"only some lanes `{word}` here", statement.span, cause)

    def returned(self, statement: ir.Return, value: ir.Expression | None, path: BlockPath) -> None:
        parted = self.out.parts((), path)
        if parted is not None and not self.out.parting_returns:
            self.out.parting_returns = True
            self.changed = True
        if value is None:
            return
        if parted is not None:
            message = "only some lanes return here"
            self.merge(self.out.result, range(len(self.out.result)), [Reason(message, statement.span, parted)])
        self.merge(self.out.result, range(len(self.out.result)), self.expression(value))

    def call(self, call: ir.Call, path: BlockPath) -> None:
        arguments = [self.expression(a) for a in call.arguments]
        pattern = tuple(tuple(r is not None for r in leaves) for leaves in arguments)
        callee = self.analysis.analyse(call.function, pattern, arguments)
        if call.target is None:
            return
        cause = first([r for leaves in arguments for r in leaves])
        message = f"the result of `{short_name(call.function)}` varies"
        results: Leaves = [Reason(message, call.span, cause or r) if r else None for r in callee.result]
        self.assign(call.target, (), results, path, call.span)

    def assign(
        self, target: str, member_path: tuple[str, ...], leaves: Leaves, path: BlockPath, span: Span | None
    ) -> None:
        type_ = variable_type(self.function, target)
        if isinstance(type_, Array):
            type_ = type_.item
        parted = self.out.parts(self.out.homes[target], path)
        if parted is not None:
            leaves = [r or Reason(f"`{target}` is assigned where lanes have parted", span, parted) for r in leaves]
        elif not target.startswith(TEMPORARY):
            leaves = [Reason(f"`{target}` is assigned here", span, r) if r else None for r in leaves]
        self.merge(self.out.variables[target], at_path(type_, member_path)[1], leaves)

    def merge(self, into: Leaves, at: range, leaves: Leaves) -> None:
        if len(leaves) == 1:
            leaves = leaves * len(at)
        for position, reason in zip(at, leaves, strict=True):
            if reason is not None and into[position] is None:
                into[position] = reason
                self.changed = True

    # --- expressions --------------------------------------------------------------------------------------------------

    def expression(self, expression: ir.Expression) -> Leaves:
        """For every leaf of the value the reason why it varies, or None. A table has no leaves."""
        match expression:
            case ir.Constant() | ir.Length():
                return [None]
            case ir.NamedTable():
                return []
            case ir.Local(name):
                return list(self.out.variables[name])
            case ir.Operate():
                return self.operate(expression)
            case ir.Member(base, name):
                leaves = self.expression(base)
                return [leaves[i] for i in base.type.leaf_range(name)]
            case ir.Element(array, index):
                reason = because("read at an index that varies", index.span, first(self.expression(index)))
                return [r or reason for r in self.out.variables[array]]
            case ir.Construct(arguments, type_):
                leaves = [r for argument in arguments for r in self.expression(argument)]
                return leaves if len(leaves) == len(type_.leaves) else leaves * len(type_.leaves)
            case ir.Load(_, index, _, type_):
                reason = because("loaded at an index that varies", expression.span, first(self.expression(index)))
                return [reason] * len(type_.leaves)
        raise TypeError(f"no expression: {expression!r}")

    def operate(self, expression: ir.Operate) -> Leaves:
        arguments = [self.expression(a) for a in expression.arguments]
        operation = OPERATIONS[expression.operation]
        if operation.name == "same_lanes" and (reason := first(arguments[0])) is not None:
            self.errors.append(lanes_differ(expression, reason))
        if operation.sort == "lanes":
            return [None]
        count = len(expression.type.leaves)
        if operation.sort == "primitive":
            columns = [leaves if len(leaves) == count else leaves * count for leaves in arguments]
            return [first(list(column)) for column in zip(*columns, strict=True)]
        return [first([r for leaves in arguments for r in leaves])] * count


def lanes_differ(expression: ir.Operate, reason: Reason) -> Diagnostic:
    """The error of a `same_lanes` whose argument varies, with the chain of reasons."""
    notes = tuple(Note(r.message, r.span) for r in reason.chain())
    return Diagnostic(
        "`same_lanes` of a value that may differ from lane to lane",
        expression.span,
        expected="a value that is the same in all active lanes",
        found="a value that varies",
        notes=notes,
    )


def first(leaves: Leaves) -> Reason | None:
    return next((r for r in leaves if r is not None), None)


def because(message: str, span: Span | None, cause: Reason | None) -> Reason | None:
    return Reason(message, span, cause) if cause is not None else None


def short_name(qualified: str) -> str:
    """`module_name` of "package.file:module_name"."""
    return qualified.rsplit(":", 1)[-1]


def leaf_count(type_: Type) -> int:
    if isinstance(type_, Table):
        return 0
    return len((type_.item if isinstance(type_, Array) else type_).leaves)


def variable_type(function: ir.Function, name: str) -> Type:
    if name in function.variables:
        return function.variables[name]
    return next(p.type for p in function.parameters if p.name == name)


def find_homes(function: ir.Function) -> dict[str, BlockPath]:
    """For every variable the innermost block that holds all of its occurrences; for parameters the whole body."""
    homes: dict[str, BlockPath] = {p.name: () for p in function.parameters}
    for name, path in _occurrences(function.body, ()):
        homes[name] = _common(homes[name], path) if name in homes else path
    return {**dict.fromkeys(function.variables, ()), **homes}


def _common(a: BlockPath, b: BlockPath) -> BlockPath:
    length = 0
    while length < min(len(a), len(b)) and a[length] == b[length]:
        length += 1
    return a[:length]


def _occurrences(statements: Sequence[ir.Statement], path: BlockPath) -> Iterator[tuple[str, BlockPath]]:
    for index, statement in enumerate(statements):
        for name in _names(statement):
            yield name, path
        match statement:
            case ir.If(_, then, orelse):
                yield from _occurrences(then, (*path, (index, "then")))
                yield from _occurrences(orelse, (*path, (index, "else")))
            case ir.Loop(test, body, setup, step):
                inside: BlockPath = (*path, (index, "loop"))
                yield from ((name, inside) for name in _read_names(test))
                yield from _occurrences((*setup, *step), inside)
                yield from _occurrences(body, (*inside, (0, "body")))


def _names(statement: ir.Statement) -> Iterator[str]:
    """Variables that a statement itself names; the blocks inside it, and a loop's test, aside."""
    match statement:
        case ir.Assign(target, value):
            yield target
            yield from _read_names(value)
        case ir.SetElement(array, index, value):
            yield array
            yield from _read_names(index, value)
        case ir.Clear(array):
            yield array
        case ir.Store(table, index, value):
            yield from _read_names(table, index, value)
        case ir.Atomic():
            if statement.target:
                yield statement.target
            yield from _read_names(statement.table, statement.index, statement.value)
        case ir.Call(target, _, arguments):
            if target:
                yield target
            yield from _read_names(*arguments)
        case ir.If(test):
            yield from _read_names(test)
        case ir.Return(value) if value is not None:
            yield from _read_names(value)


def _read_names(*expressions: ir.Expression) -> Iterator[str]:
    for expression in expressions:
        match expression:
            case ir.Local(name):
                yield name
            case ir.Operate(_, arguments) | ir.Construct(arguments):
                yield from _read_names(*arguments)
            case ir.Member(base):
                yield from _read_names(base)
            case ir.Element(array, index):
                yield array
                yield from _read_names(index)
            case ir.Load(table, index):
                yield from _read_names(table, index)
            case ir.Length(table):
                yield from _read_names(table)
