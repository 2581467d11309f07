from tasuki.language import f32, module


@module
def pick(x: f32) -> f32:
    if x > 0.0:
        y = x
    for i in range(3):
        z = y
    return z + f32(i)
