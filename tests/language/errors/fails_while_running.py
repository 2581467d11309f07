from tasuki.language import f32, module

SIZES = [1, 2, 3]
LAST = SIZES[3]


@module
def unused(x: f32) -> f32:
    return x
