"""Directions of rays and light on surfaces."""

from __future__ import annotations

import numpy as np
import pytest

from tasuki.mapping import map_module
from tasuki.modules import polygon
from tasuki.modules import records as rec
from tasuki.modules.directions import reflection_direction, view_direction
from tasuki.modules.shading import accumulate_luminance, diffuse_and_highlight
from tests.modules.running import EPSILON, dot, everywhere, exactly, random_directions, records, unit

COUNT = 5000


def directions(seed: int) -> np.ndarray:
    return random_directions(np.random.default_rng(seed), COUNT)


def test_reflection_keeps_length_and_angle():
    direction, normal = directions(0), directions(1)
    mirrored = everywhere(reflection_direction, direction, normal)
    assert np.abs(np.linalg.norm(mirrored, axis=1) - 1).max() < 8 * EPSILON
    assert np.abs(dot(mirrored, normal) + dot(direction, normal)).max() < 8 * EPSILON
    # In the plane of the two.
    assert np.abs(dot(mirrored, np.cross(direction, normal))).max() < 8 * EPSILON
    again = map_module(reflection_direction, mirrored, normal)
    assert np.abs(again - direction).max() < 16 * EPSILON


def test_reflection_of_any_length_keeps_it():
    direction, normal = directions(2) * np.float32(1000), directions(3)
    mirrored = everywhere(reflection_direction, direction, normal)
    assert np.abs(np.linalg.norm(mirrored, axis=1) / 1000 - 1).max() < 8 * EPSILON


def test_a_ray_along_the_normal_comes_back_and_one_across_goes_on():
    axes = np.eye(3, dtype=np.float32)
    np.testing.assert_array_equal(map_module(reflection_direction, -axes, axes), axes)
    across = np.roll(axes, 1, axis=1)
    np.testing.assert_array_equal(map_module(reflection_direction, across, axes), across)


def test_view_directions_lead_through_the_picture():
    view = records(rec.View, 1, eye=[5, 6, 7], corner=[-2, 1.5, -3], right=[0.5, 0, 0], down=[0, -0.5, 0])[0]
    x, y = np.random.default_rng(4).uniform(0, 8, (2, COUNT)).astype(np.float32)
    found = everywhere(view_direction, view, x, y)
    exact = exactly(view_direction, view, x, y)
    assert np.abs(found - exact).max() < 4 * EPSILON
    assert np.abs(np.linalg.norm(found, axis=1) - 1).max() < 4 * EPSILON
    middle = map_module(view_direction, view, np.float32([4]), np.float32([3]))
    np.testing.assert_array_equal(middle, [[0, 0, -1]])


def test_the_basis_across_a_direction():
    direction = directions(5)
    right, up = everywhere(polygon.basis_across, direction)
    for one, other in ((right, up), (right, direction), (up, direction)):
        assert np.abs(dot(one, other)).max() < 8 * EPSILON
    length = np.linalg.norm(right, axis=1)
    assert 0.66 < length.min() < length.max() < 1 + 8 * EPSILON
    assert np.abs(np.linalg.norm(up, axis=1) - length).max() < 8 * EPSILON
    assert np.abs(np.cross(right, up) / length[:, None] ** 2 - direction).max() < 16 * EPSILON


def test_the_side_of_an_edge_is_never_the_wrong_one():
    """Against exact arithmetic: products of two float32 are exact in float64, and so is which one is larger."""
    draw = np.random.default_rng(6)
    numbers = draw.normal(size=(4, 200_000)).astype(np.float32)
    # Nearly collinear with the ray: q is p, stretched, and off by a rounding.
    numbers[2:] = numbers[:2] * draw.normal(size=200_000).astype(np.float32)
    px, py, qx, qy = numbers
    p, q = {"x": px, "y": py}, {"x": qx, "y": qy}
    side = everywhere(polygon.edge_side, p, q)
    left, right = py.astype(np.float64) * qx, px.astype(np.float64) * qy
    exact = np.sign(left - right)
    assert ((np.sign(side) == exact) | (side == 0)).all()
    assert (side != 0).mean() > 0.3
    np.testing.assert_array_equal(map_module(polygon.edge_side, q, p), -side)


def attributes(seed: int) -> np.ndarray:
    draw = np.random.default_rng(seed)
    made = records(rec.Attribute, COUNT, colour=draw.uniform(0, 1, (COUNT, 3)))
    for name in ("ambient", "diffuse", "specular"):
        made[name] = draw.choice([0, 0.3, 1.0], COUNT)
    made["exponent"] = draw.choice([0, 1, 3.5, 50, 1000], COUNT)
    return made


def lit(seed: int) -> tuple[np.ndarray, ...]:
    """Unit normals, and directions of which the ray's goes against it."""
    normal, direction, to_light = directions(seed), directions(seed + 1), directions(seed + 2)
    # Some lamps stand exactly where the mirror direction leads.
    to_light[::7] = unit(map_module(reflection_direction, direction, normal))[::7]
    facing = dot(normal, direction) > 0
    return np.where(facing[:, None], -normal, normal), direction, to_light


def test_shading_is_finite_and_never_negative():
    attribute, (normal, direction, to_light) = attributes(7), lit(8)
    colour = np.random.default_rng(9).uniform(0, 2, (COUNT, 3)).astype(np.float32)
    found = everywhere(diffuse_and_highlight, attribute, normal, direction, to_light, colour)
    assert np.isfinite(found).all()
    assert (found >= 0).all()
    # No more than diffuse and highlight at their most; the mirror direction's length is off by roundings, which a large
    # exponent magnifies.
    most = colour * (attribute["diffuse"][:, None] * attribute["colour"] + attribute["specular"][:, None])
    assert (found <= most * (1 + 1e-3) + 1e-6).all()


def test_shading_agrees_with_float64():
    attribute, (normal, direction, to_light) = attributes(10), lit(11)
    colour = np.ones(3)
    found = map_module(diffuse_and_highlight, attribute, normal, direction, to_light, colour)
    mirrored = direction - 2 * dot(direction, normal)[:, None] * normal
    cosine = np.maximum(dot(mirrored, to_light), 0)
    with np.errstate(under="ignore"):
        highlight = attribute["specular"] * np.where(attribute["exponent"] == 0, 1, cosine ** attribute["exponent"])
    diffuse = attribute["diffuse"] * np.maximum(dot(normal, to_light), 0)
    exact = diffuse[:, None] * attribute["colour"] + highlight[:, None]
    # A cosine that is off by a few roundings, to the power of the exponent.
    bound = 2e-5 + 10 * EPSILON * attribute["exponent"]
    assert (np.abs(found - exact) <= bound[:, None]).all()


def test_no_light_from_behind():
    attribute = records(rec.Attribute, 1, colour=1, diffuse=1, specular=0)[0]
    normal = directions(12)
    found = everywhere(diffuse_and_highlight, attribute, normal, -normal, -normal, np.ones(3))
    np.testing.assert_array_equal(found, 0)


@pytest.mark.parametrize("exponent", [1.0, 20.0, 1000.0])
def test_the_highlight_is_greatest_in_the_mirror_direction(exponent):
    attribute = records(rec.Attribute, 1, specular=1, exponent=exponent)[0]
    normal, direction, _ = lit(13)
    mirrored = unit(map_module(reflection_direction, direction, normal))
    at_best = map_module(diffuse_and_highlight, attribute, normal, direction, mirrored, np.ones(3))
    np.testing.assert_allclose(at_best, 1, atol=1e-3)
    beside = unit(mirrored + 0.1 * directions(14))
    less = map_module(diffuse_and_highlight, attribute, normal, direction, beside, np.ones(3))
    assert (less <= at_best * (1 + 1e-6 * exponent) + 1e-5).all()


def test_luminance_accumulates_by_weight():
    draw = np.random.default_rng(15)
    luminance, weight, contribution = draw.uniform(0, 2, (3, COUNT, 3)).astype(np.float32)
    found = everywhere(accumulate_luminance, luminance, weight, contribution)
    np.testing.assert_array_equal(found, luminance + weight * contribution)


def test_plain_python_shades_alike():
    attribute, (normal, direction, to_light) = attributes(16)[:30], [part[:30] for part in lit(17)]
    arguments = (attribute, normal, direction, to_light, np.ones(3))
    plain = map_module(diffuse_and_highlight, *arguments, machine="python")
    np.testing.assert_array_equal(plain, map_module(diffuse_and_highlight, *arguments))
