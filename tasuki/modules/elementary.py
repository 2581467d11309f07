"""Exponential, logarithm and power, each by one stated algorithm, so that every machine agrees to the last bit.

Polynomials from Cephes (S. L. Moshier, *Methods and Programs for Mathematical Functions*, 1989; `logf`, `exp2f`).
"""

from tasuki.language import bits, f32, floor, from_bits, i32, max, min, module

LOG2_E = 1.44269504088896341
SQRT_HALF_BITS = 0x3F3504F3
EXPONENT_MASK = 0x7F800000
INFINITY = float("inf")


@module
def log2(x: f32) -> f32:
    """Binary logarithm of x > 0, within 3e-7 of the larger of 1 and the result; -inf for 0, NaN for x < 0."""
    scaled = x
    shift = 0.0
    if x < 1.17549435e-38:
        scaled = x * 16777216.0
        shift = -24.0
    # Exponent and a mantissa in [sqrt(1/2), sqrt(2)).
    above = bits(scaled) - SQRT_HALF_BITS
    exponent = above >> 23
    z = from_bits(bits(scaled) - (exponent << 23)) - 1.0
    p = z * 7.0376836292e-2 - 1.1514610310e-1
    p = p * z + 1.1676998740e-1
    p = p * z - 1.2420140846e-1
    p = p * z + 1.4249322787e-1
    p = p * z - 1.6668057665e-1
    p = p * z + 2.0000714765e-1
    p = p * z - 2.4999993993e-1
    p = p * z + 3.3333331174e-1
    natural = z + (z * z * z * p - 0.5 * z * z)
    result = natural * LOG2_E + (f32(exponent) + shift)
    if x == 0.0:
        result = -INFINITY
    elif x == INFINITY:
        result = INFINITY
    elif not x > 0.0:
        result = (x - x) / 0.0
    return result


@module
def exp2(x: f32) -> f32:
    """2 to the power x, relative error below 2e-7 where the result is normal; 0 below 2**-126."""
    limited = min(max(x, -127.0), 128.0)
    whole = floor(limited + 0.5)
    f = limited - whole
    p = f * 1.535336188319500e-4 + 1.339887440266574e-3
    p = p * f + 9.618437357674640e-3
    p = p * f + 5.550332471162809e-2
    p = p * f + 2.402264791363012e-1
    p = p * f + 6.931472028550421e-1
    # In two steps, since 2**128 itself is no f32.
    half = i32(whole) >> 1
    rest = i32(whole) - half
    result = (p * f + 1.0) * from_bits((half + 127) << 23) * from_bits((rest + 127) << 23)
    if x < -126.0:
        result = 0.0
    return result


@module
def power(x: f32, y: f32) -> f32:
    """x to the power y for x >= 0, relative error below 2e-5 where the result is normal.

    0 to the power 0 is 1, to any other it is 0; x < 0 counts as 0.
    """
    result = exp2(y * log2(max(x, 0.0)))
    if y == 0.0:
        result = 1.0
    elif x <= 0.0:
        result = 0.0
    return result
