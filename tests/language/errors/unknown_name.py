from tasuki.language import f32, module

EPSILON = 1e-6


@module
def nudge(t: f32) -> f32:
    return t + EPSILOM
