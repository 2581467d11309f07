"""The function tables in LLVM: the wiring around their contents, as `isa.tables.lookup` has it."""

from __future__ import annotations

from tasuki.machines.pu.isa import CANONICAL_NAN, TABLES, contents
from tasuki.machines.pu.isa.tables import (
    BIAS,
    FRACTION,
    FRACTION_BITS,
    INFINITY,
    RCP_INDEX_BITS,
    SIGN,
    SQRT_INDEX_BITS,
    TURN,
)

_RESULT = "{ i32, i1 }"
_OVERFLOW = 0x00200000

_HEAD = f"""
declare i32 @llvm.ctlz.i32(i32, i1)

; exponent e and 23 fraction bits of m, the positive finite magnitude being 2**e * m
define internal {{ i32, i32 }} @normalise(i32 %magnitude) alwaysinline {{
  %biased = lshr i32 %magnitude, {FRACTION_BITS}
  %fraction = and i32 %magnitude, {FRACTION}
  %normal = icmp ne i32 %biased, 0
  %zeros = call i32 @llvm.ctlz.i32(i32 %fraction, i1 false)
  %wide = sub i32 %zeros, {31 - FRACTION_BITS}
  %shift = select i1 %normal, i32 0, i32 %wide
  %shifted = shl i32 %fraction, %shift
  %kept = and i32 %shifted, {FRACTION}
  %least = sub i32 {1 - BIAS}, %shift
  %unbiased = sub i32 %biased, {BIAS}
  %exponent = select i1 %normal, i32 %unbiased, i32 %least
  %with = insertvalue {{ i32, i32 }} poison, i32 %exponent, 0
  %both = insertvalue {{ i32, i32 }} %with, i32 %kept, 1
  ret {{ i32, i32 }} %both
}}

; the positive word 2**exponent * (1 + fraction / 2**23), rounded to nearest even where it is subnormal
define internal i32 @assemble(i32 %exponent, i32 %fraction) alwaysinline {{
  %biased = add i32 %exponent, {BIAS}
  %is_normal = icmp sgt i32 %biased, 0
  %high = shl i32 %biased, {FRACTION_BITS}
  %normal = or i32 %high, %fraction
  %wanted = sub i32 1, %biased
  %shift = select i1 %is_normal, i32 1, i32 %wanted
  %significand = or i32 %fraction, {1 << FRACTION_BITS}
  %whole = lshr i32 %significand, %shift
  %one_less = sub i32 %shift, 1
  %half = shl i32 1, %one_less
  %below_half = sub i32 %half, 1
  %odd = and i32 %whole, 1
  %bias = add i32 %below_half, %odd
  %biased_significand = add i32 %significand, %bias
  %rounded = lshr i32 %biased_significand, %shift
  %word = select i1 %is_normal, i32 %normal, i32 %rounded
  ret i32 %word
}}

define internal {_RESULT} @pair(i32 %word, i1 %special) alwaysinline {{
  %with = insertvalue {_RESULT} poison, i32 %word, 0
  %both = insertvalue {_RESULT} %with, i1 %special, 1
  ret {_RESULT} %both
}}
"""


def _constants(table: str) -> str:
    entries = contents(table)
    words = ", ".join(f"i32 {entry}" for entry in entries.tolist())
    return f"@entries_{table} = internal unnamed_addr constant [{len(entries)} x i32] [{words}]"


def _opening(table: str) -> str:
    return f"""
define internal {_RESULT} @lookup_{table}(i32 %x) alwaysinline {{
  %magnitude = and i32 %x, {~SIGN & 0xFFFFFFFF}
  %sign = and i32 %x, {SIGN}
  %is_nan = icmp ugt i32 %magnitude, {INFINITY}
"""


def _entry(table: str) -> str:
    return f"""  %place = getelementptr i32, ptr @entries_{table}, i32 %index
  %entry = load i32, ptr %place
"""


def _closing(special: str) -> str:
    """The canonical NaN where x is NaN, else %answer, with the special flag `special`."""
    return f"""  %word = select i1 %is_nan, i32 {CANONICAL_NAN}, i32 %answer
  %flag = or i1 %is_nan, {special}
  %result = call {_RESULT} @pair(i32 %word, i1 %flag)
  ret {_RESULT} %result
}}
"""


def _normalised(argument: str) -> str:
    return f"""  %parts = call {{ i32, i32 }} @normalise(i32 {argument})
  %exponent = extractvalue {{ i32, i32 }} %parts, 0
  %fraction = extractvalue {{ i32, i32 }} %parts, 1
"""


def _turning(table: str) -> str:
    """sin and cos."""
    return (
        _opening(table)
        + f"  %index = and i32 %x, {TURN - 1}\n"
        + _entry(table)
        + f"""  %is_infinite = icmp eq i32 %magnitude, {INFINITY}
  %answer = select i1 %is_infinite, i32 {CANONICAL_NAN}, i32 %entry
"""
        + _closing("%is_infinite")
    )


def _reciprocal(table: str) -> str:
    """rcp and point."""
    if table == "rcp":
        ends = f"""  %answer_exponent = sub i32 -1, %exponent
  %infinity = or i32 %sign, {INFINITY}
  %final = select i1 %is_infinite, i32 %sign, i32 %infinity"""
    else:
        ends = """  %answer_exponent = add i32 %exponent, 0
  %final = add i32 %x, 0"""
    return (
        _opening(table)
        + _normalised("%magnitude")
        + f"  %index = lshr i32 %fraction, {FRACTION_BITS - RCP_INDEX_BITS}\n"
        + _entry(table)
        + f"""  %is_small = icmp ule i32 %magnitude, {_OVERFLOW}
  %is_infinite = icmp eq i32 %magnitude, {INFINITY}
  %is_final = or i1 %is_small, %is_infinite
{ends}
  %safe = select i1 %is_final, i32 0, i32 %answer_exponent
  %positive = call i32 @assemble(i32 %safe, i32 %entry)
  %found = or i32 %sign, %positive
  %answer = select i1 %is_final, i32 %final, i32 %found
"""
        + _closing("%is_final")
    )


def _root() -> str:
    return (
        _opening("sqrt")
        + _normalised("%magnitude")
        + f"""  %parity = and i32 %exponent, 1
  %high = shl i32 %parity, {SQRT_INDEX_BITS}
  %low = lshr i32 %fraction, {FRACTION_BITS - SQRT_INDEX_BITS}
  %index = or i32 %high, %low
"""
        + _entry("sqrt")
        + f"""  %half = ashr i32 %exponent, 1
  %found = call i32 @assemble(i32 %half, i32 %entry)
  %is_zero = icmp eq i32 %magnitude, 0
  %is_infinite = icmp eq i32 %x, {INFINITY}
  %is_itself = or i1 %is_zero, %is_infinite
  %is_negative = icmp ne i32 %sign, 0
  %root = select i1 %is_negative, i32 {CANONICAL_NAN}, i32 %found
  %answer = select i1 %is_itself, i32 %x, i32 %root
  %is_final = or i1 %is_itself, %is_negative
"""
        + _closing("%is_final")
    )


def table_functions() -> str:
    """`{ i32, i1 } @lookup_NAME(i32)` for every table: the word and the special flag."""
    functions = [_root(), *(_reciprocal(table) for table in ("rcp", "point"))]
    functions += [_turning(table) for table in ("sin", "cos")]
    return "\n".join([*map(_constants, TABLES), _HEAD, *functions])
