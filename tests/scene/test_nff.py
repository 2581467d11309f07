"""The NFF importer: every entity, every layout."""

from dataclasses import replace
from pathlib import Path

import pytest

from tasuki.scene import Cone, Cylinder, Material, PointLight, Polygon, Sphere, load_scene
from tasuki.scene.importers.nff import read
from tasuki.scene.source import SourceText

VIEW = "v\nfrom 0 -5 1\nat 0 0 0.5\nup 0 0 1\nangle 40\nhither 0.25\nresolution 320 200\n"
SPD = Path(__file__).parents[3] / "shared" / "spd"


def scene(text: str, view: str = VIEW):
    return read(SourceText.from_bytes("test.nff", (view + text).encode()))


def shapes(text: str):
    return list(scene("f 1 1 1 1 0 1 0 1\n" + text).shapes)


def same_but_material(shape, other):
    return replace(shape, material=None) == other


def test_view():
    camera = scene("").camera
    assert camera.eye == (0.0, -5.0, 1.0)
    assert camera.at == (0.0, 0.0, 0.5)
    assert camera.up == (0.0, 0.0, 1.0)
    assert camera.angle == 40.0
    assert camera.angle_between == "centres"
    assert camera.hither == 0.25
    assert camera.resolution == (320, 200)


def test_background_is_black_unless_given():
    assert scene("").background == (0.0, 0.0, 0.0)
    assert scene("b 0.1 0.2 0.3").background == (0.1, 0.2, 0.3)


def test_lights_with_and_without_colour():
    assert scene("l 1 2 3\nl 4 5 6 0.5 0.6 0.7").lights == (
        PointLight((1.0, 2.0, 3.0)),
        PointLight((4.0, 5.0, 6.0), (0.5, 0.6, 0.7)),
    )


def test_material():
    (material,) = scene("f 0.1 0.2 0.3 0.4 0.5 6 0.7 1.8").materials
    assert material == Material(
        "material 1", (0.1, 0.2, 0.3), None, 0.4, 0.5, 6.0, reflection=0.5, transmission=0.7, index=1.8
    )


def test_an_opaque_material_may_leave_its_index_zero():
    assert scene("f 1 1 1 1 0 1 0 0").materials[0].index == 1.0


def test_equal_materials_are_one():
    red, green = "f 1 0 0 1 0 1 0 1\n", "f 0 1 0 1 0 1 0 1\n"
    found = scene(red + "s 0 0 0 1\n" + green + "s 1 0 0 1\n" + red + "s 2 0 0 1")
    assert [material.colour for material in found.materials] == [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]
    assert [shape.material.colour[0] for shape in found.shapes] == [1.0, 0.0, 1.0]


def test_sphere_and_its_place():
    (sphere,) = shapes("\n  s 1 2 3 -4")
    assert same_but_material(sphere, Sphere((1.0, 2.0, 3.0), -4.0))
    assert (sphere.place.file, sphere.place.line) == ("test.nff", 10)


@pytest.mark.parametrize(
    "text", ["c 1 2 3 4 5 6 7 8", "c\n1 2 3 4\n5 6 7 8", "c 1 2 3 4\n5 6 7 8", "c 1 2\n3 4 5 6\n7 8"]
)
def test_every_layout_of_a_cone(text):
    (cone,) = shapes(text)
    assert same_but_material(cone, Cone((1.0, 2.0, 3.0), 4.0, (5.0, 6.0, 7.0), 8.0, open=True))


def test_polygon_and_patch():
    polygon, patch = shapes("p 3\n0 0 0\n1 0 0\n0 1 0\npp 3\n0 0 1 0 0 1\n1 0 1 0 1 0\n0 1 1 1 0 0")
    assert polygon.points == ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert polygon.normals is None
    assert patch.points == ((0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (0.0, 1.0, 1.0))
    assert patch.normals == ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))


def test_shapes_keep_their_order():
    found = shapes("s 0 0 0 1\nc 0 0 0 1 0 0 1 1\ns 1 0 0 1\np 3 0 0 0 1 0 0 0 1 0\ns 2 0 0 1")
    assert [type(shape) for shape in found] == [Sphere, Cylinder, Sphere, Polygon, Sphere]
    assert [shape.centre[0] for shape in found if isinstance(shape, Sphere)] == [0.0, 1.0, 2.0]


def test_comments_white_space_and_line_ends():
    text = "# 初め\r\nf 1 1 1 1 0 1 0 1 # white\r\n\ts  0 0\r\n0 1# a sphere\r\n#s 9 9 9 9"
    assert len(scene(text).shapes) == 1
    assert len(scene(text.replace("\r\n", "\r")).shapes) == 1


def test_a_byte_order_mark_is_skipped():
    assert read(SourceText.from_bytes("test.nff", b"\xef\xbb\xbf" + VIEW.encode())).camera.angle == 40.0


def test_notations_of_numbers():
    (sphere,) = shapes("s +1 -.5 1.e2 2.5E-1")
    assert same_but_material(sphere, Sphere((1.0, -0.5, 100.0), 0.25))


def test_shapes_and_lights_may_stand_before_the_view():
    found = scene(VIEW, view="s 0 0 0 1\nl 1 2 3\nb 1 1 1\n")
    assert len(found.shapes) == len(found.lights) == 1


def test_hither_may_be_missing():
    assert scene("", view=VIEW.replace("hither 0.25\n", "")).camera.hither == 0.0


def test_a_shape_before_any_material_is_white_with_a_warning():
    found = scene("s 0 0 0 1\nf 1 0 0 1 0 1 0 1\ns 1 0 0 1")
    assert [shape.material.colour for shape in found.shapes] == [(1.0, 1.0, 1.0), (1.0, 0.0, 0.0)]
    assert found.warnings == ["test.nff:8: warning: no material (`f`) before this shape: it is white"]


def test_degenerate_polygons_are_dropped_with_a_warning(tmp_path):
    path = tmp_path / "flat.NFF"
    line = "p 3 0 0 0 1 1 1 2 2 2\n"
    path.write_text(VIEW + "l 1 1 1\nf 1 1 1 1 0 1 0 1\ns 0 0 0 1\n" + line * 7 + "p 3 0 0 0 1 0 0 0 1 0\n")
    found = load_scene(path)
    assert [type(shape) for shape in found.shapes] == [Sphere, Polygon]
    assert found.warnings[0] == f"{path}:11:1: warning: this polygon has no area; it is left out"
    assert found.warnings[-1] == "warning: 2 more polygons have no area; they are left out"


def test_thin_polygons_stay(tmp_path):
    path = tmp_path / "thin.nff"
    path.write_text(VIEW + "l 1 1 1\nf 1 1 1 1 0 1 0 1\np 3 0 0 0 1 0 0 0.5 1e-6 0\n")
    assert len(load_scene(path).shapes) == 1


def test_dark_and_empty_scenes_get_advice(tmp_path):
    path = tmp_path / "empty.nff"
    path.write_text(VIEW)
    assert [warning.split(":")[1] for warning in load_scene(path).warnings] == [
        " the scene has no light",
        " the scene has no shapes",
    ]


COUNTS = {
    "balls": (7382, 2, 3),
    "gears": (9345, 63, 5),
    "mount": (8196, 2, 1),
    "rings": (8401, 7, 3),
    "teapot": (9264, 3, 2),
    "tetra": (4096, 1, 1),
    "tree": (8191, 2, 7),
}


@pytest.mark.parametrize("name", COUNTS)
@pytest.mark.skipif(not SPD.is_dir(), reason=f"needs the Standard Procedural Databases in {SPD.name}")
def test_standard_databases(name):
    found = load_scene(SPD / f"{name}.nff")
    assert (len(found.shapes), len(found.materials), len(found.lights)) == COUNTS[name]
    assert found.warnings == []
