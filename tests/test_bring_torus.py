"""The torus that examples/torus.py brings: its modules against its definition, alone and in set operations."""

from __future__ import annotations

import numpy as np
import pytest

from tasuki.renderers.options import RenderOptions
from tasuki.renderers.raytrace import RayTracer
from tasuki.scene import Box, Camera, Difference, Group, Material, PointLight, Scene, Solid, Sphere
from tests.extending import PLACES, brought
from tests.modules.running import everywhere, exactly, random_directions, records

RADII = ((1.0, 0.4), (2.0, 0.05), (1.0, 0.95), (1e-4, 3e-5), (1e4, 4e3))
COUNT = 2000
CAMERA = Camera(eye=(2.0, -5.0, 3.0), at=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), angle=38.0, resolution=(64, 48))
LIGHTS = (PointLight((4.0, -5.0, 6.0)),)


@pytest.fixture(scope="module")
def torus():
    with brought("torus") as (module,):
        yield module


def shape(torus, major, minor, count=COUNT):
    return records(torus.Torus, count, major=major, minor=minor)


def outside(points, major, minor):
    """Negative inside, in units of `major`: the distance from the circle, less `minor`."""
    aside = np.hypot(points[..., 0], points[..., 1]) - major
    return (np.hypot(aside, points[..., 2]) - minor) / major


def rays(seed, size):
    """Rays of any length about a torus of this size, most of them at it; some along the axes and through its middle."""
    draw = np.random.default_rng(seed)
    origin = draw.uniform(-3.0, 3.0, (COUNT, 3))
    way = draw.uniform(-1.2, 1.2, (COUNT, 3)) - origin
    way[::3] = random_directions(draw, len(way[::3]))
    origin[::7] = -2.0 * way[::7]
    origin[1::7, 2] = 0.0
    way[1::7, 2] = 0.0
    length = np.exp(draw.uniform(-3.0, 3.0, (COUNT, 1)))
    return (origin * size).astype(np.float32), (way * length * size).astype(np.float32)


def crossings(torus, ring, origin, way, leaving=None):
    """Where each ray crosses the torus, (n, 4) float64 in ascending order; NaN behind the last."""
    leaving = np.zeros(len(origin), bool) if leaving is None else leaving
    at = exactly(torus.torus_crossings, ring, origin, way, leaving)
    return np.sort(np.where(np.isfinite(at), at, np.nan), axis=1)


@pytest.mark.parametrize(("major", "minor"), RADII)
def test_the_state_along_rays_is_that_of_dense_samples(torus, major, minor):
    size = major + minor
    origin, way = rays(1, size)
    ring = shape(torus, major, minor)
    at = crossings(torus, ring, origin, way)
    for t in np.random.default_rng(2).uniform(-0.5, 3.0, (200, COUNT)):
        points = origin + t[:, None] * way.astype(np.float64)
        value = outside(points, major, minor)
        clear = np.abs(value) > 1e-5
        assert np.array_equal(((at <= t[:, None]).sum(axis=1) % 2 == 1)[clear], (value < 0.0)[clear])


@pytest.mark.parametrize(("major", "minor"), RADII)
def test_crossings_lie_on_the_torus(torus, major, minor):
    origin, way = rays(3, major + minor)
    at = crossings(torus, shape(torus, major, minor), origin, way)
    points = origin[:, None] + np.nan_to_num(at)[..., None] * way[:, None].astype(np.float64)
    assert np.isfinite(at).any(axis=1).mean() > 0.05
    assert np.abs(outside(points, major, minor))[np.isfinite(at)].max() < 2e-6


def test_a_longer_direction_only_changes_the_unit_of_t(torus):
    origin, way = rays(4, 1.0)
    ring = shape(torus, 1.0, 0.4)
    at, of_longer = crossings(torus, ring, origin, way), crossings(torus, ring, origin, 8.0 * way)
    np.testing.assert_allclose(8.0 * of_longer, at, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize(("major", "minor"), RADII)
def test_a_ray_that_leaves_the_surface_crosses_it_at_zero(torus, major, minor):
    draw = np.random.default_rng(5)
    round_, up = draw.uniform(0.0, 2.0 * np.pi, (2, COUNT))
    out = np.stack([np.cos(round_) * np.cos(up), np.sin(round_) * np.cos(up), np.sin(up)], axis=1)
    middle = np.stack([np.cos(round_), np.sin(round_), np.zeros(COUNT)], axis=1)
    origin = (major * middle + minor * out).astype(np.float32)
    way = (draw.normal(size=(COUNT, 3)) * major).astype(np.float32)
    ring, leaving = shape(torus, major, minor), np.ones(COUNT, bool)
    before, after, _coming = everywhere(torus.torus_span, ring, origin, way, leaving, np.float32(0.0))
    slope = (out * way).sum(axis=1) / np.linalg.norm(way, axis=1)
    steep = np.abs(slope) > 1e-3
    assert np.array_equal(before[steep], slope[steep] > 0.0)
    assert np.array_equal(after[steep], slope[steep] < 0.0)
    at = crossings(torus, ring, origin, way, leaving)
    for t in draw.uniform(-1.0, 1.0, (50, COUNT)):
        value = outside(origin + t[:, None] * way.astype(np.float64), major, minor)
        clear = np.abs(value) > 1e-4
        assert np.array_equal(((at <= t[:, None]).sum(axis=1) % 2 == 1)[clear], (value < 0.0)[clear])


@pytest.mark.parametrize(("major", "minor"), RADII)
def test_normal_inside_and_bounds(torus, major, minor):
    draw = np.random.default_rng(6)
    size = major + minor
    points = (draw.uniform(-1.1, 1.1, (COUNT, 3)) * (size, size, minor)).astype(np.float32)
    ring = shape(torus, major, minor)
    value = outside(points.astype(np.float64), major, minor)
    clear = np.abs(value) > 1e-6
    assert np.array_equal(everywhere(torus.torus_inside, ring, points)[clear], value[clear] < 0.0)
    low, high = exactly(torus.torus_bounds, ring)
    within = ((points >= low) & (points <= high)).all(axis=1)
    assert within[clear & (value < 0.0)].all()
    normal = everywhere(torus.torus_normal, ring, points)
    step = 1e-4 * minor
    slope = [
        outside(points + step * axis, major, minor) - outside(points - step * axis, major, minor) for axis in np.eye(3)
    ]
    far = np.abs(value * major + minor) > 0.2 * minor
    np.testing.assert_allclose(normal[far], (np.array(slope).T * major / (2.0 * step))[far], atol=2e-3)


@pytest.mark.parametrize(("major", "minor"), RADII[:3])
def test_machines_agree_to_the_bit(torus, major, minor):
    origin, way = rays(7, major + minor)
    t = np.random.default_rng(8).uniform(-1.0, 2.0, COUNT).astype(np.float32)
    everywhere(torus.torus_span, shape(torus, major, minor), origin, way, np.arange(COUNT) % 2 == 0, t)


# --- pictures ---------------------------------------------------------------------------------------------------------


def coverage(scene: Scene) -> np.ndarray:
    """Which pixels show something."""
    width, height = scene.camera.resolution
    return RayTracer(scene, RenderOptions(width, height)).render()[..., 3] > 0.0


def sampled(scene: Scene, inside, samples=3000) -> np.ndarray:
    """Which pixels' rays meet a point that is `inside`, as the definition says it."""
    width, height = scene.camera.resolution
    view = scene.camera.frame(width, height)
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    way = view.corner + x[..., None] * view.right + y[..., None] * view.down
    found = np.zeros((height, width), bool)
    for t in np.linspace(2.0, 10.0, samples):
        found |= inside(view.eye + t * way)
    return found


@pytest.mark.usefixtures("torus")
@pytest.mark.parametrize("place", PLACES)
def test_its_picture_is_that_of_its_definition(place):
    node = PLACES[place](Solid("torus", major=1.0, minor=0.4))
    scene = Scene(CAMERA, [node], LIGHTS)
    inverse = np.linalg.inv(node.transform.matrix)

    def inside(points):
        return outside(points @ inverse[:3, :3].T + inverse[:3, 3], 1.0, 0.4) < 0.0

    wrong = coverage(scene) != sampled(scene, inside)
    # The samples miss what is thinner than their distance: the very rim.
    assert wrong.mean() < 0.002


@pytest.mark.usefixtures("torus")
def test_it_may_be_part_of_set_operations():
    ring = Solid("torus", major=1.0, minor=0.4)
    whole = Difference([ring, Box((0.0, -2.0, -1.0), (2.0, 0.0, 1.0)), Sphere((-1.0, 0.0, 0.3), 0.5)])
    node = Group([whole.rotate("z", 20.0)]).translate(0.0, 0.1, 0.2)
    scene = Scene(CAMERA, [node], LIGHTS)
    inverse = np.linalg.inv(node.transform.matrix @ whole.rotate("z", 20.0).transform.matrix)

    def inside(points):
        points = points @ inverse[:3, :3].T + inverse[:3, 3]
        boxed = ((points > (0.0, -2.0, -1.0)) & (points < (2.0, 0.0, 1.0))).all(axis=-1)
        ball = np.linalg.norm(points - (-1.0, 0.0, 0.3), axis=-1) < 0.5
        return (outside(points, 1.0, 0.4) < 0.0) & ~boxed & ~ball

    assert (coverage(scene) != sampled(scene, inside)).mean() < 0.002


@pytest.mark.usefixtures("torus")
def test_it_may_be_of_glass_and_mirror_itself():
    glass = Material(diffuse=0.0, ambient=0.0, transmission=1.0, index=1.0)
    air = Scene(CAMERA, [Solid("torus", major=1.0, minor=0.4, material=glass)], (), background=(0.2, 0.5, 0.9))
    picture = RayTracer(air, RenderOptions(64, 48, depth=8)).render()
    np.testing.assert_allclose(picture[..., :3], np.broadcast_to((0.2, 0.5, 0.9), (48, 64, 3)), atol=1e-5)
    mirror = Material(diffuse=0.0, ambient=0.0, reflection=1.0)
    furnace = Scene(CAMERA, [Solid("torus", major=1.0, minor=0.4, material=mirror)], (), background=(1.0, 1.0, 1.0))
    assert RayTracer(furnace, RenderOptions(64, 48, depth=30)).render()[..., :3].min() > 0.999
