"""Surfaces of users' kinds: each is an object of its own, and stands in local coordinates, as users' solids do.

An object with the flag SURFACE has one literal, whose kind has no inside: it is asked through the sockets of primitives
that stand alone, by a ray in its own coordinates.
"""

from tasuki.language import f32, i32, module, vec3
from tasuki.modules.frames import local_ray, normal_from_local
from tasuki.modules.objects import facet_of_anything, hit_of_anything
from tasuki.modules.records import SURFACE, objects, tokens
from tasuki.modules.search import OBJECT, primitive_hit
from tasuki.modules.surface import Facet, primitive_surface


@module
def is_local_surface(code: i32) -> bool:
    """Whether a thing is an object that is a surface."""
    is_surface = False
    if code & 31 == OBJECT:
        is_surface = objects[code >> 5].flags & SURFACE != 0
    return is_surface


@module
def local_surface_hit(index: i32, origin: vec3, direction: vec3, left: i32) -> f32:
    """The first visible crossing of an object that is a surface, with t > 0, or NOWHERE (or NaN)."""
    token = tokens[objects[index].first]
    place, along = local_ray(token.matrix, origin, direction)
    return primitive_hit(token.operand & 31, token.operand >> 5, place, along, left == token.operand)


@module
def local_surface_facet(index: i32, origin: vec3, direction: vec3, t: f32) -> Facet:
    """The surface where a ray has hit an object that is one, at t."""
    token = tokens[objects[index].first]
    place, along = local_ray(token.matrix, origin, direction)
    geometry, normal, attribute, matrix = primitive_surface(
        token.operand & 31, token.operand >> 5, place, along, place + t * along
    )
    outward = normal_from_local(token.matrix, geometry)
    return Facet(outward, normal_from_local(token.matrix, normal), attribute, matrix, token.operand)


@module(fills="hit_of")
def hit_with_local_surfaces(code: i32, origin: vec3, direction: vec3, left: i32, far: f32) -> f32:
    """For scenes with surfaces of users' kinds."""
    if is_local_surface(code):
        t = local_surface_hit(code >> 5, origin, direction, left)
    else:
        t = hit_of_anything(code, origin, direction, left, far)
    return t


@module(fills="facet_of")
def facet_with_local_surfaces(code: i32, origin: vec3, direction: vec3, t: f32, left: i32) -> Facet:
    """For scenes with surfaces of users' kinds."""
    if is_local_surface(code):
        facet = local_surface_facet(code >> 5, origin, direction, t)
    else:
        facet = facet_of_anything(code, origin, direction, t, left)
    return facet
