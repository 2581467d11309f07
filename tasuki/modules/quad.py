"""Flat convex quadrilaterals with smooth normals: cheaper than two triangles. A surface: it has no IN and OUT."""

from tasuki.language import cross, dot, f32, i32, max, min, module, normalize, select, vec3
from tasuki.modules.crossing import NOWHERE, first_crossing
from tasuki.modules.parts import segment_part
from tasuki.modules.polygon import Seen, basis_across, edge_side, seen_along
from tasuki.modules.records import Quad


@module
def quad_plane_normal(quad: Quad) -> vec3:
    """The normal, of any length, from the diagonals."""
    return cross(quad.c - quad.a, quad.d - quad.b)


@module
def seen_corners(quad: Quad, origin: vec3, direction: vec3) -> tuple[Seen, Seen, Seen, Seen]:
    """The corners as a ray of unit direction sees them."""
    right, up = basis_across(direction)
    a = seen_along(quad.a - origin, right, up)
    b = seen_along(quad.b - origin, right, up)
    c = seen_along(quad.c - origin, right, up)
    d = seen_along(quad.d - origin, right, up)
    return a, b, c, d


@module
def quad_hit(quad: Quad, origin: vec3, direction: vec3, leaving: bool) -> f32:
    """The visible crossing with t > 0 (`crossing.NOWHERE` if there is none)."""
    a, b, c, d = seen_corners(quad, origin, direction)
    ab = edge_side(a, b)
    bc = edge_side(b, c)
    cd = edge_side(c, d)
    da = edge_side(d, a)
    front = min(min(ab, bc), min(cd, da)) >= 0.0
    back = max(max(ab, bc), max(cd, da)) <= 0.0
    normal = quad_plane_normal(quad)
    t = dot(normal, quad.a - origin) / dot(normal, direction)
    hit = first_crossing(quad.flags, select(front, t, NOWHERE), select(back, t, NOWHERE))
    return select(leaving, NOWHERE, hit)


@module
def quad_surface(quad: Quad, origin: vec3, direction: vec3, point: vec3) -> tuple[vec3, vec3, i32, i32]:
    """The normal of the plane, that interpolated between the corners, and the attribute.

    Interpolated in the triangle, abc or acd, through which the ray passes.
    """
    a, b, c, d = seen_corners(quad, origin, direction)
    flat = quad_plane_normal(quad)
    facing = select(dot(flat, direction) < 0.0, 1.0, -1.0)
    beyond = facing * edge_side(c, a)
    weight_b = max(beyond, 0.0)
    weight_d = max(-beyond, 0.0)
    in_abc = beyond >= 0.0
    weight_a = facing * select(in_abc, edge_side(b, c), edge_side(c, d))
    weight_c = facing * select(in_abc, edge_side(a, b), edge_side(d, a))
    smooth = weight_a * quad.normal_a + weight_b * quad.normal_b + weight_c * quad.normal_c + weight_d * quad.normal_d
    return normalize(flat), normalize(smooth), quad.attribute, quad.matrix


@module
def quad_bounds(quad: Quad) -> tuple[vec3, vec3]:
    """The box of the corners."""
    return min(min(quad.a, quad.b), min(quad.c, quad.d)), max(max(quad.a, quad.b), max(quad.c, quad.d))


@module
def quad_part(quad: Quad, axis: i32, low: f32, high: f32) -> tuple[vec3, vec3]:
    """The box of what lies between two planes: of the edges there."""
    ab_low, ab_high = segment_part(quad.a, quad.b, axis, low, high)
    bc_low, bc_high = segment_part(quad.b, quad.c, axis, low, high)
    cd_low, cd_high = segment_part(quad.c, quad.d, axis, low, high)
    da_low, da_high = segment_part(quad.d, quad.a, axis, low, high)
    return min(min(ab_low, bc_low), min(cd_low, da_low)), max(max(ab_high, bc_high), max(cd_high, da_high))
