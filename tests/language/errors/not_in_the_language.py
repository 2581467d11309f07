from tasuki.language import f32, module


@module
def everything(x: f32) -> f32:
    assert x > 0.0
    import math
    with x:
        pass
    try:
        pass
    except ValueError:
        pass
    raise x
    y = [x, x]
    z = {x: x}
    f = lambda a: a
    t = "text"
    u = (v := x)
    w = [a for a in y]
    del x
    s = x in y
    c = None
    g = 1j
    global k

    def inner():
        pass

    match x:
        case _:
            pass
    return x
