"""The scanline method as a whole: coverage is exact, the nearest face shows, and the ray tracer sees the same."""

from __future__ import annotations

import runpy
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasuki import render
from tasuki.diagnostics import SceneError
from tasuki.modules.scanline import records as scan
from tasuki.modules.scanline.luminance import flat_luminance, gouraud_luminance
from tasuki.programs import REPORT
from tasuki.renderers.options import Region, RenderOptions
from tasuki.renderers.raytrace import RayTracer
from tasuki.renderers.scanline import ScanlineRenderer
from tasuki.scene import Camera, HalfSpace, Material, PointLight, Polygon, Scene

SIZE = 48
CAMERA = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 30.0, (SIZE, SIZE))
HALF_PIXEL = 4.0 * np.tan(np.radians(15.0)) / SIZE
"""Half a pixel's side in the plane z = 0, as CAMERA sees it."""
LIGHTS = [PointLight((3.0, 5.0, 6.0)), PointLight((-4.0, 2.0, 5.0))]


def coloured(number: int) -> Material:
    """A material that shows its number, whatever the light."""
    colour = ((number & 15) / 16.0, (number >> 4 & 15) / 16.0, (1 + (number >> 8)) / 16.0)
    return Material(f"number {number}", colour, ambient=1.0, diffuse=0.0, two_sided=True)


def numbered(triangles: np.ndarray, camera: Camera = CAMERA) -> Scene:
    """Triangles (n, 3, 3), each in a colour of its own."""
    return Scene(
        camera, [Polygon(tuple(map(tuple, t)), material=coloured(n)) for n, t in enumerate(triangles.tolist())]
    )


def drawn(scene: Scene, modules=None, **options) -> ScanlineRenderer:
    width, height = scene.camera.resolution
    renderer = ScanlineRenderer(scene, RenderOptions(width, height, **options), modules)
    renderer.render()
    return renderer


def covering(renderer: ScanlineRenderer) -> np.ndarray:
    """(faces, height, width) bool: whether a pixel's centre lies in a face on the screen, in exact arithmetic.

    An edge reaches a row from its upper end to its lower end, without that; a centre is in where it has an odd number
    of the face's edges to its left, or on it.
    """
    vertices = renderer.records("screen_vertices", scan.ScreenVertex)
    corners = np.stack([renderer.mesh.faces[name] for name in "abc"], axis=1)
    x, y = (vertices[axis].astype(np.int64)[corners] for axis in "xy")
    width, height = renderer.options.width, renderer.options.height
    row = 4096 * np.arange(height)[:, None] + 2048
    column = 4096 * np.arange(width)[None, :] + 2048
    inside = np.zeros((len(corners), height, width), bool)
    for here, there in ((0, 1), (1, 2), (2, 0)):
        swapped = y[:, here] > y[:, there]
        top_x, top_y = (np.where(swapped, one[:, there], one[:, here])[:, None, None] for one in (x, y))
        end_x, end_y = (np.where(swapped, one[:, here], one[:, there])[:, None, None] for one in (x, y))
        crossed = (top_y <= row) & (row < end_y)
        inside ^= crossed & ((column - top_x) * (end_y - top_y) >= (row - top_y) * (end_x - top_x))
    return inside


on_the_grid = st.integers(-2 * SIZE, 2 * SIZE).map(lambda n: n * HALF_PIXEL / 2.0)
"""Coordinates whose places on the screen are quarters of pixels: many edges pass through centres."""


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(on_the_grid, on_the_grid), min_size=5, max_size=16, unique=True))
def test_a_fan_covers_each_pixel_once(points):
    middle, *around = points
    around.sort(key=lambda point: np.arctan2(point[1] - middle[1], point[0] - middle[0]))
    ring = [*around, around[0]]
    fan = np.array([[(*a, 0.0), (*b, 0.0), (*middle, 0.0)] for a, b in pairwise(ring)])
    fan = fan[np.abs(np.cross(fan[:, 1] - fan[:, 0], fan[:, 2] - fan[:, 0])[:, 2]) > 1e-6]
    fan = fan[(np.abs(fan[..., :2]) < SIZE * HALF_PIXEL).all(axis=(1, 2))]
    if not len(fan):
        return
    renderer = drawn(numbered(fan))
    inside = covering(renderer)
    visible = renderer.visible()
    assert np.array_equal(visible >= 0, inside.any(axis=0))
    once = inside.sum(axis=0) == 1
    assert np.array_equal(visible[once], inside.argmax(axis=0)[once])


def grid_mesh(cells: int, seed: int) -> np.ndarray:
    """A square of triangles with shaken inner points, larger than the picture: no pixel is uncovered, none twice."""
    draw = np.random.default_rng(seed)
    reach = 1.2 * SIZE * HALF_PIXEL
    x, y = np.meshgrid(np.linspace(-reach, reach, cells + 1), np.linspace(-reach, reach, cells + 1), indexing="ij")
    shake = np.zeros((2, cells + 1, cells + 1))
    shake[:, 1:-1, 1:-1] = 0.4 * reach / cells * draw.uniform(-1.0, 1.0, (2, cells - 1, cells - 1))
    points = np.stack([x + shake[0], y + shake[1], np.zeros_like(x)], axis=-1)
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    return np.stack([np.stack([a, b, c], 2), np.stack([a, c, d], 2)], 2).reshape(-1, 3, 3)


@pytest.mark.parametrize("cells", [1, 2, 7, 40, 150])
def test_a_plane_of_triangles_has_no_crack(cells):
    renderer = drawn(numbered(grid_mesh(cells, cells)))
    assert (renderer.pixels()[..., 3] == 1.0).all()
    if cells > 2:  # else every triangle is clipped
        inside = covering(renderer)
        planes = renderer.records("face_planes", scan.FacePlane)
        inside[planes["state"] != scan.WHOLE] = False
        some = inside.any(axis=0)
        assert inside.sum(axis=0).max() == 1
        assert np.array_equal(renderer.visible()[some], inside.argmax(axis=0)[some])


def bumpy_sphere(cells: int) -> np.ndarray:
    """A closed mesh, (n, 3, 3), its outside counterclockwise."""
    latitude, longitude = np.meshgrid(
        np.linspace(0.0, np.pi, cells + 1), np.linspace(0.0, 2.0 * np.pi, 2 * cells + 1), indexing="ij"
    )
    longitude[:, -1] = 0.0
    radius = 0.8 + 0.2 * np.sin(5.0 * latitude) * np.sin(4.0 * longitude)
    across = np.where((latitude == 0.0) | (latitude == np.pi), 0.0, radius * np.sin(latitude))
    points = np.stack([across * np.cos(longitude), radius * np.cos(latitude), -across * np.sin(longitude)], axis=-1)
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    triangles = np.concatenate(
        [np.stack([a, b, c], 2)[:-1].reshape(-1, 3, 3), np.stack([a, c, d], 2)[1:].reshape(-1, 3, 3)]
    )
    return triangles.astype(np.float32).astype(np.float64)


def agreement(scene: Scene) -> float:
    """The share of pixels that the two methods show in the same colour."""
    width, height = scene.camera.resolution
    traced = RayTracer(scene, RenderOptions(width, height, depth=1)).render()
    return float((np.abs(drawn(scene).pixels() - traced).max(axis=-1) < 1e-3).mean())


@pytest.mark.parametrize("cells", [6, 20, 36])
def test_the_ray_tracer_sees_the_same_triangles(cells):
    camera = Camera((0.3, 1.4, 3.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 35.0, (400, 300))
    assert agreement(numbered(bumpy_sphere(cells), camera)) >= 0.9999


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_triangles_that_cross_each_other_and_the_eye_agree_with_the_ray_tracer(seed):
    draw = np.random.default_rng(seed)
    triangles = draw.uniform(-1.0, 1.0, (30, 3, 3)) * draw.choice([0.5, 2.0, 8.0], (30, 1, 1)) + (0.0, 0.0, 1.0)
    camera = Camera((0.1, 0.2, 1.5), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 60.0, (120, 90))
    assert agreement(numbered(triangles, camera)) >= 0.9995


@settings(max_examples=40, deadline=None)
@given(
    st.lists(
        st.tuples(*[st.tuples(*[st.sampled_from([-1.0, 0.0, 1e-4, 0.5, 1.0, 4.0])] * 3)] * 3), min_size=1, max_size=8
    )
)
def test_degenerate_triangles_do_no_harm(triangles):
    """Corners that coincide, lie on one line, in the plane of the eye, or in the eye itself."""
    pixels = drawn(numbered(np.array(triangles))).pixels()
    assert np.isfinite(pixels).all()
    assert np.isin(pixels[..., 3], (0.0, 1.0)).all()


def smooth_scene(size: tuple[int, int] = (SIZE, SIZE), cells: int = 8) -> Scene:
    """A closed mesh with interpolated normals, a flat floor that reaches behind the eye, and a wall that crosses it."""
    shiny = Material("shiny", (0.8, 0.4, 0.2), diffuse=0.7, specular=0.5, exponent=12.0)
    floor = Material("floor", (0.3, 0.6, 0.3), two_sided=True)
    mesh = [
        Polygon(tuple(map(tuple, t)), normals=tuple(map(tuple, t)), material=shiny) for t in bumpy_sphere(8).tolist()
    ]
    corners = ((-9.0, -0.5, 9.0), (9.0, -0.5, 9.0), (9.0, -0.5, -9.0), (-9.0, -0.5, -9.0))
    wall = ((-0.2, -2.0, -3.0), (0.4, 2.0, -3.0), (0.1, 1.0, 2.0))
    shapes = [*mesh, Polygon(corners, material=floor), Polygon(wall, material=floor)]
    camera = Camera((0.5, 1.0, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 40.0, size)
    return Scene(camera, shapes, LIGHTS, (0.1, 0.2, 0.3))


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_among_many_layers_the_nearest_shows(seed):
    """Large triangles behind and through each other, against all of their depths."""
    draw = np.random.default_rng(seed)
    renderer = drawn(numbered(draw.uniform(-0.75, 0.75, (120, 3, 3))))
    planes = renderer.records("face_planes", scan.FacePlane)
    assert (planes["state"] == scan.WHOLE).all()
    x = (np.arange(SIZE) + 0.5 - SIZE / 2.0) * np.tan(np.radians(15.0)) / (SIZE / 2.0)
    slope = planes["slope"].astype(np.float64)
    depth = slope[:, None, None, 0] * x + slope[:, None, None, 1] * x[:, None] + slope[:, None, None, 2]
    depth = np.where(covering(renderer), depth, 0.0)
    visible = renderer.visible()
    assert np.array_equal(visible >= 0, depth.any(axis=0))
    shown = np.take_along_axis(depth, np.maximum(visible, 0)[None], axis=0)[0]
    assert (shown >= depth.max(axis=0) * (1.0 - 1e-5)).all()


def test_threads_do_not_change_the_picture():
    scene = smooth_scene((203, 157))
    expected = drawn(scene, threads=1).pixels()
    for threads in (2, 3, 7):
        assert np.array_equal(drawn(scene, threads=threads).pixels(), expected)


@pytest.mark.parametrize("region", [Region(0, 0, 203, 9), Region(31, 50, 77, 64), Region(202, 156, 1, 1)])
def test_a_region_is_a_part_of_the_whole(region):
    scene = smooth_scene((203, 157))
    whole = drawn(scene, samples=3).pixels()
    part = whole[region.y : region.y + region.height, region.x : region.x + region.width]
    assert np.array_equal(drawn(scene, samples=3, region=region).pixels(), part)


def test_plain_python_draws_the_same_picture():
    scene = smooth_scene((13, 9), cells=3)
    expected = drawn(scene, samples=2).pixels()
    assert np.array_equal(drawn(scene, samples=2, machine="python").pixels(), expected)


def test_a_second_picture_is_like_the_first():
    renderer = drawn(smooth_scene())
    first = renderer.pixels().copy()
    renderer.look(CAMERA)
    assert not np.array_equal(renderer.render(), first)
    renderer.look(smooth_scene().camera)
    assert np.array_equal(renderer.render(), first)


def test_moving_the_mesh_is_moving_the_scene():
    """With the camera and the lamps moved back, a moved mesh looks as it did."""
    scene = smooth_scene()
    turn = np.array([[0.0, -1.0, 0.0, 3.0], [1.0, 0.0, 0.0, -2.0], [0.0, 0.0, 1.0, 5.0], [0.0, 0.0, 0.0, 1.0]])

    def moved(point, w=1.0):
        return tuple((turn @ np.array([*point, w]))[:3].tolist())

    lights = [PointLight(moved(light.position)) for light in scene.lights]
    camera = Camera(
        moved(scene.camera.eye), moved(scene.camera.at), moved(scene.camera.up, 0.0), 40.0, scene.camera.resolution
    )
    renderer = ScanlineRenderer(
        Scene(camera, scene.shapes, lights, scene.background), RenderOptions(*scene.camera.resolution)
    )
    renderer.place(turn)
    difference = np.abs(renderer.render() - drawn(scene).pixels()).max(axis=-1)
    assert (difference < 1e-3).mean() > 0.995


@pytest.mark.parametrize("matrix", [np.zeros((3, 3)), np.full((4, 4), np.nan), np.ones((4, 4))])
def test_a_matrix_that_places_nothing_is_refused(matrix):
    with pytest.raises(SceneError, match="places nothing"):
        drawn(smooth_scene()).place(matrix)


def test_the_light_is_that_of_the_ray_tracer_without_shadows():
    """On a convex mesh nothing is in shadow but what faces away."""
    material = Material("m", (0.8, 0.4, 0.2), diffuse=0.7, specular=0.5, exponent=12.0, two_sided=False)
    ball = [
        Polygon(t, normals=t, material=material)
        for t in (tuple(map(tuple, corners)) for corners in bumpy_sphere_without_bumps(24).tolist())
    ]
    scene = Scene(Camera((0.5, 1.0, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 30.0, (160, 120)), ball, LIGHTS)
    traced = RayTracer(scene, RenderOptions(160, 120, depth=1)).render()
    assert (np.abs(drawn(scene).pixels() - traced).max(axis=-1) < 2e-3).mean() > 0.995


def bumpy_sphere_without_bumps(cells: int) -> np.ndarray:
    triangles = bumpy_sphere(cells)
    return triangles / np.linalg.norm(triangles, axis=-1, keepdims=True)


@pytest.mark.parametrize("luminance", [flat_luminance, gouraud_luminance])
def test_other_shadings_change_colours_only(luminance):
    scene = smooth_scene((120, 90))
    phong = drawn(scene)
    other = drawn(scene, {"luminance": luminance})
    assert np.array_equal(other.visible(), phong.visible())
    assert not np.array_equal(other.pixels(), phong.pixels())
    assert np.abs(other.pixels() - phong.pixels()).mean() < 0.05


def test_an_empty_scene_is_background():
    renderer = drawn(Scene(CAMERA, [], LIGHTS, (0.25, 0.5, 1.0)))
    assert (renderer.pixels() == (0.25, 0.5, 1.0, 0.0)).all()


def test_the_report_counts_the_mesh():
    picture = render(smooth_scene(), method="scanline", size=(64, 48))
    stats = picture.stats
    assert stats["method"] == "scanline"
    assert stats["rays"] is None
    assert stats["scene"]["primitives"] == {"triangle": len(bumpy_sphere(8)) + 3}
    assert stats["scene"]["clipped"] > 0
    assert {row["socket"] for row in stats["modules"]} == {"shading", "luminance"}


def test_a_profile_names_the_modules():
    stats = render(smooth_scene(), method="scanline", size=(64, 48), profile=True).stats
    rows = {row["module"]: row for row in stats["profile"]}
    assert rows["tasuki.modules.scanline.luminance:phong_luminance"]["lanes"] > 0
    assert rows["tasuki.modules.scanline.spans:draw_row"]["lanes"] == 48


def test_what_has_no_bounds_is_refused():
    scene = Scene(CAMERA, [HalfSpace((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))], LIGHTS)
    with pytest.raises(SceneError, match="this object has no bounds"):
        render(scene, method="scanline")


def test_the_turntable_turns_and_compiles_nothing_between_frames(tmp_path):
    module = runpy.run_path(str(Path(__file__).parents[2] / "examples" / "turntable.py"))
    mesh = tmp_path / "mesh.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    module["turntable"](mesh, tmp_path / "first", frames=3, size=32)
    programs = REPORT.programs
    module["turntable"](mesh, tmp_path / "second", frames=3, size=32)
    assert REPORT.programs == programs
    first, second = (
        [path.read_bytes() for path in sorted((tmp_path / name).iterdir())] for name in ("first", "second")
    )
    assert first == second
    assert len(set(first)) == 3
