"""The surface that examples/bilinear.py brings: its modules against its definition, and as a node of scenes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tasuki.diagnostics import SceneError
from tasuki.renderers.options import RenderOptions
from tasuki.renderers.raytrace import RayTracer
from tasuki.renderers.scanline import ScanlineRenderer
from tasuki.scene import (
    Box,
    Camera,
    Difference,
    Group,
    Instance,
    Material,
    PointLight,
    Polygon,
    Scene,
    Solid,
    Sphere,
    load_scene,
)
from tasuki.scene.material import Texture
from tasuki.scene.yaml_format import dump_yaml
from tests.extending import PLACES, brought
from tests.modules.running import everywhere, exactly, records

COUNT = 2000
CORNERS = {"a": (-1.0, -1.0, -0.5), "b": (1.2, -0.8, 0.4), "c": (1.0, 1.0, -0.6), "d": (-0.9, 0.7, 0.9)}
CAMERA = Camera(eye=(2.0, -5.0, 3.0), at=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), angle=38.0, resolution=(96, 72))
LIGHTS = (PointLight((4.0, -5.0, 6.0)),)
CHECKER = Texture("checker", {"other": (0.1, 0.2, 0.6), "size": 0.31})
BOTH = Material(colour=(0.9, 0.7, 0.5), ambient=0.3, specular=0.3, exponent=20.0, two_sided=True)
FRONT = replace(BOTH, two_sided=False)


@pytest.fixture(scope="module", autouse=True)
def bilinear():
    with brought("bilinear", "textures") as (module, _):
        yield module


def sheet(**more) -> Solid:
    return Solid("bilinear", **CORNERS, **more)


def point_and_normal(u, v):
    """Of the patch of `CORNERS`, by its definition; (..., 3) each."""
    a, b, c, d = (np.array(CORNERS[name]) for name in "abcd")
    u, v = np.asarray(u)[..., None], np.asarray(v)[..., None]
    point = (1 - u) * (1 - v) * a + u * (1 - v) * b + u * v * c + (1 - u) * v * d
    along, up = (1 - v) * (b - a) + v * (c - d), (1 - u) * (d - a) + u * (c - b)
    return point, np.cross(along, up)


def tessellated(material: Material, pieces: int = 40) -> Group:
    """The same sheet of triangles with its normals."""
    u, v = np.meshgrid(*(np.linspace(0.0, 1.0, pieces + 1),) * 2, indexing="ij")
    points, normals = point_and_normal(u, v)
    parts = []
    for i in range(pieces):
        for j in range(pieces):
            ring = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            for corners in (ring[:3], [ring[0], *ring[2:]]):
                own = (tuple(tuple(array[at].tolist()) for at in corners) for array in (points, normals))
                parts.append(Polygon(*own))
    return Group(parts, material=material)


def picture(*nodes, lights=LIGHTS, background=(0.0, 0.0, 0.0), **options) -> np.ndarray:
    width, height = CAMERA.resolution
    scene = Scene(CAMERA, nodes, lights, background)
    return RayTracer(scene, RenderOptions(width, height, **options)).render().copy()


# --- its modules ------------------------------------------------------------------------------------------------------


def rays(seed):
    """Rays of any length, most of them at the sheet."""
    draw = np.random.default_rng(seed)
    origin = draw.uniform(-3.0, 3.0, (COUNT, 3))
    way = draw.uniform(-1.0, 1.0, (COUNT, 3)) - origin
    way *= np.exp(draw.uniform(-3.0, 3.0, (COUNT, 1)))
    return origin.astype(np.float32), way.astype(np.float32)


def patches(module, flags):
    corners = {name: np.tile(np.array(point, np.float32), (COUNT, 1)) for name, point in CORNERS.items()}
    return records(module.Bilinear, COUNT, flags=flags, **corners)


@pytest.mark.parametrize("flags", [0, 1, 2])
def test_crossings_lie_on_the_patch_and_show_the_side_that_they_should(bilinear, flags):
    origin, way = rays(1)
    t = exactly(bilinear.bilinear_hit, patches(bilinear, flags), origin, way, np.zeros(COUNT, bool))
    met = np.isfinite(t)
    assert 0.1 < met.mean() < 0.9
    assert (t[met] > 0.0).all()
    points = (origin + t[:, None] * way.astype(np.float64))[met]
    normal, _, _, _ = exactly(bilinear.bilinear_surface, patches(bilinear, flags)[met], origin[met], way[met], points)
    facing = np.einsum("ni,ni->n", normal, way[met])
    if flags != 1:
        assert ((facing < 0.0) == (flags == 0)).all()
    u, v = np.random.default_rng(2).uniform(size=(2, 400, len(points)))
    near = np.linalg.norm(point_and_normal(u, v)[0] - points, axis=-1).min(axis=0)
    assert near.max() < 0.3
    flat = exactly(bilinear.frame_of, patches(bilinear, flags)[:1])
    x, y, z = (exactly(bilinear.in_frame, np.repeat(flat, len(points)), points - np.array(CORNERS["a"]))).T
    np.testing.assert_allclose(z, x * y, atol=1e-5)


def test_a_ray_that_leaves_the_patch_crosses_it_no_second_time_there(bilinear):
    draw = np.random.default_rng(3)
    points, _ = point_and_normal(*draw.uniform(0.02, 0.98, (2, COUNT)))
    way = draw.normal(size=(COUNT, 3)).astype(np.float32)
    patch, origin = patches(bilinear, 1), points.astype(np.float32)
    t = everywhere(bilinear.bilinear_hit, patch, origin, way, np.ones(COUNT, bool))
    free = exactly(bilinear.bilinear_hit, patch, origin - 10.0 * way, way, np.zeros(COUNT, bool)) - 10.0
    met = np.isfinite(t)
    assert 0.0 < met.mean() < 0.5
    assert (t[met] > 0.0).all()
    # Where it crosses again, it is where a ray from farther away finds one of its crossings, or this one.
    assert (np.isfinite(free) | ~met).all()


def test_machines_agree_to_the_bit(bilinear):
    origin, way = rays(4)
    everywhere(bilinear.bilinear_hit, patches(bilinear, np.arange(COUNT) % 3), origin, way, np.arange(COUNT) % 5 == 0)
    everywhere(bilinear.bilinear_surface, patches(bilinear, 0), origin, way, origin)


# --- as a node --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("material", [FRONT, BOTH, replace(BOTH, texture=CHECKER)], ids=["front", "both", "checker"])
@pytest.mark.parametrize("place", PLACES)
def test_its_picture_is_that_of_many_triangles(place, material):
    found = picture(PLACES[place](sheet(material=material)))
    expected = picture(PLACES[place](tessellated(material)))
    assert (expected[..., 3] > 0.0).mean() > 0.05
    wrong = np.abs(found - expected).max(axis=2) > 0.02
    # At the rim, at colours' and shadows' edges, a ray falls to either side.
    assert wrong.mean() < 0.015


@pytest.mark.parametrize("accelerator", ["bvh", "extents"])
def test_it_stands_among_solids_groups_and_instances(accelerator):
    cut = Difference([Box((-0.4, -0.4, -0.4), (0.4, 0.4, 0.4)), Sphere((0.4, -0.4, 0.4), 0.4)]).translate(
        0.3, -0.9, 0.5
    )
    ball = Sphere((-0.6, 0.2, 0.4), 0.4, material=Material(reflection=0.6))

    def scene(one):
        return [cut, Group([ball, Instance(one), Instance(one).scale(0.5, 0.5, 0.7).translate(0.8, 0.9, 0.9)])]

    found, expected = (
        picture(*scene(one), accelerator=accelerator) for one in (sheet(material=BOTH), tessellated(BOTH))
    )
    assert (np.abs(found - expected).max(axis=2) > 0.03).mean() < 0.02


def test_glass_of_no_index_is_not_seen_even_within_a_solid_of_glass():
    clear = Material(diffuse=0.0, ambient=0.0, transmission=1.0, index=1.0)
    sky = (0.2, 0.5, 0.9)
    ball = Sphere((0.0, 0.0, 0.0), 0.9, material=clear)
    found = picture(ball, sheet(material=clear), lights=(), background=sky, depth=12)
    np.testing.assert_allclose(found[..., :3], np.broadcast_to(sky, found[..., :3].shape), atol=1e-5)


def test_a_mirror_loses_no_light():
    mirror = Material(diffuse=0.0, ambient=0.0, reflection=1.0, two_sided=True)
    found = picture(sheet(material=mirror), lights=(), background=(1.0, 1.0, 1.0), depth=30)
    assert found[..., :3].min() > 0.999


def test_every_machine_makes_its_picture():
    scene = Scene(CAMERA, [sheet(material=BOTH), Sphere((0.0, 0.0, -0.4), 0.5)], LIGHTS)
    cpu, plain, pu = (
        RayTracer(scene, RenderOptions(24, 18, depth=2, machine=machine)).render().copy()
        for machine in ("cpu", "python", "pu")
    )
    assert np.array_equal(cpu, plain)
    assert (np.abs(cpu - pu).max(axis=2) < 0.01).mean() > 0.98


# --- scene files, and what goes wrong ---------------------------------------------------------------------------------

HEAD = "camera: {eye: [2, -5, 3], at: [0, 0, 0]}\nshapes:\n"
NODE = "bilinear: {a: [-1, -1, -0.5], b: [1.2, -0.8, 0.4], c: [1, 1, -0.6], d: [-0.9, 0.7, 0.9]}"


def loaded(tmp_path, text: str) -> Scene:
    (tmp_path / "scene.yaml").write_text(HEAD + text + "\n")
    return load_scene(tmp_path / "scene.yaml")


def test_it_is_a_node_of_scene_files(tmp_path):
    scene = loaded(tmp_path, f"  - {NODE}")
    assert scene.shapes[0] == sheet()
    (tmp_path / "again.yaml").write_text(dump_yaml(scene))
    assert load_scene(tmp_path / "again.yaml").shapes[0] == sheet()


WRONG = {
    "an operand": (
        f"  - union:\n    - box: {{low: [0, 0, 0], high: [1, 1, 1]}}\n    - {NODE}",
        ":5:7: .*: a bilinear has no inside, so it cannot be an operand of a union.*expected: a solid",
    ),
    "an extent": (f"  - {NODE[:-1]}, extent: auto}}", ":3:.*bilinear.extent: there is no such key"),
    "a field too few": ("  - bilinear: {a: [0, 0, 0], b: [1, 0, 0], c: [1, 1, 1]}", ":3:.*'d'"),
    "a field that is none": (f"  - {NODE[:-1]}, e: [0, 0, 0]}}", ":3:.*bilinear.e: there is no such key"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_shown_where_it_stands(case, tmp_path):
    text, message = WRONG[case]
    with pytest.raises(SceneError, match=f"(?s)scene.yaml{message}"):
        loaded(tmp_path, text)


def test_nodes_in_python_say_what_is_wrong():
    for node, message in (
        (sheet() | Box((0, 0, 0), (1, 1, 1)), "a bilinear has no inside, so it cannot be an operand of a union"),
        (sheet(extent="auto"), "a bilinear can have no extent"),
        (Solid("bilinear", a=(0, 0, 0)), "this is missing"),
        (Solid("cone", base=(0, 0, 0)), "what comes with Tasuki has nodes of its own"),
    ):
        with pytest.raises(SceneError, match=message):
            picture(node)


def test_it_cannot_be_made_of_triangles():
    with pytest.raises(SceneError, match="a bilinear cannot be made of triangles"):
        ScanlineRenderer(Scene(CAMERA, [sheet()], LIGHTS), RenderOptions(16, 12))
