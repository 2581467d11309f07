"""A module's own Python source, changed just so far that CPython gives it the meaning of the language.

What is left alone keeps its line, so that breakpoints and tracebacks are those of the user's file. What is changed:

- numbers: a float literal becomes an F32; arithmetic on integer literals alone is folded as i32; an integer literal
  that becomes a variable's value takes the variable's type. Global constants stand for literals.
- assignment to a member: values never change, so `hit.t = v` becomes `hit = _tasuki.updated(hit, ("t",), v)`, and
  `stack[i].x = v` becomes `_tasuki.place(stack, i, ("x",)).value = v`.
- names: Python's `min`, `max`, `abs`, `len`, `range` and the language's `array` and `atomic_*` become methods of the
  *runtime*, the object that the name `_tasuki` is bound to (`tasuki.language.plain.Runtime`).
"""

from __future__ import annotations

import ast
import builtins
import copy
from collections.abc import Iterator, Sequence
from dataclasses import fields
from types import CellType, CodeType, FunctionType, ModuleType
from typing import Any

from tasuki.ir.nodes import Function, Local, Node, Operate
from tasuki.ir.types import F32, I32, VOID, Array, Tuple, Type
from tasuki.language.declare import Module
from tasuki.language.names import PYTHON_TWINS, AtomicName, Builtin
from tasuki.language.values import evaluate

RUNTIME = "_tasuki"
"""The name of the runtime inside a rewritten function; with underscores before it where the function uses that name."""

_MISSING = object()

_BINARY: dict[type[ast.operator], str] = {
    ast.Add: "add",
    ast.Sub: "subtract",
    ast.Mult: "multiply",
    ast.FloorDiv: "floor_divide",
    ast.Mod: "modulo",
    ast.BitAnd: "bit_and",
    ast.BitOr: "bit_or",
    ast.BitXor: "bit_xor",
    ast.LShift: "shift_left",
    ast.RShift: "shift_right",
}
_UNARY: dict[type[ast.unaryop], str] = {ast.USub: "negate", ast.Invert: "bit_not"}


def plain_function(module: Module, checked: Function, runtime: Any) -> FunctionType:
    """The function of `module`, rewritten and compiled as if it stood in its own file.

    `checked` is what checking made of the module. The new function shares the globals and the closure of the original;
    `runtime` is bound to the name `RUNTIME`.
    """
    original = module.function
    name = RUNTIME
    while name in (*original.__code__.co_names, *original.__code__.co_varnames, *original.__code__.co_freevars):
        name = "_" + name
    _, definition = module.parsed
    rewritten = Rewriter(module, checked, name).function(copy.deepcopy(definition))
    code = _compile(rewritten, (*original.__code__.co_freevars, name), module.file)
    cells = dict(zip(original.__code__.co_freevars, original.__closure__ or (), strict=True))
    cells[name] = CellType(runtime)
    closure = tuple(cells[free] for free in code.co_freevars)
    function = FunctionType(code, original.__globals__, original.__name__, None, closure)
    function.__qualname__ = original.__qualname__
    function.__module__ = original.__module__
    return function


def _compile(definition: ast.FunctionDef, free_names: Sequence[str], file: str) -> CodeType:
    """The code of `definition`, in which `free_names` are free. Only an enclosing function can make a name free."""
    enclosing = ast.FunctionDef(
        name="_",
        args=ast.arguments([], [ast.arg(name) for name in free_names], None, [], [], None, []),
        body=[definition],
        decorator_list=[],
    )
    tree = ast.Module([ast.fix_missing_locations(ast.copy_location(enclosing, definition))], [])
    [outer] = _codes_in(compile(tree, file, "exec", dont_inherit=True))
    [inner] = _codes_in(outer)
    return inner.replace(co_qualname=definition.name)


def _codes_in(code: CodeType) -> list[CodeType]:
    return [constant for constant in code.co_consts if isinstance(constant, CodeType)]


class Rewriter(ast.NodeTransformer):
    """Rewrites one function. The module has been checked: what is not in the language does not occur."""

    def __init__(self, module: Module, checked: Function, runtime: str) -> None:
        self.source, _ = module.parsed
        self.names = module.names
        self.variables = {parameter.name: parameter.type for parameter in checked.parameters} | dict(checked.variables)
        # Whether the literals in a conditional expression are f32 may depend on its other arm: only checking knows.
        self.conditionals = {node.span: node.type for node in _nodes(checked.body) if isinstance(node, Operate | Local)}
        self.local_names = {*module.function.__code__.co_varnames, *module.function.__code__.co_cellvars}
        self.runtime = runtime
        self.temporaries = 0

    def function(self, definition: ast.FunctionDef) -> ast.FunctionDef:
        definition.decorator_list = []
        definition.returns = None
        for argument in (*definition.args.posonlyargs, *definition.args.args):
            argument.annotation = None
        definition.body = [new for statement in definition.body for new in self._statement(statement)]
        return ast.fix_missing_locations(definition)

    def _statement(self, statement: ast.stmt) -> list[ast.stmt]:
        result = self.visit(statement)
        return result if isinstance(result, list) else [result]

    # --- numbers -----------------------------------------------------------------------------------------------------

    def visit_Constant(self, node: ast.Constant) -> ast.expr:
        return self._number(node, node.value)

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return self._number(node, self._lookup(node))

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        found = self._lookup(node)
        if found is not _MISSING:
            return self._number(node, found)
        node.value = self.visit(node.value)
        return node

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        node.left, node.right = self.visit(node.left), self.visit(node.right)
        if type(node.op) in _BINARY:
            return self._folded(node, _BINARY[type(node.op)], [node.left, node.right])
        return node

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.expr:
        node.operand = self.visit(node.operand)
        if isinstance(node.op, ast.USub) and isinstance(node.operand, ast.Constant) and node.operand.value == 2**31:
            return ast.copy_location(ast.Constant(-(2**31)), node)  # the least i32, which has no positive
        if type(node.op) in _UNARY:
            return self._folded(node, _UNARY[type(node.op)], [node.operand])
        return node

    def visit_IfExp(self, node: ast.IfExp) -> ast.expr:
        type_ = self.conditionals.get(self.source.span(node))
        node.test = self.visit(node.test)
        node.body, node.orelse = (self._fitted(self.visit(arm), type_) for arm in (node.body, node.orelse))
        return node

    def _number(self, node: ast.expr, value: Any) -> ast.expr:
        """`node`, whose value is `value`: an F32 for a float, an integer literal for an int, else as it stands."""
        if isinstance(value, float):
            return self._runtime_call(node, "f32", ast.Constant(float(value)))
        if isinstance(value, int) and not isinstance(value, bool):
            return ast.copy_location(ast.Constant(int(value)), node)
        return node

    def _folded(self, node: ast.expr, operation: str, operands: Sequence[ast.expr]) -> ast.expr:
        """`node`, or, where all operands are integer literals, the literal that the operation makes of them."""
        if not all(map(_is_integer, operands)):
            return node
        result = evaluate(operation, *(operand.value for operand in operands))  # type: ignore[attr-defined]
        if isinstance(result, float):
            return self._runtime_call(node, "f32", ast.Constant(float(result)))
        return ast.copy_location(ast.Constant(result if isinstance(result, bool) else int(result)), node)

    def _fitted(self, value: ast.expr, type_: Type | None) -> ast.expr:
        """`value`, about to become a `type_`: its literals take the types of what they become."""
        if isinstance(value, ast.Tuple) and isinstance(type_, Tuple):
            value.elts = [self._fitted(item, t) for item, t in zip(value.elts, type_.items, strict=True)]
        elif _is_integer(value) and type_ in (F32, I32):
            return self._runtime_call(value, str(type_), value)
        return value

    # --- calls -------------------------------------------------------------------------------------------------------

    def visit_Call(self, node: ast.Call) -> ast.expr:
        called = self._lookup(node.func)
        called = PYTHON_TWINS.get(called, called) if callable(called) else called
        if isinstance(called, AtomicName):
            return self._atomic(node, called)
        node.args = [self.visit(argument) for argument in node.args]
        for keyword in node.keywords:
            keyword.value = self.visit(keyword.value)
        if called in (builtins.len, builtins.range):
            return self._runtime_call(node, called.__name__, *node.args)
        if isinstance(called, Builtin):
            if all(map(_is_integer, node.args)):
                return self._folded(node, called.operation, node.args)
            if called in PYTHON_TWINS.values():
                return self._runtime_call(node, "operate", ast.Constant(called.operation), *node.args)
            return node
        node.func = self.visit(node.func)
        return node

    def _atomic(self, node: ast.Call, called: AtomicName) -> ast.expr:
        place, value = node.args
        return self._runtime_call(node, "atomic", ast.Constant(called.operation), self._place(place), self.visit(value))

    # --- assignment --------------------------------------------------------------------------------------------------

    def visit_Assign(self, node: ast.Assign) -> list[ast.stmt]:
        value = self.visit(node.value)
        if len(node.targets) == 1:
            return self._assign(node, node.targets[0], value)
        # A literal takes the type of each target; anything else is evaluated once.
        statements: list[ast.stmt] = []
        if not _is_integer(value):
            name = self._temporary()
            statements.append(_assignment(node, ast.Name(name, ast.Store()), value))
            value = ast.Name(name, ast.Load())
        for target in node.targets:
            statements += self._assign(node, target, copy.deepcopy(value))
        return statements

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.stmt | list[ast.stmt]:
        if node.value is None:
            return node
        return self._assign(node, node.target, self.visit(node.value))

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.stmt:
        node.value = self.visit(node.value)
        if isinstance(node.target, ast.Name):
            return node
        if _is_member_of_variable(node.target):
            assert isinstance(node.target, ast.Attribute)
            before = copy.deepcopy(node.target)
            before.ctx = ast.Load()
            after = ast.copy_location(ast.BinOp(before, node.op, node.value), node)
            return self._update_variable(node, node.target, after)
        return ast.copy_location(ast.AugAssign(self._place_target(node.target), node.op, node.value), node)

    def _assign(self, node: ast.stmt, target: ast.expr, value: ast.expr) -> list[ast.stmt]:
        later: list[ast.stmt] = []
        if isinstance(target, ast.Name) and isinstance(self.variables.get(target.id), Array):
            value = self._runtime_call(value, "array", ast.Constant(target.id))
        elif _is_member_of_variable(target):
            return [self._update_variable(node, target, value)]
        value = self._fitted(value, self._target_type(target))
        return [_assignment(node, self._target(node, target, later), value), *later]

    def _target(self, node: ast.stmt, target: ast.expr, later: list[ast.stmt]) -> ast.expr:
        """What Python assigns to in place of `target`; a member of a variable gets its value `later`."""
        if isinstance(target, ast.Name):
            return target
        if isinstance(target, ast.Tuple | ast.List):
            target.elts = [self._target(node, item, later) for item in target.elts]
            return target
        if _is_member_of_variable(target):
            name = self._temporary()
            later.append(self._update_variable(node, target, ast.Name(name, ast.Load())))
            return ast.copy_location(ast.Name(name, ast.Store()), target)
        return self._place_target(target)

    def _target_type(self, target: ast.expr) -> Type | None:
        """The type that literals take for `target`; None where what is assigned to converts them itself."""
        if isinstance(target, ast.Tuple | ast.List):
            return Tuple(tuple(self._target_type(item) or VOID for item in target.elts))
        return self.variables.get(target.id) if isinstance(target, ast.Name) else None

    def _temporary(self) -> str:
        self.temporaries += 1
        return f"{self.runtime}_{self.temporaries}"

    def _update_variable(self, node: ast.stmt, target: ast.expr, value: ast.expr) -> ast.stmt:
        """`a.b.x = value` as `a = updated(a, ("b", "x"), value)`."""
        base, path = _split(target)
        assert isinstance(base, ast.Name)
        load = ast.copy_location(ast.Name(base.id, ast.Load()), base)
        updated = self._runtime_call(value, "updated", load, _path(path), value)
        return _assignment(node, ast.copy_location(ast.Name(base.id, ast.Store()), base), updated)

    def _place_target(self, target: ast.expr) -> ast.Attribute:
        return ast.copy_location(ast.Attribute(self._place(target), "value", ast.Store()), target)

    def _place(self, node: ast.expr) -> ast.expr:
        """`table[i].a.b` as a place that can be read, written, and changed atomically."""
        base, path = _split(node)
        assert isinstance(base, ast.Subscript)
        return self._runtime_call(node, "place", self.visit(base.value), self.visit(base.slice), _path(path))

    # --- small things ------------------------------------------------------------------------------------------------

    def _lookup(self, node: ast.expr) -> Any:
        """What a global name, or a name inside a Python module (`math.pi`), stands for; _MISSING for anything else."""
        if isinstance(node, ast.Name) and node.id not in self.local_names:
            return self.names.get(node.id, getattr(builtins, node.id, _MISSING))
        if isinstance(node, ast.Attribute):
            base = self._lookup(node.value)
            if isinstance(base, ModuleType):
                return getattr(base, node.attr, _MISSING)
        return _MISSING

    def _runtime_call(self, place: ast.expr, method: str, *arguments: ast.expr) -> ast.Call:
        function = ast.Attribute(ast.Name(self.runtime, ast.Load()), method, ast.Load())
        call = ast.copy_location(ast.Call(function, list(arguments), []), place)
        return ast.fix_missing_locations(call)


def _nodes(tree: Any) -> Iterator[Node]:
    """Every node of the IR under `tree`, a node or a tuple of nodes."""
    if isinstance(tree, tuple):
        for item in tree:
            yield from _nodes(item)
    elif isinstance(tree, Node):
        yield tree
        for field in fields(tree):
            yield from _nodes(getattr(tree, field.name))


def _assignment(node: ast.stmt, target: ast.expr, value: ast.expr) -> ast.stmt:
    return ast.fix_missing_locations(ast.copy_location(ast.Assign([target], value), node))


def _is_integer(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and type(node.value) is int


def _is_member_of_variable(node: ast.expr) -> bool:
    return isinstance(node, ast.Attribute) and isinstance(_split(node)[0], ast.Name)


def _split(node: ast.expr) -> tuple[ast.expr, list[str]]:
    """`base.a.b` as `base` and its path `["a", "b"]`."""
    path: list[str] = []
    while isinstance(node, ast.Attribute):
        path.insert(0, node.attr)
        node = node.value
    return node, path


def _path(names: Sequence[str]) -> ast.Tuple:
    return ast.Tuple([ast.Constant(name) for name in names], ast.Load())
