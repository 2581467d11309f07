"""Intersection search through a bounding volume hierarchy, for packets with one shared stack (modules 14 and 15).

All lanes of a packet walk together: a node is visited when any lane hits its box, the nearer child first by majority.
Each lane keeps its own nearest hit, and hits are ordered by (t, code), so that the walk's order never shows in a result
(I. Wald et al., "Interactive Rendering with Coherent Ray Tracing", 2001).
"""

from tasuki.language import any_lane, array, count_lanes, f32, i32, module, select, vec3
from tasuki.modules.crossing import NOWHERE
from tasuki.modules.records import LEAF_MASK, LEAF_SHIFT, bvh_nodes, references
from tasuki.modules.search import NOTHING, hit_of, nearer_hit
from tasuki.modules.slabs import slab_entry, slab_ray

STACK_SIZE = 64
"""Deeper than any tree that `bvh_build` makes."""


@module
def child_entries(code: i32, inverse: vec3, shifted: vec3, far: f32) -> tuple[f32, f32, f32, f32]:
    """Where a ray enters and leaves the boxes of a node's children, as `slabs.slab_entry`: the left one's, the right
    one's. One step down the tree.
    """
    node = bvh_nodes[code]
    left_enter, left_leave = slab_entry(node.left_low, node.left_high, inverse, shifted, far)
    right_enter, right_leave = slab_entry(node.right_low, node.right_high, inverse, shifted, far)
    return left_enter, left_leave, right_enter, right_leave


@module
def leaf_range(leaf: i32) -> tuple[i32, i32]:
    """The first place in `references` that belongs to a leaf, and the first after it."""
    first = leaf >> LEAF_SHIFT
    return first, first + (leaf & LEAF_MASK) + 1


@module
def nearest_in_leaf(
    leaf: i32, origin: vec3, direction: vec3, left: i32, nearest: f32, hit: i32
) -> tuple[f32, i32]:
    """The nearer of the nearest hit so far and those in a leaf."""
    first, end = leaf_range(leaf)
    for place in range(first, end):
        nearest, hit = nearer_hit(references[place].code, origin, direction, left, nearest, hit)
    return nearest, hit


@module
def blocked_in_leaf(leaf: i32, origin: vec3, direction: vec3, left: i32, distance: f32) -> bool:
    """Whether something in a leaf is hit before `distance`."""
    first, end = leaf_range(leaf)
    blocked = False
    for place in range(first, end):
        t = hit_of(references[place].code, origin, direction, left, distance)
        blocked = blocked or t < distance
    return blocked


@module(number=14, method="raytrace", fills="nearest_hit")
def nearest_intersection(origin: vec3, direction: vec3, left: i32) -> tuple[f32, i32]:
    """The nearest visible hit, through the BVH: see `search.nearest_hit`."""
    inverse, shifted = slab_ray(origin, direction)
    nearest = NOWHERE
    hit = NOTHING
    stack = array(i32, STACK_SIZE)
    entries = array(f32, STACK_SIZE)
    depth = 0
    code = 0
    walking = len(bvh_nodes) > 0
    while walking:
        while code >= 0:
            left_enter, left_leave, right_enter, right_leave = child_entries(code, inverse, shifted, nearest)
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


@module(number=15, method="raytrace", fills="is_blocked")
def shadow_intersection(origin: vec3, direction: vec3, left: i32, distance: f32) -> bool:
    """Whether something visible lies before `distance`, through the BVH: see `search.is_blocked`."""
    inverse, shifted = slab_ray(origin, direction)
    stack = array(i32, STACK_SIZE)
    depth = 0
    code = 0
    walking = len(bvh_nodes) > 0
    while walking:
        while code >= 0:
            left_enter, left_leave, right_enter, right_leave = child_entries(code, inverse, shifted, distance)
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
