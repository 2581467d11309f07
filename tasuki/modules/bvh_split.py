"""Where to divide a node of the bounding volume hierarchy: between references to things, or across them.

A reference (a record of the table `references`) is a thing's code and the box around it, or around a part of it. A
division across references cuts those that lie on both sides of a plane into two, each with the box of its own part: so
long slanting things need not make every box that holds them large (M. Stich et al., "Spatial Splits in Bounding Volume
Hierarchies", 2009).
"""

from tasuki.language import array, f32, i32, max, min, module, record, sqrt, vec3
from tasuki.modules.parts import ENDLESS, along, primitive_part, with_component
from tasuki.modules.records import references

BINS = 16
MOST_EXTENT = 1.0e15
"""What is longer counts as this long: things without end have areas that can be compared."""
LEAST_EXTENT = 256.0
"""In units of the boxes' slack: what is shorter is not cut."""
FEW = 64
"""Up to so many references are cut exactly to choose among splits; of more, single ones matter little."""
TOUCHING = 1.0e-3
"""Of a bin: what reaches no farther into it is not cut for it."""


@record
class Split:
    """A division of references: of `BINS` bins along `axis` those below `bin` go left. Axis -1: there is none.

    `scale` bins are a unit of length. `across`: bins begin at `low`, and what lies in bins on both sides is cut.
    Else they begin at low / 2, and what counts is the bin of a box's middle. `price` is `search_cost` of both sides.
    """

    axis: i32
    bin: i32
    across: bool
    low: f32
    scale: f32
    price: f32


# --- boxes ------------------------------------------------------------------------------------------------------------


@module
def half_area(low: vec3, high: vec3) -> f32:
    """Half the surface of a box; 0 of an empty one."""
    d = min(max(high - low, vec3(0.0)), vec3(MOST_EXTENT))
    return d.x * d.y + d.y * d.z + d.z * d.x


@module
def is_empty(low: vec3, high: vec3) -> bool:
    """Whether nothing lies between two corners."""
    return low.x > high.x or low.y > high.y or low.z > high.z


@module
def bounds_of(first: i32, count: i32) -> tuple[vec3, vec3]:
    """The box around a range of references."""
    low = vec3(ENDLESS)
    high = vec3(-ENDLESS)
    for i in range(first, first + count):
        low = min(low, references[i].low)
        high = max(high, references[i].high)
    return low, high


@module
def part_of(i: i32, axis: i32, low: f32, high: f32, slack: f32) -> tuple[vec3, vec3]:
    """The box of the part of a reference between two planes, widened by what its computation may round."""
    reference = references[i]
    part_low, part_high = primitive_part(reference.code & 31, reference.code >> 5, axis, low, high)
    part_low = with_component(part_low, axis, max(along(part_low, axis), low))
    part_high = with_component(part_high, axis, min(along(part_high, axis), high))
    rounding = vec3(2.0 * slack)
    return max(part_low - rounding, reference.low), min(part_high + rounding, reference.high)


@module
def search_cost(low: vec3, high: vec3, cost: f32) -> f32:
    """What the search of a box is expected to cost, in a unit that is the same for all boxes of a tree.

    Rays that meet the parent meet the box in proportion to its surface. They will not test everything in it, as the
    surface area heuristic supposes, since its own subtree keeps most of it from them: the cost grows as a power below 1
    of what it holds. So boxes that fit are worth more, and what is cut in two costs less than two.
    """
    root = sqrt(cost)
    return half_area(low, high) * root * sqrt(root)


# --- bins -------------------------------------------------------------------------------------------------------------


@module
def bin_at(x: f32) -> i32:
    """The bin in which x falls, the first and last without end."""
    return min(max(i32(x), 0), BINS - 1)


@module
def bins_of(i: i32, split: Split) -> tuple[i32, i32]:
    """The first and the last bin in which a reference counts."""
    low = along(references[i].low, split.axis)
    high = along(references[i].high, split.axis)
    if not split.across:
        middle = bin_at((low + high - split.low) * split.scale)
        return middle, middle
    first = bin_at((low - split.low) * split.scale + TOUCHING)
    return first, max(bin_at((high - split.low) * split.scale - TOUCHING), first)


@module
def plane_below(bin: i32, split: Split) -> f32:
    """Where a bin begins, of a split across references."""
    return split.low + f32(bin) / split.scale


@module
def part_in_bin(i: i32, bin: i32, split: Split, slack: f32, exact: bool) -> tuple[vec3, vec3]:
    """The box of the part of a reference in a bin; if not `exact`, of all that its own box has there."""
    begin = plane_below(bin, split)
    end = plane_below(bin + 1, split)
    if exact:
        return part_of(i, split.axis, begin, end, slack)
    low = references[i].low
    high = references[i].high
    low = with_component(low, split.axis, max(along(low, split.axis), begin))
    high = with_component(high, split.axis, min(along(high, split.axis), end))
    return low, high


@module
def best_bin(first: i32, count: i32, split: Split, slack: f32) -> Split:
    """`split` at the bin where it is cheapest; its price is infinite if all references fall into one bin."""
    entering = array(f32, BINS)
    leaving = array(f32, BINS)
    lows = array(vec3, BINS)
    highs = array(vec3, BINS)
    for b in range(BINS):
        lows[b] = vec3(ENDLESS)
        highs[b] = vec3(-ENDLESS)
    for i in range(first, first + count):
        begin, end = bins_of(i, split)
        entering[begin] = entering[begin] + references[i].cost
        leaving[end] = leaving[end] + references[i].cost
        low = references[i].low
        high = references[i].high
        for b in range(begin, end + 1):
            if begin < end:
                low, high = part_in_bin(i, b, split, slack, count <= FEW)
            if not is_empty(low, high):
                lows[b] = min(lows[b], low)
                highs[b] = max(highs[b], high)
    # From the right: what the bins k and above cost, before any bin below is looked at.
    right_prices = array(f32, BINS)
    right_low = vec3(ENDLESS)
    right_high = vec3(-ENDLESS)
    right_cost = 0.0
    for k in range(BINS - 1, 0, -1):
        right_low = min(right_low, lows[k])
        right_high = max(right_high, highs[k])
        right_cost += leaving[k]
        right_prices[k] = search_cost(right_low, right_high, right_cost)
    best = split
    left_low = vec3(ENDLESS)
    left_high = vec3(-ENDLESS)
    left_cost = 0.0
    for k in range(1, BINS):
        left_low = min(left_low, lows[k - 1])
        left_high = max(left_high, highs[k - 1])
        left_cost += entering[k - 1]
        price = search_cost(left_low, left_high, left_cost) + right_prices[k]
        if left_cost > 0.0 and right_cost > 0.0 and price < best.price:
            best.bin = k
            best.price = price
    return best


# --- splits -----------------------------------------------------------------------------------------------------------


@module
def object_split(first: i32, count: i32) -> Split:
    """The cheapest division between references, by the middles of their boxes.

    I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007.
    """
    low = vec3(ENDLESS)
    high = vec3(-ENDLESS)
    for i in range(first, first + count):
        low = min(low, references[i].low + references[i].high)
        high = max(high, references[i].low + references[i].high)
    best = Split(-1, 0, False, 0.0, 0.0, ENDLESS)
    for axis in range(3):
        extent = along(high, axis) - along(low, axis)
        if extent > 0.0:
            # The first and the last bin are never empty: each side gets at least one reference.
            scale = f32(BINS) * 0.9999 / extent
            split = best_bin(first, count, Split(axis, 0, False, along(low, axis), scale, ENDLESS), 0.0)
            if split.price < best.price:
                best = split
    return best


@module
def spatial_split(first: i32, count: i32, slack: f32) -> Split:
    """The cheapest division across references."""
    low, high = bounds_of(first, count)
    best = Split(-1, 0, True, 0.0, 0.0, ENDLESS)
    for axis in range(3):
        extent = along(high, axis) - along(low, axis)
        if extent > LEAST_EXTENT * slack:
            scale = f32(BINS) / extent
            split = best_bin(first, count, Split(axis, 0, True, along(low, axis), scale, ENDLESS), slack)
            if split.price < best.price:
                best = split
    return best


@module
def overlap(first: i32, count: i32, split: Split) -> f32:
    """Half the surface of what the boxes of the two sides of a split between references have in common."""
    left_low = vec3(ENDLESS)
    left_high = vec3(-ENDLESS)
    right_low = vec3(ENDLESS)
    right_high = vec3(-ENDLESS)
    for i in range(first, first + count):
        begin, _end = bins_of(i, split)
        if begin < split.bin:
            left_low = min(left_low, references[i].low)
            left_high = max(left_high, references[i].high)
        else:
            right_low = min(right_low, references[i].low)
            right_high = max(right_high, references[i].high)
    return half_area(max(left_low, right_low), min(left_high, right_high))


# --- dividing ---------------------------------------------------------------------------------------------------------


@module
def side_of(i: i32, split: Split, slack: f32) -> i32:
    """Where a reference goes: -1 to the left, 1 to the right, 0 to both sides."""
    begin, end = bins_of(i, split)
    if end < split.bin:
        return -1
    if begin >= split.bin:
        return 1
    plane = plane_below(split.bin, split)
    low, high = part_of(i, split.axis, -ENDLESS, plane, slack)
    if is_empty(low, high):
        return 1
    low, high = part_of(i, split.axis, plane, ENDLESS, slack)
    if is_empty(low, high):
        return -1
    return 0


@module
def exchange(i: i32, j: i32):
    """Exchange two references."""
    kept = references[i]
    references[i] = references[j]
    references[j] = kept


@module
def sort_by_side(first: i32, count: i32, split: Split, slack: f32) -> tuple[i32, i32]:
    """Bring what goes left to the front of a range, what goes right to its end; how many go left, and to both sides."""
    left = first
    i = first
    right = first + count
    while i < right:
        side = side_of(i, split, slack)
        if side < 0:
            exchange(i, left)
            left += 1
            i += 1
        elif side > 0:
            right -= 1
            exchange(i, right)
        else:
            i += 1
    return left - first, right - left


@module
def cut(i: i32, copy: i32, split: Split, slack: f32):
    """Reference i becomes its part on the right, and reference `copy` that on the left."""
    plane = plane_below(split.bin, split)
    left_low, left_high = part_of(i, split.axis, -ENDLESS, plane, slack)
    right_low, right_high = part_of(i, split.axis, plane, ENDLESS, slack)
    references[copy] = references[i]
    references[copy].low = left_low
    references[copy].high = left_high
    references[i].low = right_low
    references[i].high = right_high
