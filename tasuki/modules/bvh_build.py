"""Building the bounding volume hierarchy by the binned surface area heuristic. Runs on one lane.

I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007. The boxes (`records.boxes`) are sorted
in place; `records.bvh_nodes` receives one node less than there are boxes. A split that would make the tree too deep for
the search's stack is replaced by one at the median.
"""

from tasuki.language import array, f32, i32, max, min, module, record, vec3
from tasuki.modules.records import LEAF_MASK, LEAF_SHIFT, boxes, bvh_nodes

BINS = 16
LEAF_SIZE = LEAF_MASK + 1
MEDIAN_DEPTH = 36
"""From here on splits halve their range: 36 + log2(2**27 primitives) stays below the search's stack."""
EMPTY = 3.0e38
NODE_COST = 1.5
"""What it costs to visit a node, in units of `Box.cost` (measured: docs/benchmarks.md)."""


@record
class Range:
    """Work to do: boxes first .. first + count - 1 belong under a node; `slot` is 2 * node + (1 for its right child).
    """

    first: i32
    count: i32
    slot: i32
    depth: i32


@record
class Split:
    """Where to divide a range: boxes whose bin along `axis` is below `bin` go left; axis -1: at the median."""

    axis: i32
    bin: i32
    cost: f32


@module
def half_area(low: vec3, high: vec3) -> f32:
    """Half the surface of a box; 0 of an empty one."""
    d = max(high - low, vec3(0.0))
    return d.x * d.y + d.y * d.z + d.z * d.x


@module
def along(v: vec3, axis: i32) -> f32:
    """The component of v along a coordinate axis 0, 1, 2."""
    if axis == 0:
        return v.x
    if axis == 1:
        return v.y
    return v.z


@module
def bin_of(index: i32, axis: i32, low: f32, scale: f32) -> i32:
    """The bin in which the middle of box `index` falls."""
    middle = along(boxes[index].low + boxes[index].high, axis)
    return min(max(i32((middle - low) * scale), 0), BINS - 1)


@module
def middle_range(first: i32, count: i32) -> tuple[vec3, vec3]:
    """Twice the least and the greatest middles of a range of boxes."""
    low = vec3(EMPTY)
    high = vec3(-EMPTY)
    for i in range(first, first + count):
        middle = boxes[i].low + boxes[i].high
        low = min(low, middle)
        high = max(high, middle)
    return low, high


@module
def best_split_along(first: i32, count: i32, axis: i32, low: f32, scale: f32) -> Split:
    """The cheapest of the divisions between bins along one axis; infinite cost if all boxes fall into one."""
    costs = array(f32, BINS)
    lows = array(vec3, BINS)
    highs = array(vec3, BINS)
    for b in range(BINS):
        lows[b] = vec3(EMPTY)
        highs[b] = vec3(-EMPTY)
    for i in range(first, first + count):
        b = bin_of(i, axis, low, scale)
        costs[b] = costs[b] + boxes[i].cost
        lows[b] = min(lows[b], boxes[i].low)
        highs[b] = max(highs[b], boxes[i].high)
    # From the right: what the bins k and above cost, before any bin below is looked at.
    right_prices = array(f32, BINS)
    right_low = vec3(EMPTY)
    right_high = vec3(-EMPTY)
    right_cost = 0.0
    for k in range(BINS - 1, 0, -1):
        right_low = min(right_low, lows[k])
        right_high = max(right_high, highs[k])
        right_cost += costs[k]
        right_prices[k] = half_area(right_low, right_high) * right_cost
    best = Split(axis, 0, EMPTY)
    left_low = vec3(EMPTY)
    left_high = vec3(-EMPTY)
    left_cost = 0.0
    for k in range(1, BINS):
        left_low = min(left_low, lows[k - 1])
        left_high = max(left_high, highs[k - 1])
        left_cost += costs[k - 1]
        cost = half_area(left_low, left_high) * left_cost + right_prices[k]
        # The first and the last bin are never empty: each side gets at least one box.
        if cost < best.cost:
            best = Split(axis, k, cost)
    return best


@module
def exchange(i: i32, j: i32):
    """Exchange two boxes."""
    kept = boxes[i]
    boxes[i] = boxes[j]
    boxes[j] = kept


@module
def partition(first: i32, count: i32, split: Split, low: f32, scale: f32) -> i32:
    """Bring the boxes that go left to the front of the range; how many they are."""
    i = first
    j = first + count - 1
    while i <= j:
        if bin_of(i, split.axis, low, scale) < split.bin:
            i += 1
        else:
            exchange(i, j)
            j -= 1
    return i - first


@module
def bounds_of(first: i32, count: i32, slack: f32) -> tuple[vec3, vec3]:
    """The box around a range of boxes, widened by `slack`."""
    low = vec3(EMPTY)
    high = vec3(-EMPTY)
    for i in range(first, first + count):
        low = min(low, boxes[i].low)
        high = max(high, boxes[i].high)
    return low - vec3(slack), high + vec3(slack)


@module
def cost_of(first: i32, count: i32) -> f32:
    """What it costs to intersect a range of primitives."""
    cost = 0.0
    for i in range(first, first + count):
        cost += boxes[i].cost
    return cost


@module
def median(count: i32) -> i32:
    """Half of a range that cannot be divided by place; nothing, where it can be one leaf."""
    if count <= LEAF_SIZE:
        return 0
    return count // 2


@module
def divide(range_: Range) -> i32:
    """Divide a range of two or more boxes in two; the size of the first part, or 0 where it had better be a leaf."""
    if range_.depth >= MEDIAN_DEPTH:
        return median(range_.count)
    low, high = middle_range(range_.first, range_.count)
    best = Split(-1, 0, EMPTY)
    for axis in range(3):
        extent = along(high, axis) - along(low, axis)
        if extent > 0.0:
            scale = f32(BINS) * 0.9999 / extent
            split = best_split_along(range_.first, range_.count, axis, along(low, axis), scale)
            if split.cost < best.cost:
                best = split
    if best.axis < 0:
        return median(range_.count)
    if range_.count <= LEAF_SIZE:
        box_low, box_high = bounds_of(range_.first, range_.count, 0.0)
        if (cost_of(range_.first, range_.count) - NODE_COST) * half_area(box_low, box_high) <= best.cost:
            return 0
    scale = f32(BINS) * 0.9999 / (along(high, best.axis) - along(low, best.axis))
    return partition(range_.first, range_.count, best, along(low, best.axis), scale)


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
    """Build the hierarchy of the first `count` boxes; how many nodes it has.

    Every box is widened by `slack`, the error bound of the search's slab test.
    """
    if count == 0:
        return 0
    work = array(Range, 128)
    work[0] = Range(0, count, -1, 0)
    waiting = 1
    nodes = 0
    while waiting > 0:
        waiting -= 1
        task = work[waiting]
        left = 0
        if task.count > 1:
            left = divide(task)
        child = -1 - (task.first << LEAF_SHIFT | task.count - 1)
        if left > 0:
            child = nodes
            nodes += 1
            work[waiting] = Range(task.first + left, task.count - left, 2 * child + 1, task.depth + 1)
            work[waiting + 1] = Range(task.first, left, 2 * child, task.depth + 1)
            waiting += 2
        low, high = bounds_of(task.first, task.count, slack)
        if task.slot >= 0:
            attach(task.slot, child, low, high)
        elif left == 0:
            # The root is a leaf. A node has two children: it is entered twice.
            attach(0, child, low, high)
            attach(1, child, low, high)
            nodes = 1
    return nodes
