"""The ray tracer as a whole: machines and packets agree, and pictures stay what they are where nothing has changed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tasuki.diagnostics import SceneError
from tasuki.ir.interpret import interpret
from tasuki.machines.cpu.machine import Items
from tasuki.modules.light_paths import trace_tree
from tasuki.modules.raytrace import trace_pixel
from tasuki.programs import Options, executable, link_program
from tasuki.renderers.options import Region, RenderOptions
from tasuki.renderers.raytrace import RayTracer, pixel_places
from tasuki.scene import Camera, Material, PointLight, Polygon, Scene, Sphere, load_scene

DATA = Path(__file__).parents[1] / "data"
CAMERA = Camera(eye=(0.0, -6.0, 1.5), at=(0.0, 0.0, 1.0), up=(0.0, 0.0, 1.0), angle=40.0, resolution=(48, 36))
FLOOR = Polygon(
    ((-9.0, -9.0, 0.0), (9.0, -9.0, 0.0), (9.0, 9.0, 0.0), (-9.0, 9.0, 0.0)), material=Material(colour=(0.8, 0.5, 0.3))
)
PAINT = Material(colour=(0.9, 0.2, 0.1), diffuse=0.7, reflection=0.2, specular=0.3)
RED = Sphere((-0.8, 1.0, 1.0), 1.0, material=PAINT)
LIGHTS = (PointLight((3.0, -5.0, 6.0)), PointLight((-4.0, -2.0, 5.0)))
AIR = Material(diffuse=0.0, ambient=0.0, specular=0.0, transmission=1.0, index=1.0)


def rendered(scene: Scene, **options) -> np.ndarray:
    width, height = scene.camera.resolution
    return RayTracer(scene, RenderOptions(width, height, **options)).render().copy()


@pytest.mark.parametrize("name", ["still_life.nff", "pavilion.yaml"])
@pytest.mark.parametrize(("width", "region"), [(None, Region(9, 11, 22, 14)), (5, Region(12, 12, 13, 7))])
def test_the_interpreter_draws_the_same_picture(name, width, region):
    options = RenderOptions(40, 30, depth=4, region=region)
    tracer = RayTracer(load_scene(DATA / name), options)
    expected = tracer.render().copy()
    counts = tracer.ray_counts()
    tracer.pixels()[:] = -1.0
    program = link_program(trace_pixel, tracer.prepared.fillers())
    places = pixel_places(options.region)
    interpret(program, [[places]], lanes=len(places), tables=tracer.prepared.tables(), width=width)
    assert np.array_equal(tracer.pixels(), expected)
    assert tracer.ray_counts() == counts


@pytest.mark.parametrize("width", [1, 4, 8])
@pytest.mark.parametrize("name", ["still_life.nff", "pavilion.yaml"])
def test_packets_of_any_width_draw_the_same_picture(name, width):
    options = RenderOptions(61, 47, depth=6)
    tracer = RayTracer(load_scene(DATA / name), options)
    expected = tracer.render().copy()
    counts = tracer.ray_counts()
    tracer.pixels()[:] = -1.0
    program = executable(trace_pixel, Options(("items",), width=width), tracer.prepared.fillers())
    places = pixel_places(options.region)
    program.run([Items([places])], len(places), tables=tracer.prepared.tables(), threads=2)
    assert np.array_equal(tracer.pixels(), expected)
    assert tracer.ray_counts() == counts


def test_the_tree_of_rays_is_the_chain_of_mirrors_where_nothing_is_transparent():
    scene = Scene(CAMERA, [FLOOR, RED], LIGHTS, background=(0.2, 0.3, 0.5))
    options = RenderOptions(48, 36)
    tree = RayTracer(scene, options, {"traced_light": trace_tree})
    chain = RayTracer(scene, options)
    assert np.array_equal(tree.render(), chain.render())
    assert tree.ray_counts() == chain.ray_counts()


def test_a_ball_of_air_is_not_seen():
    # Without lamps, by ambient light alone: shadow rays do not pass through glass.
    things = [
        Polygon(FLOOR.points, material=Material(colour=(0.8, 0.5, 0.3), ambient=0.6)),
        Sphere(RED.centre, RED.radius, material=Material(colour=(0.9, 0.2, 0.1), ambient=0.5, reflection=0.2)),
    ]
    ball = Sphere((0.4, -1.5, 1.2), 0.6, material=AIR)
    pictures = [
        rendered(Scene(CAMERA, shapes, (), background=(0.2, 0.3, 0.5)), depth=8) for shapes in (things, [*things, ball])
    ]
    without, through = pictures
    # At the ball's rim and at edges behind it a ray that has been moved by a rounding may pass on the other side.
    differs = np.abs(through - without)[..., :3].max(axis=2) > 1e-4
    assert differs.mean() < 0.005
    assert (through[..., 3] > without[..., 3]).any() or (without[..., 3] == 1).all()
    assert np.ptp(without[..., 0]) > 0.3


def test_glass_in_a_furnace_is_not_seen():
    # Light of 1 from everywhere: whatever glass does to it, what comes out is 1, but for what the last rays carried.
    glass = Material(diffuse=0.0, ambient=0.0, specular=0.0, transmission=1.0, index=1.5)
    scene = Scene(CAMERA, [Sphere((0.0, 0.0, 1.0), 1.0, material=glass)], (), background=(1.0, 1.0, 1.0))
    furnace = rendered(scene, depth=12)[..., :3]
    assert furnace.max() <= 1.0 + 1e-5
    assert furnace.min() > 0.98
    short = rendered(scene, depth=2)[..., :3]
    assert short.min() < 0.5


def test_coloured_glass_takes_by_the_distance():
    # Straight through the middle: twice as thick, the square of the transmittance.
    camera = replace(CAMERA, eye=(0.0, -6.0, 0.0), at=(0.0, 0.0, 0.0), resolution=(1, 1), angle=0.01)
    tinted = replace(AIR, transmittance=(0.5, 0.25, 1.0))
    thin = Scene(camera, [Sphere((0.0, 0.0, 0.0), 0.5, material=tinted)], (), background=(1.0, 1.0, 1.0))
    thick = Scene(camera, [Sphere((0.0, 0.0, 0.0), 1.0, material=tinted)], (), background=(1.0, 1.0, 1.0))
    assert rendered(thin)[0, 0, :3] == pytest.approx([0.5, 0.25, 1.0], rel=1e-4)
    assert rendered(thick)[0, 0, :3] == pytest.approx([0.25, 0.0625, 1.0], rel=1e-4)


def test_a_tree_deeper_than_its_stack_is_refused():
    scene = Scene(CAMERA, [Sphere((0.0, 0.0, 1.0), 1.0, material=AIR)], LIGHTS)
    with pytest.raises(SceneError, match="depth"):
        rendered(scene, depth=33)
    assert rendered(Scene(CAMERA, [RED], LIGHTS), depth=33).shape == (36, 48, 4)


@pytest.mark.parametrize("far", [(1e3, -2e3, 0.0), (1e5, 0.0, 1e5), (-3e7, 1e7, 2e7)])
def test_a_scene_far_away_looks_like_one_at_home(far):
    def at(offset) -> Scene:
        def moved(*point: float) -> tuple[float, ...]:
            return tuple(np.add(point, offset).tolist())

        camera = replace(CAMERA, eye=moved(*CAMERA.eye), at=moved(*CAMERA.at))
        shapes = [
            Polygon(tuple(moved(*point) for point in FLOOR.points), material=FLOOR.material),
            Sphere(moved(*RED.centre), RED.radius, material=RED.material),
            Sphere(moved(0.9, -0.5, 0.6), 0.6, material=Material(transmission=0.9, index=1.5, diffuse=0.05)),
        ]
        lights = tuple(PointLight(moved(*light.position)) for light in LIGHTS)
        return Scene(camera, shapes, lights, background=(0.2, 0.3, 0.5))

    home, away = rendered(at((0.0, 0.0, 0.0))), rendered(at(far))
    # The offsets round the scene itself, in float64; pixels on edges may fall to either side.
    assert (np.abs(home - away).max(axis=2) > 1e-2).mean() < 0.002


def test_a_cutoff_leaves_out_rays_that_are_not_seen():
    scene = load_scene(DATA / "still_life.nff")
    options = RenderOptions(64, 64, depth=8)
    every, some = RayTracer(scene, options), RayTracer(scene, replace(options, cutoff=0.01))
    whole, rough = every.render().copy(), some.render().copy()
    # Each ray left out weighs 0.01 at most, and few of them meet in one pixel.
    assert 0.0 < np.abs(whole - rough).max() < 0.05
    counts, fewer = every.ray_counts(), some.ray_counts()
    assert fewer["reflection"] < counts["reflection"]
    assert fewer["eye_hits"] == counts["eye_hits"]
    none = RayTracer(scene, replace(options, cutoff=1.0))
    none.render()
    assert none.ray_counts()["reflection"] == none.ray_counts()["refraction"] == 0
