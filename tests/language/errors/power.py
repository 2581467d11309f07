from tasuki.language import f32, module


@module
def square(x: f32) -> f32:
    y = x**2
    y **= 2
    return y
