from tasuki.language import module, socket, vec3


@socket
def shading(point: vec3, normal: vec3) -> vec3:
    """What a surface looks like."""
    ...


@module
def pixel(point: vec3) -> vec3:
    return shading(point, -point) * 0.5
