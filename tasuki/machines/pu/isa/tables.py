"""The function tables: contents, made here, and the wiring around them. `lookup` is the reference for simulators.

A table access takes a word x and gives a word and a *special* flag. Wired logic (no ALU step) makes the index:

- **rcp, point, sqrt** take x = (-1)**s * 2**e * m with 1 <= m < 2. A normaliser shifts subnormal operands so that this
  holds for them too. For `rcp` and `point` the index is the first 12 bits of m's fraction; for `sqrt` it is the parity
  of e, then the first 11 bits. The exponent path makes the exponent of the answer (-e - 1 for `rcp`, e for `point`,
  floor(e / 2) for `sqrt`), the sign is that of x, and the fraction comes from the table. Answers of `rcp` below 2**-126
  are shifted into subnormal form, rounded to nearest even; `point` has 21 fraction bits and needs no rounding down
  to 2**-128, below which its lowest bits are cut off.
- **sin, cos** take the low ten bits of x, which is where adding 1.5 * 2**23 leaves a whole number.

Answers that are final, and that Newton's step would spoil, carry the special flag:

| table | x | answer |
|---|---|---|
| rcp | 0, and abs(x) <= 2**-128 (1/x overflows) | infinity with the sign of x |
| rcp | infinity | 0 with the sign of x |
| point | 0, infinity, abs(x) <= 2**-128 | x |
| sqrt | 0 of either sign, +infinity | x |
| sqrt | below 0 | canonical NaN |
| all | NaN | canonical NaN |
| sin, cos | infinity | canonical NaN |

The special flag is false for every other x.

**Accurate tables.** `rcp` does not hold the reciprocal of the middle of its interval, but of a point z near the middle
whose reciprocal lies almost exactly on a binary32 number (S. Gal, "Computing elementary functions: a new approach for
achieving high accuracy and good performance", 1986). `point` gives z itself, so that 1/x = Y - Y*Y*(x - z) + ... starts
from a Y that is better than its 24 bits at z: off by 0.0024 ulp in the median, 0.43 ulp in the worst interval (near
the square root of 2, where neighbouring candidates all round alike). Newton's x*L, 1-S, L*S, L+S may use `rcp` alone,
as if it were any seed.

Relative errors, over all x whose answer is normal (`worst_seed_error` measures them): rcp 1.25 * 2**-13, sqrt
1.12 * 2**-13. Sine and cosine are rounded to nearest binary32.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import numpy.typing as npt

from tasuki.machines.pu.isa.encoding import float_bits

Contents = npt.NDArray[np.uint32]

CANONICAL_NAN = 0x7FC00000
INFINITY = 0x7F800000
SIGN = 0x80000000
FRACTION_BITS = 23
FRACTION = (1 << FRACTION_BITS) - 1
BIAS = 127

RCP_INDEX_BITS = 12
SQRT_INDEX_BITS = 11
"""Bits of the fraction; the parity of the exponent comes on top."""
SQRT_ENTRY_BITS = 15
TURN = 1024
"""Entries of `sin` and `cos`: equal parts of a full turn."""
POINT_BITS = 21
"""Fraction bits of z: so few that z is exact also where x is subnormal, above 2**-128."""
_OVERFLOW = 0x00200000
"""The bits of 2**-128: operands up to here have no finite reciprocal."""

TABLES = ("rcp", "point", "sqrt", "sin", "cos")


@cache
def contents(table: str) -> Contents:
    """The entries of one table. rcp, point, sqrt: the 23 fraction bits of the answer. sin, cos: whole binary32 words.

    The arrays cannot be written to. Raises KeyError for an unknown table.
    """
    made = {"rcp": _rcp, "point": _point, "sqrt": _sqrt, "sin": _sin, "cos": _cos}[table]()
    made.setflags(write=False)
    return made


def _points() -> npt.NDArray[np.int64]:
    """For every interval the z = integer / 2**21 in its middle quarter whose 2/z is nearest to a 24-bit number."""
    entries = 1 << RCP_INDEX_BITS
    steps = 1 << (POINT_BITS - RCP_INDEX_BITS)
    middles = (1 << POINT_BITS) + np.arange(entries, dtype=np.int64) * steps + steps // 2
    candidates = middles[:, None] + np.arange(-steps // 8, steps // 8 + 1)
    remainders = (1 << (POINT_BITS + FRACTION_BITS + 1)) % candidates
    distances = np.minimum(remainders, candidates - remainders) / candidates
    return candidates[np.arange(entries), distances.argmin(axis=1)]


def _point() -> Contents:
    return ((_points() << (FRACTION_BITS - POINT_BITS)) & FRACTION).astype(np.uint32)


def _rcp() -> Contents:
    """Fractions of 2/z, rounded to nearest: exact integer arithmetic, so the same everywhere."""
    points = _points()
    doubled = 1 << (POINT_BITS + FRACTION_BITS + 2)
    return (((doubled // points + 1) >> 1) & FRACTION).astype(np.uint32)


def _sqrt() -> Contents:
    """Fractions of the mean of the square roots at the interval's ends, rounded to 15 bits; m from 1 to 2, then 2 to 4.

    The rounding is done on squares of integers, exactly.
    """
    entries = []
    for parity in (0, 1):
        for i in range(1 << SQRT_INDEX_BITS):
            low, high = (math.sqrt((1 + (i + end) / (1 << SQRT_INDEX_BITS)) * (1 + parity)) for end in (0, 1))
            entries.append(round((low + high) / 2 * (1 << SQRT_ENTRY_BITS)) << (FRACTION_BITS - SQRT_ENTRY_BITS))
    return (np.array(entries, dtype=np.int64) & FRACTION).astype(np.uint32)


def _quarter(i: int) -> float:
    """sin(2 pi i / 1024), the arguments folded into the first eighth so that the zeros and ones are exact."""
    i %= TURN
    if i >= TURN // 2:
        return -_quarter(i - TURN // 2)
    if i > TURN // 4:
        i = TURN // 2 - i
    if i > TURN // 8:
        return math.cos(2 * math.pi * (TURN // 4 - i) / TURN)
    return math.sin(2 * math.pi * i / TURN)


def _sin() -> Contents:
    return np.array([float_bits(_quarter(i) + 0.0) for i in range(TURN)], dtype=np.uint32)


def _cos() -> Contents:
    return np.array([float_bits(_quarter(i + TURN // 4) + 0.0) for i in range(TURN)], dtype=np.uint32)


@cache
def _entries(table: str) -> tuple[int, ...]:
    """The contents as Python integers: `lookup` serves the plain simulator, one word at a time."""
    return tuple(contents(table).tolist())


def lookup(table: str, x: int) -> tuple[int, bool]:
    """(word, special) that `table` gives for the word `x`. Raises KeyError for an unknown table."""
    magnitude = x & ~SIGN
    if magnitude > INFINITY:
        return CANONICAL_NAN, True
    if table in ("sin", "cos"):
        return (CANONICAL_NAN, True) if magnitude == INFINITY else (_entries(table)[x % TURN], False)
    if table == "sqrt":
        return _lookup_sqrt(x)
    sign = x & SIGN
    if magnitude <= _OVERFLOW or magnitude == INFINITY:
        infinite = magnitude <= _OVERFLOW
        return (x if table == "point" else sign | (INFINITY if infinite else 0)), True
    exponent, fraction = normalise(magnitude)
    entry = _entries(table)[fraction >> (FRACTION_BITS - RCP_INDEX_BITS)]
    if table == "point":
        return sign | assemble(exponent, entry), False
    return sign | assemble(-exponent - 1, entry), False


def _lookup_sqrt(x: int) -> tuple[int, bool]:
    if x in (0, SIGN, INFINITY):
        return x, True
    if x & SIGN:
        return CANONICAL_NAN, True
    exponent, fraction = normalise(x)
    index = (exponent & 1) << SQRT_INDEX_BITS | fraction >> (FRACTION_BITS - SQRT_INDEX_BITS)
    return assemble(exponent >> 1, _entries("sqrt")[index]), False


def normalise(magnitude: int) -> tuple[int, int]:
    """(exponent e, 23 fraction bits of m) of the positive finite word `magnitude` = 2**e * m, subnormal or not."""
    exponent, fraction = magnitude >> FRACTION_BITS, magnitude & FRACTION
    if exponent:
        return exponent - BIAS, fraction
    shift = FRACTION_BITS + 1 - fraction.bit_length()
    return 1 - BIAS - shift, fraction << shift & FRACTION


def assemble(exponent: int, fraction: int) -> int:
    """The positive word 2**exponent * (1 + fraction / 2**23); below 2**-126 rounded to nearest even.

    The exponent is at most 127 and at least -128: the range that `rcp` and `point` need.
    """
    if exponent + BIAS > 0:
        return exponent + BIAS << FRACTION_BITS | fraction
    shift = 1 - BIAS - exponent
    significand = 1 << FRACTION_BITS | fraction
    kept, lost = significand >> shift, significand & (1 << shift) - 1
    half = 1 << (shift - 1)
    return kept + (lost > half or (lost == half and kept & 1))


def worst_seed_error(table: str) -> float:
    """The greatest relative error of `rcp` or `sqrt` as a first approximation: it lies at an end of an interval."""
    if table == "rcp":
        ends = 1 + np.arange((1 << RCP_INDEX_BITS) + 1) / (1 << RCP_INDEX_BITS)
        seeds = (1 + contents("rcp") / 2**FRACTION_BITS) / 2
        return float(max(np.abs(seeds * ends[:-1] - 1).max(), np.abs(seeds * ends[1:] - 1).max()))
    steps = 1 << SQRT_INDEX_BITS
    seeds = 1 + contents("sqrt") / 2**FRACTION_BITS
    worst = 0.0
    for parity in (0, 1):
        ends = np.sqrt((1 + np.arange(steps + 1) / steps) * (1 + parity))
        part = seeds[parity * steps : (parity + 1) * steps]
        worst = max(worst, float(np.abs(part / ends[:-1] - 1).max()), float(np.abs(part / ends[1:] - 1).max()))
    return worst
