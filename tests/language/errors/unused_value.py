from tasuki.language import f32, module, sqrt


@module
def unused(x: f32):
    """A docstring is no value."""
    x + 1.0
    sqrt(x)
    x == 2.0
