"""Planes: intersection (module 9), IN/OUT (11), and what the search needs of the kind."""

from tasuki.language import dot, f32, i32, module, select, vec3
from tasuki.modules.crossing import NOWHERE, first_crossing
from tasuki.modules.records import Plane

FAR = 1.0e30


@module(number=9, method="raytrace")
def plane_intersection(plane: Plane, origin: vec3, direction: vec3) -> f32:
    """The parameter t at which origin + t * direction lies in the plane; infinite or NaN for a parallel ray."""
    return -(dot(plane.normal, origin) + plane.d) / dot(plane.normal, direction)


@module(number=11, method="raytrace")
def plane_inside(plane: Plane, point: vec3) -> bool:
    """Whether the point is IN: n . P + d < 0."""
    return dot(plane.normal, point) + plane.d < 0.0


@module
def plane_span(plane: Plane, origin: vec3, direction: vec3, leaving: bool, t: f32) -> tuple[bool, bool, f32]:
    """Whether the ray is IN just before and just after t, and where it next changes; a parallel ray never does."""
    height = dot(plane.normal, origin) + plane.d
    slope = dot(plane.normal, direction)
    crossing = select(leaving, 0.0, -height / slope)
    before = select(slope < 0.0, crossing < t, t <= crossing)
    after = select(slope < 0.0, crossing <= t, t < crossing)
    parallel = slope == 0.0
    inside = plane_inside(plane, origin)
    coming = select(not parallel and crossing > t, crossing, NOWHERE)
    return select(parallel, inside, before), select(parallel, inside, after), coming


@module
def plane_normal(plane: Plane, point: vec3) -> vec3:
    """The outward unit normal."""
    return plane.normal


@module
def plane_hit(plane: Plane, origin: vec3, direction: vec3, leaving: bool) -> f32:
    """The first visible crossing; none for a ray that begins in the plane (`leaving`)."""
    t = plane_intersection(plane, origin, direction)
    falls = dot(plane.normal, direction) < 0.0
    enter = select(falls, t, NOWHERE)
    leave = select(falls, NOWHERE, t)
    return select(leaving, NOWHERE, first_crossing(plane.flags, enter, leave))


@module
def plane_surface(plane: Plane, origin: vec3, direction: vec3, point: vec3) -> tuple[vec3, vec3, i32, i32]:
    """The outward normal, as geometry and for shading; the attribute and the matrix."""
    return plane.normal, plane.normal, plane.attribute, plane.matrix


@module
def plane_bounds(plane: Plane) -> tuple[vec3, vec3]:
    """A plane has no bounds: the box of everything."""
    return vec3(-FAR), vec3(FAR)
