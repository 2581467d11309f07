"""The function tables: sizes, stated errors, wiring for subnormals, and the special flag."""

import math
import struct
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tasuki.machines.pu.isa import CANONICAL_NAN, TABLES, contents, float_bits, lookup
from tasuki.machines.pu.isa.tables import worst_seed_error

INFINITY = 0x7F800000
SIGN = 0x80000000
WORDS = st.integers(0, 0xFFFFFFFF)


def value(word: int) -> float:
    return struct.unpack(">f", word.to_bytes(4))[0]


@pytest.mark.parametrize("table", TABLES)
def test_at_most_4096_entries(table: str):
    assert len(contents(table)) == (1024 if table in ("sin", "cos") else 4096)
    assert contents(table).dtype == np.uint32
    with pytest.raises(ValueError, match="read-only"):
        contents(table)[0] = 1


def test_the_stated_errors_are_the_measured_ones():
    assert 1.24 < worst_seed_error("rcp") * 2**13 <= 1.25
    assert 1.11 < worst_seed_error("sqrt") * 2**13 <= 1.12


@given(WORDS)
def test_reciprocal_seed(word: int):
    answer, special = lookup("rcp", word)
    x = value(word)
    if math.isnan(x):
        assert (answer, special) == (CANONICAL_NAN, True)
    elif abs(x) <= 2.0**-128:
        assert (answer, special) == (word & SIGN | INFINITY, True)
    elif math.isinf(x):
        assert (answer, special) == (word & SIGN, True)
    else:
        assert not special
        relative = abs(Fraction(value(answer)) * Fraction(x) - 1)
        subnormal = abs(value(answer)) < 2.0**-126
        rounding = Fraction(2) ** -150 * abs(Fraction(x)) if subnormal else 0
        assert relative <= Fraction(1.25 * 2**-13) + rounding


@given(WORDS)
def test_point_is_near_and_its_reciprocal_is_the_seed(word: int):
    z, special = lookup("point", word)
    seed, seed_special = lookup("rcp", word)
    assert special == seed_special
    if special:
        assert z == (CANONICAL_NAN if math.isnan(value(word)) else word)
        return
    x, at = Fraction(value(word)), Fraction(value(z))
    assert abs(at / x - 1) <= Fraction(1.25 * 2**-13)
    assert lookup("rcp", z) == (seed, False)
    if abs(value(seed)) >= 2.0**-126:
        ulp = Fraction(2) ** (math.frexp(value(seed))[1] - 24)
        assert abs(Fraction(value(seed)) - 1 / at) <= Fraction(43, 100) * ulp


def test_points_are_almost_rounded():
    """0.0024 ulp in the median."""
    z = (1 << 23 | contents("point").astype(np.int64)).astype(object)
    y = (1 << 23 | contents("rcp").astype(np.int64)).astype(object)
    off = np.abs(np.array(y * z - (1 << 47), dtype=float) / np.array(z, dtype=float))
    assert 0.0023 < np.median(off) < 0.0025
    assert off.max() <= 0.43


@given(WORDS)
def test_square_root_seed(word: int):
    answer, special = lookup("sqrt", word)
    x = value(word)
    if x == 0 or x == math.inf:
        assert (answer, special) == (word, True)
    elif not x > 0:
        assert (answer, special) == (CANONICAL_NAN, True)
    else:
        assert not special
        assert abs(value(answer) / math.sqrt(x) - 1) <= 1.12 * 2**-13


@pytest.mark.parametrize("table", ["sin", "cos"])
def test_sine_and_cosine_are_rounded(table: str):
    for i in range(-1024, 1024):
        exact = getattr(math, table)(2 * math.pi * i / 1024)
        answer, special = lookup(table, float_bits(1.5 * 2**23 + i))
        assert not special
        half_ulp = 2.0 ** (math.frexp(exact)[1] - 25)
        assert abs(value(answer) - exact) <= max(half_ulp, 1e-15)


def test_sine_and_cosine_at_the_quarters_are_exact():
    assert [value(lookup("sin", i)[0]) for i in (0, 256, 512, 768)] == [0.0, 1.0, 0.0, -1.0]
    assert [value(lookup("cos", i)[0]) for i in (0, 256, 512, 768)] == [1.0, 0.0, -1.0, 0.0]
    assert lookup("sin", 512)[0] == 0


@given(st.sampled_from(["sin", "cos"]), WORDS)
def test_sine_and_cosine_of_any_word(table: str, word: int):
    answer, special = lookup(table, word)
    assert special == (word & 0x7FFFFFFF >= INFINITY)
    assert answer == (CANONICAL_NAN if special else contents(table)[word % 1024])


def test_edges():
    least, below_normal = 1, 0x007FFFFF
    assert lookup("rcp", 0) == (INFINITY, True)
    assert lookup("rcp", SIGN) == (SIGN | INFINITY, True)
    assert lookup("rcp", 0x00200000) == (INFINITY, True)
    assert lookup("rcp", 0x00200001)[1] is False
    assert value(lookup("rcp", below_normal)[0]) == pytest.approx(2.0**126, rel=2**-12)
    assert lookup("rcp", 0x7F7FFFFF)[0] < 0x00800000
    assert value(lookup("sqrt", least)[0]) == pytest.approx(2.0**-74.5, rel=2**-12)
    assert lookup("sqrt", SIGN) == (SIGN, True)
    assert lookup("sqrt", SIGN | least) == (CANONICAL_NAN, True)
    with pytest.raises(KeyError):
        lookup("tan", 0x3F800000)
