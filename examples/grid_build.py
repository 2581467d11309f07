"""A uniform grid of cells, each with a list of the things that reach into it; `grid.py` searches it."""

from tasuki.language import Table, f32, floor, i32, max, min, module, record, vec3
from tasuki.modules.elementary import power
from tasuki.modules.records import Box, boxes
from tasuki.renderers.accelerators import Tables
from tasuki.scene.pack import Packed

DENSITY = 4
"""Cells for each thing, about."""
ROOM = 32
"""Places in lists for each thing, on average. What would need more than are left is loose."""
LARGE, UNBOUNDED = 16.0, 1e29
"""Things more than so many times the mean size, such as floors, are loose; sizes beyond all bounds do not count."""


@record
class Grid:
    """The least corner of a grid, the size of a cell, and how many there are along each axis (whole numbers)."""

    low: vec3
    cell: vec3
    counts: vec3


@record
class Link:
    """A thing in a list, by its code, and the row of the next, or 0. Lists begin in rows without a thing, one for each
    cell; row 0 begins that of loose things, which are in no cell.
    """

    code: i32
    next: i32


grids = Table(Grid)
links = Table(Link)


@module
def cell_at(grid: Grid, point: vec3) -> vec3:
    """The place along each axis of the cell in which a point lies, or of the nearest one: whole numbers."""
    place = min(max((point - grid.low) / grid.cell, vec3(0.0)), grid.counts - vec3(1.0))
    return vec3(floor(place.x), floor(place.y), floor(place.z))


@module
def row_of(grid: Grid, place: vec3) -> i32:
    """The row in which the list of a cell begins."""
    return 1 + i32((place.z * grid.counts.y + place.y) * grid.counts.x + place.x)


@module
def size_of(box: Box) -> f32:
    """The longest side of a box."""
    return max(box.high.x - box.low.x, box.high.y - box.low.y, box.high.z - box.low.z)


@module
def grid_around(count: i32, limit: f32, slack: f32) -> Grid:
    """A grid around the boxes that are not larger than `limit`, and by `slack` more, its cells nearly cubes."""
    low, high = vec3(UNBOUNDED), vec3(-UNBOUNDED)
    for i in range(count):
        if size_of(boxes[i]) <= limit:
            low, high = min(low, boxes[i].low), max(high, boxes[i].high)
    size = max(high - low, vec3(0.0)) + vec3(2.0 * slack)
    long = max(size, vec3(0.1 * max(size.x, size.y, size.z)))
    side = power(long.x * long.y * long.z / f32(DENSITY * count), 1.0 / 3.0)
    counts = vec3(1.0 + floor(long.x / side), 1.0 + floor(long.y / side), 1.0 + floor(long.z / side))
    return Grid(low - vec3(slack), size / counts, counts)


@module
def build_grid(count: i32, slack: f32) -> i32:
    """Link every thing into the lists of all cells that its box, wider by `slack`, meets; how many cells there are."""
    limit = 0.0
    for i in range(count):
        limit += LARGE / f32(count) * (size_of(boxes[i]) if size_of(boxes[i]) < UNBOUNDED else 0.0)
    grid = grid_around(count, limit, 4.0 * slack)
    grids[0] = grid
    cells = i32(grid.counts.x * grid.counts.y * grid.counts.z)
    used = cells
    for i in range(count):
        first, last = cell_at(grid, boxes[i].low - vec3(2.0 * slack)), cell_at(grid, boxes[i].high + vec3(2.0 * slack))
        sides = last - first + vec3(1.0)
        is_loose = size_of(boxes[i]) > limit or used + i32(sides.x * sides.y * sides.z) > cells + ROOM * count
        for item in range(1 if is_loose else i32(sides.x * sides.y * sides.z)):
            across, rest = item % i32(sides.x), item // i32(sides.x)
            place = first + vec3(f32(across), f32(rest % i32(sides.y)), f32(rest // i32(sides.y)))
            row = 0 if is_loose else row_of(grid, place)
            used += 1
            links[used] = Link(boxes[i].code, links[row].next)
            links[row].next = used
    return cells


def tables(packed: Packed) -> Tables:
    """Room for the grid of a packed scene."""
    return {"grids": (Grid, 1), "links": (Link, (4 * DENSITY + ROOM + 1) * packed.things + 65)}
