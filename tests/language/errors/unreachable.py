from tasuki.language import f32, module


@module
def early(x: f32) -> f32:
    while True:
        break
        x = 1.0
    return x
    x = 2.0
