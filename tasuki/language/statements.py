"""Checking of statements: one case for each form that the language has."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from tasuki.diagnostics import Note
from tasuki.ir.nodes import (
    Assign,
    Break,
    Clear,
    Constant,
    Construct,
    Continue,
    Expression,
    If,
    Local,
    Loop,
    Member,
    Operate,
    Return,
    Statement,
)
from tasuki.ir.types import BOOL, I32, VOID, Array, Table, Tuple, Type
from tasuki.language.annotations import AnnotationError, is_value, type_of
from tasuki.language.calls import Calls
from tasuki.language.context import POISON, UNKNOWN, Literal, Variable, describe
from tasuki.language.effects import is_cheap, reads_memory, variables_read
from tasuki.language.flow import Flow, join
from tasuki.language.names import ArrayName
from tasuki.language.operations import BINARY
from tasuki.language.places import ElementPlace, Place, RowPlace
from tasuki.language.signatures import TYPES

if TYPE_CHECKING:
    from tasuki.language.declare import Module

STATEMENT_NAMES: dict[type[ast.AST], str] = {
    ast.FunctionDef: "a function inside a module",
    ast.AsyncFunctionDef: "`async`",
    ast.AsyncFor: "`async`",
    ast.AsyncWith: "`async`",
    ast.ClassDef: "`class`",
    ast.Delete: "`del`",
    ast.With: "`with`",
    ast.Match: "`match`",
    ast.Raise: "`raise`",
    ast.Try: "`try`",
    ast.TryStar: "`try`",
    ast.Assert: "`assert`",
    ast.Import: "`import`",
    ast.ImportFrom: "`import`",
    ast.Global: "`global`",
    ast.Nonlocal: "`nonlocal`",
}
STATEMENT_HINTS: dict[type[ast.AST], str] = {
    ast.FunctionDef: "write it beside this one, with @module",
    ast.Import: "import at the head of the file",
    ast.ImportFrom: "import at the head of the file",
    ast.Match: "`if` and `elif`",
}


@dataclass
class LoopState:
    """A loop whose body is being checked: its variable, if it is a `for`, and what holds at each `break`."""

    variable: str | None = None
    breaks: list[Flow] = field(default_factory=list)


class Statements(Calls):
    """Checking of a whole body."""

    def __init__(self, module: Module) -> None:
        super().__init__(module)
        self.result: Type = VOID
        self.loops: list[LoopState] = []

    def suite(self, statements: Sequence[ast.stmt]) -> tuple[Statement, ...]:
        """The statements of a block, as a block of IR."""
        with self.nested_block() as block:
            for statement in statements:
                if not self.flow.reachable:
                    self.error(statement, "this is never reached")
                    break
                self.statement(statement)
        return tuple(block)

    def statement(self, node: ast.stmt) -> None:
        match node:
            case ast.Pass():
                pass
            case ast.Expr():
                self.expression_statement(node)
            case ast.Assign():
                self.assign(node)
            case ast.AnnAssign():
                self.declare(node)
            case ast.AugAssign():
                self.augment(node)
            case ast.If():
                self.branch(node)
            case ast.While():
                self.while_loop(node)
            case ast.For():
                self.for_loop(node)
            case ast.Return():
                self.give_back(node)
            case ast.Break() | ast.Continue():
                self.leave(node)
            case _:
                what = STATEMENT_NAMES.get(type(node), f"`{type(node).__name__}`")
                self.not_in_language(node, what, STATEMENT_HINTS.get(type(node)))

    # --- expressions as statements ------------------------------------------------------------------------------------

    def expression_statement(self, node: ast.Expr) -> None:
        """A call for its effect; a docstring, `...` and `breakpoint()` say nothing here."""
        expression = node.value
        if isinstance(expression, ast.Constant) and isinstance(expression.value, str | type(...)):
            return
        if isinstance(expression, ast.Call) and self.lookup(expression.func) is breakpoint:
            return
        value = self.raw(expression)
        made = self.take_result(value)
        if made is not None and made.target is not None:
            del self.temporaries[made.target]
            self.block[-1] = replace(made, target=None)
        elif made is None and value.type not in (UNKNOWN, VOID):
            self.error(node, "this value is not used")

    # --- assignment ---------------------------------------------------------------------------------------------------

    def assign(self, node: ast.Assign) -> None:
        """`a = v`, `a, b = v, w`, `a = b = v`: all values first, then the targets from the left."""
        if self.array_declaration(node):
            return
        value = self.raw(node.value, self.wanted_by(node.targets))
        only = node.targets[0] if len(node.targets) == 1 else None
        if isinstance(only, ast.Name):
            self.assign_name(only, value, node, sole=True)
            return
        if not only and value.type not in (UNKNOWN, VOID):
            value = self.bind(value)
        for target in node.targets:
            self.assign_to(target, value, node)

    def wanted_by(self, targets: Sequence[ast.expr]) -> Type | None:
        """The type that the targets are known to have, as a hint for literals."""
        target = targets[0]
        if isinstance(target, ast.Name) and target.id in self.variables:
            return self.variables[target.id].type
        if isinstance(target, ast.Tuple):
            return Tuple(tuple(self.wanted_by([item]) or UNKNOWN for item in target.elts))
        return None

    def assign_to(self, target: ast.expr, value: Expression, node: ast.stmt) -> None:
        match target:
            case ast.Name():
                self.assign_name(target, value, node)
            case ast.Attribute() | ast.Subscript():
                self.assign_place(target, value, node)
            case ast.Tuple() | ast.List():
                self.unpack(target, value, node)
            case _:
                self.not_in_language(target, "this target")

    def assign_name(self, target: ast.Name, value: Expression, node: ast.stmt, sole: bool = False) -> None:
        """A whole variable becomes `value`, which goes nowhere else if `sole`."""
        name = target.id
        self.refuse_loop_variable(target)
        if name not in self.variables and not self.can_be_variable(target, value):
            value = POISON
        variable = self.variables.setdefault(name, Variable(value.type, self.span(target)))
        self.flow.assigned.add(name)
        if isinstance(variable.type, Array | Table):
            self.error(target, f"`{name}` is {describe(variable.type)} and cannot be assigned as a whole")
            return
        notes = self.fixed_before(name, node)
        fitted = self.fit(value, variable.type, source_of(node), f"the value of `{name}`", notes)
        if fitted.type == UNKNOWN:
            return
        made = self.take_result(fitted) if sole else None
        if made is not None and made.target is not None:
            del self.temporaries[made.target]
            self.block[-1] = replace(made, target=name)
        else:
            self.emit(Assign(name, fitted, span=self.span(node)))

    def fixed_before(self, name: str, node: ast.stmt) -> tuple[Note, ...]:
        """Where the type of variable `name` was fixed, if not by `node` itself."""
        variable = self.variables[name]
        if variable.span.line == node.lineno:
            return ()
        return (Note(f"`{name}` is {describe(variable.type)} from here on", variable.span),)

    def can_be_variable(self, target: ast.expr, value: Expression) -> bool:
        """Whether a variable can hold `value`; an error where it cannot."""
        if value.type == VOID:
            self.error(target, "there is no value to assign: what is called returns nothing")
        elif isinstance(value.type, Table):
            self.error(target, "a table cannot be held in a variable", hint="use the table's own name")
        else:
            return True
        return False

    def assign_place(self, target: ast.expr, value: Expression, node: ast.stmt) -> None:
        start = len(self.block)
        place = self.resolve(target)
        if UNKNOWN in (place.type, value.type):
            return
        if not isinstance(place, Place):
            hint = "assign the components one by one" if isinstance(place, Construct) else None
            self.error(target, f"`{ast.unparse(target)}` cannot be assigned", hint=hint)
            return
        self.refuse_loop_variable(target)
        what = f"the value of `{ast.unparse(target)}`"
        value = self.fit(self.protect(value, start), place.type, source_of(node), what)
        if value.type != UNKNOWN:
            self.emit(place.write(value, self.span(node)))

    def refuse_loop_variable(self, target: ast.expr) -> None:
        if isinstance(target, ast.Name) and any(loop.variable == target.id for loop in self.loops):
            self.error(target, f"`{target.id}` is the variable of a `for` loop and cannot be assigned inside it")

    def unpack(self, target: ast.Tuple | ast.List, value: Expression, node: ast.stmt) -> None:
        """`a, b = ...`: the items of a tuple, to one target each."""
        if value.type == UNKNOWN:
            for item in target.elts:
                self.assign_to(item, POISON, node)
            return
        count = len(value.type.items) if isinstance(value.type, Tuple) else None
        if count != len(target.elts):
            found = f"{count} values" if count else describe(value.type)
            self.error(node, "the targets do not fit the values", expected=f"{len(target.elts)} values", found=found)
            return
        for item, part in zip(target.elts, self.items(target, value), strict=True):
            self.assign_to(item, part, node)

    def items(self, target: ast.Tuple | ast.List, value: Expression) -> list[Expression]:
        """The items of a tuple, safe from being changed by the assignment of the ones before."""
        assert isinstance(value.type, Tuple)
        if not isinstance(value, Construct):
            whole = value if is_cheap(value) else self.bind(value)
            types = value.type.items
            return [Member(whole, str(i), item, span=value.span) for i, item in enumerate(types)]
        written = {node.id for item in target.elts[:-1] for node in ast.walk(item) if isinstance(node, ast.Name)}
        simple = all(isinstance(item, ast.Name) for item in target.elts)
        clash = any(variables_read(item) & written or (reads_memory(item) and not simple) for item in value.arguments)
        if not clash:
            return list(value.arguments)
        return [self.bind(item) for item in value.arguments]

    def array_declaration(self, node: ast.Assign) -> bool:
        """`name = array(item type, length)`: the life of a local array begins. False where `node` is something else."""
        call = node.value
        if not isinstance(call, ast.Call) or not isinstance(self.lookup(call.func), ArrayName):
            return False
        target = node.targets[0]
        if len(node.targets) > 1 or not isinstance(target, ast.Name):
            self.error(node, "a local array is assigned to one new name")
            return True
        kind = self.array_type(call)
        variable = self.variables.setdefault(target.id, Variable(kind, self.span(target)))
        self.flow.assigned.add(target.id)
        if kind == UNKNOWN or variable.type == UNKNOWN:
            return True
        if variable.type != kind:
            expected, found = str(variable.type), str(kind)
            notes = self.fixed_before(target.id, node)
            self.error(node, f"`{target.id}` has the wrong type", expected=expected, found=found, notes=notes)
        else:
            self.emit(Clear(target.id, span=self.span(node)))
        return True

    def array_type(self, call: ast.Call) -> Type:
        arguments = self.positional(call, "array", 2)
        if arguments is None:
            return UNKNOWN
        item = self.annotation(arguments[0], f"the items of an array: {TYPES}")
        length = self.raw(arguments[1])
        if not isinstance(length, Literal) or length.value < 1:
            if length.type != UNKNOWN:
                expected = "a whole number, at least 1"
                self.error(arguments[1], "the length of a local array is a constant", expected=expected)
            return UNKNOWN
        return Array(item, int(length.value)) if item != UNKNOWN else UNKNOWN

    def declare(self, node: ast.AnnAssign) -> None:
        """`x: f32 = 0`, or `x: f32` alone: the type of a variable, said rather than inferred."""
        if not isinstance(node.target, ast.Name):
            self.error(node.target, "only a variable can be annotated")
            return
        kind = self.annotation(node.annotation, TYPES)
        variable = self.variables.setdefault(node.target.id, Variable(kind, self.span(node.target)))
        if UNKNOWN not in (kind, variable.type) and variable.type != kind:
            notes = self.fixed_before(node.target.id, node)
            message = f"`{node.target.id}` has another type already"
            self.error(node.annotation, message, expected=str(variable.type), found=str(kind), notes=notes)
        if node.value is not None:
            self.assign_name(node.target, self.raw(node.value, kind), node, sole=True)

    def annotation(self, node: ast.expr, expected: str) -> Type:
        """The type that an annotation inside the body names."""
        text = node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ast.unparse(node)
        for name in (part.id for part in ast.walk(node) if isinstance(part, ast.Name)):
            self.lookup(ast.Name(name))
        try:
            kind = type_of(text, self.names)
            if is_value(kind):
                return kind
            raise AnnotationError(str(kind))
        except AnnotationError as error:
            self.error(node, f"`{text}` is not a type here", expected=expected, found=error.found, hint=error.hint)
        return UNKNOWN

    def augment(self, node: ast.AugAssign) -> None:
        """`a += v` and its like; an index of the target is evaluated once."""
        target = self.resolve(node.target)
        if isinstance(target, ElementPlace | RowPlace) and not is_cheap(target.index):
            target = replace(target, index=self.bind(target.index))
        self.refuse_loop_variable(node.target)
        if isinstance(target, Place) and isinstance(target.type, Array):
            self.read(node.target)
            return
        old = target.read() if isinstance(target, Place) else target
        start = len(self.block)
        value = self.raw(node.value)
        old = self.protect(old, start)
        symbol, name = BINARY[type(node.op)]
        if isinstance(node.op, ast.Pow):
            self.not_in_language(node, "`**=`", "multiply: x = x * x")
            return
        if isinstance(node.op, ast.MatMult):
            result = self.matrix_product(node, old, value)
        else:
            result = self.operate(node, symbol, name, (old, value))
        if UNKNOWN in (target.type, result.type):
            return
        if not isinstance(target, Place):
            self.error(node.target, f"`{ast.unparse(node.target)}` cannot be assigned")
            return
        result = self.fit(result, target.type, node, f"the value of `{ast.unparse(node.target)}`")
        if result.type != UNKNOWN:
            self.emit(target.write(result, self.span(node)))

    # --- control flow -------------------------------------------------------------------------------------------------

    def branch(self, node: ast.If) -> None:
        test = self.condition(node.test, "`if`")
        before = self.flow
        self.flow = before.copy()
        then = self.suite(node.body)
        after_then, self.flow = self.flow, before.copy()
        orelse = self.suite(node.orelse)
        self.flow = join([after_then, self.flow])
        self.emit(If(test, then, orelse, span=self.span(node.test)))

    def while_loop(self, node: ast.While) -> None:
        if node.orelse:
            self.not_in_language(node.orelse[0], "`else` of a loop")
        with self.nested_block() as setup:
            test = self.condition(node.test, "`while`")
        endless = isinstance(test, Constant) and test.value is True
        body = self.loop_body(node.body, LoopState(), leaves_by_itself=not endless)
        self.emit(Loop(test, body, tuple(setup), span=self.span(node.test)))

    def loop_body(
        self, statements: Sequence[ast.stmt], loop: LoopState, leaves_by_itself: bool
    ) -> tuple[Statement, ...]:
        """The body of a loop. Behind it holds what holds at its test (if it ends there) and at every `break`."""
        at_test = self.flow.copy()
        if loop.variable is not None:
            self.flow.assigned.add(loop.variable)
        self.loops.append(loop)
        body = self.suite(statements)
        self.loops.pop()
        self.flow = join([*loop.breaks, *([at_test] if leaves_by_itself else [])])
        return body

    def for_loop(self, node: ast.For) -> None:
        """`for i in range(...)`: the bounds are evaluated once, before the loop."""
        if node.orelse:
            self.not_in_language(node.orelse[0], "`else` of a loop")
        bounds = self.range_of(node)
        if not isinstance(node.target, ast.Name):
            self.error(node.target, "the variable of a `for` loop is one name")
            return
        name, span = node.target.id, self.span(node.target)
        self.refuse_loop_variable(node.target)
        variable = self.variables.setdefault(name, Variable(I32, span))
        if variable.type not in (I32, UNKNOWN):
            message, found = f"`{name}` has the wrong type", str(variable.type)
            self.error(node.target, message, expected="i32", found=found, notes=self.fixed_before(name, node))
        if bounds is None:
            self.loop_body(node.body, LoopState(name), leaves_by_itself=True)
            return
        start, stop, step = bounds
        self.emit(Assign(name, start, span=span))
        self.flow.assigned.discard(name)
        body = self.loop_body(node.body, LoopState(name), leaves_by_itself=True)
        self.flow.assigned.discard(name)
        self.loop_variables.add(name)
        counter = Local(name, I32, span=span)
        test = Operate("less" if step > 0 else "greater", (counter, stop), BOOL, span=span)
        increased = Operate("add", (counter, Constant(step, I32, span=span)), I32, span=span)
        self.emit(Loop(test, body, step=(Assign(name, increased, span=span),), span=span))

    def range_of(self, node: ast.For) -> tuple[Expression, Expression, int] | None:
        """Start, stop and step of the `range` that a `for` goes over; None after an error."""
        call = node.iter
        if not isinstance(call, ast.Call) or self.lookup(call.func) is not range:
            self.error(call, "`for` goes over `range(...)` only", hint="for i in range(len(table))")
            return None
        arguments = self.positional(call, "range", 1, 3)
        if arguments is None:
            return None
        values = [
            self.bind(self.fit(value, I32, argument, "a bound of `range`"))
            for argument, value in zip(arguments, self.operands(arguments), strict=True)
        ]
        if any(value.type == UNKNOWN for value in values):
            return None
        step = values[2] if len(values) == 3 else Constant(1, I32)
        if not isinstance(step, Constant) or step.value == 0:
            self.error(arguments[2], "the step of `range` is a constant other than 0")
            return None
        start: Expression = values[0] if len(values) > 1 else Constant(0, I32, span=self.span(call))
        stop = values[1] if len(values) > 1 else values[0]
        return start, stop, int(step.value)

    def give_back(self, node: ast.Return) -> None:
        self.flow.stop()
        if node.value is None or (isinstance(node.value, ast.Constant) and node.value.value is None):
            if self.result != VOID:
                self.error(node, "`return` without a value", expected=describe(self.result))
            self.emit(Return(span=self.span(node)))
            return
        value = self.raw(node.value, self.result)
        if value.type == VOID == self.result:
            self.emit(Return(span=self.span(node)))
            return
        value = self.fit(value, self.result, node.value, f"the result of `{self.module.name}`")
        self.emit(Return(value, span=self.span(node)))

    def leave(self, node: ast.Break | ast.Continue) -> None:
        if isinstance(node, ast.Break):
            self.loops[-1].breaks.append(self.flow.copy())
            self.emit(Break(span=self.span(node)))
        else:
            self.emit(Continue(span=self.span(node)))
        self.flow.stop()


def source_of(node: ast.stmt) -> ast.AST:
    """What a message about the value of an assignment points at."""
    return getattr(node, "value", None) or node
