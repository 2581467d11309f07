from tasuki.language import f32, i32, module


@module
def logic(n: i32, x: f32, p: bool) -> bool:
    if n:
        return not n
    while x:
        x = 0.0
    y = 1.0 if n else 2.0
    z = 1.0 if p else n
    a = ~p
    b = p + p
    return p and n
