"""The model: the camera's geometry, and shapes as a sequence over arrays."""

import math

import numpy as np
import pytest

from tasuki.diagnostics import SceneError
from tasuki.scene import Camera, Cone, Material, Polygon, Scene, Shapes, Sphere, default_intensity, load_scene

CAMERA = Camera((0.0, -5.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 90.0)


def angle_between(a, b):
    return math.degrees(math.acos(np.dot(a, b) / (np.linalg.norm(a) * np.linalg.norm(b))))


def direction(frame, x, y):
    return frame.corner + x * frame.right + y * frame.down


def test_an_angle_between_edges_spans_the_height():
    frame = CAMERA.frame(40, 30)
    assert angle_between(direction(frame, 20, 0), direction(frame, 20, 30)) == pytest.approx(90.0)
    assert direction(frame, 20, 15) == pytest.approx([0.0, 1.0, 0.0])
    assert np.linalg.norm(frame.right) == pytest.approx(np.linalg.norm(frame.down))


def test_an_angle_between_centres_spans_the_outer_rows():
    camera = Camera(CAMERA.eye, CAMERA.at, CAMERA.up, 45.0, angle_between="centres")
    frame = camera.frame(64, 64)
    assert angle_between(direction(frame, 32, 0.5), direction(frame, 32, 63.5)) == pytest.approx(45.0)
    assert camera.edge_angle(64) > 45.0
    assert camera.edge_angle(1) == 45.0


def test_the_picture_is_upright_and_not_mirrored():
    frame = CAMERA.frame(10, 10)
    # Looking along +y with z up, x points to the right.
    assert frame.right[0] > 0.0
    assert frame.down[2] < 0.0
    assert frame.corner[0] < 0.0 < frame.corner[2]


def test_the_up_vector_need_not_be_perpendicular_nor_of_unit_length():
    frame = CAMERA.frame(10, 10)
    leaning = Camera(CAMERA.eye, CAMERA.at, (0.0, 3e30, 7e30), 90.0).frame(10, 10)
    assert leaning.corner == pytest.approx(frame.corner)
    assert leaning.down == pytest.approx(frame.down)


def test_default_intensity():
    assert [default_intensity(n) for n in (0, 1, 4)] == [0.0, 0.5, 0.25]


def test_shapes_are_a_sequence_in_scene_order():
    red = Material("red", (1.0, 0.0, 0.0))
    given = [
        Sphere((0.0, 0.0, 0.0), 1.0, material=red),
        Cone((0.0, 0.0, 0.0), 1.0, (0.0, 0.0, 1.0), 0.5, open=True, material=Material()),
        Polygon(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), material=red),
        Sphere((1.0, 0.0, 0.0), -2.0, material=Material()),
    ]
    shapes = Shapes.of(given)
    assert list(shapes) == given
    assert shapes[-1] == given[-1]
    assert shapes[1:3] == given[1:3]
    assert shapes == Shapes.of(iter(given))
    assert shapes != Shapes.of(given[::-1])
    assert shapes.materials == (red, Material())
    with pytest.raises(IndexError):
        shapes[4]


@pytest.mark.parametrize("count", [0, 2])
def test_a_polygon_needs_three_points(count):
    with pytest.raises(SceneError, match="at least 3 points"):
        Polygon(((0.0, 0.0, 0.0),) * count)


def test_a_patch_needs_a_normal_for_every_point():
    with pytest.raises(SceneError, match="a normal for every point"):
        Polygon(((0.0, 0.0, 0.0),) * 3, ((0.0, 0.0, 1.0),) * 2)


@pytest.mark.parametrize(
    ("material", "flat", "smooth"),
    [
        (Material(), False, True),
        (Material(transmission=0.5), True, True),
        (Material(two_sided=True), True, True),
        (Material(transmission=0.5, two_sided=False), False, False),
    ],
)
def test_which_sides_show(material, flat, smooth):
    assert material.shows_both_sides() is flat
    assert material.shows_both_sides(smooth=True) is smooth


def test_load_scene_may_override_the_sides(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text("camera: {eye: [0, -5, 1], at: [0, 0, 0]}\nmaterials: {a: {two_sided: true}, b: {}}\n")
    for wanted in (True, False):
        assert [one.two_sided for one in load_scene(path, two_sided=wanted).materials] == [wanted, wanted]
    assert [one.two_sided for one in load_scene(path).materials] == [True, None]


def test_area_vectors_point_to_the_front():
    square = Polygon(((5.0, 5.0, 1.0), (7.0, 5.0, 1.0), (7.0, 7.0, 1.0), (5.0, 7.0, 1.0)))
    polygons = Scene(CAMERA, [square]).shapes.polygons
    assert polygons.area_vectors.tolist() == [[0.0, 0.0, 8.0]]
    assert polygons.perimeters.tolist() == [8.0]
