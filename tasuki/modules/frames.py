"""Local coordinates: points, rays and normals between those in memory and those of a thing of its own."""

from tasuki.language import i32, module, normalize, transpose, vec3, vec4
from tasuki.modules.records import matrices


@module
def local_point(matrix: i32, point: vec3) -> vec3:
    """A point in the local coordinates of matrix number `matrix`."""
    placed = vec4(point, 1.0) @ matrices[matrix].m
    return placed.xyz


@module
def local_ray(matrix: i32, origin: vec3, direction: vec3) -> tuple[vec3, vec3]:
    """A ray in local coordinates. The direction keeps no unit length, so that t means the same on both sides."""
    m = matrices[matrix].m
    placed = vec4(origin, 1.0) @ m
    turned = vec4(direction, 0.0) @ m
    return placed.xyz, turned.xyz


@module
def normal_from_local(matrix: i32, normal: vec3) -> vec3:
    """A local normal, of unit length again, in the coordinates in memory: normals go by the transpose of the inverse.
    """
    turned = vec4(normal, 0.0) @ transpose(matrices[matrix].m)
    return normalize(turned.xyz)
