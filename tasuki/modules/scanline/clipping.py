"""Clipping in homogeneous coordinates, before division (module 4).

I. E. Sutherland and G. W. Hodgman, "Reentrant Polygon Clipping", 1974; before division as in J. F. Blinn and
M. E. Newell, "Clipping Using Homogeneous Coordinates", 1978. Points are (x, y, w): x / w and y / w are pixels.
"""

from tasuki.language import f32, i32, module, select, vec3
from tasuki.modules.records import View
from tasuki.modules.scanline.records import Frame

SIDES = 5
"""Near plane, left, right, upper and lower side; in this order they are bits of an outcode."""
MOST_CORNERS = 3 + SIDES
"""Each side cuts off a corner, and thereby adds one at most."""


@module
def distance_inside(point: vec3, side: i32, view: View, frame: Frame) -> f32:
    """How far within one side of the view a homogeneous point lies, times a factor that depends on the side alone."""
    if side == 0:
        return point.z - frame.near
    if side == 1:
        return point.x
    if side == 2:
        return f32(view.width) * point.z - point.x
    if side == 3:
        return point.y
    return f32(view.height) * point.z - point.y


@module
def outcode(point: vec3, view: View, frame: Frame) -> i32:
    """The sides of the view that a homogeneous point lies beyond, one bit for each."""
    code = 0
    for side in range(SIDES):
        if not distance_inside(point, side, view, frame) >= 0.0:
            code = code | 1 << side
    return code


@module
def crossing(a: vec3, a_distance: f32, b: vec3, b_distance: f32) -> vec3:
    """Where the way between a point within a side (its distance not negative) and one beyond meets that side.

    Always reckoned from the one within: the faces on both sides of an edge cut it in one point, to the last bit.
    """
    from_a = a_distance >= 0.0
    inside = select(from_a, a, b)
    outside = select(from_a, b, a)
    near = select(from_a, a_distance, b_distance)
    far = select(from_a, b_distance, a_distance)
    return inside + near / (near - far) * (outside - inside)
