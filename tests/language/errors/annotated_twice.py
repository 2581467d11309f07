from tasuki.language import f32, i32, module


@module
def twice(x: f32) -> f32:
    y: f32 = 1
    y: i32 = 2
    z: list = x
    x.w: f32 = 1.0
    return y
