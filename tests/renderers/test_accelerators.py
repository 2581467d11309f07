"""Accelerators: no picture shows which one was used; what is counted of their search."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasuki import render
from tasuki.diagnostics import SceneError
from tasuki.language import f32, i32, module, vec3
from tasuki.modules.extents import nearest_in_extents
from tasuki.renderers.accelerators import lookup
from tasuki.renderers.options import Region, RenderOptions
from tasuki.renderers.raytrace import RayTracer
from tasuki.renderers.search_counts import MOST_PIXELS, sampled_places, search_counts
from tasuki.scene import (
    Box,
    Camera,
    Cylinder,
    Ellipsoid,
    Extent,
    Group,
    HalfSpace,
    Instance,
    Material,
    PointLight,
    Polygon,
    Scene,
    Sphere,
    load_scene,
)
from tests.scene.strategies import transforms
from tests.scene.test_extents import trees
from tests.test_spd import SPD

DATA = Path(__file__).parents[1] / "data"
CAMERA = Camera(eye=(1.0, -9.0, 4.0), at=(0.0, 0.0, 1.0), up=(0.0, 0.0, 1.0), angle=40.0, resolution=(64, 48))
LIGHTS = (PointLight((3.0, -5.0, 6.0)), PointLight((-4.0, -2.0, 5.0)))
GLASS = Material("glass", diffuse=0.1, transmission=0.8, index=1.5, reflection=0.1, transmittance=(0.9, 0.7, 0.9))
RED, MIRROR = Material("red", (0.9, 0.2, 0.1)), Material("mirror", reflection=0.6, diffuse=0.2)


def arm() -> Group:
    """Groups in groups, of objects, surfaces, instances, glass; one extent is the user's, one is to be computed."""
    drilled = Box((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0)) - Cylinder((0.0, 0.0, -1.0), (0.0, 0.0, 2.0), 0.3)
    finger = Group(
        [
            drilled,
            Sphere((0.0, 0.0, 1.4), 0.4, material=MIRROR),
            Polygon(((1, 0, 0), (1, 1, 0), (1, 0, 1)), material=RED),
        ],
        extent=Extent((0.4, 0.2, 0.9), 1.6),
    )
    lens = Sphere((0.0, 0.0, 0.0), 1.0, material=GLASS) & Sphere((0.0, 1.2, 0.0), 1.0, material=GLASS)
    return Group(
        [
            finger.rotate("y", 30).translate(-2.0, 0.0, 0.5),
            Instance(finger).scale(1.5, 1.0, 0.7).rotate("z", 70).translate(1.5, 1.0, 0.0),
            Group([lens.translate(0.0, -2.0, 1.5), Ellipsoid((0, 1, 2.5), (1, 0.5, 0.3), material=GLASS)]),
            Group(
                [Sphere((-1.0, -1.0, 0.5), 0.5, material=RED), Sphere((2.5, -2.0, 0.4), 0.4, material=GLASS)],
                extent="auto",
            ),
        ]
    )


SCENES = {
    "nff": lambda: load_scene(DATA / "still_life.nff"),
    "yaml": lambda: load_scene(DATA / "pavilion.yaml"),
    "groups": lambda: Scene(CAMERA, [arm(), HalfSpace((0, 0, 1), (0, 0, 0))], LIGHTS, (0.2, 0.3, 0.5)),
    "far away": lambda: Scene(
        Camera((1e5 + 1.0, -9.0, 4.0), (1e5, 0.0, 1.0), (0.0, 0.0, 1.0), 40.0), [arm().translate(1e5, 0, 0)], LIGHTS
    ),
    "nothing": lambda: Scene(CAMERA, [], LIGHTS, (0.2, 0.3, 0.5)),
    "nothing that shows": lambda: Scene(CAMERA, [Group([Sphere((0, 0, 0), 1) & Sphere((9, 0, 0), 1), Group([])])]),
}


def traced(scene: Scene, accelerator: str, width: int = 64, height: int = 48) -> RayTracer:
    tracer = RayTracer(scene, RenderOptions(width, height, depth=6, accelerator=accelerator, threads=2))
    tracer.render()
    return tracer


@pytest.mark.parametrize("name", SCENES)
def test_no_picture_shows_the_accelerator(name):
    scene = SCENES[name]()
    expected, found = traced(scene, "bvh"), traced(scene, "extents")
    assert found.pixels().tobytes() == expected.pixels().tobytes()
    assert found.ray_counts() == expected.ray_counts()
    assert name.startswith("nothing") or (expected.pixels()[..., 3] > 0).mean() > 0.1


@pytest.mark.skipif(not SPD.is_dir(), reason=f"needs the databases in {SPD}")
@pytest.mark.parametrize("name", ["balls", "gears", "mount", "rings", "teapot", "tetra", "tree"])
def test_nor_does_any_of_the_standard_scenes(name):
    scene = load_scene(SPD / f"{name}.nff")
    expected, found = (traced(scene, accelerator, 29, 31) for accelerator in ("bvh", "extents"))
    assert found.pixels().tobytes() == expected.pixels().tobytes()


@settings(max_examples=10, deadline=None)
@given(st.lists(st.lists(trees, min_size=1, max_size=3).map(Group), min_size=1, max_size=3), transforms())
def test_nor_does_any_made_at_random(groups, transform):
    scene = Scene(CAMERA, [Group(groups, material=MIRROR).transformed(transform)], LIGHTS, (0.2, 0.3, 0.5))
    expected, found = (traced(scene, accelerator, 40, 30) for accelerator in ("bvh", "extents"))
    assert found.pixels().tobytes() == expected.pixels().tobytes()


def test_an_unknown_accelerator_is_an_error():
    with pytest.raises(SceneError, match="did you mean 'extents'"):
        lookup("extent")


# Counts


def test_every_thing_without_an_extent_is_tested_by_every_ray():
    """Of n half-spaces each of the eye rays tests n, in as many steps; a BVH has one leaf for up to eight of them."""
    walls = [HalfSpace((0.0, 0.0, 1.0), (0.0, 0.0, -float(n))) for n in range(5)]
    tracer = traced(Scene(CAMERA, walls), "extents")
    counts = search_counts(tracer)
    pixels = 64 * 48
    assert counts == {
        "accelerator": "extents",
        "rays": pixels,
        "tests_per_ray": 5.0,
        "steps_per_ray": 5.0,
        "sampled_pixels": pixels,
    }


def test_counts_are_those_of_single_rays():
    """A ray that meets nothing but the background passes over a group in one step; one in it looks at its members."""
    ball = Sphere((0.0, 0.0, 1.0), 0.25)
    group = Group([ball, *(Sphere((0.0, 0.5 * n, 1.0), 0.25) for n in (1, 2, 3))], extent=Extent((0.0, 1.0, 1.0), 1.5))
    tracer = traced(Scene(CAMERA, [group]), "extents")
    counts = search_counts(tracer)
    met = counts["steps_per_ray"] - 1.0
    assert 0.0 < met < 4.0
    assert round(met * counts["rays"]) % 4 == 0
    assert 0.0 < counts["tests_per_ray"] < met


@module(fills="is_blocked")
def blocked_by_the_nearest(origin: vec3, direction: vec3, left: i32, distance: f32) -> bool:
    return nearest_in_extents(origin, direction, left)[0] < distance


def test_a_search_that_calls_the_other_is_one_ray():
    scene, options = SCENES["nff"](), RenderOptions(20, 10, accelerator="extents")
    tracers = [RayTracer(scene, options, modules) for modules in ({}, {"is_blocked": blocked_by_the_nearest})]
    own, nested = (search_counts(tracer) for tracer in tracers)
    assert nested["rays"] == own["rays"]
    assert nested["tests_per_ray"] > own["tests_per_ray"]


@pytest.mark.parametrize("accelerator", ["bvh", "extents"])
def test_the_picture_is_not_changed_by_counting(accelerator):
    scene = SCENES["groups"]()
    tracer = traced(scene, accelerator)
    picture, rays = tracer.pixels().copy(), tracer.ray_counts()
    counts = search_counts(tracer)
    assert np.array_equal(tracer.pixels(), picture)
    # Every pixel is in the sample of a picture so small.
    assert counts["rays"] == sum(rays[name] for name in ("eye", "reflection", "refraction", "shadow"))
    assert 0.0 < counts["tests_per_ray"] < counts["steps_per_ray"] + 8.0


def test_the_report_has_them_where_they_are_asked_for():
    scene = SCENES["nff"]()
    counted = render(scene, size=(20, 10), count=True).stats["search"]
    assert counted["accelerator"] == "bvh"
    assert counted["sampled_pixels"] == 200
    assert "search" not in render(scene, size=(20, 10)).stats


@pytest.mark.parametrize("size", [(1, 1), (64, 64), (65, 64), (513, 512), (65535, 3), (1, 65535), (3, 2000)])
def test_samples_lie_evenly(size):
    places = sampled_places(Region(0, 0, *size))
    rows, columns = places >> 16 & 65535, places & 65535
    assert len(np.unique(places)) == len(places) <= MOST_PIXELS
    assert len(places) >= min(size[0] * size[1], MOST_PIXELS) / 3
    for side, taken in zip(size, (columns, rows), strict=True):
        assert taken.max() < side
        assert abs(taken.mean() - (side - 1) / 2) <= max(1.0, 0.01 * side)
