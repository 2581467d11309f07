"""Triangles and quadrilaterals: hits, sides, normals and bounds. (That meshes are watertight: see `test_search`.)"""

from __future__ import annotations

import numpy as np
import pytest

from tasuki.mapping import map_module
from tasuki.modules import quad, triangle
from tasuki.modules.records import INSIDE_ONLY, TWO_SIDED, Triangle
from tests.modules.primitives import COUNT, point_at, quads, rays, triangles
from tests.modules.running import EPSILON, dot, everywhere, records, unit


def barycentric(given: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights of the corners in float64, and the height above the plane."""
    a, b, c = (given[name].astype(np.float64) for name in "abc")
    normal = np.cross(b - a, c - a)
    area = dot(normal, normal)
    weights = [dot(np.cross(q - p, point - p), normal) / area for p, q in ((b, c), (c, a), (a, b))]
    return np.stack(weights, axis=-1), dot(normal, point - a) / np.sqrt(area)


def test_hits_of_triangles():
    given, (origin, direction) = triangles(32), rays(33)
    aim = (given["a"] + given["b"] + given["c"]) / 3
    direction[::2] = unit(aim - origin)[::2]
    hit = everywhere(triangle.triangle_hit, given, origin, direction, np.zeros(COUNT, bool))
    normal = np.cross(given["b"] - given["a"], given["c"] - given["a"]).astype(np.float64)
    flat = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    steepness = np.abs(dot(flat, direction))
    fair = (steepness > 1e-2) & (np.linalg.norm(normal, axis=-1) > 0.1)
    met = np.isfinite(hit) & fair
    exact = dot(flat, given["a"] - origin.astype(np.float64)) / dot(flat, direction)
    weights, _ = barycentric(given, point_at(origin, direction, np.where(fair, exact, 0)))
    np.testing.assert_allclose(hit[met], exact[met], rtol=0, atol=3e-4)
    assert (weights[met] > -1e-4).all()
    assert (np.abs(hit - exact) * steepness)[met].max() < 1e-5
    missed = ~np.isfinite(hit) & fair
    assert not ((weights[missed] > 1e-4).all(axis=-1) & (exact[missed] > 1e-4)).any()
    assert met.sum() > COUNT / 4
    assert np.isinf(everywhere(triangle.triangle_hit, given, origin, direction, np.ones(COUNT, bool))).all()


def test_sides_of_triangles():
    given, (origin, direction) = triangles(34), rays(35)
    aim = (given["a"] + given["b"] + given["c"]) / 3
    direction = unit(aim - origin)
    normal = np.cross(given["b"] - given["a"], given["c"] - given["a"])
    facing = dot(normal, direction)
    fair = np.abs(facing) > 1e-3
    both = map_module(triangle.triangle_hit, given, origin, direction, False)
    for flags, shows in ((0, facing < 0), (INSIDE_ONLY, facing > 0)):
        given["flags"] = flags
        hit = everywhere(triangle.triangle_hit, given, origin, direction, np.zeros(COUNT, bool))
        np.testing.assert_array_equal(hit[fair], np.where(shows, both, np.inf)[fair])


def test_smooth_normals_are_weighted_by_where_the_ray_passes():
    given, (origin, _) = triangles(36), rays(37)
    for name in ("normal_a", "normal_b", "normal_c"):
        given[name][:, 2] = np.abs(given[name][:, 2]) + 1
    weights = np.random.default_rng(38).dirichlet([1, 1, 1], COUNT)
    aim = sum(weights[:, k, None] * given[name] for k, name in enumerate("abc"))
    direction = unit(aim - origin)
    point = aim.astype(np.float32)
    flat, smooth, attribute, _ = everywhere(triangle.triangle_surface, given, origin, direction, point)
    normal = np.cross(given["b"] - given["a"], given["c"] - given["a"])
    fair = (np.abs(dot(normal, direction)) > 0.05) & (np.linalg.norm(aim - origin, axis=-1) > 0.1)
    expected = sum(weights[:, k, None] * given[f"normal_{name}"] for k, name in enumerate("abc"))
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    assert np.abs(smooth - expected)[fair].max() < 1e-4
    assert np.abs(np.abs(dot(flat, normal)) / np.linalg.norm(normal, axis=-1) - 1)[fair].max() < 1e-6
    np.testing.assert_array_equal(attribute, 0)


@pytest.mark.parametrize("size", [1.0, 1e-2, 1e-3])
def test_small_triangles_far_away_are_hit_where_they_are(size):
    """A ray's place in the triangle is off by roundings of its distance, not of the distance's square over the size."""
    draw = np.random.default_rng(39)
    given, (origin, _) = triangles(40), rays(41, reach=10)
    middle = draw.uniform(-5, 5, (COUNT, 3))
    corners = middle[None] + size * draw.normal(size=(3, COUNT, 3))
    for name, corner in zip("abc", corners, strict=True):
        given[name] = corner
    weights = draw.dirichlet([1, 1, 1], COUNT)
    weights += draw.choice([-0.2, 0.0], (COUNT, 1)) * (weights == weights.max(axis=1, keepdims=True))
    weights /= weights.sum(axis=1, keepdims=True)
    aim = sum(weights[:, k, None] * given[name].astype(np.float64) for k, name in enumerate("abc"))
    direction = unit(aim - origin)
    hit = everywhere(triangle.triangle_hit, given, origin, direction, np.zeros(COUNT, bool))
    normal = np.cross(given["b"].astype(np.float64) - given["a"], given["c"].astype(np.float64) - given["a"])
    flat = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    exact = dot(flat, given["a"] - origin.astype(np.float64)) / dot(flat, direction)
    where, _ = barycentric(given, point_at(origin, direction, exact))
    edges = np.stack([given["c"] - given["b"], given["a"] - given["c"], given["b"] - given["a"]])
    lengths = np.linalg.norm(edges, axis=-1).T
    # How far within the triangle, seen along the ray, against roundings of the distance.
    heights = np.linalg.norm(normal, axis=-1)[:, None] / lengths * np.abs(dot(flat, direction))[:, None]
    margin = (where * heights).min(axis=1)
    bound = 30 * EPSILON * (np.linalg.norm(origin, axis=-1) + np.linalg.norm(aim, axis=-1))
    assert np.isfinite(hit)[margin > bound].all()
    assert not np.isfinite(hit)[margin < -bound].any()
    assert (np.abs(margin) > bound).mean() > 0.5


def halves(given: np.ndarray) -> list[np.ndarray]:
    """The triangles abc and acd of quadrilaterals."""
    pairs = []
    for corners in ("abc", "acd"):
        fields = {target: given[source] for target, source in zip("abc", corners, strict=True)}
        fields |= {f"normal_{target}": given[f"normal_{source}"] for target, source in zip("abc", corners, strict=True)}
        pairs.append(records(Triangle, len(given), **fields, flags=given["flags"]))
    return pairs


def test_quadrilaterals_are_two_triangles():
    given, (origin, direction) = quads(42), rays(43)
    direction[::2] = unit(given["a"] * 0.5 + given["c"] * 0.3 + given["b"] * 0.2 - origin)[::2]
    leaving = np.zeros(COUNT, bool)
    hit = everywhere(quad.quad_hit, given, origin, direction, leaving)
    both = np.fmin(*(map_module(triangle.triangle_hit, half, origin, direction, leaving) for half in halves(given)))
    normal = np.cross(given["c"] - given["a"], given["d"] - given["b"]).astype(np.float64)
    size = np.linalg.norm(normal, axis=-1)
    fair = (np.abs(dot(normal, direction)) > 0.05 * size) & (size > 0.1)
    np.testing.assert_array_equal(np.isfinite(hit)[fair], np.isfinite(both)[fair])
    met = fair & np.isfinite(hit)
    assert met.sum() > COUNT / 4
    np.testing.assert_allclose(hit[met], both[met], atol=2e-4)
    flat, smooth, _, _ = everywhere(quad.quad_surface, given, origin, direction, point_at(origin, direction, both))
    assert np.abs(np.abs(dot(flat, normal)) / size - 1)[met].max() < 1e-5
    assert np.abs(dot(smooth, normal) / size - 1)[met].max() < 1e-5


@pytest.mark.parametrize(("module", "made"), [(triangle.triangle_bounds, triangles), (quad.quad_bounds, quads)])
def test_bounds_of_polygons_are_those_of_their_corners(module, made):
    given = made(44)
    low, high = everywhere(module, given)
    corners = np.stack([given[name] for name in "abcd" if name in (given.dtype.names or ())])
    np.testing.assert_array_equal(low, corners.min(axis=0))
    np.testing.assert_array_equal(high, corners.max(axis=0))


def test_a_degenerate_triangle_is_never_hit():
    given = records(Triangle, 3, a=[0, 0, 1], b=[[0, 0, 1], [1, 0, 1], [2, 2, 1]], c=[[0, 0, 1], [2, 0, 1], [1, 1, 1]])
    given["flags"] = TWO_SIDED
    for direction in ([0, 0, 1.0], [0.6, 0, 0.8]):
        hit = everywhere(triangle.triangle_hit, given, np.zeros(3), np.array(direction), False)
        assert not (hit < np.inf).any()
