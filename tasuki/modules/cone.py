"""Open cones and cylinders: intersection and what the search needs of the kind. A surface: it has no IN and OUT."""

from tasuki.language import abs, copysign, dot, f32, i32, max, min, module, normalize, select, sqrt, vec3
from tasuki.modules.crossing import NOWHERE, first_crossing
from tasuki.modules.records import Cone


@module
def cone_crossings(cone: Cone, origin: vec3, direction: vec3, leaving: bool) -> tuple[f32, f32]:
    """The parameters, in order, at which the ray meets the infinite cone (both nappes); NaN where it does not.

    With the axis' part taken out of origin and direction the radius equation is a quadratic; origin and roots are
    treated as in module 10.
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
    q = -(b + copysign(sqrt(b * b - a * c), b))
    first = q / a
    second = c / q
    return shift + min(first, second), shift + max(first, second)


@module
def on_cone(cone: Cone, origin: vec3, direction: vec3, t: f32) -> bool:
    """Whether the point at t lies between base and apex."""
    height = dot(origin + t * direction - cone.base, cone.axis)
    return height >= 0.0 and height <= cone.length


@module
def faces_out(cone: Cone, origin: vec3, direction: vec3, t: f32) -> bool:
    """Whether the ray meets the outside of the cone at t."""
    f = origin + t * direction - cone.base
    height = dot(f, cone.axis)
    radius = cone.radius + cone.slope * height
    return dot(f - (height + cone.slope * radius) * cone.axis, direction) < 0.0


@module
def cone_hit(cone: Cone, origin: vec3, direction: vec3, leaving: bool) -> f32:
    """The first visible crossing with t > 0 between base and apex (`crossing.NOWHERE` if there is none)."""
    near, far = cone_crossings(cone, origin, direction, leaving)
    hit = NOWHERE
    if on_cone(cone, origin, direction, far):
        out = faces_out(cone, origin, direction, far)
        hit = first_crossing(cone.flags, select(out, far, NOWHERE), select(out, NOWHERE, far))
    if on_cone(cone, origin, direction, near):
        out = faces_out(cone, origin, direction, near)
        nearer = first_crossing(cone.flags, select(out, near, NOWHERE), select(out, NOWHERE, near))
        hit = min(nearer, hit)
    return hit


@module
def cone_surface(cone: Cone, origin: vec3, direction: vec3, point: vec3) -> tuple[vec3, vec3, i32]:
    """The outward unit normal, as geometry and for shading, and the attribute."""
    f = point - cone.base
    height = dot(f, cone.axis)
    radius = cone.radius + cone.slope * height
    normal = normalize(f - (height + cone.slope * radius) * cone.axis)
    return normal, normal, cone.attribute


@module
def cone_bounds(cone: Cone) -> tuple[vec3, vec3]:
    """The box of the two end circles: a circle reaches radius * sqrt(1 - axis_i^2) along coordinate axis i."""
    apex = cone.base + cone.length * cone.axis
    reach = vec3(1.0) - cone.axis * cone.axis
    spread = vec3(sqrt(max(reach.x, 0.0)), sqrt(max(reach.y, 0.0)), sqrt(max(reach.z, 0.0)))
    base_spread = abs(cone.radius) * spread
    apex_spread = abs(cone.radius + cone.slope * cone.length) * spread
    return min(cone.base - base_spread, apex - apex_spread), max(cone.base + base_spread, apex + apex_spread)
