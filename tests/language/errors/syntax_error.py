from tasuki.language import f32, module


@module
def broken(x: f32) -> f32:
    return x +
