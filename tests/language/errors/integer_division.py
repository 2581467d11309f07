from tasuki.language import f32, i32, module


@module
def halve(count: i32) -> f32:
    return count / 2
