from tasuki.language import f32, module


@module
def nothing(x: f32):
    """A docstring, `...`, `pass` and `breakpoint()` leave no trace."""
    ...
    pass
    breakpoint()
    return None
