"""Parts of primitives between two planes: every point of a primitive is in the box of the part in which it lies."""

from __future__ import annotations

import numpy as np
import pytest

from tasuki.mapping import map_module
from tasuki.scene.kinds import lookup
from tests.modules.primitives import cones, quads, spheres, triangles
from tests.modules.running import random_directions

COUNT, POINTS = 2000, 12
ROUNDING = 2.0**-19
"""Of the largest coordinate, which is below 16: twice the bound by which the builder widens a part."""


def on_polygons(rows: np.ndarray, draw: np.random.Generator) -> np.ndarray:
    corners = np.stack([rows[name] for name in "abcd" if name in rows.dtype.names], axis=1).astype(np.float64)
    return np.einsum("nkc,ncx->nkx", draw.dirichlet(np.full(corners.shape[1], 0.5), (COUNT, POINTS)), corners)


def on_spheres(rows: np.ndarray, draw: np.random.Generator) -> np.ndarray:
    way = random_directions(draw, COUNT * POINTS).reshape(COUNT, POINTS, 3).astype(np.float64)
    return rows["centre"][:, None] + np.sqrt(rows["constant"].astype(np.float64))[:, None, None] * way


def on_cones(rows: np.ndarray, draw: np.random.Generator) -> np.ndarray:
    axis = rows["axis"][:, None].astype(np.float64)
    way = np.cross(axis, draw.normal(size=(COUNT, POINTS, 3)))
    way /= np.linalg.norm(way, axis=2, keepdims=True)
    height = draw.uniform(0, 1, (COUNT, POINTS)) * rows["length"][:, None]
    radius = rows["radius"][:, None] + rows["slope"][:, None].astype(np.float64) * height
    return rows["base"][:, None] + height[..., None] * axis + radius[..., None] * way


KINDS = {
    "triangle": (triangles, on_polygons),
    "quad": (quads, on_polygons),
    "quadric": (spheres, on_spheres),
    "cone": (cones, on_cones),
}


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("name", KINDS)
def test_parts_hold_the_points_between_the_planes(name, axis):
    make, points_on = KINDS[name]
    draw = np.random.default_rng(axis)
    rows = make(17, COUNT)
    points = points_on(rows, draw)
    # Planes through points of the primitive, so that many parts are narrow, or an edge's end.
    low, high = np.sort(points[:, :2, axis], axis=1).T.astype(np.float32)
    high[::5] = low[::5]
    module = lookup(name).resolve("part")
    part_low, part_high = map_module(module, rows, np.int32(axis), low, high)
    between = (low[:, None] <= points[..., axis]) & (points[..., axis] <= high[:, None])
    reach = ROUNDING * np.abs(points).max(axis=(1, 2))[:, None, None]
    inside = (part_low[:, None] - reach <= points) & (points <= part_high[:, None] + reach)
    # Along the axis the planes themselves bound the part.
    assert between.sum() > COUNT
    assert inside.all(axis=2)[between].all()


@pytest.mark.parametrize("name", ["triangle", "quad"])
def test_parts_of_polygons_are_tight(name):
    """Between planes that hold it all a polygon's part is its box, to the bit; beyond it there is none."""
    make, _ = KINDS[name]
    rows = make(18, COUNT)
    kind = lookup(name)
    box_low, box_high = map_module(kind.resolve("box"), rows)
    part = kind.resolve("part")
    low, high = map_module(part, rows, np.int32(1), box_low[:, 1].copy(), box_high[:, 1].copy())
    np.testing.assert_array_equal(low, box_low)
    np.testing.assert_array_equal(high, box_high)
    low, high = map_module(part, rows, np.int32(1), box_high[:, 1] + 1, box_high[:, 1] + 2)
    assert (low > high).all()
