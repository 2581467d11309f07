"""Checking of expressions: one case for each form that the language has.

An expression becomes an IR expression; what IR keeps among the statements (calls, and whatever must not be evaluated
before its turn) is put into the block first. `raw` may give a `Literal` that still awaits its type; `value` never does.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from functools import partial
from types import ModuleType
from typing import Any

import numpy as np

from tasuki.diagnostics import Note, SourceError
from tasuki.ir.nodes import Assign, Constant, Construct, Expression, If, Local, Member, NamedTable, Operate, Statement
from tasuki.ir.types import BOOL, F32, I32, MAT4, Array, Matrix, Record, Table, Tuple, Type, Vector
from tasuki.language.annotations import TableType
from tasuki.language.context import MISSING, POISON, UNKNOWN, Literal, describe
from tasuki.language.declare import Declaration, RecordType
from tasuki.language.effects import eager_safe, is_cheap, variables_read
from tasuki.language.names import VOCABULARY, Builtin, TypeName
from tasuki.language.operations import BINARY, COMPARISON, Operations
from tasuki.language.places import ElementPlace, Place, RowPlace, VariablePlace
from tasuki.language.tables import Table as NamedTableObject

EXPRESSION_NAMES: dict[type[ast.AST], str] = {
    ast.NamedExpr: "assignment inside an expression",
    ast.Lambda: "`lambda`",
    ast.Dict: "a dictionary",
    ast.Set: "a set",
    ast.List: "a list",
    ast.ListComp: "a comprehension",
    ast.SetComp: "a comprehension",
    ast.DictComp: "a comprehension",
    ast.GeneratorExp: "a comprehension",
    ast.Await: "`await`",
    ast.Yield: "`yield`",
    ast.YieldFrom: "`yield`",
    ast.JoinedStr: "text",
    ast.Starred: "`*`",
    ast.Slice: "a slice",
}
EXPRESSION_HINTS: dict[type[ast.AST], str] = {ast.List: "a local array: name = array(f32, 8)"}


class Expressions(Operations):
    """Checking of expressions. Calls are left to `Calls`, which extends this class."""

    # --- entries ------------------------------------------------------------------------------------------------------

    def value(self, node: ast.expr, wanted: Type | None = None, what: str = "this value") -> Expression:
        """The expression at `node`, of type `wanted` if one is given; an error calls it `what`."""
        found = self.raw(node, wanted)
        if wanted is not None:
            return self.fit(found, wanted, node, what)
        return self.settle(found)

    def condition(self, node: ast.expr, what: str) -> Expression:
        """A bool: the test of `what`."""
        found = self.raw(node)
        if found.type in (BOOL, UNKNOWN):
            return found
        hint = "compare: ... != 0" if found.type in (F32, I32) else None
        return self.error(node, f"{what} needs a bool", expected="bool", found=describe(found.type), hint=hint)

    def operands(self, nodes: Sequence[ast.expr], wanted: Sequence[Type | None] = ()) -> list[Expression]:
        """Several expressions, left to right; what a later one's calls could change is read before them."""
        values: list[Expression] = []
        for position, node in enumerate(nodes):
            start = len(self.block)
            value = self.raw(node, wanted[position] if position < len(wanted) else None)
            values = [*(self.protect(earlier, start) for earlier in values), value]
        return values

    def raw(self, node: ast.expr, wanted: Type | None = None) -> Expression:
        """The expression at `node`. `wanted` is a hint for literals in tuples and conditional expressions."""
        match node:
            case ast.Constant():
                return self.constant(node, node.value)
            case ast.Name() | ast.Attribute() | ast.Subscript():
                return self.read(node)
            case ast.UnaryOp():
                return self.unary(node)
            case ast.BinOp():
                return self.binary(node)
            case ast.Compare():
                return self.comparison(node)
            case ast.BoolOp():
                return self.logic(node)
            case ast.IfExp():
                return self.conditional(node, wanted)
            case ast.Call():
                return self.call(node)
            case ast.Tuple():
                items = wanted.items if isinstance(wanted, Tuple) else ()
                return self.tuple_of(self.operands(node.elts, items), wanted, self.span(node))
            case _:
                what = EXPRESSION_NAMES.get(type(node), f"`{type(node).__name__}`")
                return self.not_in_language(node, what, EXPRESSION_HINTS.get(type(node)))

    def call(self, node: ast.Call) -> Expression:
        raise NotImplementedError

    # --- constants ----------------------------------------------------------------------------------------------------

    def constant(self, node: ast.expr, value: Any) -> Expression:
        """A number or bool that stands in the source or in a global name."""
        if isinstance(value, bool):
            return Constant(value, BOOL, span=self.span(node))
        if isinstance(value, int):
            if not -(2**31) <= value < 2**31:
                return self.error(node, f"{value} does not fit i32", expected="-2147483648 to 2147483647")
            return Literal(int(value), I32, span=self.span(node))
        if isinstance(value, float):
            with np.errstate(over="ignore"):
                rounded = float(np.float32(value))
            if np.isinf(rounded) and not np.isinf(value):
                return self.error(node, f"{value} does not fit f32", expected="at most 3.4028235e+38")
            return Constant(rounded, F32, span=self.span(node))
        what = "text" if isinstance(value, str | bytes) else f"`{value}`"
        return self.not_in_language(node, what)

    # --- names, members, indices --------------------------------------------------------------------------------------

    def read(self, node: ast.expr) -> Expression:
        found = self.resolve(node)
        if isinstance(found, Place):
            if isinstance(found.type, Array):
                message = "a local array is not a value: it is read element by element"
                return self.error(node, message, found=str(found.type))
            return found.read()
        return found

    def resolve(self, node: ast.expr) -> Place | Expression:
        """What a name, attribute or subscript leads to: a place where there is one, else an expression."""
        match node:
            case ast.Name():
                return self.variable(node) if node.id in self.local_names else self.global_value(node, node.id)
            case ast.Attribute():
                if isinstance(self.lookup(node.value), ModuleType):
                    return self.global_value(node, ast.unparse(node))
                return self.member(node)
            case ast.Subscript():
                return self.element(node)
            case _:
                return self.raw(node)

    def variable(self, node: ast.Name) -> Place | Expression:
        variable = self.variables.get(node.id)
        if variable is not None and node.id in self.flow.assigned:
            if isinstance(variable.type, Table):
                return Local(node.id, variable.type, span=self.span(node))
            if variable.type == UNKNOWN:
                return POISON
            return VariablePlace(variable.type, variable.type, (), self.span(node), node.id)
        self.flow.assigned.add(node.id)  # said once
        if variable is None:
            return self.error(node, f"`{node.id}` is read before it is assigned")
        if variable.type == UNKNOWN:
            return POISON
        if node.id in self.loop_variables:
            hint = "keep it in another variable inside the loop"
            return self.error(node, f"`{node.id}`, the variable of a `for` loop, has no value after it", hint=hint)
        notes = (Note(f"`{node.id}` is assigned here, but not on every path that leads on", variable.span),)
        return self.error(node, f"`{node.id}` may have no value here", notes=notes)

    def global_value(self, node: ast.expr, name: str) -> Expression:
        found = self.lookup(node)
        if isinstance(found, bool | int | float):
            self.constants[self.module.file, name] = found
            return self.constant(node, found)
        if isinstance(found, NamedTableObject):
            return self.named_table(node, found, name)
        if found is MISSING:
            known = [*self.variables, *self.names, *VOCABULARY]
            return self.error(node, f"unknown name `{name}`", hint=self.suggestion(name, known))
        if isinstance(found, Declaration | Builtin | TypeName | RecordType | TableType) or callable(found):
            return self.error(node, f"`{name}` is not a value: it can only be called")
        return self.error(
            node,
            f"`{name}` is a Python {type(found).__name__}, which a module cannot use",
            expected="a number or bool, a table, a module, a record or a type",
        )

    def named_table(self, node: ast.expr, table: NamedTableObject, name: str) -> Expression:
        try:
            kind = table.type
        except SourceError as error:
            self.diagnostics += error.diagnostics
            return POISON
        name = table.named(name.rpartition(".")[2])
        other = self.tables.setdefault(name, table)
        if other is not table:
            self.error(node, f"two tables are called `{name}`")
        return NamedTable(name, kind, span=self.span(node))

    def member(self, node: ast.Attribute) -> Place | Expression:
        """A field of a record, a component or a swizzle of a vector."""
        base = self.resolve(node.value)
        kind = base.type
        if kind == UNKNOWN:
            return POISON
        found = kind.member(node.attr) if isinstance(kind, Record | Vector) else None
        if found is not None:
            if isinstance(base, Place):
                return base.member(node.attr, self.span(node))
            return Member(base, node.attr, found, span=self.span(node))
        if isinstance(kind, Vector) and is_swizzle(node.attr, kind):
            return self.swizzle(node, base)
        return self.no_member(node, kind)

    def swizzle(self, node: ast.Attribute, base: Place | Expression) -> Expression:
        vector = base.read() if isinstance(base, Place) else base
        vector = vector if is_cheap(vector) else self.bind(vector)
        span = self.span(node)
        components = tuple(Member(vector, name, F32, span=span) for name in node.attr)
        return Construct(components, Vector(len(components)), span=span)

    def no_member(self, node: ast.Attribute, kind: Type) -> Expression:
        name = node.attr
        if isinstance(kind, Record):
            fields = [field for field, _ in kind.fields]
            hint = self.suggestion(name, fields)
            return self.error(node, f"record {kind} has no field `{name}`", expected=", ".join(fields), hint=hint)
        if isinstance(kind, Vector):
            components = "xyzw"[: kind.size]
            hint = "a swizzle has three or four components" if set(name) <= set(components) else None
            return self.error(node, f"{kind} has no component `{name}`", expected=", ".join(components), hint=hint)
        if isinstance(kind, Table | Array):
            return self.error(node, f"`.{name}` needs one element of {kind}", hint=f"index it first: [i].{name}")
        hint = "m.column(i)" if kind == MAT4 else None
        return self.error(node, f"{describe(kind)} has no member `{name}`", hint=hint)

    def element(self, node: ast.Subscript) -> Place | Expression:
        """A record of a table, an element of a local array, an item of a tuple."""
        base = self.resolve(node.value)
        kind, span = base.type, self.span(node)
        if isinstance(kind, Tuple):
            return self.item(node, base, kind)
        if isinstance(node.slice, ast.Slice | ast.Tuple):
            return self.not_in_language(node.slice, EXPRESSION_NAMES[ast.Slice])
        index = self.value(node.slice, I32, "an index")
        if UNKNOWN in (kind, index.type):
            return POISON
        if isinstance(kind, Table) and isinstance(base, Local | NamedTable):
            return RowPlace(kind.record, kind.record, (), span, base, index)
        if isinstance(kind, Array) and isinstance(base, VariablePlace):
            return ElementPlace(kind.item, kind.item, (), span, base.name, index)
        hint = {Vector: "components are .x, .y, ...", Matrix: "columns are m.column(i)"}.get(type(kind))
        expected = "a table, a local array or a tuple"
        return self.error(node, f"{describe(kind)} has no elements", expected=expected, hint=hint)

    def item(self, node: ast.Subscript, base: Place | Expression, kind: Tuple) -> Expression:
        index = self.raw(node.slice)
        if not isinstance(index, Literal) or not 0 <= index.value < len(kind.items):
            expected = f"0 to {len(kind.items) - 1}"
            return self.error(node.slice, "an item of a tuple is chosen by a number", expected=expected)
        value = base.read() if isinstance(base, Place) else base
        return Member(value, str(index.value), kind.items[int(index.value)], span=self.span(node))

    # --- operators ----------------------------------------------------------------------------------------------------

    def unary(self, node: ast.UnaryOp) -> Expression:
        if isinstance(node.op, ast.Not):
            test = self.condition(node.operand, "`not`")
            return self.operate(node, "not", "bit_not", (test,))
        if isinstance(node.op, ast.USub) and isinstance(node.operand, ast.Constant) and type(node.operand.value) is int:
            return self.constant(node, -node.operand.value)  # so that -2147483648 can be written
        value = self.raw(node.operand)
        if isinstance(node.op, ast.USub):
            return self.operate(node, "-", "negate", (value,))
        if isinstance(node.op, ast.Invert):
            if value.type == BOOL:
                return self.error(node, "`~` does not take these operands", expected="i32", found="bool", hint="`not`")
            return self.operate(node, "~", "bit_not", (value,))
        return value if self.operate(node, "+", "negate", (value,)) is not POISON else POISON

    def binary(self, node: ast.BinOp) -> Expression:
        symbol, name = BINARY[type(node.op)]
        left, right = self.operands([node.left, node.right])
        if isinstance(node.op, ast.Pow):
            return self.power(node)
        if isinstance(node.op, ast.MatMult):
            return self.matrix_product(node, left, right)
        return self.operate(node, symbol, name, (left, right))

    def comparison(self, node: ast.Compare) -> Expression:
        if len(node.ops) == 1:
            left, right = self.operands([node.left, node.comparators[0]])
            return self.compare(node, node.ops[0], left, right)
        return self.chain(node)

    def chain(self, node: ast.Compare) -> Expression:
        """`a < b < c`: the middle is evaluated once, the end only if it matters."""
        left = self.raw(node.left)

        def test(operator: ast.cmpop, right_node: ast.expr) -> Expression:
            nonlocal left
            start = len(self.block)
            right = self.raw(right_node)
            left = self.protect(left, start)
            if right_node is not node.comparators[-1] and not is_cheap(right):
                right = self.bind(right)
            compared = self.compare(node, operator, left, right)
            left = right
            return compared

        links = zip(node.ops, node.comparators, strict=True)
        return self.lazily(node, [partial(test, operator, right) for operator, right in links], "bit_and")

    def compare(self, node: ast.Compare, operator: ast.cmpop, left: Expression, right: Expression) -> Expression:
        if type(operator) not in COMPARISON:
            word = {ast.In: "in", ast.NotIn: "not in", ast.Is: "is", ast.IsNot: "is not"}[type(operator)]
            return self.not_in_language(node, f"`{word}`")
        symbol, name = COMPARISON[type(operator)]
        return self.operate(node, symbol, name, (left, right))

    # --- laziness -----------------------------------------------------------------------------------------------------

    def logic(self, node: ast.BoolOp) -> Expression:
        symbol = "and" if isinstance(node.op, ast.And) else "or"
        tests = [partial(self.condition, value, f"`{symbol}`") for value in node.values]
        return self.lazily(node, tests, "bit_and" if symbol == "and" else "bit_or")

    def lazily(self, node: ast.expr, tests: Sequence[Callable[[], Expression]], operation: str) -> Expression:
        """`and` or `or` of `tests`, each evaluated only if the ones before leave the answer open.

        Where evaluating one too many cannot be noticed it is an ordinary operation; else an `If` around the rest.
        """
        result = tests[0]()
        conditional: set[str] = set()  # temporaries that have a value only if their test was reached
        for test in tests[1:]:
            known = set(self.temporaries)
            with self.nested_block() as block:
                value = test()
            if UNKNOWN in (result.type, value.type):
                result = POISON
            elif not block and eager_safe(value) and not variables_read(value) & conditional:
                result = self.operate(node, "and", operation, (result, value))
            else:
                conditional |= set(self.temporaries) - known
                result = self._decide(node, result, operation, block, value)
        return result

    def _decide(
        self, node: ast.expr, first: Expression, operation: str, block: Sequence[Statement], second: Expression
    ) -> Expression:
        span = self.span(node)
        if not (isinstance(first, Local) and first.name in self.temporaries):
            name = self.temporary(BOOL)
            self.emit(Assign(name, first, span=span))
            first = Local(name, BOOL, span=span)
        open_still = first if operation == "bit_and" else Operate("bit_not", (first,), BOOL, span=span)
        self.emit(If(open_still, (*block, Assign(first.name, second, span=span)), span=span))
        return first

    def conditional(self, node: ast.IfExp, wanted: Type | None) -> Expression:
        """`a if test else b`: a `select` where evaluating both cannot be noticed, else an `If`."""
        test = self.condition(node.test, "`if`")
        with self.nested_block() as then_block:
            then = self.raw(node.body, wanted)
        with self.nested_block() as else_block:
            orelse = self.raw(node.orelse, wanted)
        if F32 in (then.type, orelse.type, wanted):
            then, orelse = self.as_f32(then), self.as_f32(orelse)
        then, orelse = self.settle(then), self.settle(orelse)
        if UNKNOWN in (test.type, then.type, orelse.type):
            return POISON
        if then.type != orelse.type:
            found = f"{describe(then.type)} and {describe(orelse.type)}"
            return self.error(node, "both values of `if ... else` must have one type", found=found)
        if isinstance(then.type, Table):
            return self.error(node, "a table cannot be chosen while the program runs", hint="choose between records")
        span = self.span(node)
        if not then_block and not else_block and eager_safe(then) and eager_safe(orelse):
            return Operate("select", (test, then, orelse), then.type, span=span)
        name = self.temporary(then.type)
        then_block.append(Assign(name, then, span=span))
        else_block.append(Assign(name, orelse, span=span))
        self.emit(If(test, tuple(then_block), tuple(else_block), span=span))
        return Local(name, then.type, span=span)


def is_swizzle(name: str, kind: Vector) -> bool:
    return len(name) in (3, 4) and set(name) <= set("xyzw"[: kind.size])
