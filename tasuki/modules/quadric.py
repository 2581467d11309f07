"""Quadrics, spheres among them: intersection (module 10), IN/OUT (12), and what the search needs of the kind."""

from tasuki.language import abs, cross, dot, f32, i32, max, min, module, normalize, select, sqrt, vec3
from tasuki.modules.crossing import NOWHERE, first_crossing, quadratic_crossings
from tasuki.modules.parts import ENDLESS, along, with_component
from tasuki.modules.records import SPHERE, Quadric

FAR = 1.0e30
ROUNDING = 1.9073486e-6
"""2**-19: relative error, with room to spare, of a determinant of well-conditioned numbers."""


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
    half = select(leaving, abs(middle), sqrt(quadric.constant - dot(aside, aside)))
    return middle - half, middle + half


@module(number=10, method="raytrace")
def quadric_intersection(quadric: Quadric, origin: vec3, direction: vec3, leaving: bool) -> tuple[f32, f32]:
    """The parameters at which origin + t * direction enters and leaves the quadric; NaN where it does not.

    The origin is first moved to the ray's nearest point to the centre. A ray that starts on the surface (`leaving`) has
    one crossing at exactly 0. Where the ray's ends lie inside (a hyperboloid's), it leaves before it enters.
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
    enter, leave = quadratic_crossings(a, b, c)
    return begin + enter, begin + leave


@module(number=12, method="raytrace")
def quadric_inside(quadric: Quadric, point: vec3) -> bool:
    """Whether the point is IN: (P-p)^T Q (P-p) + l . (P-p) < r."""
    v = point - quadric.centre
    linear = vec3(quadric.l1, quadric.l2, quadric.l3)
    return dot(v, quadric_matrix_times(quadric, v)) + dot(linear, v) - quadric.constant < 0.0


@module
def quadric_span(quadric: Quadric, origin: vec3, direction: vec3, leaving: bool, t: f32) -> tuple[bool, bool, f32]:
    """Whether the ray is IN just before and just after t, and where it next changes.

    A ray that crosses nowhere is IN all the way or not at all: where it comes nearest to the centre decides.
    """
    if quadric.flags & SPHERE != 0:
        enter, leave = sphere_crossings(quadric, origin, direction, leaving)
        inside = False
    else:
        enter, leave = quadric_intersection(quadric, origin, direction, leaving)
        inside = quadric_holds_line(quadric, origin, direction, leaving)
    convex = enter <= leave
    before = select(convex, enter < t and t <= leave, enter < t or t <= leave)
    after = select(convex, enter <= t and t < leave, enter <= t or t < leave)
    crosses = convex or leave < enter
    coming = min(select(enter > t, enter, NOWHERE), select(leave > t, leave, NOWHERE))
    return select(crosses, before, inside), select(crosses, after, inside), coming


@module
def quadric_holds_line(quadric: Quadric, origin: vec3, direction: vec3, leaving: bool) -> bool:
    """Whether a line that does not cross the quadric lies inside; one that touches it where it leaves lies inside
    where the quadric bends away from it on both sides.
    """
    middle = origin - (dot(origin - quadric.centre, direction) / dot(direction, direction)) * direction
    bend = dot(direction, quadric_matrix_times(quadric, direction))
    return select(leaving, bend < 0.0, quadric_inside(quadric, middle))


@module
def quadric_normal(quadric: Quadric, point: vec3) -> vec3:
    """The outward unit normal: half the gradient made unit."""
    linear = vec3(quadric.l1, quadric.l2, quadric.l3)
    return normalize(quadric_matrix_times(quadric, point - quadric.centre) + 0.5 * linear)


@module
def sphere_hit(quadric: Quadric, origin: vec3, direction: vec3, leaving: bool) -> f32:
    """`quadric_hit` for a quadric with the flag SPHERE."""
    enter, leave = sphere_crossings(quadric, origin, direction, leaving)
    return first_crossing(quadric.flags, enter, leave)


@module
def quadric_hit(quadric: Quadric, origin: vec3, direction: vec3, leaving: bool) -> f32:
    """The first visible crossing with t > 0 (`crossing.NOWHERE` if there is none)."""
    if quadric.flags & SPHERE != 0:
        t = sphere_hit(quadric, origin, direction, leaving)
    else:
        enter, leave = quadric_intersection(quadric, origin, direction, leaving)
        t = first_crossing(quadric.flags, enter, leave)
    return t


@module
def quadric_surface(quadric: Quadric, origin: vec3, direction: vec3, point: vec3) -> tuple[vec3, vec3, i32, i32]:
    """The outward unit normal, as geometry and for shading; the attribute and the matrix."""
    normal = quadric_normal(quadric, point)
    return normal, normal, quadric.attribute, quadric.matrix


@module
def quadric_bounds(quadric: Quadric) -> tuple[vec3, vec3]:
    """The box of an ellipsoid; the box of everything for any other quadric.

    Completing the square moves the centre to p - Q^-1 l / 2 and r to r + l^T Q^-1 l / 4; along axis i an ellipsoid
    reaches sqrt(r (Q^-1)_ii). The box is widened by what rounding may do to Q^-1, which grows with Q's condition.
    """
    column1 = cross(quadric.q2, quadric.q3)
    column2 = cross(quadric.q3, quadric.q1)
    column3 = cross(quadric.q1, quadric.q2)
    determinant = dot(quadric.q1, column1)
    size = dot(quadric.q1, quadric.q1) + dot(quadric.q2, quadric.q2) + dot(quadric.q3, quadric.q3)
    doubt = ROUNDING * size * sqrt(size) / abs(determinant)
    # Q is definite if its leading minors have the signs + + + or - + -.
    definite = column3.z > 0.0 and quadric.q1.x * determinant > 0.0
    low = vec3(-FAR)
    high = vec3(FAR)
    if definite and doubt < 0.5:
        linear = vec3(quadric.l1, quadric.l2, quadric.l3) * (0.5 / determinant)
        shift = vec3(dot(column1, linear), dot(column2, linear), dot(column3, linear))
        constant = quadric.constant + determinant * dot(linear, shift)
        scale = max(constant / determinant, 0.0)
        half = vec3(sqrt(scale * column1.x), sqrt(scale * column2.y), sqrt(scale * column3.z)) * (1.0 + doubt)
        low = quadric.centre - shift * (1.0 + doubt) - half
        high = quadric.centre - shift * (1.0 - doubt) + half
        low = min(low, quadric.centre - shift * (1.0 - doubt) - half)
        high = max(high, quadric.centre - shift * (1.0 + doubt) + half)
    return low, high


@module
def quadric_part(quadric: Quadric, axis: i32, low: f32, high: f32) -> tuple[vec3, vec3]:
    """The box of what lies between two planes, of a sphere; of any other quadric, of everything there."""
    if quadric.flags & SPHERE == 0:
        return vec3(-ENDLESS), vec3(ENDLESS)
    middle = along(quadric.centre, axis)
    away = max(max(low - middle, middle - high), 0.0)
    rest = quadric.constant - away * away
    if rest < 0.0:
        return vec3(ENDLESS), vec3(-ENDLESS)
    reach = with_component(vec3(sqrt(rest)), axis, sqrt(quadric.constant))
    return quadric.centre - reach, quadric.centre + reach
