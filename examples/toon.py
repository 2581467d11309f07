"""A shading module of one's own: light in three flat steps, without highlights.

tasuki render tests/data/still_life.nff --module shading=examples/toon.py:toon
"""

from tasuki.language import dot, floor, max, module, vec3
from tasuki.modules.records import Attribute


@module(fills="shading")
def toon(attribute: Attribute, normal: vec3, direction: vec3, to_light: vec3, light_colour: vec3) -> vec3:
    """Lambert's diffuse component, rounded to thirds."""
    steps = floor(3.0 * max(dot(normal, to_light), 0.0) + 0.5) / 3.0
    return attribute.diffuse * steps * light_colour * attribute.colour
