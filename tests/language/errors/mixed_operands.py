from tasuki.language import f32, i32, module


@module
def average(sum: f32, count: i32) -> f32:
    return sum / count
