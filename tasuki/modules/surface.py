"""The surface where a ray has hit something: its normals, its material, its texture."""

from tasuki.language import abs, dot, f32, i32, max, module, record, socket, vec3
from tasuki.modules.frames import local_point
from tasuki.modules.records import Attribute, attributes, views

LIFT = 1.9073486e-6
"""2**-19: four times the relative error of a hit point and of the way to it. So far from a flat face a ray begins
outside the face's box, which is widened by the slab test's error, and need not search the face and its neighbours.
"""


@record
class Facet:
    """What a thing is where a ray has hit it: unit normals of the geometry and for shading, its attribute, the matrix
    of its local coordinates (-1: none of its own), and the code by which a ray that leaves here knows the surface.
    """

    geometry: vec3
    normal: vec3
    attribute: i32
    matrix: i32
    code: i32


@record
class Surface:
    """A point that a ray has hit. The normals face the side from which the ray came; `entering`: that is the front.

    `code` is what rays that go on from here have `left`.
    """

    point: vec3
    geometry: vec3
    normal: vec3
    attribute: i32
    entering: bool
    matrix: i32
    code: i32


@socket(dispatch=True)
def primitive_surface(
    kind: i32, index: i32, origin: vec3, direction: vec3, point: vec3
) -> tuple[vec3, vec3, i32, i32]:
    """At a point of a primitive that this ray has hit: the unit normals of the geometry and for shading; the attribute
    and the matrix.
    """
    ...


@socket
def facet_of(code: i32, origin: vec3, direction: vec3, t: f32, left: i32) -> Facet:
    """The facet of thing `code` that a ray, which began on surface `left`, has hit at t."""
    ...


@socket
def texture(attribute: Attribute, point: vec3, normal: vec3) -> vec3:
    """The colour of a material at a point in local coordinates; the normal, for shading, is in the scene's."""
    ...


@module(fills="facet_of")
def facet_of_primitive(code: i32, origin: vec3, direction: vec3, t: f32, left: i32) -> Facet:
    """For scenes without objects."""
    point = origin + t * direction
    geometry, normal, attribute, matrix = primitive_surface(code & 31, code >> 5, origin, direction, point)
    return Facet(geometry, normal, attribute, matrix, code)


@module(fills="texture")
def plain_texture(attribute: Attribute, point: vec3, normal: vec3) -> vec3:
    """The material's own colour everywhere."""
    return attribute.colour


@module
def surface_at(origin: vec3, direction: vec3, t: f32, hit: i32, left: i32) -> Surface:
    """The surface where a ray, which began on surface `left`, has hit thing `hit` at t."""
    facet = facet_of(hit, origin, direction, t, left)
    entering = dot(facet.geometry, direction) <= 0.0
    geometry = facet.geometry
    normal = facet.normal
    if not entering:
        geometry = -geometry
        normal = -normal
    return Surface(
        origin + t * direction, geometry, normal, facet.attribute, entering, facet.matrix, facet.code
    )


@module
def lift(surface: Surface, t: f32) -> vec3:
    """From the hit point to where rays leave the surface: along its normal, beyond the error bound of the point."""
    size = max(max(abs(surface.point.x), abs(surface.point.y)), max(abs(surface.point.z), t))
    return (size * LIFT) * surface.geometry


@module
def material_of(surface: Surface) -> Attribute:
    """What the surface is made of at this point: its attribute, coloured by the texture."""
    attribute = attributes[surface.attribute]
    if surface.matrix >= 0:
        place = local_point(surface.matrix, surface.point)
    else:
        place = surface.point + views[0].origin
    attribute.colour = texture(attribute, place, surface.normal)
    return attribute
