"""The hierarchy and the searches over it: against brute force by the same hit modules, for any grouping of lanes."""

from __future__ import annotations

import numpy as np
import pytest

from tasuki.modules import bvh, slabs
from tasuki.modules import records as rec
from tasuki.modules.records import LEAF_MASK, LEAF_SHIFT, TWO_SIDED
from tasuki.modules.search import NOTHING
from tests.machines.running import WIDTHS, assert_same_bits
from tests.modules.primitives import cones, planes, quads, random_quadrics, rays, spheres, triangles
from tests.modules.running import dot, everywhere, random_directions, records, unit
from tests.modules.searching import NUMBERS, Scene, build_over

# --- the slab test ----------------------------------------------------------------------------------------------------


def exact_slab(low: np.ndarray, high: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Whether a ray meets a box, in float64; a ray that runs along a face within it does."""
    origin, direction = origin.astype(np.float64), direction.astype(np.float64)
    with np.errstate(all="ignore"):
        one, two = (low - origin) / direction, (high - origin) / direction
    parallel = direction == 0
    inside = (low <= origin) & (origin <= high)
    near = np.where(parallel, np.where(inside, -np.inf, np.inf), np.minimum(one, two)).max(axis=1)
    far = np.where(parallel, np.where(inside, np.inf, -np.inf), np.maximum(one, two)).min(axis=1)
    return np.maximum(near, 0) <= far


def test_no_ray_that_meets_a_box_misses_it_when_it_is_widened():
    """Rays at corners, edges and faces, and along them, from near and from far."""
    count = 60_000
    draw = np.random.default_rng(0)
    middle, half = draw.uniform(-5, 5, (count, 3)), 10 ** draw.uniform(-4, 0.5, (count, 3))
    half[::7] *= draw.choice([0.0, 1.0], half[::7].shape)
    low, high = (middle - half).astype(np.float32), (middle + half).astype(np.float32)
    place = np.clip(draw.uniform(-1.5, 1.5, (count, 3)), -1, 1)
    aim = middle + half * place
    origin = draw.uniform(-10, 10, (count, 3)).astype(np.float32)
    direction = unit(aim - origin)
    direction[::11] = random_directions(draw, len(direction[::11]))
    # Straight at a face from outside, along its edge too.
    direction[1::11] = draw.permuted(np.tile([1.0, 0.0, -0.0], (len(direction[1::11]), 1)), axis=1)
    origin[1::11] = (aim - 7 * direction)[1::11]
    slack = np.float32(12 * 2.0**-21)
    inverse = np.stack([everywhere(slabs.slab_reciprocal, direction[:, axis].copy()) for axis in range(3)], axis=-1)
    shifted = -(origin * inverse)
    boxes = low - slack, high + slack
    enter, leave = everywhere(slabs.slab_entry, *boxes, inverse, shifted, np.full(count, np.inf, np.float32))
    meets = exact_slab(low.astype(np.float64), high.astype(np.float64), origin, direction)
    assert meets.mean() > 0.5
    assert (enter <= leave)[meets].all()
    # And it is not just always met: where a box of four times the slack is missed, so is ours.
    wide = 4 * float(slack)
    missed = ~exact_slab(low - wide, high + wide, origin, direction)
    assert missed.mean() > 0.02
    assert not (enter <= leave)[missed].any()


def test_slabs_beyond_the_far_end_or_behind_are_missed():
    low, high = np.array([[4.0, -1, -1]] * 4, np.float32), np.array([[6.0, 1, 1]] * 4, np.float32)
    inverse, shifted = np.float32([1, 1e20, 1e20]), np.zeros(3, np.float32)
    far = np.float32([3.99, 4.0, 5.0, np.inf])
    enter, leave = everywhere(slabs.slab_entry, low, high, inverse, shifted, far)
    np.testing.assert_array_equal(enter <= leave, [False, True, True, True])
    enter, leave = everywhere(slabs.slab_entry, -high, -low, inverse, shifted, far)
    assert not (enter <= leave).any()


def test_slab_reciprocals_are_finite():
    x = np.array([0, -0.0, 1e-45, -1e-45, 1e-20, -1e-20, 1, -0.5, 1e-30], np.float32)
    found = everywhere(slabs.slab_reciprocal, x)
    assert np.isfinite(found).all()
    np.testing.assert_array_equal(np.signbit(found), np.signbit(x))


# --- the tree ---------------------------------------------------------------------------------------------------------


def boxes_of(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    result = records(rec.Box, len(low), low=low, high=high)
    result["code"] = np.random.default_rng(1).permutation(len(low))
    if "cost" in (result.dtype.names or ()):
        result["cost"] = 1.0
    return result


def check_tree(nodes: np.ndarray, references: np.ndarray, slack: float) -> tuple[int, np.ndarray]:
    """Every reference is in at most one leaf, every child's box holds what is below it.

    Returns the depth of the tree, and the references that are in leaves.
    """
    seen = np.zeros(len(references), int)
    visited = np.zeros(len(nodes), int)
    deepest = 0
    waiting = [(0, 0, None, None)]
    while waiting:
        code, depth, low, high = waiting.pop()
        deepest = max(deepest, depth)
        if code >= 0:
            node = nodes[code]
            visited[code] += 1
            for side in ("left", "right"):
                child_low, child_high = node[f"{side}_low"], node[f"{side}_high"]
                if low is not None:
                    assert (low <= child_low).all()
                    assert (child_high <= high).all()
                waiting.append((int(node[side]), depth + 1, child_low, child_high))
            continue
        leaf = -1 - code
        first, count = leaf >> LEAF_SHIFT, (leaf & LEAF_MASK) + 1
        seen[first : first + count] += 1
        mine = references[first : first + count]
        assert (low <= mine["low"] - np.float32(slack)).all()
        assert (mine["high"] + np.float32(slack) <= high).all()
    # A single leaf is entered twice: a node has two children.
    assert seen.max() <= (1 if len(nodes) > 1 else 2)
    assert (visited == 1).all()
    return deepest, references[seen > 0]


def random_boxes(count: int) -> np.ndarray:
    draw = np.random.default_rng(count)
    middle, half = draw.uniform(-10, 10, (count, 3)), 10 ** draw.uniform(-3, 0, (count, 3))
    return boxes_of(middle - half, middle + half)


def doubling_line(count: int) -> np.ndarray:
    """Each box twice as far out as the one before: every division by area takes off a few at the end."""
    place = 2.0 ** np.linspace(-100, 90, count)
    corner = np.stack([place, np.zeros(count), np.zeros(count)], axis=1)
    return boxes_of(corner, corner * 1.01)


def nested(count: int) -> np.ndarray:
    """Boxes around one middle, each half as large as the one before."""
    half = np.tile(2.0 ** -np.linspace(0, 120, count)[:, None], (1, 3))
    return boxes_of(-half, half)


def endless(count: int) -> np.ndarray:
    """Boxes of planes and of open quadrics."""
    return boxes_of(np.full((count, 3), -1e30), np.full((count, 3), 1e30))


def flat_grid(count: int) -> np.ndarray:
    side = int(np.sqrt(count))
    x, y = (grid.reshape(-1) for grid in np.meshgrid(np.arange(side), np.arange(side)))
    corner = np.stack([x, y, np.zeros(side * side)], axis=1)
    return boxes_of(corner, corner + np.array([1, 1, 0]))


INPUTS = {
    "one": lambda: random_boxes(1),
    "two": lambda: random_boxes(2),
    "a leaf full": lambda: random_boxes(LEAF_MASK + 1),
    "one more": lambda: random_boxes(LEAF_MASK + 2),
    "many": lambda: random_boxes(100_000),
    "all equal": lambda: boxes_of(np.zeros((5000, 3)), np.ones((5000, 3))),
    "all a point": lambda: boxes_of(np.zeros((500, 3)), np.zeros((500, 3))),
    "a doubling line": lambda: doubling_line(20_000),
    "a short doubling line": lambda: doubling_line(150),
    "nested": lambda: nested(3000),
    "endless": lambda: endless(1000),
    "flat grid": lambda: flat_grid(10_000),
    "endless among others": lambda: np.concatenate([endless(3), random_boxes(1000)]),
}


@pytest.mark.parametrize("name", INPUTS)
def test_trees(name):
    given = INPUTS[name]()
    slack = 2.0**-18
    nodes, references = build_over(given, slack)
    depth, held = check_tree(nodes, references, slack)
    # Sorted, none lost.
    np.testing.assert_array_equal(np.sort(held, order="code"), np.sort(given, order="code"))
    assert len(nodes) <= max(1, len(given) - 1)
    assert depth < bvh.STACK_SIZE


@pytest.mark.parametrize("name", INPUTS)
def test_trees_whose_boxes_are_cut(name):
    """What is cut is held by the boxes of its parts together: a point of the whole is in one of them."""
    given = INPUTS[name]()
    given["code"] = np.arange(len(given))
    room = len(given) // 2
    nodes, references = build_over(given, 2.0**-18, room=room)
    depth, held = check_tree(nodes, references, 2.0**-18)
    assert depth < bvh.STACK_SIZE
    assert len(given) <= len(held) <= len(given) + room
    place = np.random.default_rng(3).uniform(0, 1, (len(given), 20, 3))
    points = given["low"][:, None] + place * (given["high"] - given["low"])[:, None].astype(np.float64)
    whole = given[held["code"]]
    assert (held["low"] >= whole["low"]).all()
    assert (held["high"] <= whole["high"]).all()
    mine = points[held["code"]]
    inside = ((held["low"][:, None] <= mine) & (mine <= held["high"][:, None])).all(axis=2)
    covered = np.zeros((len(given), 20), bool)
    np.logical_or.at(covered, held["code"], inside)
    assert covered.all()


def test_long_slanting_boxes_are_cut():
    """Diagonal sticks that cross: whole boxes all overlap, parts do not; so a ray asks for fewer of them."""
    draw = np.random.default_rng(9)
    rows = cones(9, 400)
    rows["base"], rows["length"], rows["radius"], rows["slope"] = draw.uniform(-9, 9, (400, 3)), 8, 0.05, 0
    scene = Scene.of(cone=rows)
    _, held = check_tree(scene.tables["bvh_nodes"], scene.tables["references"], 0.0)
    assert 1.3 * len(rows) < len(held) <= 1.5 * len(rows)
    whole = (scene.tables["boxes"]["high"] - scene.tables["boxes"]["low"]).prod(axis=1).sum()
    assert (held["high"] - held["low"]).prod(axis=1).sum() < 0.8 * whole


def test_a_tree_over_nothing_has_no_nodes():
    nodes, _ = build_over(records(rec.Box, 0))
    assert len(nodes) == 0


# --- the search -------------------------------------------------------------------------------------------------------


def mixed_scene(seed: int = 0) -> Scene:
    """Some of every kind, one-sided and two-sided, a few coincident, one endless of each sort."""
    triangle_rows = triangles(seed, 60)
    triangle_rows["flags"][::3] = 0
    triangle_rows[40:45] = triangle_rows[:5]
    sphere_rows = spheres(seed + 1, 40, TWO_SIDED)
    sphere_rows["flags"][::2] &= ~TWO_SIDED
    sphere_rows[30:33] = sphere_rows[:3]
    open_rows = random_quadrics("hyperboloid of one sheet", seed + 2, 2)
    ellipsoids = random_quadrics("ellipsoid", seed + 3, 10)
    ellipsoids["constant"] *= 0.1
    plane_rows = planes(seed + 4, 2, TWO_SIDED)
    plane_rows["d"] = [9, -9]
    return Scene.of(
        triangle=triangle_rows,
        quadric=np.concatenate([sphere_rows, open_rows, ellipsoids]),
        cone=cones(seed + 5, 20),
        plane=plane_rows,
        quad=quads(seed + 6, 20),
    )


@pytest.fixture(scope="module")
def mixed() -> Scene:
    return mixed_scene()


def test_nearest_is_the_nearest_of_all(mixed):
    origin, direction = rays(50, 3001, 8.0)
    found = mixed.nearest(origin, direction)
    expected = mixed.nearest_of_all(origin, direction)
    assert_same_bits(found, expected)
    assert len(np.unique(found[1])) > 50


def test_rays_that_leave_a_primitive(mixed):
    """From each hit onwards: the primitive just left is known by its code."""
    origin, direction = rays(51, 3001, 8.0)
    t, hit = mixed.nearest(origin, direction)
    there = hit != NOTHING
    start = (origin + np.where(there, t, 0)[:, None] * direction)[there]
    onwards = random_directions(np.random.default_rng(52), len(start))
    found = mixed.nearest(start, onwards, hit[there])
    assert_same_bits(found, mixed.nearest_of_all(start, onwards, hit[there]))


def test_shadows_are_cast_by_what_is_nearer_than_the_lamp(mixed):
    origin, direction = rays(53, 3001, 8.0)
    nearest, _ = mixed.nearest_of_all(origin, direction)
    distance = np.random.default_rng(54).uniform(0, 12, len(origin)).astype(np.float32)
    distance[::5] = nearest[::5]
    distance[1::5] = np.nextafter(nearest[1::5], np.float32(np.inf))
    left = np.where(np.arange(len(origin)) % 2 == 0, NOTHING, 5).astype(np.int32)
    expected, _ = mixed.nearest_of_all(origin, direction, left)
    np.testing.assert_array_equal(mixed.shadow(origin, direction, distance, left), expected < distance)


def test_any_grouping_of_lanes_gives_the_same_bits(mixed):
    """Coherent and incoherent rays; in their order, shuffled, and in packets of every width."""
    origin, direction = rays(55, 6001, 8.0)
    origin[:3000] = origin[0]
    order = np.random.default_rng(56).permutation(len(origin))
    back = np.argsort(order)
    distance = np.full(len(origin), 5.0, np.float32)
    left = np.where(np.arange(len(origin)) % 3 == 0, 3 * 32 + NUMBERS["triangle"], NOTHING).astype(np.int32)
    expected = mixed.nearest(origin, direction, left, width=1)
    shadowed = mixed.shadow(origin, direction, distance, left, width=1)
    for width in WIDTHS:
        assert_same_bits(mixed.nearest(origin, direction, left, width=width), expected, f"width {width}")
        shuffled = mixed.nearest(origin[order], direction[order], left[order], width=width)
        assert_same_bits([leaf[back] for leaf in shuffled], expected, f"width {width}, shuffled")
        np.testing.assert_array_equal(mixed.shadow(origin, direction, distance, left, width=width), shadowed)
        again = mixed.shadow(origin[order], direction[order], distance, left[order], width=width)
        np.testing.assert_array_equal(again[back], shadowed)


def test_the_search_is_what_the_interpreter_says(mixed):
    origin, direction = rays(57, 64, 8.0)
    for width in WIDTHS:
        found = mixed.nearest(origin, direction, width=width)
        assert_same_bits(found, mixed.nearest(origin, direction, machine="interpreter", width=width))
    distance = np.full(64, 4.0, np.float32)
    expected = mixed.shadow(origin, direction, distance, machine="interpreter")
    np.testing.assert_array_equal(mixed.shadow(origin, direction, distance), expected)


def test_the_order_of_the_primitives_does_not_show(mixed):
    """Permuted tables give the same hits, under the new codes."""
    draw = np.random.default_rng(58)
    orders = {name: draw.permutation(len(rows)) for name, rows in mixed.primitives.items()}
    permuted = Scene.of(**{name: rows[orders[name]] for name, rows in mixed.primitives.items()})
    origin, direction = rays(59, 4001, 8.0)
    t, hit = mixed.nearest(origin, direction)
    other_t, other_hit = permuted.nearest(origin, direction)
    np.testing.assert_array_equal(other_t, t)
    # The same record was hit, if not the same row: some stand twice.
    for name, rows in mixed.primitives.items():
        mine = (hit & 31 == NUMBERS[name]) & (hit != NOTHING)
        there = permuted.primitives[name][other_hit[mine] >> 5]
        np.testing.assert_array_equal(rows[hit[mine] >> 5], there)


def test_of_coincident_primitives_the_lower_code_is_hit():
    rows = triangles(60, 1).repeat(7)
    balls = spheres(61, 1).repeat(9)
    scene = Scene.of(triangle=rows, quadric=balls)
    aim = rows[0]["a"] * 0.3 + rows[0]["b"] * 0.3 + rows[0]["c"] * 0.4
    origin = (aim + 5 * random_directions(np.random.default_rng(62), 500)).astype(np.float32)
    for width in WIDTHS:
        _, hit = scene.nearest(origin, unit(aim - origin), width=width)
        on_triangle = hit & 31 == NUMBERS["triangle"]
        assert on_triangle.sum() > 100
        assert (hit[on_triangle & (hit != NOTHING)] >> 5 == 0).all()
        _, hit = scene.nearest(origin, unit(balls[0]["centre"] - origin), width=width)
        on_ball = (hit & 31 == NUMBERS["quadric"]) & (hit != NOTHING)
        assert on_ball.sum() > 100
        assert (hit[on_ball] >> 5 == 0).all()


def test_an_empty_scene_is_never_hit():
    scene = Scene.of()
    origin, direction = rays(63, 50)
    t, hit = scene.nearest(origin, direction)
    assert np.isinf(t).all()
    assert (hit == NOTHING).all()
    assert not scene.shadow(origin, direction, np.full(50, np.inf, np.float32)).any()


def test_plain_python_searches_alike(mixed):
    """Item by item, in CPython."""
    origin, direction = rays(64, 12, 8.0)
    assert_same_bits(mixed.nearest(origin, direction, machine="python"), mixed.nearest(origin, direction))


# --- meshes -----------------------------------------------------------------------------------------------------------


def ball_mesh(rings: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A closed mesh around (3, 2, 1), bumpy, of radius about 2: one-sided triangles facing out; and its corners."""
    draw = np.random.default_rng(seed)
    around, down = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False), np.linspace(0, np.pi, rings + 1))
    radius = 2 * (1 + 0.1 / rings * draw.normal(size=around.shape))
    radius[[0, -1]] = 2
    outward = np.stack([np.sin(down) * np.cos(around), np.sin(down) * np.sin(around), np.cos(down)], axis=-1)
    outward[[0, -1]] = outward[[0, -1], :1]
    corner = (radius[..., None] * outward + [3, 2, 1]).astype(np.float32)
    right = np.roll(corner, -1, axis=1)
    a, b, c, d = corner[:-1], corner[1:], right[1:], right[:-1]
    lower, upper = slice(0, rings - 1), slice(1, rings)
    fields = [
        np.concatenate([one[lower].reshape(-1, 3), two[upper].reshape(-1, 3)]) for one, two in ((a, a), (b, c), (c, d))
    ]
    rows = records(rec.Triangle, len(fields[0]), **dict(zip("abc", fields, strict=True)))
    return rows, corner[1:-1].reshape(-1, 3)


@pytest.mark.parametrize("distance", [5.0, 500.0])
@pytest.mark.parametrize("rings", [6, 60])
def test_no_ray_slips_through_a_mesh(rings, distance):
    """Aimed at corners and at edges, from outside at the faces that face it, from inside at all."""
    rows, corners = ball_mesh(rings)
    middle = np.array([3.0, 2, 1])
    draw = np.random.default_rng(65)
    count = 30_000
    triangle = rows[draw.integers(0, len(rows), count)]
    weights = draw.dirichlet([1, 1, 1], count)
    weights[::3] = np.eye(3)[draw.integers(0, 3, len(weights[::3]))]
    weights[1::3, 0] = 0
    weights /= weights.sum(axis=1, keepdims=True)
    aim = sum(weights[:, k, None] * triangle[name] for k, name in enumerate("abc"))
    for outside in (True, False):
        rows["flags"] = 0 if outside else TWO_SIDED
        scene = Scene.of(reach=distance + 10, triangle=rows)
        if outside:
            origin = (middle + distance * unit(unit(aim - middle) + 0.7 * random_directions(draw, count))).astype(
                np.float32
            )
        else:
            origin = (middle + draw.uniform(-0.5, 0.5, (count, 3))).astype(np.float32)
        direction = unit(aim - origin)
        # How far from the middle the ray passes: where that is well below the radius, it must meet the mesh.
        passes = np.linalg.norm(np.cross(middle - origin, direction.astype(np.float64)), axis=1) < 1.6
        for width in (1, 16):
            _, hit = scene.nearest(origin, direction, width=width)
            assert (hit != NOTHING)[passes].all()
            assert scene.shadow(origin, direction, np.full(count, np.inf, np.float32), width=width)[passes].all()
        assert passes.sum() > count / 3
    assert len(corners) == (rings - 1) * 2 * rings


@pytest.mark.parametrize("distance", [20.0, 300.0])
def test_lanes_do_not_show_on_a_fine_mesh(distance):
    """Camera rays and stray rays over small triangles far away: what one lane hits never depends on the others."""
    rows, _ = ball_mesh(90)
    scene = Scene.of(reach=distance + 10, triangle=rows)
    middle = np.array([3.0, 2, 1])
    draw = np.random.default_rng(66)
    eye = (middle + distance * unit(np.array([1.0, 2, 0.5]))).astype(np.float32)
    camera = np.tile(eye, (16_000, 1))
    stray = (middle + distance * random_directions(draw, 4000)).astype(np.float32)
    origin = np.concatenate([camera, stray])
    aim = middle + draw.uniform(-2.2, 2.2, (len(origin), 3))
    # Neighbours travel together.
    aim[:16_000] = aim[:16_000][np.lexsort(np.round(aim[:16_000] * 4).T)]
    direction = unit(aim - origin)
    expected = scene.nearest(origin, direction, width=1)
    met = expected[1] != NOTHING
    assert met.mean() > 0.3
    for width in WIDTHS[1:]:
        assert_same_bits(scene.nearest(origin, direction, width=width), expected, f"width {width}")
    flat = np.cross(rows["b"] - rows["a"], rows["c"] - rows["a"])[expected[1][met] >> 5]
    assert (dot(flat, direction[met]) < 0).all()
