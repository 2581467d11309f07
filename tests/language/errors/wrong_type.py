from tasuki.language import f32, module


@module
def area(radius: f32) -> f32:
    half: f32 = 3
    count = 0
    count = count + radius
    return half
