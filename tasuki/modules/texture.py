"""Textures that users bring: the material's texture is looked up, and its module gives the colour."""

from tasuki.language import i32, module, socket, vec3
from tasuki.modules.records import Attribute


@socket(dispatch=True)
def texture_colour(kind: i32, index: i32, colour: vec3, point: vec3, normal: vec3) -> vec3:
    """The colour of a texture at a point in local coordinates; `colour` is that of the material.

    The unit normal, for shading, is in the scene's coordinates.
    """
    ...


@module(fills="texture")
def material_texture(attribute: Attribute, point: vec3, normal: vec3) -> vec3:
    """For scenes with textures: the colour of the material's texture, or its own where it has none."""
    colour = attribute.colour
    if attribute.texture >= 0:
        colour = texture_colour(attribute.texture & 31, attribute.texture >> 5, colour, point, normal)
    return colour
