"""Which media lie before and behind a crossing: the dielectrics that a ray leaves and enters.

A medium is the attribute of a transparent solid, or NOTHING, which is air. Where solids overlap, the one that comes
first in the scene rules, as with nested dielectrics by priority (C. M. Schmidt, B. Budge, "Simple Nested Dielectrics in
Ray Traced Images", 2002); where they touch, a ray is refracted once, from the one into the other.
"""

from tasuki.language import any_lane, f32, i32, module, select, socket, vec3
from tasuki.modules.crossing import NOWHERE
from tasuki.modules.formula import intersection_validity, solid_span
from tasuki.modules.records import attributes, media, objects
from tasuki.modules.search import NOTHING, OBJECT
from tasuki.modules.slabs import slab_entry, slab_ray
from tasuki.modules.surface import Surface


@socket
def media_at(origin: vec3, direction: vec3, left: i32, t: f32, surface: Surface) -> tuple[i32, i32]:
    """The media before and behind the surface that a ray, which began on surface `left`, has hit at t."""
    ...


@module
def index_of(medium: i32) -> f32:
    """The refractive index of a medium."""
    index = 1.0
    if medium != NOTHING:
        index = attributes[medium].index
    return index


@module(fills="media_at")
def own_medium(origin: vec3, direction: vec3, left: i32, t: f32, surface: Surface) -> tuple[i32, i32]:
    """For scenes in which no transparent solid meets another thing: the surface's own medium behind its front, air
    before it.
    """
    medium = select(attributes[surface.attribute].transmission > 0.0, surface.attribute, NOTHING)
    return select(surface.entering, NOTHING, medium), select(surface.entering, medium, NOTHING)


@module
def solid_around(
    code: i32, origin: vec3, direction: vec3, inverse: vec3, shifted: vec3, left: i32, t: f32
) -> tuple[bool, bool]:
    """Whether a ray is inside of a solid just before and just after t."""
    if code & 31 == OBJECT:
        before, after, _row = intersection_validity(objects[code >> 5], origin, direction, inverse, shifted, left, t)
    else:
        before, after, _coming = solid_span(code & 31, code >> 5, origin, direction, left == code, t)
    return before, after


@module(fills="media_at")
def nested_media(origin: vec3, direction: vec3, left: i32, t: f32, surface: Surface) -> tuple[i32, i32]:
    """For scenes in which transparent solids meet other things: asks each of the former, the first of all first.

    What belongs to none of them is as in `own_medium`.
    """
    inverse, shifted = slab_ray(origin, direction)
    before, after = own_medium(origin, direction, left, t, surface)
    for back in range(len(media)):
        medium = media[len(media) - 1 - back]
        enter, leave = slab_entry(medium.low, medium.high, inverse, shifted, NOWHERE)
        if any_lane(enter <= t and t <= leave):
            was, will = solid_around(medium.code, origin, direction, inverse, shifted, left, t)
            before = select(was, medium.attribute, before)
            after = select(will, medium.attribute, after)
    return before, after
