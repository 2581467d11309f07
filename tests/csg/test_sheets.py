"""Polygons in the faces of solids: both are one surface, from all sides and from within."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tasuki.scene import Camera, Material, Scene
from tasuki.scene.pack import pack
from tasuki.scene.solids import Box, Cylinder, HalfSpace, Polygon
from tasuki.scene.tree import Extent, Group, Node, Union
from tests.csg.pictures import BACKGROUND, camera_from, flat_material, rendered

GLASS = Material("glass", diffuse=0.0, ambient=0.0, transmission=1.0, index=1.5)
AIR = replace(GLASS, name="air", index=1.0)
PAINT = replace(flat_material(200), two_sided=True)
SQUARE = ((-2.0, -2.0, 0.0), (2.0, -2.0, 0.0), (2.0, 2.0, 0.0), (-2.0, 2.0, 0.0))
DENTED = ((-2.0, -2.0, 0.0), (2.0, -2.0, 0.0), (2.0, 2.0, 0.0), (0.3, 0.2, 0.0), (-2.0, 2.0, 0.0))
FLOOR = Polygon(SQUARE, material=PAINT)
PLATE = Box((-2.0, -2.0, -1e-4), (2.0, 2.0, 0.0), material=PAINT)
BLOCK = Box((-1.0, -1.1, 0.0), (1.2, 1.0, 0.7))


def of(solid: Node, material: Material) -> Node:
    return Union((solid,), material=material)


def picture(*things: Node, camera: Camera, **options) -> np.ndarray:
    return rendered(Scene(camera, things, (), BACKGROUND), depth=12, **options)


def wrong(first: np.ndarray, second: np.ndarray) -> int:
    """In how many pixels two pictures differ."""
    assert np.ptp(first[..., 0]) > 0.1
    return int((np.abs(first - second).max(axis=2) > 2e-3).sum())


def turned(*things: Node) -> Node:
    """All of them at odd angles, as one node."""
    return Group(things).rotate((1, 2, 3), 37.0).translate(0.3, 0.2, 0.1)


def objects(*things: Node) -> int:
    """How many objects a scene has in memory."""
    return pack(Scene(camera_from(1), things, (), BACKGROUND)).objects.count


@pytest.mark.parametrize("placed", [Group, lambda things: turned(*things)])
@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("solid", [BLOCK, Cylinder((0, 0, 0), (0, 0, 0.9), 1.1)])
def test_glass_on_a_polygon_is_glass_on_a_thin_plate(solid, first, placed):
    for number in range(6):
        camera = replace(camera_from(number), angle=50.0)
        things = [(of(solid, GLASS), floor)[:: 1 if first else -1] for floor in (FLOOR, PLATE)]
        found, expected = (picture(placed(pair), camera=camera) for pair in things)
        # The plate's edges are not quite where the polygon's are.
        assert wrong(found, expected) <= 4


@pytest.mark.parametrize("outline", [SQUARE, DENTED])
def test_what_does_not_refract_is_not_seen_on_a_polygon(outline):
    floor = Polygon(outline, material=PAINT)
    for number in range(6):
        camera = camera_from(number)
        alone, under = picture(turned(floor), camera=camera), picture(turned(of(BLOCK, AIR), floor), camera=camera)
        assert wrong(under, alone) == 0


def test_no_ray_slips_through_where_such_polygons_meet_others():
    draw, side = np.random.default_rng(5), 16
    grid = np.linspace(-2.0, 2.0, side + 1)
    points = np.zeros((side + 1, side + 1, 3))
    points[..., 0], points[..., 1] = np.meshgrid(grid, grid, indexing="ij")
    points[1:-1, 1:-1, :2] += draw.uniform(-0.08, 0.08, (side - 1, side - 1, 2))
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    corners = np.concatenate([np.stack(one, axis=2).reshape(-1, 3, 3) for one in ((a, b, c), (a, c, d))])
    tiles = [Polygon(tuple(map(tuple, one)), material=PAINT) for one in corners.tolist()]
    wall = Polygon(((-2.0, -2.0, 0.0), (-2.0, 2.0, 0.0), (-2.0, 2.0, 0.9), (-2.0, -2.0, 0.9)), material=PAINT)
    blocks = of(Box((-1, -1.1, 0), (0.1, 1, 0.7)), AIR), of(Box((-2, -2, 0), (-1.4, 1.7, 0.5)), AIR)
    assert 10 < objects(*blocks, *tiles, wall) - 2 < len(tiles)
    for number in range(6):
        camera = camera_from(number)
        alone = picture(turned(*tiles, wall), camera=camera, size=(200, 200))
        assert wrong(picture(turned(*blocks, *tiles, wall), camera=camera, size=(200, 200)), alone) == 0


def test_a_polygon_on_a_face_shows_if_it_comes_first():
    table, sticker = of(Box((-2, -2, -1), (2, 2, 0)), flat_material(77)), Polygon(SQUARE, material=flat_material(300))
    camera = camera_from(3)
    over = [picture(*things, camera=camera) for things in ((sticker, table), (table, sticker), (table,))]
    assert not np.array_equal(over[0], over[2])
    assert np.array_equal(over[1], over[2])


def test_only_polygons_that_matter_become_objects():
    opaque = flat_material(77)
    one_sided = Polygon(SQUARE, material=opaque)
    far = Polygon(tuple((x + 9.0, y, z) for x, y, z in SQUARE), material=PAINT)
    slope = Polygon(((-2, -2, 0), (2, -2, 0), (2, 2, 0.01), (-2, 2, 0.01)), material=PAINT)
    rounded = Polygon(SQUARE, ((0.1, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1)), material=PAINT)
    plain = Polygon(SQUARE, ((0, 0, 2), (0, 0, 1), (0, 0, 1), (0, 0, 1)), material=PAINT)
    glass = of(BLOCK, GLASS)
    assert [objects(glass, one) for one in (one_sided, far, slope, rounded, plain)] == [2, 1, 1, 1, 2]
    # Of what stands on a floor the under side shows from below only, the floor from above.
    assert objects(of(BLOCK, opaque), one_sided) == 1
    assert objects(of(HalfSpace((0, 0, 1), (0, 0, 0)), opaque), one_sided) == 2


def test_a_polygon_under_glass_shows_its_front_only():
    one_sided = Polygon(SQUARE, material=replace(PAINT, two_sided=False))
    above, below = (replace(camera_from(5), eye=(0.3, 0.2, height), up=(0.0, 1.0, 0.0)) for height in (5.0, -5.0))
    middle = (slice(24, 40), slice(24, 40))
    block = of(BLOCK, AIR)
    for camera, colour in ((above, PAINT.colour), (below, BACKGROUND)):
        seen = picture(block, one_sided, camera=camera)[middle]
        assert seen.reshape(-1, 3) == pytest.approx(np.broadcast_to(colour, (256, 3)), abs=1e-6)


def test_every_accelerator_finds_them():
    camera = camera_from(3)
    things = Group((of(BLOCK, GLASS), FLOOR), extent=Extent((0.0, 0.0, 0.0), 4.0))
    by_boxes, by_extents = (picture(things, camera=camera, accelerator=name) for name in ("bvh", "extents"))
    assert np.array_equal(by_boxes, by_extents)
    automatic = Group((of(BLOCK, GLASS), FLOOR), extent="auto")
    assert np.array_equal(picture(automatic, camera=camera, accelerator="extents"), by_boxes)
