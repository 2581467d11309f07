"""What the operations of the floating-point units and of the ALU compute: words in, a word out.

A sum, difference or product of two binary32 numbers is computed in binary64 and then rounded to binary32. The two
roundings give what one would: a product is exact in binary64, and for sums 53 bits are more than twice 24 plus 2 (S. A.
Figueroa, "When is double rounding innocuous?", 1995); sums that are subnormal in binary32 are exact.
"""

from __future__ import annotations

import math
import operator
import struct
from collections.abc import Callable

from tasuki.machines.pu.isa import CANONICAL_NAN, float_bits

WORD = 0xFFFFFFFF
SIGN = 0x80000000
INFINITY = 0x7F800000
_INT_MAX = (1 << 31) - 1


def number(word: int) -> float:
    """The value of a binary32 word."""
    return struct.unpack("<f", word.to_bytes(4, "little"))[0]


def is_nan(word: int) -> bool:
    return word & ~SIGN > INFINITY


def signed(word: int) -> int:
    """The word as an integer in two's complement."""
    return word - (1 << 32) if word & SIGN else word


def _rounded(function: Callable[[float, float], float]) -> Callable[[int, int], int]:
    def operation(a: int, b: int) -> int:
        return float_bits(function(number(a), number(b)))

    return operation


def _canonical(function: Callable[[int, int], int]) -> Callable[[int, int], int]:
    """`function`, but for NaN in a the canonical NaN."""

    def operation(a: int, b: int) -> int:
        return CANONICAL_NAN if is_nan(a) else function(a, b)

    return operation


def _floor(a: int, b: int) -> int:
    value = number(a)
    return a if math.isinf(value) else float_bits(math.copysign(math.floor(value), value))


def _ftoi(a: int, b: int) -> int:
    value = number(a)
    if math.isnan(value):
        return 0
    return int(min(max(value, -_INT_MAX - 1), _INT_MAX)) & WORD


FLOAT: dict[str, Callable[[int, int], int]] = {
    "copy": lambda a, b: a,
    "add": _rounded(operator.add),
    "sub": _rounded(operator.sub),
    "mul": _rounded(operator.mul),
    "min": lambda a, b: a if number(a) < number(b) else b,
    "max": lambda a, b: a if number(a) > number(b) else b,
    "neg": _canonical(lambda a, b: a ^ SIGN),
    "abs": _canonical(lambda a, b: a & ~SIGN),
    "sign": _canonical(lambda a, b: a & ~SIGN | b & SIGN),
    "itof": lambda a, b: float_bits(float(signed(a))),
    "ftoi": _ftoi,
    "floor": _canonical(_floor),
}
"""Operations of an FPP whose result depends on the operands alone."""

INTEGER: dict[str, Callable[[int, int], int]] = {
    "copy": lambda a, b: a,
    "add": lambda a, b: a + b & WORD,
    "sub": lambda a, b: a - b & WORD,
    "mul": lambda a, b: a * b & WORD,
    "and": operator.and_,
    "or": operator.or_,
    "xor": operator.xor,
    "shl": lambda a, b: a << b % 32 & WORD,
    "shr": lambda a, b: a >> b % 32,
    "sar": lambda a, b: signed(a) >> b % 32 & WORD,
    "min": lambda a, b: a if signed(a) < signed(b) else b,
    "max": lambda a, b: a if signed(a) > signed(b) else b,
}
"""Operations of the ALU whose result depends on the operands alone."""


def float_flags(a: int, b: int) -> dict[str, bool]:
    """What `cmp` of an FPP finds."""
    x, y = number(a), number(b)
    return {"lt": x < y, "eq": x == y, "un": math.isnan(x) or math.isnan(y)}


def integer_flags(a: int, b: int) -> dict[str, bool]:
    """What `cmp` of the ALU finds."""
    return {"lt": signed(a) < signed(b), "eq": a == b, "ult": a < b}
