"""An accelerator of one's own, a uniform grid: `tasuki render SCENE --with examples/grid.py --accelerator grid`.

J. Amanatides, A. Woo, "A Fast Voxel Traversal Algorithm for Ray Tracing", 1987. `grid_build.py` makes the grid.
"""

from grid_build import Grid, build_grid, cell_at, grids, links, row_of, tables

from tasuki.language import copysign, f32, i32, max, min, module, vec3
from tasuki.modules.crossing import NOWHERE
from tasuki.modules.search import NOTHING, nearer_hit
from tasuki.modules.slabs import slab_entry, slab_ray
from tasuki.renderers.accelerators import Accelerator, register


@module
def nearest_in_list(row: i32, origin: vec3, direction: vec3, left: i32, far: f32, hit: i32) -> tuple[f32, i32]:
    """The nearer of the nearest hit so far and those of a list. One step of a ray."""
    row = links[row].next
    while row > 0:
        far, hit = nearer_hit(links[row].code, origin, direction, left, far, hit)
        row = links[row].next
    return far, hit


@module
def next_cell(grid: Grid, cell: vec3, inverse: vec3, shifted: vec3) -> tuple[vec3, f32]:
    """The cell that a ray enters next, and where. The way to each plane is computed anew, so that no errors add up."""
    step = vec3(copysign(1.0, inverse.x), copysign(1.0, inverse.y), copysign(1.0, inverse.z))
    t = (grid.low + (cell + max(step, vec3(0.0))) * grid.cell) * inverse + shifted
    first = min(t.x, t.y, t.z)
    # Through an edge of the cell it goes at once into the cell beyond: what lies at the edge is in the lists of both.
    moves = vec3(f32(t.x == first), f32(t.y == first), f32(t.z == first))
    return cell + moves * step, first


@module
def search(origin: vec3, direction: vec3, left: i32, far: f32) -> tuple[f32, i32]:
    """The nearest visible hit before `far`: among loose things, then from cell to cell along the ray."""
    grid = grids[0]
    inverse, shifted = slab_ray(origin, direction)
    nearest, hit = nearest_in_list(0, origin, direction, left, far, NOTHING)
    enter, leave = slab_entry(grid.low, grid.low + grid.counts * grid.cell, inverse, shifted, nearest)
    cell = cell_at(grid, origin + enter * direction)
    walking = enter <= leave
    while walking:
        nearest, hit = nearest_in_list(row_of(grid, cell), origin, direction, left, nearest, hit)
        cell, until = next_cell(grid, cell, inverse, shifted)
        room = grid.counts - cell
        walking = until < nearest and min(cell.x, cell.y, cell.z) >= 0.0 and min(room.x, room.y, room.z) > 0.0
    return nearest, hit


@module(fills="nearest_hit")
def nearest_in_grid(origin: vec3, direction: vec3, left: i32) -> tuple[f32, i32]:
    """The nearest visible hit."""
    return search(origin, direction, left, NOWHERE)


@module(fills="is_blocked")
def blocked_in_grid(origin: vec3, direction: vec3, left: i32, distance: f32) -> bool:
    """Whether something visible lies before `distance`."""
    _nearest, hit = search(origin, direction, left, distance)
    return hit != NOTHING


register(Accelerator("grid", nearest_in_grid, blocked_in_grid, tables, build_grid, steps=[nearest_in_list]))
