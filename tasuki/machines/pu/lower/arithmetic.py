"""The processor unit's arithmetic, for the interpreter: the same tables, the same operations, the same order.

Each function is a macro of the library, step by step, on arrays of float32. (`isa.tables.lookup` states the tables for
one word; here they are for arrays.) Sums, differences and products round once, as anywhere. There is no fused
multiply-add, and inner products of four terms are summed as (x + y) + (z + w), so that transforming by a matrix is too.
The errors stand in docs/table-1.md.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tasuki.ir import expansions
from tasuki.ir.arithmetic import Arithmetic
from tasuki.ir.expansions import Term, Vec
from tasuki.machines.pu.isa import tables

Floats = npt.NDArray[np.float32]
Words = npt.NDArray[np.uint32]
_ROUND = np.float32(12582912.0)
"""1.5 * 2**23: added and taken away again it rounds to a whole number, whose low bits it leaves in the sum."""
_TURNS = np.float32(162.97466172610083)
_STEPS = (np.float32(0.005859375), np.float32(0.000274658203125), np.float32(0.0000018899484177446))
"""2 pi / 1024 in three terms."""


# --- tables -----------------------------------------------------------------------------------------------------------


def _normalised(magnitude: Words) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """(exponents e, 23 fraction bits of m) of positive finite words 2**e * m, subnormal or not."""
    wide = magnitude.astype(np.int64)
    mantissa, exponent = np.frexp(magnitude.view(np.float32).astype(np.float64))
    subnormal = (mantissa * 2 ** (tables.FRACTION_BITS + 1)).astype(np.int64) & tables.FRACTION
    fraction = np.where(wide >> tables.FRACTION_BITS > 0, wide & tables.FRACTION, subnormal)
    return exponent.astype(np.int64) - 1, fraction


def _assembled(exponent: npt.NDArray[np.int64], fraction: npt.NDArray[np.int64]) -> Words:
    """The positive words 2**exponent * (1 + fraction / 2**23), rounded to nearest even below 2**-126."""
    value = np.ldexp((tables.FRACTION + 1 + fraction).astype(np.float64), exponent - tables.FRACTION_BITS)
    return value.astype(np.float32).view(np.uint32)


def reciprocal_seed(a: Floats) -> tuple[Floats, Floats, npt.NDArray[np.bool_]]:
    """(Y, z, special): the answers of the tables `rcp` and `point`."""
    words = np.ascontiguousarray(a).view(np.uint32)
    sign, magnitude = words & np.uint32(tables.SIGN), words & np.uint32(~tables.SIGN & 0xFFFFFFFF)
    overflows = magnitude <= np.uint32(0x00200000)
    special = overflows | (magnitude >= tables.INFINITY)
    exponent, fraction = _normalised(np.where(special, np.uint32(0x3F800000), magnitude))
    index = fraction >> (tables.FRACTION_BITS - tables.RCP_INDEX_BITS)
    seed = _assembled(-exponent - 1, tables.contents("rcp")[index].astype(np.int64))
    point = _assembled(exponent, tables.contents("point")[index].astype(np.int64))
    final = np.where(overflows, np.uint32(tables.INFINITY), np.uint32(0))
    is_nan = magnitude > tables.INFINITY
    seed = np.where(special, final, seed) | sign
    point = np.where(special, magnitude, point) | sign
    nan = np.uint32(tables.CANONICAL_NAN)
    seed, point = np.where(is_nan, nan, seed), np.where(is_nan, nan, point)
    return seed.astype(np.uint32).view(np.float32), point.astype(np.uint32).view(np.float32), special


def root_seed(a: Floats) -> Floats:
    """The answer of the table `sqrt`."""
    words = np.ascontiguousarray(a).view(np.uint32)
    special = (words & np.uint32(0x7FFFFFFF) == 0) | (words >= tables.INFINITY)
    exponent, fraction = _normalised(np.where(special, np.uint32(0x3F800000), words))
    index = (exponent & 1) << tables.SQRT_INDEX_BITS | fraction >> (tables.FRACTION_BITS - tables.SQRT_INDEX_BITS)
    seed = _assembled(exponent >> 1, tables.contents("sqrt")[index].astype(np.int64)).view(np.float32)
    keeps = (a == 0) | (a == np.inf)
    return np.where(special, np.where(keeps, a, np.float32(np.nan)), seed)


# --- the library's macros ---------------------------------------------------------------------------------------------


def reciprocal(a: Floats) -> Floats:
    """`rcp`: Y - Y * (Y * (a - z))."""
    seed, point, special = reciprocal_seed(a)
    return np.where(special, seed, seed - seed * (seed * (a - point)))


def divide(a: Floats, b: Floats) -> Floats:
    """`div`: a times the reciprocal of b."""
    return a * reciprocal(b)


def square_root(a: Floats) -> Floats:
    """`sqrt`: (s0 + a / s0) / 2, the quotient by a Newton reciprocal of s0."""
    seed = root_seed(a)
    inverse, _, inverse_special = reciprocal_seed(seed)
    refined = inverse + inverse * (np.float32(1.0) - seed * inverse)
    quotient = a * np.where(inverse_special, inverse, refined)
    # What guards the sum is the flag of the table that was read last: that of the reciprocal of s0.
    return np.where(inverse_special, seed, seed + quotient) * np.float32(0.5)


def fused(a: Floats, b: Floats, c: Floats) -> Floats:
    """A product and a sum, each rounded."""
    return a * b + c


def _reduced(a: Floats) -> tuple[Floats, Floats, Floats]:
    """(r, sine, cosine of the nearest 1024th of a turn n): a = n * 2 pi / 1024 + r."""
    shifted = a * _TURNS + _ROUND
    number = shifted - _ROUND
    rest = a
    for term in _STEPS:
        rest = rest - number * term
    index = np.ascontiguousarray(shifted).view(np.uint32) % tables.TURN
    known = np.isfinite(shifted)
    sine, cosine = (tables.contents(name)[index].view(np.float32) for name in ("sin", "cos"))
    nan = np.float32(np.nan)
    return rest, np.where(known, sine, nan), np.where(known, cosine, nan)


def sine(a: Floats) -> Floats:
    """`sin`: sin(n) + (r * cos(n) - r*r/2 * sin(n))."""
    rest, at_sine, at_cosine = _reduced(a)
    half_square = rest * (rest * np.float32(0.5))
    return at_sine + (rest * at_cosine - at_sine * half_square)


def cosine(a: Floats) -> Floats:
    """`cos`: cos(n) - (r * sin(n) + r*r/2 * cos(n))."""
    rest, at_sine, at_cosine = _reduced(a)
    half_square = rest * (rest * np.float32(0.5))
    return at_cosine - (rest * at_sine + at_cosine * half_square)


# --- sums of four terms -----------------------------------------------------------------------------------------------


def _dot(a: Vec, b: Vec) -> Vec:
    if len(a) == 3:
        return expansions.dot(a, b)
    x, y, z, w = (one * other for one, other in zip(a, b, strict=True))
    return [(x + y) + (z + w)]


def _norm(a: Vec) -> Vec:
    return [_dot(a, a)[0].op("sqrt")]


def _normalize(a: Vec) -> Vec:
    scale: Term = 1.0 / _norm(a)[0]
    return [x * scale for x in a]


def _transform(v: Vec, m: Vec) -> Vec:
    return [_dot(v, m[4 * i : 4 * i + 4])[0] for i in range(4)]


def _compose(a: Vec, b: Vec) -> Vec:
    turned = expansions.transpose(a)
    rows = [_transform(turned[4 * i : 4 * i + 4], b) for i in range(4)]
    return expansions.transpose([x for row in rows for x in row])


ARITHMETIC = Arithmetic(
    primitives={"divide": divide, "sqrt": square_root, "fma": fused},
    expansions={
        "dot": _dot,
        "norm": _norm,
        "normalize": _normalize,
        "transform": _transform,
        "compose": _compose,
    },
    functions={"sin": sine, "cos": cosine},
)
"""What differs from the meaning of the IR. The reciprocal needs no line: it is 1 / a, and 1 times anything is that."""
