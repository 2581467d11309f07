from tasuki.language import f32, i32, module


@module
def trace(depth: i32) -> f32:
    return shade(depth - 1)


@module
def shade(depth: i32) -> f32:
    return mirror(depth)


@module
def mirror(depth: i32) -> f32:
    return trace(depth) * 0.5


@module
def picture(depth: i32) -> f32:
    return trace(depth)
