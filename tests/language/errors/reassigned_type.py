from tasuki.language import f32, module


@module
def counter(x: f32) -> f32:
    t = 0
    if x > 1.0:
        t = x
    return t
