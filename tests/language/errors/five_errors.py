from tasuki.language import dot, f32, i32, module, vec3


@module
def five(a: f32, n: i32) -> vec3:
    b = a + n
    c = b * undefined
    d = dot(a, a)
    if n:
        e = 1.0
    f = e + c + d
    return f
