from tasuki.language import f32, i32, module


@module
def helper(a: f32, b: i32) -> f32:
    return a * f32(b)


@module
def nothing(a: f32):
    pass


def plain(a):
    return a


@module
def caller(x: f32) -> f32:
    a = helper(x)
    b = helper(x, 1, 2)
    c = helper(x, c=1)
    d = helper(x, a=x, b=1)
    e = helper(1, 2.5)
    f = nothing(x)
    g = plain(x)
    h = helper(*x, **x)
    i = x(1)
    return helper
