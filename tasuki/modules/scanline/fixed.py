"""Screen coordinates in fixed point, and exact multiples of fractions in 32 bits."""

from tasuki.language import f32, floor, i32, module, reciprocal, select

SUBPIXEL_BITS = 12
SUBPIXEL = 1 << SUBPIXEL_BITS
"""Steps of a screen coordinate in a pixel. The largest picture has 2**16 pixels along a side: 28 bits in all."""


@module
def fixed(x: f32) -> i32:
    """A coordinate in pixels as the nearest whole number of subpixels."""
    return i32(floor(x * SUBPIXEL + 0.5))


@module
def first_from(x: i32, sample: i32) -> i32:
    """The first pixel (or row) whose sample, `sample` subpixels from its beginning, lies at x or behind."""
    return (x - sample + (SUBPIXEL - 1)) >> SUBPIXEL_BITS


@module
def multiple(n: i32, bits: i32, whole: i32, rest: i32, divisor: i32) -> tuple[i32, i32]:
    """n times (whole + rest / divisor), as such a sum again: 0 <= rest < divisor < 2**29.

    n has `bits` bits, and is multiplied one bit after another, from the highest: no product has more than 32 bits where
    the result has not.
    """
    total = 0
    part = 0
    for bit in range(bits - 1, -1, -1):
        there = n >> bit & 1
        total = 2 * total + there * whole
        part = 2 * part + there * rest
        # `part` was less than three times the divisor.
        over = part >= divisor
        total += i32(over)
        part = select(over, part - divisor, part)
        over = part >= divisor
        total += i32(over)
        part = select(over, part - divisor, part)
    return total, part


@module
def quotient(n: i32, divisor: i32) -> tuple[i32, i32]:
    """floor(n / divisor) and what remains, exact where |n| < 2**30, 0 < divisor < 2**30, |n / divisor| < 2**20.

    By the f32 quotient, whose error is then less than 1: lanes have no division of integers.
    """
    near = i32(floor(f32(n) * reciprocal(f32(divisor))))
    rest = n - near * divisor
    below = rest < 0
    near = select(below, near - 1, near)
    rest = select(below, rest + divisor, rest)
    above = rest >= divisor
    return select(above, near + 1, near), select(above, rest - divisor, rest)
