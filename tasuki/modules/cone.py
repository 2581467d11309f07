"""Open cones and cylinders: intersection and what the search needs of the kind. A surface: it has no IN and OUT."""

from tasuki.language import abs, dot, f32, i32, max, min, module, normalize, select, sqrt, vec3
from tasuki.modules.crossing import NOWHERE, first_crossing, quadratic_crossings
from tasuki.modules.parts import ENDLESS, along
from tasuki.modules.records import Cone

LEAST_RISE = 1.0e-6
"""A cone whose axis rises less lies along the planes."""


@module
def cone_intersection(cone: Cone, origin: vec3, direction: vec3, leaving: bool) -> tuple[f32, f32]:
    """The parameters at which the ray enters and leaves the cone between base and apex; NOWHERE or NaN where not.

    With the axis' part taken out of origin and direction the radius equation is a quadratic; origin and roots are
    treated as in module 10. On the cone's other nappe, too, no height lies between base and apex.
    """
    shift = select(leaving, 0.0, dot(cone.base - origin, direction))
    f = origin - cone.base + shift * direction
    height = dot(f, cone.axis)
    rise = dot(direction, cone.axis)
    outward = f - height * cone.axis
    across = direction - rise * cone.axis
    radius = cone.radius + cone.slope * height
    widening = cone.slope * rise
    a = dot(across, across) - widening * widening
    b = dot(outward, across) - radius * widening
    c = select(leaving, 0.0, dot(outward, outward) - radius * radius)
    enter, leave = quadratic_crossings(a, b, c)
    enter_height = height + enter * rise
    leave_height = height + leave * rise
    on_enter = enter_height >= 0.0 and enter_height <= cone.length
    on_leave = leave_height >= 0.0 and leave_height <= cone.length
    return select(on_enter, shift + enter, NOWHERE), select(on_leave, shift + leave, NOWHERE)


@module
def cone_hit(cone: Cone, origin: vec3, direction: vec3, leaving: bool) -> f32:
    """The first visible crossing with t > 0 (`crossing.NOWHERE` if there is none)."""
    enter, leave = cone_intersection(cone, origin, direction, leaving)
    return first_crossing(cone.flags, enter, leave)


@module
def cone_surface(cone: Cone, origin: vec3, direction: vec3, point: vec3) -> tuple[vec3, vec3, i32, i32]:
    """The outward unit normal, as geometry and for shading, and the attribute."""
    f = point - cone.base
    height = dot(f, cone.axis)
    radius = cone.radius + cone.slope * height
    normal = normalize(f - (height + cone.slope * radius) * cone.axis)
    return normal, normal, cone.attribute, cone.matrix


@module
def frustum_bounds(cone: Cone, begin: f32, end: f32) -> tuple[vec3, vec3]:
    """The box of the circles at two heights: a circle reaches radius * sqrt(1 - axis_i^2) along coordinate axis i."""
    reach = vec3(1.0) - cone.axis * cone.axis
    spread = vec3(sqrt(max(reach.x, 0.0)), sqrt(max(reach.y, 0.0)), sqrt(max(reach.z, 0.0)))
    a = cone.base + begin * cone.axis
    b = cone.base + end * cone.axis
    a_spread = abs(cone.radius + cone.slope * begin) * spread
    b_spread = abs(cone.radius + cone.slope * end) * spread
    return min(a - a_spread, b - b_spread), max(a + a_spread, b + b_spread)


@module
def cone_bounds(cone: Cone) -> tuple[vec3, vec3]:
    """The box of the two end circles."""
    return frustum_bounds(cone, 0.0, cone.length)


@module
def cone_part(cone: Cone, axis: i32, low: f32, high: f32) -> tuple[vec3, vec3]:
    """The box of the circles that reach between two planes, taken as wide as the widest."""
    rise = along(cone.axis, axis)
    widest = max(abs(cone.radius), abs(cone.radius + cone.slope * cone.length)) * sqrt(max(1.0 - rise * rise, 0.0))
    begin = 0.0
    end = cone.length
    if abs(rise) > LEAST_RISE:
        at_low = (low - widest - along(cone.base, axis)) / rise
        at_high = (high + widest - along(cone.base, axis)) / rise
        begin = max(begin, min(at_low, at_high))
        end = min(end, max(at_low, at_high))
    part_low, part_high = frustum_bounds(cone, begin, end)
    if begin > end:
        part_low, part_high = vec3(ENDLESS), vec3(-ENDLESS)
    return part_low, part_high
