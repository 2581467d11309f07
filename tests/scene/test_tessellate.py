"""Scenes as triangles: what they enclose, how near they are to the surfaces, what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from tasuki.diagnostics import SceneError
from tasuki.scene import (
    Box,
    Camera,
    Cone,
    Cylinder,
    Difference,
    Ellipsoid,
    HalfSpace,
    Hyperboloid,
    Intersection,
    Material,
    Paraboloid,
    Polygon,
    Quadric,
    RoundedBox,
    Scene,
    Slab,
    Sphere,
    Tube,
    Union,
    Wedge,
    load_scene,
)
from tasuki.scene.exporters import exported
from tasuki.scene.tessellate import tessellated
from tasuki.scene.triangulate import triangulate

CAMERA = Camera((4.0, -8.0, 5.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 40.0)
PI = np.pi
CAP = Slab((0.0, 0.0, 1.0), (0.0, 0.0, 1.0), 2.0)

VOLUMES = {
    "box": (Box((0.0, 0.0, 0.0), (1.0, 2.0, 3.0)), 6.0),
    "sphere": (Sphere((1.0, 2.0, 3.0), 1.5), 4.0 / 3.0 * PI * 1.5**3),
    "ellipsoid": (Ellipsoid((1.0, 0.0, 0.0), (1.0, 2.0, 0.5)), 4.0 / 3.0 * PI),
    "cylinder": (Cylinder((0.0, 0.0, 0.0), (1.0, 2.0, 2.0), 0.5), PI * 0.25 * 3.0),
    "cone": (Cone((0.0, 0.0, 0.0), 1.0, (0.0, 2.0, 0.0), 0.5), PI * 2.0 / 3.0 * (1.0 + 0.5 + 0.25)),
    "wedge": (Wedge((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), 0.5),
    "tube": (Tube((0.0, 0.0, 0.0), (0.0, 0.0, 2.0), 1.0, 0.5), PI * 2.0 * 0.75),
    "rounded box": (RoundedBox((0.0, 0.0, 0.0), (2.0, 2.0, 2.0), 0.5), 1.0 + 6 * 0.5 + 3 * PI / 4 + PI / 6),
    "one sheet": (Hyperboloid((0.0, 0.0, 1.0), (1.0, 1.0, 1.0)) & CAP, PI * (2.0 + 2.0 / 3.0)),
    "paraboloid": (Paraboloid((0.0, 0.0, 0.0), (1.0, 1.0)) & CAP, PI * 2.0),
    "drilled": (
        Box((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)) - Cylinder((0.0, 0.0, -2.0), (0.0, 0.0, 2.0), 0.5),
        8.0 - PI * 0.5,
    ),
    "flush": (Box((0.0, 0.0, 0.0), (2.0, 1.0, 1.0)) - Box((1.0, 0.0, 0.0), (3.0, 1.0, 1.0)), 1.0),
    "stacked": (Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)) | Box((0.0, 0.0, 1.0), (1.0, 1.0, 2.0)), 2.0),
    "twice complemented": (~(~Sphere((0.0, 0.0, 0.0), 1.0)), 4.0 / 3.0 * PI),
}


def triangles(scene: Scene) -> np.ndarray:
    polygons = scene.shapes.polygons
    corners, _ = triangulate(polygons)
    return polygons.points[corners]


def volume(corners: np.ndarray) -> float:
    """What closed triangles enclose, by Gauss."""
    return float(np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0)


@pytest.mark.parametrize("name", VOLUMES)
def test_triangles_enclose_the_solid_and_face_outwards(name):
    solid, expected = VOLUMES[name]
    for placed in (solid, solid.rotate((1.0, 2.0, 3.0), 40.0).translate(5.0, -3.0, 1.0)):
        made = tessellated(Scene(CAMERA, [placed]))
        assert volume(triangles(made)) == pytest.approx(expected, rel=4e-3)
    finer = tessellated(Scene(CAMERA, [solid]), 1e-5)
    assert volume(triangles(finer)) == pytest.approx(expected, rel=2e-4)


def test_chords_keep_the_tolerance_and_normals_the_gradient():
    half = Sphere((0.0, 0.0, 0.0), 1.0) - HalfSpace((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    made = tessellated(Scene(CAMERA, [half]), 1e-3)
    polygons = made.shapes.polygons
    curved = np.repeat(polygons.smooth, polygons.sizes)
    points, normals = polygons.points[curved], polygons.normals[curved]
    assert np.linalg.norm(points, axis=1) == pytest.approx(1.0, abs=1e-3)
    assert normals == pytest.approx(points / np.linalg.norm(points, axis=1, keepdims=True), abs=1e-3)
    middles = points.reshape(-1, 3, 3).mean(axis=1)
    assert np.linalg.norm(middles, axis=1).min() > 1.0 - 4e-3


def test_materials_follow_their_literals():
    red, blue = Material("red", (1.0, 0.0, 0.0)), Material("blue", (0.0, 0.0, 1.0))
    solid = Box((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), material=red) - Sphere((0.0, 0.0, 1.0), 0.5, material=blue)
    made = tessellated(Scene(CAMERA, [solid]))
    polygons = made.shapes.polygons
    colours = np.array([made.materials[number].colour for number in polygons.material])
    blue_points = polygons.points.reshape(-1, 3, 3)[colours[:, 2] == 1.0]
    assert np.linalg.norm(blue_points - [0.0, 0.0, 1.0], axis=2) == pytest.approx(0.5, abs=1e-2)


def test_polygons_stay_as_they_are():
    scene = Scene(CAMERA, [Polygon(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))])
    assert tessellated(scene) is scene


def test_a_sphere_seen_from_inside_faces_inwards():
    assert volume(triangles(tessellated(Scene(CAMERA, [Sphere((0.0, 0.0, 0.0), -1.0)])))) < -4.0


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (HalfSpace((0.0, 0.0, 1.0), (0.0, 0.0, 0.0)), "no bounds"),
        (Union((Sphere((0.0, 0.0, 0.0), 1.0), Hyperboloid((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)))), "no bounds"),
        (
            Intersection(
                (
                    Box((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)),
                    Quadric(((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 0.0)), constant=0.1),
                )
            ),
            "of this sort",
        ),
    ],
)
def test_what_has_no_triangles_is_named(shape, message):
    with pytest.raises(SceneError, match=message):
        tessellated(Scene(CAMERA, [shape]))


@pytest.mark.parametrize("suffix", [".glb", ".stl", ".obj", ".yaml"])
def test_what_is_exported_is_read_again(tmp_path, suffix):
    solid = Difference((Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), Sphere((1.0, 1.0, 1.0), 0.5)), material=Material("red"))
    path = tmp_path / f"part{suffix}"
    path.write_bytes(exported(Scene(CAMERA, [solid]), path))
    again = tessellated(load_scene(path))
    assert volume(triangles(again)) == pytest.approx(1.0 - PI * 0.5**3 / 6.0, rel=2e-3)
