"""Building the bounding volume hierarchy from the top. Runs on one lane.

The references (`records.references`) are one for every box at first, and more as some are cut (`bvh_split`). Those that
wait to be divided stand at the end of their table, those of finished leaves at its beginning; free places are between,
so that the table's size bounds how many things are cut. `records.bvh_nodes` receives at most one node less than there
are references. A split that would make the tree too deep for the search's stack is replaced by one at the median.
"""

from tasuki.language import array, f32, i32, module, record, vec3
from tasuki.modules.bvh_split import (
    bounds_of,
    cut,
    half_area,
    object_split,
    overlap,
    sort_by_side,
    spatial_split,
)
from tasuki.modules.records import LEAF_MASK, LEAF_SHIFT, boxes, bvh_nodes, references

LEAF_SIZE = LEAF_MASK + 1
OVERLAP = 3.0e-4
"""In units of the root's surface: sides that overlap by less are not worth a look at what cutting would give."""
MEDIAN_DEPTH = 36
"""From here on splits halve their range: 36 + log2(2**27 references) stays below the search's stack."""
NODE_COST = 1.75
"""What it costs to visit a node, in units of `Box.cost` (measured: docs/benchmarks.md)."""


@record
class Range:
    """Work to do: the next `count` references belong under a node; `slot` is 2 * node + (1 for its right child).

    Of the places that are free, `kept` are for work that waits longer.
    """

    count: i32
    slot: i32
    depth: i32
    kept: i32


@module
def cost_of(first: i32, count: i32) -> f32:
    """What it costs to intersect a range of references."""
    cost = 0.0
    for i in range(first, first + count):
        cost += references[i].cost
    return cost


@module
def median(count: i32) -> i32:
    """Half of a range that cannot be divided by place; nothing, where it can be one leaf."""
    if count <= LEAF_SIZE:
        return 0
    return count // 2


@module
def divide(first: i32, count: i32, depth: i32, free: i32, least: f32, slack: f32) -> tuple[i32, i32]:
    """Divide a range of two or more references in two.

    How many go left alone, and how many are cut; these stand behind those that go left, and their left parts before the
    range. Zeros where the range had better be a leaf. At most `free` are cut, and only where the sides would otherwise
    overlap by more than the half surface `least`.
    """
    if depth >= MEDIAN_DEPTH:
        return median(count), 0
    between = object_split(first, count)
    if between.axis < 0:
        return median(count), 0
    best = between
    if free > 0 and overlap(first, count, between) > least:
        across = spatial_split(first, count, slack)
        if across.price < best.price:
            best = across
    if count <= LEAF_SIZE:
        low, high = bounds_of(first, count)
        if (cost_of(first, count) - NODE_COST) * half_area(low, high) <= best.price:
            return 0, 0
    left, both = sort_by_side(first, count, best, slack)
    if both > free or left == count or left + both == 0:
        left, both = sort_by_side(first, count, between, slack)
    for k in range(both):
        cut(first + left + k, first - 1 - k, best, slack)
    return left, both


@module
def attach(slot: i32, child: i32, low: vec3, high: vec3):
    """Enter a child and its box into its parent."""
    node = slot >> 1
    if slot & 1 == 0:
        bvh_nodes[node].left_low = low
        bvh_nodes[node].left_high = high
        bvh_nodes[node].left = child
    else:
        bvh_nodes[node].right_low = low
        bvh_nodes[node].right_high = high
        bvh_nodes[node].right = child


@module
def build_bvh(count: i32, slack: f32) -> i32:
    """Build the hierarchy over the first `count` boxes; how many nodes it has.

    Every box is widened by `slack`, the error bound of the search's slab test. `references` must have room for `count`
    at least, `bvh_nodes` for one less than that table has, and for one.
    """
    if count == 0:
        return 0
    top = len(references) - count
    for i in range(count):
        references[top + i] = boxes[i]
    low, high = bounds_of(top, count)
    least = OVERLAP * half_area(low, high)
    work = array(Range, 128)
    work[0] = Range(count, -1, 0, 0)
    waiting = 1
    nodes = 0
    finished = 0
    while waiting > 0:
        waiting -= 1
        task = work[waiting]
        low, high = bounds_of(top, task.count)
        free = top - finished - task.kept
        left = 0
        both = 0
        if task.count > 1:
            left, both = divide(top, task.count, task.depth, free, least, slack)
        child = -1 - (finished << LEAF_SHIFT | task.count - 1)
        if left + both > 0:
            child = nodes
            nodes += 1
            # What is free is shared by how many they are; what the left side does not need, the right side gets.
            kept = task.kept + i32(f32(free - both) * f32(task.count - left) / f32(task.count + both))
            work[waiting] = Range(task.count - left, 2 * child + 1, task.depth + 1, task.kept)
            work[waiting + 1] = Range(left + both, 2 * child, task.depth + 1, kept)
            waiting += 2
            top -= both
        else:
            for i in range(task.count):
                references[finished + i] = references[top + i]
            finished += task.count
            top += task.count
        if task.slot >= 0:
            attach(task.slot, child, low - vec3(slack), high + vec3(slack))
        elif child < 0:
            # The root is a leaf. A node has two children: it is entered twice.
            attach(0, child, low - vec3(slack), high + vec3(slack))
            attach(1, child, low - vec3(slack), high + vec3(slack))
            nodes = 1
    return nodes
