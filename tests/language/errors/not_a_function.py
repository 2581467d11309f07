from tasuki.language import module


@module
class Thing:
    pass
