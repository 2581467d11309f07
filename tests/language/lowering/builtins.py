import builtins

from tasuki.language import (
    bits,
    copysign,
    cos,
    count_lanes,
    f32,
    floor,
    fma,
    from_bits,
    i32,
    max,
    min,
    module,
    reciprocal,
    same_lanes,
    select,
    sin,
    sqrt,
)


@module
def functions(x: f32, n: i32, p: bool) -> tuple[f32, i32]:
    a = sqrt(2) + floor(x) + fma(x, 2, 1) + copysign(x, -1) + reciprocal(x) + sin(x) + cos(x)
    b = min(x, 1, 2.0) + max(0, x) + builtins.min(x, 0)
    c = bits(x) + i32(x) + i32(p) + count_lanes(p) + min(n, 3, 4)
    d = from_bits(n) + f32(n) + f32(p) + same_lanes(x)
    e = select(p, x, 1)
    return a + b + d + e, c
