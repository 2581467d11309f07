"""Matrix to the reference coordinate system (module 1), and the lights in it (module 2)."""

from tasuki.language import cross, dot, f32, i32, mat4, module, normalize, select, vec3, vec4
from tasuki.modules.records import DIRECTIONAL, Light, View, lights, views
from tasuki.modules.scanline.records import (
    Frame,
    FrameCounts,
    RowBucket,
    frame_counts,
    frames,
    reference_lights,
    row_buckets,
)


@module(number=1, method="scanline")
def reference_matrix(view: View) -> mat4:
    """From the scene's coordinates to the reference system's, for row vectors.

    Its axes have unit length: x along the rows of the picture, y along its columns, z along the view.
    """
    forward = view.corner + 0.5 * f32(view.width) * view.right + 0.5 * f32(view.height) * view.down
    x = normalize(view.right)
    y = normalize(view.down)
    z = normalize(forward)
    return mat4(
        vec4(x, -dot(x, view.eye)), vec4(y, -dot(y, view.eye)), vec4(z, -dot(z, view.eye)), vec4(0.0, 0.0, 0.0, 1.0)
    )


@module
def normal_matrix(m: mat4) -> mat4:
    """What `m` does to normals, but for their length: its cofactors, the transposed inverse times the determinant."""
    x = m.column(0).xyz
    y = m.column(1).xyz
    z = m.column(2).xyz
    return mat4(vec4(cross(y, z), 0.0), vec4(cross(z, x), 0.0), vec4(cross(x, y), 0.0), vec4(0.0, 0.0, 0.0, 1.0))


@module(number=2, method="scanline")
def light_to_reference(light: Light, reference_from_scene: mat4) -> Light:
    """A light in the reference system: the place of a lamp, the direction to a light that is far away."""
    place = vec4(light.position, select(light.kind == DIRECTIONAL, 0.0, 1.0))
    moved = place @ reference_from_scene
    return Light(moved.xyz, light.kind, light.colour)


@module
def begin_frame(item: i32):
    """The frame's matrices, its lights, and counts of nothing yet. Runs on one lane."""
    reference_from_scene = reference_matrix(views[0])
    reference_from_object = frames[0].scene_from_object @ reference_from_scene
    frames[0].reference_from_scene = reference_from_scene
    frames[0].reference_from_object = reference_from_object
    frames[0].reference_from_normal = normal_matrix(reference_from_object)
    for n in range(len(lights)):
        reference_lights[n] = light_to_reference(lights[n], reference_from_scene)
    frame_counts[0] = FrameCounts(0, 0)
    for row in range(views[0].region_height):
        row_buckets[row] = RowBucket(0, 0, 0)


@module
def sample_direction(view: View, frame: Frame, column: i32, row: i32) -> vec3:
    """The direction, in reference coordinates with z = 1, in which the sample of a pixel of the region lies."""
    x = f32(view.region_x + column) + f32(frame.sample_x) / 4096.0 - 0.5 * f32(view.width)
    y = f32(view.region_y + row) + f32(frame.sample_y) / 4096.0 - 0.5 * f32(view.height)
    return vec3(x * frame.pixel, y * frame.pixel, 1.0)


@module
def quads_across(view: View) -> i32:
    """How many quadruples of pixels a row of the region takes."""
    return view.region_width + 3 >> 2
