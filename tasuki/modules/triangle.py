"""Triangles with smooth normals: intersection and what the search needs of the kind. A surface: it has no IN and OUT.
"""

from tasuki.language import cross, dot, f32, i32, max, min, module, normalize, select, vec3
from tasuki.modules.crossing import NOWHERE, first_crossing
from tasuki.modules.parts import segment_part
from tasuki.modules.polygon import basis_across, edge_side, seen_along
from tasuki.modules.records import Triangle


@module
def corner_weights(triangle: Triangle, origin: vec3, direction: vec3) -> tuple[f32, f32, f32]:
    """For each corner the side of the opposite edge on which a ray of unit direction passes. Equal signs: inside."""
    right, up = basis_across(direction)
    a = seen_along(triangle.a - origin, right, up)
    b = seen_along(triangle.b - origin, right, up)
    c = seen_along(triangle.c - origin, right, up)
    return edge_side(b, c), edge_side(c, a), edge_side(a, b)


@module
def triangle_hit(triangle: Triangle, origin: vec3, direction: vec3, leaving: bool) -> f32:
    """The visible crossing with t > 0 (`crossing.NOWHERE` if there is none)."""
    u, v, w = corner_weights(triangle, origin, direction)
    front = u >= 0.0 and v >= 0.0 and w >= 0.0
    back = u <= 0.0 and v <= 0.0 and w <= 0.0
    normal = cross(triangle.b - triangle.a, triangle.c - triangle.a)
    t = dot(normal, triangle.a - origin) / dot(normal, direction)
    hit = first_crossing(triangle.flags, select(front, t, NOWHERE), select(back, t, NOWHERE))
    return select(leaving, NOWHERE, hit)


@module
def triangle_surface(triangle: Triangle, origin: vec3, direction: vec3, point: vec3) -> tuple[vec3, vec3, i32, i32]:
    """The normal of the plane, that interpolated between the corners, and the attribute."""
    u, v, w = corner_weights(triangle, origin, direction)
    flat = normalize(cross(triangle.b - triangle.a, triangle.c - triangle.a))
    blended = u * triangle.normal_a + v * triangle.normal_b + w * triangle.normal_c
    total = u + v + w
    smooth = normalize(select(total < 0.0, -blended, blended))
    return flat, smooth, triangle.attribute, triangle.matrix


@module
def triangle_bounds(triangle: Triangle) -> tuple[vec3, vec3]:
    """The box of the corners."""
    low = min(triangle.a, min(triangle.b, triangle.c))
    high = max(triangle.a, max(triangle.b, triangle.c))
    return low, high


@module
def triangle_part(triangle: Triangle, axis: i32, low: f32, high: f32) -> tuple[vec3, vec3]:
    """The box of what lies between two planes: of the edges there."""
    ab_low, ab_high = segment_part(triangle.a, triangle.b, axis, low, high)
    bc_low, bc_high = segment_part(triangle.b, triangle.c, axis, low, high)
    ca_low, ca_high = segment_part(triangle.c, triangle.a, axis, low, high)
    return min(ab_low, min(bc_low, ca_low)), max(ab_high, max(bc_high, ca_high))
