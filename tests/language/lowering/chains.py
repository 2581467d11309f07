from tasuki.language import f32, module


@module
def middle(x: f32) -> f32:
    return x * 2.0


@module
def chains(x: f32, far: f32) -> bool:
    """The middle is evaluated once, the end only if it matters."""
    return 0.0 < x < far and 0 <= middle(x) < middle(far) <= 3
