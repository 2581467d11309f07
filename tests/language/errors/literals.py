from tasuki.language import f32, i32, module

MANY = 3_000_000_000


@module
def numbers(x: f32, n: i32) -> f32:
    a = n + MANY
    b = x * 1e39
    c = n + 1.0
    d: i32 = 1.5
    e = 1 / 2
    f = -2147483648
    g = 2147483648
    return x
