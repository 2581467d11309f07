"""Quadrics, spheres among them: intersection (module 10), IN/OUT (12), and what the search needs of the kind."""

from tasuki.language import abs, copysign, dot, f32, max, min, module, normalize, select, sqrt, vec3
from tasuki.modules.crossing import first_crossing
from tasuki.modules.records import SPHERE, Quadric

FAR = 1.0e30


@module
def quadric_matrix_times(quadric: Quadric, v: vec3) -> vec3:
    """Q v."""
    return vec3(dot(quadric.q1, v), dot(quadric.q2, v), dot(quadric.q3, v))


@module
def sphere_crossings(quadric: Quadric, origin: vec3, direction: vec3, leaving: bool) -> tuple[f32, f32]:
    """Where a ray of unit direction enters and leaves a sphere; NaN where it misses.

    The discriminant comes from the ray's nearest point to the centre, not from squares of large distances
    (E. Haines et al., "Precision Improvements for Ray/Sphere Intersection", Ray Tracing Gems, 2019). A ray that starts
    on the sphere (`leaving`) has one crossing at exactly 0.
    """
    to_centre = quadric.centre - origin
    middle = dot(to_centre, direction)
    aside = to_centre - middle * direction
    half = sqrt(quadric.constant - dot(aside, aside))
    enter = select(leaving, min(middle + middle, 0.0), middle - half)
    leave = select(leaving, max(middle + middle, 0.0), middle + half)
    return enter, leave


@module(number=10, method="raytrace")
def quadric_intersection(quadric: Quadric, origin: vec3, direction: vec3, leaving: bool) -> tuple[f32, f32]:
    """The parameters, in order, at which origin + t * direction meets the quadric; NaN where it does not.

    a t^2 + 2 b t + c = 0 with the origin moved to the ray's nearest point to the centre, and roots without cancellation.
    A ray that starts on the surface (`leaving`) has one crossing at exactly 0.
    """
    f = origin - quadric.centre
    shift = -dot(f, direction) / dot(direction, direction)
    near = select(leaving, f, f + shift * direction)
    begin = select(leaving, 0.0, shift)
    linear = vec3(quadric.l1, quadric.l2, quadric.l3)
    q_direction = quadric_matrix_times(quadric, direction)
    a = dot(direction, q_direction)
    b = dot(near, q_direction) + 0.5 * dot(linear, direction)
    c = select(leaving, 0.0, dot(near, quadric_matrix_times(quadric, near)) + dot(linear, near) - quadric.constant)
    q = -(b + copysign(sqrt(b * b - a * c), b))
    first = q / a
    second = c / q
    return begin + min(first, second), begin + max(first, second)


@module(number=12, method="raytrace")
def quadric_inside(quadric: Quadric, point: vec3) -> bool:
    """Whether the point is IN: (P-p)^T Q (P-p) + l . (P-p) < r."""
    v = point - quadric.centre
    linear = vec3(quadric.l1, quadric.l2, quadric.l3)
    return dot(v, quadric_matrix_times(quadric, v)) + dot(linear, v) - quadric.constant < 0.0


@module
def quadric_hit(quadric: Quadric, origin: vec3, direction: vec3, leaving: bool) -> f32:
    """The first visible crossing with t > 0 (`crossing.NOWHERE` if there is none)."""
    if quadric.flags & SPHERE != 0:
        enter, leave = sphere_crossings(quadric, origin, direction, leaving)
    else:
        enter, leave = quadric_intersection(quadric, origin, direction, leaving)
    return first_crossing(quadric.flags, enter, leave)


@module
def quadric_normal(quadric: Quadric, origin: vec3, direction: vec3, point: vec3) -> tuple[vec3, vec3]:
    """The outward unit normal, half the gradient made unit, as geometry and for shading."""
    linear = vec3(quadric.l1, quadric.l2, quadric.l3)
    normal = normalize(quadric_matrix_times(quadric, point - quadric.centre) + 0.5 * linear)
    return normal, normal


@module
def quadric_bounds(quadric: Quadric) -> tuple[vec3, vec3]:
    """The box of an ellipsoid (sqrt(r * (Q^-1)_ii) about the centre); the box of everything for any other quadric."""
    c11 = quadric.q2.y * quadric.q3.z - quadric.q3.y * quadric.q2.z
    c22 = quadric.q1.x * quadric.q3.z - quadric.q3.x * quadric.q1.z
    c33 = quadric.q1.x * quadric.q2.y - quadric.q2.x * quadric.q1.y
    determinant = (
        quadric.q1.x * c11
        + quadric.q2.x * (quadric.q3.y * quadric.q1.z - quadric.q1.y * quadric.q3.z)
        + quadric.q3.x * (quadric.q1.y * quadric.q2.z - quadric.q2.y * quadric.q1.z)
    )
    linear = abs(quadric.l1) + abs(quadric.l2) + abs(quadric.l3)
    definite = quadric.q1.x > 0.0 and c33 > 0.0 and determinant > 0.0
    if not (definite and linear == 0.0 and quadric.constant > 0.0):
        return vec3(-FAR), vec3(FAR)
    scale = quadric.constant / determinant
    half = vec3(sqrt(scale * c11), sqrt(scale * c22), sqrt(scale * c33))
    return quadric.centre - half, quadric.centre + half
