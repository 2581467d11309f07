"""Exponential, logarithm and power: the errors that their docstrings state, over whole octaves where that is cheap."""

from __future__ import annotations

import numpy as np
import pytest

from tasuki.mapping import map_module
from tasuki.modules.elementary import exp2, log2, power
from tests.modules.running import everywhere

EDGES = np.array(
    [0.0, -0.0, 1.0, 2.0, 0.5, 2.0**-126, 2.0**-149, 2.0**-127, 1e-40, 3.4028235e38, np.inf, -np.inf, np.nan, -1.0],
    np.float32,
)


def octave(exponent: int) -> np.ndarray:
    """Every float32 from 2**exponent up to 2**(exponent + 1)."""
    first = np.array(2.0**exponent, np.float32).view(np.int32)
    return np.arange(first, first + 2**23, dtype=np.int32).view(np.float32)


def any_positive(count: int) -> np.ndarray:
    """Any positive finite float32, subnormals too."""
    return np.random.default_rng(1).integers(1, 0x7F800000, count).astype(np.int32).view(np.float32)


@pytest.mark.parametrize("numbers", [octave(-1), octave(0), any_positive(2**21)], ids=["half", "one", "any"])
def test_log2_keeps_its_stated_error(numbers):
    exact = np.log2(numbers.astype(np.float64))
    error = np.abs(map_module(log2, numbers) - exact) / np.maximum(1, np.abs(exact))
    assert error.max() <= 3e-7


def test_log2_near_one_is_relatively_exact():
    # What keeps a power with a large exponent right.
    near = np.concatenate([octave(0)[: 2**20], octave(-1)[-(2**20) :]])
    exact = np.log2(near.astype(np.float64))
    there = exact != 0
    error = np.abs(map_module(log2, near) - exact)[there] / np.abs(exact[there])
    assert error.max() < 5e-7


def test_log2_of_powers_of_two_is_exact():
    exponents = np.arange(-149, 128)
    np.testing.assert_array_equal(map_module(log2, (2.0**exponents).astype(np.float32)), exponents)


def test_exp2_keeps_its_stated_error():
    exponents = np.linspace(-126, 128, 2**22, endpoint=False).astype(np.float32)
    exponents = np.concatenate([exponents, octave(-3), -octave(-3)])
    exponents = exponents[exponents < 128]
    exact = np.exp2(exponents.astype(np.float64))
    assert (np.abs(map_module(exp2, exponents) / exact - 1)).max() < 2e-7


def test_exp2_at_and_beyond_its_ends():
    below = np.nextafter(np.float32(-126), np.float32(-200))
    given = np.array([-126, below, -150, -np.inf, 128, 129, 1e30, np.inf, 0.0, -0.0], np.float32)
    expected = np.array([2.0**-126, 0, 0, 0, np.inf, np.inf, np.inf, np.inf, 1, 1], np.float32)
    np.testing.assert_array_equal(map_module(exp2, given), expected)


def test_whole_exponents_are_exact():
    exponents = np.arange(-126, 128)
    np.testing.assert_array_equal(map_module(exp2, exponents.astype(np.float32)), 2.0**exponents)


def test_log2_at_its_ends():
    given = np.array([0.0, -0.0, np.inf, -1.0, -1e-45, -np.inf, np.nan], np.float32)
    expected = np.array([-np.inf, -np.inf, np.inf, *[np.nan] * 4], np.float32)
    np.testing.assert_array_equal(map_module(log2, given), expected)


def test_power_keeps_its_stated_error():
    draw = np.random.default_rng(2)
    x = np.concatenate([draw.uniform(0, 1, 2**20), draw.uniform(0.9, 1.1, 2**19), any_positive(2**19)])
    y = np.concatenate([draw.uniform(0, 100, 2**20), draw.uniform(-1000, 1000, 2**19), draw.uniform(-2, 2, 2**19)])
    x, y = x.astype(np.float32), y.astype(np.float32)
    exact = x.astype(np.float64) ** y.astype(np.float64)
    normal = (exact >= 2.0**-126) & (exact < 2.0**127.9)
    error = np.abs(map_module(power, x, y) / exact - 1)[normal]
    assert normal.mean() > 0.7
    assert error.max() < 2e-5


def test_power_of_nothing_and_to_nothing():
    x = np.array([0, 0, -1, -1, 0.5, 2, 1, 0, 1e-45], np.float32)
    y = np.array([0, 5, 0, 2, 0, 0, 1000, 0.001, 1], np.float32)
    expected = np.array([1, 0, 1, 0, 1, 1, 1, 0, 0], np.float32)
    np.testing.assert_array_equal(map_module(power, x, y), expected)


def test_power_grows_with_its_base_on_the_whole():
    x = np.linspace(0, 1, 10001).astype(np.float32)
    for exponent in (1.0, 5.0, 50.0):
        value = map_module(power, x, np.float32(exponent))
        assert (value >= 0).all()
        assert value[-1] == 1
        assert (np.diff(value) >= -2e-5 * value[1:]).all()


@pytest.mark.parametrize("module", [log2, exp2])
def test_every_machine_gives_the_same_bits(module):
    numbers = np.concatenate([EDGES, any_positive(5000), np.linspace(-200, 200, 5001).astype(np.float32)])
    everywhere(module, numbers)


def test_every_machine_gives_the_same_powers():
    x, y = (grid.reshape(-1) for grid in np.meshgrid(EDGES, [*EDGES, 5, -50, 1e-3]))
    everywhere(power, x, y.astype(np.float32))
    plain = map_module(power, x[:60], y[:60].astype(np.float32), machine="python")
    np.testing.assert_array_equal(plain, map_module(power, x[:60], y[:60].astype(np.float32)))
