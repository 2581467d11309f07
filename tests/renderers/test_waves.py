"""Rays in waves: whoever waits for whom, the picture is that of one ray after the other."""

from dataclasses import replace

import numpy as np
import pytest

from tasuki.machines.cpu.machine import Items
from tasuki.modules.raytrace import trace_pixel
from tasuki.programs import Options, executable
from tasuki.renderers import waves
from tasuki.renderers.options import Region, RenderOptions
from tasuki.renderers.raytrace import RayTracer, pixel_places
from tasuki.scene import Material, PointLight, Polygon, Scene, Sphere
from tests.renderers.test_raytrace import CAMERA

MIRROR = Material(colour=(0.9, 0.7, 0.4), diffuse=0.4, specular=0.3, reflection=0.6, exponent=20.0)
FLOOR = Polygon(((-9.0, -9.0, 0.0), (9.0, -9.0, 0.0), (9.0, 9.0, 0.0), (-9.0, 9.0, 0.0)), material=MIRROR)
LIGHTS = (PointLight((4.0, -6.0, 8.0)), PointLight((-5.0, -3.0, 6.0), (0.5, 0.5, 0.4)))


def balls(count: int = 40) -> Scene:
    """Mirror balls in a heap: after two generations their rays go anywhere."""
    random = np.random.default_rng(7)
    places = random.uniform((-2.0, -2.0, 0.2), (2.0, 2.0, 2.0), (count, 3))
    shapes = [FLOOR, *(Sphere(tuple(place), 0.3, material=MIRROR) for place in places.tolist())]
    return Scene(CAMERA, shapes, LIGHTS, background=(0.2, 0.3, 0.5))


def one_by_one(tracer: RayTracer) -> tuple[np.ndarray, dict[str, int]]:
    """The same picture and counts by `trace_pixel`, one lane at a time."""
    tracer.pixels()[:] = -1.0
    program = executable(trace_pixel, Options(("items",), width=1), tracer.prepared.fillers())
    places = pixel_places(tracer.options.region)
    program.run([Items([places])], len(places), tables=tracer.prepared.tables())
    return tracer.pixels().copy(), tracer.ray_counts()


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize("fewest", [0, 4, 100])
def test_waves_draw_the_same_picture(fewest, samples, threads):
    options = RenderOptions(61, 47, samples=samples, depth=6, threads=threads, region=Region(3, 2, 50, 41))
    tracer = RayTracer(balls(), options)
    tracer.memory.table("waves")["fewest"] = fewest
    picture, counts = tracer.render().copy(), tracer.ray_counts()
    assert (tracer.waves.waited > 0) == (fewest > 0)
    expected, expected_counts = one_by_one(tracer)
    assert np.array_equal(picture, expected)
    assert counts == expected_counts


def test_waves_in_bands_draw_the_same_picture(monkeypatch):
    monkeypatch.setattr(waves, "BAND", 300)
    tracer = RayTracer(balls(), RenderOptions(48, 36, samples=2, depth=5, threads=3))
    picture = tracer.render().copy()
    assert tracer.waves.waited > 600
    assert np.array_equal(picture, one_by_one(tracer)[0])


def test_a_second_picture_is_the_same():
    tracer = RayTracer(balls(), RenderOptions(48, 36, depth=5))
    first = tracer.render().copy()
    assert np.array_equal(tracer.render(), first)


def test_only_scenes_of_mirrors_have_waves():
    plain = replace(MIRROR, reflection=0.0)
    glass = replace(MIRROR, transmission=0.5, index=1.5)
    for material, depth, has in ((MIRROR, 5, True), (MIRROR, 1, False), (plain, 5, False), (glass, 5, False)):
        scene = Scene(CAMERA, [Sphere((0.0, 0.0, 1.0), 1.0, material=material)], LIGHTS)
        tracer = RayTracer(scene, RenderOptions(16, 12, depth=depth))
        assert (tracer.waves is not None) == has
        assert tracer.render().shape == (12, 16, 4)


def test_rays_that_leave_the_scene_need_no_box():
    # Nothing has bounds but the lens of the camera: all rays are sorted into one cell.
    scene = Scene(CAMERA, [replace(FLOOR)], LIGHTS, background=(0.1, 0.2, 0.3))
    tracer = RayTracer(scene, RenderOptions(32, 24, depth=4))
    assert np.array_equal(tracer.render().copy(), one_by_one(tracer)[0])


def test_an_interrupted_picture_of_several_samples_has_means(monkeypatch):
    monkeypatch.setattr(waves, "PROMPT", 1e-4)
    tracer = RayTracer(balls(), RenderOptions(64, 48, samples=32, depth=4, threads=2))
    whole = tracer.render().copy()
    assert tracer.waves.waited > 0

    def interrupt(share: float) -> None:
        if 0.3 < share < 1.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tracer.render(interrupt)
    part = tracer.pixels()
    # Two bands, each of which has begun some of its samples; of the last one a part may be missing.
    ratio = part[..., :3].mean() / whole[..., :3].mean()
    assert 0.8 < ratio < 1.1
    assert part[..., 3].max() <= 1.0


def test_the_profile_counts_all_steps():
    tracer = RayTracer(balls(), RenderOptions(32, 24, depth=5, profile=True))
    tracer.render()
    counted = tracer.ray_counts()
    searched = sum(edge.lanes for edge in tracer.profile() if edge.callee.endswith("nearest_intersection"))
    assert searched == counted["eye"] + counted["reflection"]
    blocked = sum(edge.lanes for edge in tracer.profile() if edge.callee.endswith("shadow_intersection"))
    assert blocked == counted["shadow"]
