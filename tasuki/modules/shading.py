"""Light on a surface: diffuse and highlight components (module 3), and luminance accumulation (module 7)."""

from tasuki.language import dot, max, module, socket, vec3
from tasuki.modules.directions import reflection_direction
from tasuki.modules.elementary import power
from tasuki.modules.records import Attribute


@socket
def shading(attribute: Attribute, normal: vec3, direction: vec3, to_light: vec3, light_colour: vec3) -> vec3:
    """The light that one lamp sends from a surface towards the viewer.

    `direction` is that of the arriving ray, `normal` faces it, `to_light` leads to the lamp; all have unit length.
    """
    ...


@module(number=3, method="raytrace", fills="shading")
def diffuse_and_highlight(
    attribute: Attribute, normal: vec3, direction: vec3, to_light: vec3, light_colour: vec3
) -> vec3:
    """Lambert's diffuse component and Phong's highlight (B. T. Phong, "Illumination for Computer Generated Pictures",
    1975).
    """
    diffuse = attribute.diffuse * max(dot(normal, to_light), 0.0)
    highlight = 0.0
    if attribute.specular > 0.0:
        mirrored = reflection_direction(direction, normal)
        highlight = attribute.specular * power(max(dot(mirrored, to_light), 0.0), attribute.exponent)
    return light_colour * (diffuse * attribute.colour + vec3(highlight))


@module(number=7, method="raytrace")
def accumulate_luminance(luminance: vec3, weight: vec3, contribution: vec3) -> vec3:
    """The luminance so far and a contribution, weighted by what the path has let through."""
    return luminance + weight * contribution
