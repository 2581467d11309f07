from tasuki.language import f32, i32, module


@module
def first(x: f32) -> f32:
    return x + y


@module
def second(x: f32) -> i32:
    return first(x)


@module
def entry(x: f32) -> f32:
    return second(x) + first(x)
