from tasuki.language import f32, i32, module


@module
def helper(a: f32, n: i32) -> tuple[f32, i32]:
    return a * f32(n), n


@module
def nothing(a: f32):
    if a > 0.0:
        return


@module
def calls(x: f32) -> f32:
    y = helper(x, 1)[0] + helper(n=2, a=x)[0]
    a, n = helper(y, 3)
    pair = helper(a, n)
    nothing(pair[0])
    helper(a, n)
    while helper(a, 1)[0] > 1.0:
        a = a - 1
    return a
