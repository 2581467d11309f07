"""Directions of rays: the view direction (module 2) and the mirror direction (module 4)."""

from tasuki.language import dot, f32, module, normalize, vec3
from tasuki.modules.records import View


@module(number=2, method="raytrace")
def view_direction(view: View, x: f32, y: f32) -> vec3:
    """The unit direction from the eye through (x, y) of the picture, in pixels from its upper left corner."""
    return normalize(view.corner + x * view.right + y * view.down)


@module(number=4, method="raytrace")
def reflection_direction(direction: vec3, normal: vec3) -> vec3:
    """`direction` mirrored at a surface with this unit normal; as long as `direction` is."""
    return direction - (2.0 * dot(direction, normal)) * normal
