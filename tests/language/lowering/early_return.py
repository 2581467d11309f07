from tasuki.language import f32, module


@module
def sign(x: f32) -> f32:
    if x > 0.0:
        return 1
    elif x < 0.0:
        return -1
    return 0
