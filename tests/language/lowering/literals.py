import math

from tasuki.language import f32, i32, module

THIRD = 1.0 / 3.0
COUNT = 4
YES = True


@module
def literals(x: f32, n: i32) -> tuple[f32, f32, f32, i32, i32, bool]:
    """Arithmetic of constants is done once, in float32; whole numbers become f32 where one is wanted."""
    a = 1.0 / 3.0 + THIRD
    b = x * 2 * COUNT
    c: f32 = -3
    d = COUNT * 2 - n
    e = -2147483648
    return a + 2 * math.pi, b, c, d, e, YES
