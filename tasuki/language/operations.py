"""Operations of the table `tasuki.ir.ops`, applied: which types they take, and what constants come to."""

from __future__ import annotations

import ast
from collections.abc import Sequence

import numpy as np

from tasuki.diagnostics import Span
from tasuki.ir.nodes import Constant, Expression, Operate
from tasuki.ir.ops import OPERATIONS, Operation
from tasuki.ir.types import BOOL, F32, I32, MAT4, VEC4, Matrix, Scalar, Type, Vector
from tasuki.language.context import POISON, UNKNOWN, Context, Literal, describe

_DTYPES = {"f32": np.float32, "i32": np.int32, "bool": np.bool_}

BINARY: dict[type[ast.operator], tuple[str, str]] = {
    ast.Add: ("+", "add"),
    ast.Sub: ("-", "subtract"),
    ast.Mult: ("*", "multiply"),
    ast.Div: ("/", "divide"),
    ast.FloorDiv: ("//", "floor_divide"),
    ast.Mod: ("%", "modulo"),
    ast.BitAnd: ("&", "bit_and"),
    ast.BitOr: ("|", "bit_or"),
    ast.BitXor: ("^", "bit_xor"),
    ast.LShift: ("<<", "shift_left"),
    ast.RShift: (">>", "shift_right"),
    ast.MatMult: ("@", "transform"),
    ast.Pow: ("**", ""),
}
COMPARISON: dict[type[ast.cmpop], tuple[str, str]] = {
    ast.Lt: ("<", "less"),
    ast.LtE: ("<=", "less_equal"),
    ast.Gt: (">", "greater"),
    ast.GtE: (">=", "greater_equal"),
    ast.Eq: ("==", "equal"),
    ast.NotEq: ("!=", "not_equal"),
}


class Operations(Context):
    """Checking of operators and built-in functions, given their operands."""

    def operate(self, node: ast.AST, symbol: str, name: str, arguments: Sequence[Expression]) -> Expression:
        """Operation `name`, written `symbol`, on `arguments`: its types found, literals fitted, constants folded."""
        if any(argument.type == UNKNOWN for argument in arguments):
            return POISON
        operation = OPERATIONS[name]
        result = operation.result([argument.type for argument in arguments])
        if result is None and (symbol != "/" or not all(isinstance(a, Literal) for a in arguments)):
            as_f32 = [self.as_f32(argument) for argument in arguments]
            result = operation.result([argument.type for argument in as_f32])
            arguments = as_f32 if result else arguments
        if result is None:
            return self._refuse(node, symbol, operation, arguments)
        folded = fold(operation, arguments, result, self.span(node))
        return folded or Operate(name, tuple(map(self.settle, arguments)), result, span=self.span(node))

    def power(self, node: ast.BinOp) -> Expression:
        return self.not_in_language(node, "`**`", "multiply: x * x")

    def matrix_product(self, node: ast.AST, left: Expression, right: Expression) -> Expression:
        """`v @ m` transforms a row vector, `a @ b` composes."""
        name = "compose" if left.type == MAT4 else "transform"
        return self.operate(node, "@", name, (left, right))

    def _refuse(self, node: ast.AST, symbol: str, operation: Operation, arguments: Sequence[Expression]) -> Expression:
        types = [argument.type for argument in arguments]
        operands = "arguments" if symbol.isidentifier() else "operands"
        return self.error(
            node,
            f"`{symbol}` does not take these {operands}",
            expected=_expected(operation),
            found=", ".join(map(describe, types)),
            hint=_hint(symbol, types),
        )


def _expected(operation: Operation) -> str:
    if operation.name in ("transform", "compose"):
        return "(vec4, mat4) or (mat4, mat4)"
    every = [", ".join(map(str, parameters)) for parameters, _ in operation.signatures]
    takes = " or ".join(f"({parameters})" if "," in parameters else parameters for parameters in every)
    vectors = [VEC4] * len(operation.signatures[0][0])
    elementwise = operation.sort == "primitive" and operation.result(vectors) is not None
    return f"{takes}, or vectors and matrices elementwise" if elementwise else takes


def _hint(symbol: str, types: Sequence[Type]) -> str | None:
    numbers = {t for t in types if isinstance(t, Scalar)}
    shaped = any(isinstance(t, Vector | Matrix) for t in types)
    if symbol == "/" and numbers == {I32} and not shaped:
        return "`//` divides whole numbers, rounding down; f32(...) converts"
    if I32 in numbers and (F32 in numbers or shaped):
        return "nothing is converted unasked: f32(...) or i32(...)"
    if symbol == "@" and list(types) == [MAT4, VEC4]:
        return "vectors are rows here: v @ m"
    if symbol == "not" or (BOOL in numbers and symbol in ("and", "or")):
        return "compare: x != 0"
    if symbol in ("==", "!=") and shaped:
        return "compare the components"
    return None


def fold(operation: Operation, arguments: Sequence[Expression], result: Type, span: Span) -> Constant | None:
    """What `operation` comes to on constants, by its own reference, in float32 and i32; None where they are not."""
    constants = [argument for argument in arguments if isinstance(argument, Constant)]
    if len(constants) < len(arguments) or operation.reference is None or not isinstance(result, Scalar):
        return None
    arrays: list[np.ndarray] = [np.array([constant.value], _DTYPES[str(constant.type)]) for constant in constants]
    with np.errstate(all="ignore"):
        value = operation.reference(*arrays).astype(_DTYPES[result.name])[0].item()
    literal = result == I32 and all(isinstance(constant, Literal) for constant in constants)
    return Literal(value, I32, span=span) if literal else Constant(value, result, span=span)
