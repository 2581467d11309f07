from tasuki.language import f32, i32, module


@module
def pair(x: f32) -> tuple[f32, i32]:
    if x > 1.0:
        return x
    if x > 2.0:
        return x, x
    if x > 3.0:
        return
    return x, 1, 2


@module
def nothing(x: f32):
    return x


@module
def caller(x: f32) -> f32:
    a, b, c = pair(x)
    d, e = x
    e = pair(x)[2]
    nothing(x)
    return pair(x)
