"""The ONE table of operations: the paper's basic operation macros and the scalar operations under them.

Three sorts:

- *primitive*: on scalars. `reference` is its meaning on NumPy arrays, in float32 or (as an oracle) float64. A primitive
  is applied element by element to vectors and matrices; a scalar operand then goes with every element. Every machine
  lowers every primitive, looked up by name.
- *composite*: stated as a fixed order of primitives (`expansion`). A machine that lowers the expansion needs no code of
  its own; one with a macro for it (the PU) must keep the stated order, or state its own error.
- *lanes*: sees the active lanes.

Rules that the references obey are written at the head of `tasuki/ir/__init__.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from tasuki.ir import expansions
from tasuki.ir.types import BOOL, F32, I32, MAT4, VEC3, VEC4, Array, Matrix, Scalar, Table, Type, Vector

Sort = Literal["primitive", "composite", "lanes"]
Reference = Callable[..., np.ndarray]


@dataclass(frozen=True)
class Operation:
    """One row of the table. `signatures` lists (parameter types, result type) on scalars, or whole for composites."""

    name: str
    sort: Sort
    signatures: tuple[tuple[tuple[Type, ...], Type], ...]
    doc: str
    reference: Reference | None = None
    expansion: Callable[..., Any] | None = None
    oracle: Callable[[np.ndarray], np.ndarray] | None = None
    """In float64: the exact function, where the reference or expansion is made for float32."""

    def result(self, types: Sequence[Type]) -> Type | None:
        """The type of the result for arguments of these types, or None where the operation does not take them."""
        for parameters, result in self.signatures:
            if tuple(types) == parameters:
                return result
        if self.name == "select" and _chooses_whole_values(types):
            return types[1]
        if self.sort == "primitive":
            return self._elementwise(types)
        return None

    def _elementwise(self, types: Sequence[Type]) -> Type | None:
        shapes = {t for t in types if isinstance(t, Vector | Matrix)}
        if len(shapes) != 1 or any(not isinstance(t, Scalar | Vector | Matrix) for t in types):
            return None
        scalar = self.result([F32 if isinstance(t, Vector | Matrix) else t for t in types])
        return shapes.pop() if scalar == F32 else None


def _chooses_whole_values(types: Sequence[Type]) -> bool:
    """`select` takes any two equal types that have leaves; machines choose leaf by leaf."""
    return len(types) == 3 and types[0] == BOOL and types[1] == types[2] and not isinstance(types[1], Array | Table)


def _floor_div(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    quotient = np.floor_divide(a, np.where(b == 0, 1, b))
    return np.where(b == 0, 0, quotient).astype(np.int32)


def _floor_mod(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.where(b == 0, 0, np.mod(a, np.where(b == 0, 1, b))).astype(np.int32)


def _minimum(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.where(a < b, a, b)


def _maximum(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.where(a > b, a, b)


def _truncate(a: np.ndarray) -> np.ndarray:
    wide = np.nan_to_num(a.astype(np.float64), nan=0.0, posinf=2.0**31, neginf=-(2.0**31))
    return np.clip(np.trunc(wide), -(2.0**31), 2.0**31 - 1).astype(np.int64).astype(np.int32)


def _fma(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """a*b+c rounded once. In float32: the product is exact in float64, the sum is rounded to odd before narrowing."""
    if a.dtype != np.float32:
        return a * b + c
    product = a.astype(np.float64) * b.astype(np.float64)
    addend = c.astype(np.float64)
    total = product + addend
    back = total - product
    error = (product - (total - back)) + (addend - back)
    bits = total.view(np.int64)
    inexact = (error != 0) & np.isfinite(total) & (bits & 1 == 0)
    away = (error > 0) == (total > 0)
    odd = np.where(inexact, np.where(away, bits + 1, bits - 1), bits)
    # A sum that is zero in float64 is exact: there is nothing to make odd.
    return np.where(total == 0, total, odd.view(np.float64)).astype(np.float32)


def _bits_to_float(a: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(a, np.int32).view(np.float32)


def _float_to_bits(a: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(a.astype(np.float32)).view(np.int32)


def _to_f32(a: np.ndarray) -> np.ndarray:
    return a.astype(np.float32)


def _to_f64(a: np.ndarray) -> np.ndarray:
    return a.astype(np.float64)


def _select(c: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.where(c, a, b)


_FF_F = (((F32, F32), F32),)
_F_F = (((F32,), F32),)
_II_I = (((I32, I32), I32),)
_NUMBER2 = _FF_F + _II_I
_NUMBER1 = (((F32,), F32), ((I32,), I32))
_ORDER = (((F32, F32), BOOL), ((I32, I32), BOOL))
_EQUAL = (*_ORDER, ((BOOL, BOOL), BOOL))
_LOGIC = (((BOOL, BOOL), BOOL), ((I32, I32), I32))


def _primitive(name: str, signatures: Any, reference: Reference, doc: str, oracle: Any = None) -> Operation:
    return Operation(name, "primitive", tuple(signatures), doc, reference=reference, oracle=oracle)


def _composite(name: str, signatures: Any, doc: str, oracle: Any = None) -> Operation:
    return Operation(name, "composite", tuple(signatures), doc, expansion=getattr(expansions, name), oracle=oracle)


def _lanes(name: str, result: Type | None, doc: str) -> Operation:
    types = (BOOL,) if result else (BOOL, I32, F32)
    return Operation(name, "lanes", tuple(((t,), result or t) for t in types), doc)


_TABLE = (
    _primitive("add", _NUMBER2, np.add, "a + b, rounded once; i32 wraps."),
    _primitive("subtract", _NUMBER2, np.subtract, "a - b, rounded once; i32 wraps."),
    _primitive("multiply", _NUMBER2, np.multiply, "a * b, rounded once; i32 wraps."),
    _primitive("divide", _FF_F, np.divide, "a / b, rounded once; x/0 is an infinity or NaN as in IEEE 754."),
    _primitive("negate", _NUMBER1, np.negative, "-a; changes the sign of zero."),
    _primitive("floor_divide", _II_I, _floor_div, "a // b towards minus infinity; x // 0 is 0."),
    _primitive("modulo", _II_I, _floor_mod, "a % b with the sign of b; x % 0 is 0."),
    _primitive("absolute", _NUMBER1, np.abs, "|a|; the least i32 stays itself."),
    _primitive("minimum", _NUMBER2, _minimum, "a if a < b else b."),
    _primitive("maximum", _NUMBER2, _maximum, "a if a > b else b."),
    _primitive("sqrt", _F_F, np.sqrt, "Square root, rounded once; NaN below zero."),
    _primitive("floor", _F_F, np.floor, "The greatest whole number not above a."),
    _primitive("fma", (((F32, F32, F32), F32),), _fma, "a * b + c, rounded once at the end."),
    _primitive("copysign", _FF_F, np.copysign, "|a| with the sign of b."),
    _primitive("less", _ORDER, np.less, "a < b; false with NaN."),
    _primitive("less_equal", _ORDER, np.less_equal, "a <= b; false with NaN."),
    _primitive("greater", _ORDER, np.greater, "a > b; false with NaN."),
    _primitive("greater_equal", _ORDER, np.greater_equal, "a >= b; false with NaN."),
    _primitive("equal", _EQUAL, np.equal, "a == b; false with NaN."),
    _primitive("not_equal", _EQUAL, np.not_equal, "a != b; true with NaN."),
    _primitive("bit_and", _LOGIC, np.bitwise_and, "Bits of both; on bool: and, both sides evaluated."),
    _primitive("bit_or", _LOGIC, np.bitwise_or, "Bits of either; on bool: or, both sides evaluated."),
    _primitive("bit_xor", _LOGIC, np.bitwise_xor, "Bits that differ."),
    _primitive("bit_not", (((BOOL,), BOOL), ((I32,), I32)), np.invert, "All bits turned; on bool: not."),
    _primitive("shift_left", _II_I, lambda a, b: np.left_shift(a, b & 31), "a << (b mod 32)."),
    _primitive("shift_right", _II_I, lambda a, b: np.right_shift(a, b & 31), "a >> (b mod 32), the sign copied in."),
    _primitive("to_f32", (((I32,), F32), ((BOOL,), F32)), _to_f32, "The nearest f32.", _to_f64),
    _primitive("to_i32", (((F32,), I32),), _truncate, "Towards zero, saturating; NaN gives 0."),
    _primitive("bool_to_i32", (((BOOL,), I32),), lambda a: a.astype(np.int32), "1 or 0."),
    _primitive("bits", (((F32,), I32),), _float_to_bits, "The bits of an f32."),
    _primitive("from_bits", (((I32,), F32),), _bits_to_float, "The f32 with these bits."),
    _primitive("select", tuple(((BOOL, t, t), t) for t in (F32, I32, BOOL)), _select, "b if a else c, both evaluated."),
    _composite("reciprocal", _F_F, "1 / a, rounded once."),
    _composite("dot", (((VEC3, VEC3), F32), ((VEC4, VEC4), F32)), "Inner product, summed from the left."),
    _composite("cross", (((VEC3, VEC3), VEC3),), "Outer product."),
    _composite("norm", (((VEC3,), F32), ((VEC4,), F32)), "sqrt(dot(a, a))."),
    _composite("normalize", (((VEC3,), VEC3), ((VEC4,), VEC4)), "a * reciprocal(norm(a)) (paper, Figure 5)."),
    _composite("transform", (((VEC4, MAT4), VEC4),), "Row vector times matrix: four inner products (v @ m)."),
    _composite("compose", (((MAT4, MAT4), MAT4),), "Matrix product: the rows of a, transformed by b (a @ b)."),
    _composite("transpose", (((MAT4,), MAT4),), "Rows and columns exchanged."),
    _composite("sin", _F_F, "Sine; within 1.2e-7 for |a| up to 8192 (Cody-Waite reduction in three terms).", np.sin),
    _composite("cos", _F_F, "Cosine; as `sin`.", np.cos),
    _lanes("any_lane", BOOL, "Whether a holds in any active lane."),
    _lanes("all_lanes", BOOL, "Whether a holds in every active lane."),
    _lanes("count_lanes", I32, "In how many active lanes a holds."),
    _lanes("same_lanes", None, "a, which the author asserts to be the same in all active lanes."),
)

OPERATIONS: dict[str, Operation] = {operation.name: operation for operation in _TABLE}
