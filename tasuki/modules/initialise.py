"""Object data initialisation (module 1): what the search must know of the primitives before the first ray."""

from tasuki.language import f32, i32, module, socket, vec3
from tasuki.modules.records import Box, boxes


@socket(dispatch=True)
def primitive_bounds(kind: i32, index: i32) -> tuple[vec3, vec3]:
    """The least and greatest corner of a box around a primitive."""
    ...


@module(number=1, method="raytrace")
def initialise_object(item: i32, code: i32, cost: f32):
    """Enter the bounds of primitive `code` (index * 32 + kind), and its cost, as box number `item`."""
    low, high = primitive_bounds(code & 31, code >> 5)
    boxes[item] = Box(low, code, high, cost)
