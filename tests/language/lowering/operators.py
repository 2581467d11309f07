from tasuki.language import f32, i32, module, vec3


@module
def operators(x: f32, n: i32, v: vec3, p: bool) -> tuple[f32, i32, vec3, bool]:
    a = (x + 1) * 2 - x / 3 + -x + +x
    b = (n // 2 % 3) & 7 | 1 ^ ~n << 2 >> 1
    c = 2 * v + x - v / v * vec3(1, 2, 3)
    d = (p & (n == 1)) ^ (x != 0)
    return a, b, c, d
