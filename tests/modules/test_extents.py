"""Module 8 against float64, and the search through extents: against every primitive, for any grouping of lanes."""

from __future__ import annotations

import numpy as np
import pytest

from tasuki.mapping import map_module
from tasuki.modules import extents
from tasuki.modules import records as rec
from tasuki.modules.search import NOTHING
from tasuki.scene.extents import around, of_primitives
from tasuki.scene.kinds import lookup
from tests.machines.running import WIDTHS, assert_same_bits
from tests.modules.primitives import cones, planes, quads, rays, spheres, triangles
from tests.modules.running import dot, everywhere, random_directions, records, unit
from tests.modules.searching import FILLERS, NUMBERS, Scene

# --- module 8 ---------------------------------------------------------------------------------------------------------


def passes(centre: np.ndarray, radius: np.ndarray, origin: np.ndarray, direction: np.ndarray, far: np.ndarray):
    """By how much of its radius a ray's points at 0 <= t <= far pass a sphere, in float64; negative where it meets."""
    centre, origin, direction = (values.astype(np.float64) for values in (centre, origin, direction))
    t = np.clip(dot(centre - origin, direction) / dot(direction, direction), 0.0, far)
    return np.linalg.norm(origin + t[:, None] * direction - centre, axis=1) / radius - 1.0


@pytest.mark.parametrize("away", [0.0, 1e3])
def test_no_ray_that_meets_a_sphere_misses_it(away):
    """Rays past the rim, from inside, beginning and ending at the surface; near the origin, and far from it."""
    count = 40_000
    draw = np.random.default_rng(80)
    centre = (away + draw.uniform(-5, 5, (count, 3))).astype(np.float32)
    radius = (10 ** draw.uniform(-3, 1, count)).astype(np.float32)
    aside = unit(draw.normal(size=(count, 3)))
    along = unit(np.cross(aside, draw.normal(size=(count, 3))))
    aim = centre + aside * (radius * draw.choice([0.0, 0.5, 1.0, 1.0, 1.5], count))[:, None]
    origin = (aim + along * (10 ** draw.uniform(-2, 2, count))[:, None]).astype(np.float32)
    direction = unit(aim - origin)
    direction[::9] *= -1.0
    far = np.full(count, np.inf, np.float32)
    # Some end just where the sphere begins.
    far[::3] = np.maximum(dot(centre - origin, direction) - radius, 0.0)[::3]
    found = everywhere(extents.extent_intersection, centre, radius, origin, direction, far)
    exact = passes(centre, radius, origin, direction, far)
    assert found[exact <= 0.0].all()
    assert (exact <= 0.0).mean() > 0.3
    # Nor does every ray meet it: past the rim the test is sharp, but for what rounding takes away.
    past = passes(centre, radius, origin, direction, np.full(count, np.inf))
    rounding = 1e-5 * (1.0 + np.linalg.norm(centre - origin, axis=1) / radius)
    behind = dot(centre - origin, direction) < -radius * (1.0 + rounding)
    clear = (past > rounding) & ((dot(centre - origin, direction) > 0.0) | behind)
    assert clear.mean() > 0.1
    assert not found[clear].any()


def test_what_lies_beyond_is_not_met():
    centre, origin = np.array([[0, 0, 9]], np.float32), np.zeros((1, 3), np.float32)
    direction, radius = np.array([[0, 0, 1]], np.float32), np.ones(1, np.float32)
    met = [
        bool(map_module(extents.extent_intersection, centre, radius, origin, direction, np.float32([far]))[0])
        for far in (7.9, 8.0, 9.0, np.inf)
    ]
    assert met == [False, True, True, True]


# --- the search -------------------------------------------------------------------------------------------------------


def nodes_over(scene: Scene, seed: int) -> np.ndarray:
    """The things of a scene in groups of groups, put together at random; what has no bounds has no extent."""
    draw = np.random.default_rng(seed)
    codes, spheres_around = [], []
    for name, rows in scene.primitives.items():
        codes += [index * 32 + NUMBERS[name] for index in range(len(rows))]
        bounded = np.full((len(rows), 4), -1.0) if name == "plane" else of_primitives(lookup(name), rows)
        spheres_around += list(bounded)
    order = draw.permutation(len(codes)).tolist()
    rows: list[list] = []

    def group(members: list[int]) -> None:
        first = len(rows)
        inside = np.array([spheres_around[thing] for thing in members])
        bounded = (inside[:, 3] >= 0.0).all()
        extent = around(inside, np.zeros(len(inside), int), 1)[0] if bounded else (0.0, 0.0, 0.0, -1.0)
        rows.append([extent, 0, -1])
        while members:
            count = int(draw.integers(1, len(members) + 1))
            if count > 3 and draw.random() < 0.7:
                group(members[: count - 1])
                members = members[count - 1 :]
            else:
                rows.append([spheres_around[members[0]], len(rows) + 1, codes[members[0]]])
                members = members[1:]
        rows[first][1] = len(rows)

    group(order)
    nodes = records(rec.ExtentNode, len(rows), skip=[row[1] for row in rows], code=[row[2] for row in rows])
    every = np.array([row[0] for row in rows])
    nodes["centre"], nodes["radius"] = every[:, :3], every[:, 3] + np.abs(every[:, :3]).max(axis=1) * 2.0**-22
    return nodes


def mixed_scene() -> Scene:
    """Some of every kind that stands alone, one-sided and two-sided, a few coincident; and planes."""
    sphere_rows = spheres(91, 40)
    sphere_rows[30:33] = sphere_rows[:3]
    triangle_rows = triangles(90, 60)
    triangle_rows["flags"][::3] = 0
    scene = Scene.of(
        triangle=triangle_rows, quadric=sphere_rows, cone=cones(92, 20), quad=quads(93, 20), plane=planes(94, 2)
    )
    scene.tables["extent_nodes"] = nodes_over(scene, 95)
    return scene


@pytest.fixture(scope="module")
def mixed() -> Scene:
    return mixed_scene()


def nearest(scene: Scene, origin: np.ndarray, direction: np.ndarray, left=NOTHING, **options):
    left = np.broadcast_to(np.int32(left), len(origin))
    return map_module(extents.nearest_in_extents, origin, direction, left, fill=FILLERS, tables=scene.tables, **options)


def shadow(scene: Scene, origin: np.ndarray, direction: np.ndarray, distance: np.ndarray, **options):
    left = np.full(len(origin), NOTHING, np.int32)
    return map_module(
        extents.shadow_in_extents, origin, direction, left, distance, fill=FILLERS, tables=scene.tables, **options
    )


def test_nearest_is_the_nearest_of_all(mixed):
    origin, direction = rays(96, 3001, 8.0)
    found = nearest(mixed, origin, direction)
    assert_same_bits(found, mixed.nearest_of_all(origin, direction))
    assert_same_bits(found, mixed.nearest(origin, direction))
    assert len(np.unique(found[1])) > 50


def test_rays_that_leave_a_primitive(mixed):
    origin, direction = rays(97, 3001, 8.0)
    t, hit = nearest(mixed, origin, direction)
    there = hit != NOTHING
    start = (origin + np.where(there, t, 0)[:, None] * direction)[there]
    onwards = random_directions(np.random.default_rng(98), len(start))
    found = nearest(mixed, start, onwards, hit[there])
    assert_same_bits(found, mixed.nearest_of_all(start, onwards, hit[there]))


def test_any_grouping_of_lanes_gives_the_same_bits(mixed):
    origin, direction = rays(99, 3001, 8.0)
    order = np.random.default_rng(100).permutation(len(origin))
    distance = np.random.default_rng(101).uniform(0, 12, len(origin)).astype(np.float32)
    t, _ = expected = nearest(mixed, origin, direction, width=1)
    distance[::5] = t[::5]
    blocked = t < distance
    for width in WIDTHS:
        assert_same_bits(nearest(mixed, origin, direction, width=width), expected, f"width {width}")
        shuffled = nearest(mixed, origin[order], direction[order], width=width)
        assert_same_bits([leaf[np.argsort(order)] for leaf in shuffled], expected, f"width {width}, shuffled")
        np.testing.assert_array_equal(shadow(mixed, origin, direction, distance, width=width), blocked)


def test_the_search_is_what_the_interpreter_and_plain_python_say(mixed):
    origin, direction = rays(102, 24, 8.0)
    distance = np.full(len(origin), 4.0, np.float32)
    for machine in ("interpreter", "python"):
        assert_same_bits(nearest(mixed, origin, direction, machine=machine), nearest(mixed, origin, direction))
        found = shadow(mixed, origin, direction, distance, machine=machine)
        np.testing.assert_array_equal(found, shadow(mixed, origin, direction, distance))


def test_an_empty_scene_is_never_hit():
    scene = Scene.of()
    scene.tables["extent_nodes"] = records(rec.ExtentNode, 0)
    origin, direction = rays(103, 50)
    t, hit = nearest(scene, origin, direction)
    assert np.isinf(t).all()
    assert (hit == NOTHING).all()
    assert not shadow(scene, origin, direction, np.full(50, np.inf, np.float32)).any()
