"""Clipping in homogeneous coordinates, before division (module 4).

I. E. Sutherland and G. W. Hodgman, "Reentrant Polygon Clipping", 1974; before division as in J. F. Blinn and
M. E. Newell, "Clipping Using Homogeneous Coordinates", 1978. Points are (x, y, w): x / w and y / w are pixels.
"""

from tasuki.language import f32, i32, module, vec3
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
def crossing(inside: vec3, outside: vec3, near: f32, far: f32) -> vec3:
    """Where the way from a point inside to one outside meets a side; their distances are `near` >= 0 and `far` < 0.

    Always from the inside: the faces on both sides of an edge cut it in one point, to the last bit.
    """
    return inside + near / (near - far) * (outside - inside)
