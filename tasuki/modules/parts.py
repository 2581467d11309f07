"""Parts of primitives between two planes across a coordinate axis: what the hierarchy's builder cuts them into."""

from tasuki.language import f32, i32, max, min, module, socket, vec3
from tasuki.modules.records import Box

ENDLESS = 3.0e38
"""A box from ENDLESS to -ENDLESS is empty, one from -ENDLESS to ENDLESS holds everything."""


@socket(dispatch=True)
def primitive_part(kind: i32, index: i32, axis: i32, low: f32, high: f32) -> tuple[vec3, vec3]:
    """A box around the part of a primitive between the planes at `low` and `high` across a coordinate axis (0, 1, 2).

    Along that axis the box may reach beyond the planes. Of an empty part, some low corner lies above the high one.
    """
    ...


@module
def whole_thing(_box: Box, axis: i32, low: f32, high: f32) -> tuple[vec3, vec3]:
    """For things of which no part is known: whatever lies between the planes. The box, any row of it, is not read."""
    return vec3(-ENDLESS), vec3(ENDLESS)


@module
def along(v: vec3, axis: i32) -> f32:
    """The component of v along a coordinate axis 0, 1, 2."""
    if axis == 0:
        return v.x
    if axis == 1:
        return v.y
    return v.z


@module
def with_component(v: vec3, axis: i32, value: f32) -> vec3:
    """v, its component along a coordinate axis exchanged."""
    if axis == 0:
        return vec3(value, v.y, v.z)
    if axis == 1:
        return vec3(v.x, value, v.z)
    return vec3(v.x, v.y, value)


@module
def segment_part(p: vec3, q: vec3, axis: i32, low: f32, high: f32) -> tuple[vec3, vec3]:
    """The box around the part of a line segment, as `primitive_part`. An end that lies in it is kept to the bit."""
    begin = along(p, axis)
    reach = along(q, axis) - begin
    first = p
    last = q
    if reach < 0.0:
        first = q
        last = p
    if along(last, axis) < low or along(first, axis) > high:
        return vec3(ENDLESS), vec3(-ENDLESS)
    if along(first, axis) < low:
        first = p + (low - begin) / reach * (q - p)
    if along(last, axis) > high:
        last = p + (high - begin) / reach * (q - p)
    return min(first, last), max(first, last)
