"""Intersection search through a bounding volume hierarchy, for packets with one shared stack (modules 14 and 15).

All lanes of a packet walk together: a node is visited when any lane hits its box, the nearer child first by majority.
Each lane keeps its own nearest hit, and hits are ordered by (t, code), so that the walk's order never shows in a result
(I. Wald et al., "Interactive Rendering with Coherent Ray Tracing", 2001).
"""

from tasuki.language import (
    abs,
    any_lane,
    array,
    copysign,
    count_lanes,
    f32,
    fma,
    i32,
    max,
    min,
    module,
    reciprocal,
    select,
    socket,
    vec3,
)
from tasuki.modules.crossing import NOWHERE
from tasuki.modules.records import LEAF_MASK, LEAF_SHIFT, boxes, bvh_nodes

STACK_SIZE = 64
"""Deeper than any tree that `bvh_build` makes."""
NOTHING = -1
"""The code of no primitive: what a ray has hit that hit nothing, or has left that left nothing."""
LEAST_DIRECTION = 1.0e-20


@socket(dispatch=True)
def primitive_hit(kind: i32, index: i32, origin: vec3, direction: vec3, leaving: bool) -> f32:
    """The first visible crossing of a primitive with t > 0, or NOWHERE (or NaN)."""
    ...


@module
def slab_reciprocal(x: f32) -> f32:
    """1 / x, kept finite, so that no slab test meets 0 times infinity."""
    return reciprocal(select(abs(x) < LEAST_DIRECTION, copysign(LEAST_DIRECTION, x), x))


@module
def slab_entry(low: vec3, high: vec3, inverse: vec3, shifted: vec3, far: f32) -> tuple[f32, f32]:
    """Where a ray enters and leaves a box, clipped to 0..far; it misses where it enters after it leaves.

    (plane - origin) / direction is one fused operation: the boxes were widened by more than its error when they were
    built, and a box decides only whether its content is looked at.
    """
    x0 = fma(low.x, inverse.x, shifted.x)
    x1 = fma(high.x, inverse.x, shifted.x)
    y0 = fma(low.y, inverse.y, shifted.y)
    y1 = fma(high.y, inverse.y, shifted.y)
    z0 = fma(low.z, inverse.z, shifted.z)
    z1 = fma(high.z, inverse.z, shifted.z)
    enter = max(max(min(x0, x1), min(y0, y1)), max(min(z0, z1), 0.0))
    leave = min(min(max(x0, x1), max(y0, y1)), min(max(z0, z1), far))
    return enter, leave


@module
def leaf_range(leaf: i32) -> tuple[i32, i32]:
    """The first place in `boxes` that belongs to a leaf, and the first after it."""
    first = leaf >> LEAF_SHIFT
    return first, first + (leaf & LEAF_MASK) + 1


@module
def nearest_in_leaf(
    leaf: i32, origin: vec3, direction: vec3, left: i32, nearest: f32, hit: i32
) -> tuple[f32, i32]:
    """The nearer of the nearest hit so far and those in a leaf. Selected, not branched: lanes seldom agree."""
    first, end = leaf_range(leaf)
    for place in range(first, end):
        primitive = boxes[place].code
        t = primitive_hit(primitive & 31, primitive >> 5, origin, direction, left == primitive)
        closer = t < nearest or (t == nearest and primitive < hit)
        nearest = select(closer, t, nearest)
        hit = select(closer, primitive, hit)
    return nearest, hit


@module
def blocked_in_leaf(leaf: i32, origin: vec3, direction: vec3, left: i32, distance: f32) -> bool:
    """Whether something in a leaf is hit before `distance`."""
    first, end = leaf_range(leaf)
    blocked = False
    for place in range(first, end):
        primitive = boxes[place].code
        t = primitive_hit(primitive & 31, primitive >> 5, origin, direction, left == primitive)
        blocked = blocked or t < distance
    return blocked


@module(number=14, method="raytrace")
def nearest_intersection(origin: vec3, direction: vec3, left: i32) -> tuple[f32, i32]:
    """The nearest visible hit of a ray of unit direction: its t, and the code of the primitive (NOTHING: none).

    `left` is the code of the primitive on which the ray begins. Hits at one t go to the lower code.
    """
    inverse = vec3(slab_reciprocal(direction.x), slab_reciprocal(direction.y), slab_reciprocal(direction.z))
    shifted = -(origin * inverse)
    nearest = NOWHERE
    hit = NOTHING
    stack = array(i32, STACK_SIZE)
    entries = array(f32, STACK_SIZE)
    depth = 0
    code = 0
    walking = len(bvh_nodes) > 0
    while walking:
        while code >= 0:
            node = bvh_nodes[code]
            left_enter, left_leave = slab_entry(node.left_low, node.left_high, inverse, shifted, nearest)
            right_enter, right_leave = slab_entry(node.right_low, node.right_high, inverse, shifted, nearest)
            hits_left = left_enter <= left_leave
            hits_right = right_enter <= right_leave
            if any_lane(hits_left):
                if any_lane(hits_right):
                    both = hits_left and hits_right
                    if 2 * count_lanes(both and left_enter <= right_enter) >= count_lanes(both):
                        stack[depth] = bvh_nodes[code].right
                        entries[depth] = select(hits_right, right_enter, NOWHERE)
                        code = bvh_nodes[code].left
                    else:
                        stack[depth] = bvh_nodes[code].left
                        entries[depth] = select(hits_left, left_enter, NOWHERE)
                        code = bvh_nodes[code].right
                    depth += 1
                else:
                    code = bvh_nodes[code].left
            elif any_lane(hits_right):
                code = bvh_nodes[code].right
            else:
                break
        if code < 0:
            nearest, hit = nearest_in_leaf(-1 - code, origin, direction, left, nearest, hit)
        walking = False
        while depth > 0 and not walking:
            depth -= 1
            code = stack[depth]
            walking = any_lane(entries[depth] <= nearest)
    return nearest, hit


@module(number=15, method="raytrace")
def shadow_intersection(origin: vec3, direction: vec3, left: i32, distance: f32) -> bool:
    """Whether something visible lies on a ray of unit direction before `distance`; `left` as in module 14."""
    inverse = vec3(slab_reciprocal(direction.x), slab_reciprocal(direction.y), slab_reciprocal(direction.z))
    shifted = -(origin * inverse)
    stack = array(i32, STACK_SIZE)
    depth = 0
    code = 0
    walking = len(bvh_nodes) > 0
    while walking:
        while code >= 0:
            node = bvh_nodes[code]
            left_enter, left_leave = slab_entry(node.left_low, node.left_high, inverse, shifted, distance)
            right_enter, right_leave = slab_entry(node.right_low, node.right_high, inverse, shifted, distance)
            in_left = count_lanes(left_enter <= left_leave)
            in_right = count_lanes(right_enter <= right_leave)
            if in_left > 0:
                if in_right > 0:
                    if in_left >= in_right:
                        stack[depth] = bvh_nodes[code].right
                        code = bvh_nodes[code].left
                    else:
                        stack[depth] = bvh_nodes[code].left
                        code = bvh_nodes[code].right
                    depth += 1
                else:
                    code = bvh_nodes[code].left
            elif in_right > 0:
                code = bvh_nodes[code].right
            else:
                break
        if code < 0:
            if blocked_in_leaf(-1 - code, origin, direction, left, distance):
                return True
        walking = depth > 0
        if walking:
            depth -= 1
            code = stack[depth]
    return False
