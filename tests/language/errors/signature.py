from tasuki.language import f32, module


@module
def wrong(a, b: float, c: "vec33", d: f32 = 1.0, *rest: f32) -> list:
    return a
