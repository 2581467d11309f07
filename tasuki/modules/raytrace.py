"""Whitted's ray tracing, assembled from the modules (paper, section 6, Figure 9): one pixel.

T. Whitted, "An Improved Illumination Model for Shaded Display", 1980.
"""

from tasuki.language import dot, f32, floor, i32, module, norm, reciprocal, record, socket, vec3
from tasuki.modules.crossing import NOWHERE
from tasuki.modules.directions import view_direction
from tasuki.modules.records import (
    DIRECTIONAL,
    Attribute,
    Light,
    Pixel,
    RayCounts,
    View,
    lights,
    picture,
    ray_counts,
    views,
)
from tasuki.modules.search import is_blocked
from tasuki.modules.shading import shading
from tasuki.modules.surface import Surface

GOLDEN_X = 0.7548776662466927
GOLDEN_Y = 0.5698402909980532


@record
class Traced:
    """What came back along an eye ray, and the rays that were sent for it."""

    luminance: vec3
    eye_hits: i32
    reflection: i32
    refraction: i32
    shadow: i32


@socket
def traced_light(view: View, eye_direction: vec3) -> Traced:
    """Follow an eye ray, and the rays that it causes, for `view.depth` generations."""
    ...


@module
def light_way(light: Light, start: vec3) -> tuple[vec3, f32]:
    """The unit direction to a light, and how far it is."""
    if light.kind == DIRECTIONAL:
        return light.position, NOWHERE
    way = light.position - start
    distance = norm(way)
    return way * reciprocal(distance), distance


@module
def direct_light(attribute: Attribute, surface: Surface, start: vec3, direction: vec3) -> tuple[vec3, i32]:
    """What all lamps send from a surface towards the viewer, and how many shadow rays that took.

    A lamp behind the surface gets no shadow ray.
    """
    luminance = attribute.ambient * attribute.colour
    rays = 0
    for n in range(len(lights)):
        light = lights[n]
        to_light, distance = light_way(light, start)
        if dot(surface.normal, to_light) > 0.0:
            rays += 1
            if not is_blocked(start, to_light, surface.code, distance):
                luminance = luminance + shading(attribute, surface.normal, direction, to_light, light.colour)
    return luminance, rays


@module
def sample_offset(sample: i32, step: f32) -> f32:
    """Place of a sample within its pixel, 0..1 along one axis; the first is the middle.

    Multiples of the plastic number's powers (M. Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences",
    2018).
    """
    shifted = 0.5 + f32(sample) * step
    return shifted - floor(shifted)


@module
def eye_direction(view: View, place: i32, sample: i32) -> vec3:
    """The direction of an eye ray through the pixel of the region at row `place // 65536`, column `place % 65536`."""
    # From row 32768 on `place` is negative: the shift brings copies of its sign.
    x = f32(view.region_x + (place & 65535)) + sample_offset(sample, GOLDEN_X)
    y = f32(view.region_y + (place >> 16 & 65535)) + sample_offset(sample, GOLDEN_Y)
    return view_direction(view, x, y)


@module
def trace_pixel(place: i32):
    """Render the pixel of the region at row `place // 65536` and column `place % 65536` into the picture."""
    view = views[0]
    total = Traced(vec3(0.0), 0, 0, 0, 0)
    for sample in range(view.samples):
        traced = traced_light(view, eye_direction(view, place, sample))
        total.luminance = total.luminance + traced.luminance
        total.eye_hits += traced.eye_hits
        total.reflection += traced.reflection
        total.refraction += traced.refraction
        total.shadow += traced.shadow
    share = reciprocal(f32(view.samples))
    index = (place >> 16 & 65535) * view.region_width + (place & 65535)
    picture[index] = Pixel(share * total.luminance, share * f32(total.eye_hits))
    ray_counts[index] = RayCounts(total.eye_hits, total.reflection, total.refraction, total.shadow)
