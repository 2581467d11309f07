"""Checking of calls: conversions, constructors, built-in functions, atomics, and other modules."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Sequence
from typing import Any

from tasuki.diagnostics import SourceError
from tasuki.ir.nodes import Atomic, Call, Constant, Construct, Expression, Length, Local, Member, NamedTable, Operate
from tasuki.ir.ops import OPERATIONS
from tasuki.ir.types import BOOL, F32, I32, MAT4, VEC3, VEC4, VOID, Array, Table, Type, Vector
from tasuki.language.context import MISSING, POISON, UNKNOWN, Literal, describe
from tasuki.language.declare import Module, RecordType, Socket
from tasuki.language.effects import is_cheap
from tasuki.language.expressions import EXPRESSION_NAMES, Expressions
from tasuki.language.names import PYTHON_TWINS, VOCABULARY, ArrayName, AtomicName, Builtin, TypeName
from tasuki.language.places import Place, RowPlace

REPLACEMENTS: dict[Any, str] = {
    float: "f32(...) converts",
    int: "i32(...) converts",
    bool: "compare: x != 0",
    pow: "multiply: x * x",
    round: "floor(x + 0.5)",
    math.sqrt: "`sqrt` of tasuki.language",
    math.sin: "`sin` of tasuki.language",
    math.cos: "`cos` of tasuki.language",
    math.floor: "`floor` of tasuki.language",
    range: "only `for i in range(...)`",
}
"""What to write for functions of Python that the language does not have."""


class Calls(Expressions):
    """Checking of everything written `f(...)`."""

    def call(self, node: ast.Call) -> Expression:
        if isinstance(node.func, ast.Attribute) and node.func.attr == "column" and self.lookup(node.func) is MISSING:
            return self.column(node, node.func)
        target = self.lookup(node.func)
        target = next((ours for theirs, ours in PYTHON_TWINS.items() if target is theirs), target)
        match target:
            case AtomicName():
                return self.atomic(node, target)
            case ArrayName():
                expected = "name = array(type, length)"
                return self.error(node, "a local array begins its life by assignment", expected=expected)
            case Builtin():
                return self.builtin(node, target)
            case TypeName():
                return self.conversion(node, target)
            case RecordType():
                return self.record(node, target)
            case Module() | Socket():
                return self.module_call(node, target)
        if target is len:
            return self.length(node)
        return self.not_callable(node, target)

    def not_callable(self, node: ast.Call, target: Any) -> Expression:
        name = ast.unparse(node.func)
        hint = next((hint for function, hint in REPLACEMENTS.items() if target is function), None)
        if target is MISSING and not (isinstance(node.func, ast.Name) and node.func.id not in self.local_names):
            return self.error(node.func, f"`{name}` cannot be called")
        if hint:
            return self.error(node.func, f"`{name}` is not part of the language", hint=hint)
        if callable(target) and getattr(target, "__module__", None) != "builtins":
            hint = "decorate it with @module"
            return self.error(node.func, f"`{name}` is a Python function, not a module", hint=hint)
        if target is not MISSING and not callable(target):
            return self.error(node.func, f"`{name}` cannot be called")
        known = [*self.names, *VOCABULARY]
        return self.error(node.func, f"unknown name `{name}`", hint=self.suggestion(name, known))

    def positional(self, node: ast.Call, name: str, least: int, most: int | None = None) -> list[ast.expr] | None:
        """The arguments of a call by position alone, `least` to `most` of them; None after an error."""
        most = least if most is None else most
        for argument in node.args:
            if isinstance(argument, ast.Starred):
                self.not_in_language(argument, EXPRESSION_NAMES[ast.Starred])
                return None
        if node.keywords:
            self.error(node.keywords[0], f"`{name}` takes no arguments by name")
            return None
        if not least <= len(node.args) <= most:
            expected = f"{least}" if least == most else f"{least} or more" if most > 9 else f"{least} to {most}"
            noun = "argument" if expected == "1" else "arguments"
            self.error(node, f"`{name}` takes {expected} {noun}", found=f"{len(node.args)}")
            return None
        return node.args

    # --- built-in functions -------------------------------------------------------------------------------------------

    def builtin(self, node: ast.Call, function: Builtin) -> Expression:
        if function.operation == "select":
            return self.select(node)
        folds = function.operation in ("minimum", "maximum")
        arity = len(OPERATIONS[function.operation].signatures[0][0])
        arguments = self.positional(node, function.name, arity, 99 if folds else arity)
        if arguments is None:
            return POISON
        values = self.operands(arguments)
        result = self.operate(node, function.name, function.operation, values[:arity])
        for value in values[arity:]:
            result = self.operate(node, function.name, function.operation, (result, value))
        return result

    def select(self, node: ast.Call) -> Expression:
        """`select(test, a, b)`: both values are evaluated, whatever the test."""
        arguments = self.positional(node, "select", 3)
        if arguments is None:
            return POISON
        test, then, orelse = self.operands(arguments)
        if F32 in (then.type, orelse.type):
            then, orelse = self.as_f32(then), self.as_f32(orelse)
        test = self.fit(test, BOOL, arguments[0], "the test of `select`")
        orelse = self.fit(orelse, then.type, arguments[2], "the last argument of `select`")
        if UNKNOWN in (test.type, then.type, orelse.type):
            return POISON
        if isinstance(then.type, Table):
            return self.error(node, "a table cannot be chosen while the program runs", hint="choose between records")
        return Operate("select", (test, self.settle(then), orelse), then.type, span=self.span(node))

    def length(self, node: ast.Call) -> Expression:
        arguments = self.positional(node, "len", 1)
        if arguments is None:
            return POISON
        base = self.resolve(arguments[0])
        if isinstance(base.type, Array):
            return Constant(base.type.length, I32, span=self.span(node))
        if isinstance(base, Local | NamedTable) and isinstance(base.type, Table):
            return Length(base, I32, span=self.span(node))
        if base.type == UNKNOWN:
            return POISON
        expected, found = "a table or a local array", describe(base.type)
        return self.error(node, "`len` does not take this", expected=expected, found=found)

    def column(self, node: ast.Call, function: ast.Attribute) -> Expression:
        """`m.column(i)` with a literal i: a column of a matrix."""
        matrix = self.value(function.value, MAT4, "what has columns")
        arguments = self.positional(node, "column", 1)
        if arguments is None:
            return POISON
        index = self.raw(arguments[0])
        if not isinstance(index, Literal) or not 0 <= index.value <= 3:
            return self.error(arguments[0], "a column is chosen by a number", expected="0, 1, 2 or 3")
        if matrix.type == UNKNOWN:
            return POISON
        return Member(matrix, str(index.value), VEC4, span=self.span(node))

    def atomic(self, node: ast.Call, function: AtomicName) -> Expression:
        arguments = self.positional(node, function.name, 2)
        if arguments is None:
            return POISON
        place: Place | Expression = self.resolve(arguments[0])
        start = len(self.block)
        value = self.value(arguments[1], I32, f"the second argument of `{function.name}`")
        if UNKNOWN in (place.type, value.type):
            return POISON
        if not isinstance(place, RowPlace) or place.type != I32 or not place.path:
            found = describe(place.type) + ("" if isinstance(place, RowPlace) else " that is not in a table")
            message = f"the first argument of `{function.name}` must be an i32 field in a table"
            return self.error(arguments[0], message, expected="table[i].field", found=found)
        name = self.temporary(I32)
        span = self.span(node)
        operation: Any = function.operation
        self.emit(Atomic(name, operation, place.table, self.protect(place.index, start), value, place.path, span=span))
        return Local(name, I32, span=span)

    # --- conversions and constructors ---------------------------------------------------------------------------------

    def conversion(self, node: ast.Call, target: TypeName) -> Expression:
        if isinstance(target.type, Vector):
            return self.vector(node, target.type)
        if target.type == MAT4:
            return self.construct(node, "mat4", [VEC4] * 4, MAT4)
        arguments = self.positional(node, target.name, 1)
        if arguments is None:
            return POISON
        value = self.raw(arguments[0])
        if target.type == F32:
            value = self.as_f32(value)
        if value.type in (target.type, UNKNOWN):
            return self.settle(value)
        if target.type == I32 and value.type == BOOL:
            return self.operate(node, "i32", "bool_to_i32", (value,))
        return self.operate(node, target.name, f"to_{target.name}", (value,))

    def vector(self, node: ast.Call, target: Vector) -> Expression:
        """`vec3(x, y, z)`, `vec3(s)`, and `vec4(v, w)` with a vec3 v."""
        arguments = self.positional(node, str(target), 1, target.size)
        if arguments is None:
            return POISON
        values = [self.as_f32(value) for value in self.operands(arguments)]
        types = [value.type for value in values]
        span = self.span(node)
        if UNKNOWN in types:
            return POISON
        if types in ([F32], [F32] * target.size):
            return Construct(tuple(values), target, span=span)
        if target == VEC4 and types == [VEC3, F32]:
            base = values[0] if is_cheap(values[0]) else self.bind(values[0])
            return Construct((*(Member(base, name, F32, span=span) for name in "xyz"), values[1]), VEC4, span=span)
        also = ", or a vec3 and an f32" if target == VEC4 else ""
        expected = f"{target.size} f32, or one for all components{also}"
        hint = "nothing is converted unasked: f32(...)" if I32 in types else None
        found = ", ".join(map(describe, types))
        return self.error(node, f"`{target}` cannot be made of this", expected=expected, found=found, hint=hint)

    def construct(self, node: ast.Call, name: str, types: Sequence[Type], target: Type) -> Expression:
        arguments = self.positional(node, name, len(types))
        if arguments is None:
            return POISON
        values = self.operands(arguments, types)
        fitted = tuple(map(self.fit, values, types, arguments, [f"an argument of `{name}`"] * len(types)))
        return Construct(fitted, target, span=self.span(node))

    def record(self, node: ast.Call, cls: RecordType) -> Expression:
        """A record from all of its fields, by position or by name."""
        try:
            target = cls.ir
        except SourceError as error:
            self.diagnostics += error.diagnostics
            return POISON
        names = [name for name, _ in target.fields]
        given = self.arguments(node, f"record `{target}`", names, "field")
        if given is None:
            return POISON
        values = self.in_source_order(given, dict(target.fields), lambda name: f"field `{name}` of {target}")
        return Construct(tuple(values[name] for name in names), target, span=self.span(node))

    # --- modules and sockets ------------------------------------------------------------------------------------------

    def module_call(self, node: ast.Call, target: Module | Socket) -> Expression:
        try:
            signature = target.signature
        except SourceError as error:
            self.diagnostics += error.diagnostics
            return POISON
        given = self.arguments(node, f"`{target.name}`", target.parameters, "parameter")
        if given is None:
            return POISON
        types = dict(zip(target.parameters, signature.parameters, strict=True))
        values = self.in_source_order(given, types, lambda name: f"argument `{name}` of `{target.name}`")
        key = self.callee(target)
        span = self.span(node)
        arguments = tuple(values[name] for name in target.parameters)
        if signature.result == VOID:
            self.emit(Call(None, key, arguments, span=span))
            return Construct((), VOID, span=span)
        name = self.temporary(signature.result)
        self.emit(Call(name, key, arguments, span=span))
        return Local(name, signature.result, span=span)

    def callee(self, target: Module | Socket) -> str:
        """The key of `target` among the calls: its qualified name, told apart where two declarations share it."""
        key, count = target.qualified_name, 1
        while self.calls.setdefault(key, target) is not target:
            count += 1
            key = f"{target.qualified_name}#{count}"
        return key

    def arguments(self, node: ast.Call, what: str, names: Sequence[str], sort: str) -> dict[str, ast.expr] | None:
        """The argument for each of `names`, in source order; None after an error. `what` is called."""
        problems = len(self.diagnostics)
        given: dict[str, ast.expr] = {}
        if len(node.args) > len(names):
            noun = sort if len(names) == 1 else f"{sort}s"
            self.error(node.args[len(names)], f"{what} takes {len(names)} {noun}", found=str(len(node.args)))
        for name, argument in zip(names, node.args, strict=False):
            if isinstance(argument, ast.Starred):
                self.not_in_language(argument, EXPRESSION_NAMES[ast.Starred])
            given[name] = argument
        for keyword in node.keywords:
            if keyword.arg is None:
                self.not_in_language(keyword, "`**`")
            elif keyword.arg not in names:
                hint = self.suggestion(keyword.arg, names)
                self.error(keyword, f"{what} has no {sort} `{keyword.arg}`", expected=", ".join(names), hint=hint)
            elif keyword.arg in given:
                self.error(keyword, f"{sort} `{keyword.arg}` of {what} is given twice")
            else:
                given[keyword.arg] = keyword.value
        missing = [name for name in names if name not in given]
        if missing and len(self.diagnostics) == problems:
            listed = ", ".join(f"`{name}`" for name in missing)
            self.error(node, f"{what} needs {sort} {listed}", expected=", ".join(names))
        return given if len(self.diagnostics) == problems else None

    def in_source_order(
        self, given: dict[str, ast.expr], types: dict[str, Type], what: Callable[[str], str]
    ) -> dict[str, Expression]:
        """The values of named arguments, evaluated as they stand in the source and fitted to their `types`."""
        values = self.operands(list(given.values()), [types[name] for name in given])
        return {
            name: self.fit(value, types[name], argument, what(name))
            for (name, argument), value in zip(given.items(), values, strict=True)
        }
