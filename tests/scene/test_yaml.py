"""The own format: what it says, and that nothing is lost on the way through it."""

import json
import math
from pathlib import Path

import pytest
from hypothesis import given

from tasuki.scene import Camera, Cone, Cylinder, Material, PointLight, Polygon, Scene, Sphere, load_scene
from tasuki.scene.importers.nff import read as read_nff
from tasuki.scene.schema import SceneModel, scene_schema
from tasuki.scene.source import SourceText
from tasuki.scene.yaml_format import dump_yaml, read
from tasuki.scene.yaml_nodes import resolve_scalar
from tests.scene.strategies import nff_scenes, nff_text

DATA = Path(__file__).parents[1] / "data"
CAMERA = "camera: {eye: [0, -5, 1], at: [0, 0, 0]}\n"


def scene(text):
    return read(SourceText.from_bytes("test.yaml", text.encode()))


def test_defaults():
    found = scene(CAMERA)
    assert found == Scene(Camera((0.0, -5.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 45.0), [])
    assert found.camera.angle_between == "edges"
    assert found.camera.resolution == (512, 512)


def test_everything_that_can_be_said():
    text = """
version: 1
camera: {eye: [0, -5, 1], at: [0, 0, 0], up: [0, 1, 0], angle: 30, angle_between: centres,
         resolution: [64, 48], hither: 0.5}
background: [0.1, 0.2, 0.3]
lights:
  - {position: [1, 2, 3]}
  - {position: [4, 5, 6], colour: [1, 0.5, 0.25]}
materials:
  no: {colour: [1, 0, 0], ambient: 0.1, diffuse: 0.2, specular: 0.3, exponent: 4, reflection: 0.5,
       transmission: 0.6, index: 1.5, transmittance: [0.7, 0.8, 0.9], two_sided: true}
shapes:
  - sphere: {centre: [0, 0, 0], radius: 1e-3, material: no}
  - cylinder: {base: [0, 0, 0], apex: [0, 0, 1], radius: -2}
  - cone: {base: [0, 0, 0], base_radius: 1, apex: [0, 0, 1]}
  - polygon: {points: [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}
  - patch: {points: [[0, 0, 0], [1, 0, 0], [0, 1, 0]], normals: [[0, 0, 1], [0, 0, 2], [0, 0, 3]]}
"""
    red = Material("no", (1.0, 0.0, 0.0), 0.1, 0.2, 0.3, 4.0, 0.5, 0.6, 1.5, (0.7, 0.8, 0.9), True)
    plain = Material()
    origin, top = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    corners = (origin, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    found = scene(text)
    assert found.camera == Camera((0.0, -5.0, 1.0), origin, (0.0, 1.0, 0.0), 30.0, (64, 48), 0.5, "centres")
    assert found.background == (0.1, 0.2, 0.3)
    assert found.lights == (PointLight((1.0, 2.0, 3.0)), PointLight((4.0, 5.0, 6.0), (1.0, 0.5, 0.25)))
    assert list(found.shapes) == [
        Sphere(origin, 1e-3, material=red),
        Cylinder(origin, top, -2.0, open=True, material=plain),
        Cone(origin, 1.0, top, 0.0, open=True, material=plain),
        Polygon(corners, material=plain),
        Polygon(corners, (top, (0.0, 0.0, 2.0), (0.0, 0.0, 3.0)), material=plain),
    ]
    assert found.shapes[1].place.line == 14


@given(nff_scenes())
def test_a_scene_survives_nff_and_yaml(original):
    from_nff = read_nff(SourceText.from_bytes("random.nff", nff_text(original).encode()))
    assert from_nff == original
    assert scene(dump_yaml(from_nff)) == original


@pytest.mark.parametrize("path", sorted(DATA.glob("*.nff")) + sorted(DATA.glob("*.yaml")), ids=lambda path: path.name)
def test_our_scenes_survive(path):
    original = load_scene(path)
    assert original.warnings == []
    assert scene(dump_yaml(original)) == original


def test_aliases_repeat_values():
    found = scene(CAMERA + "background: &grey [0.5, 0.5, 0.5]\nlights: [{position: [0, 0, 0], colour: *grey}]")
    assert found.lights[0].colour == (0.5, 0.5, 0.5)


def test_names_of_materials_may_be_any_text():
    names = ["no", "1", "a: b", "真鍮", 'quo"te', "", "null", "a #b", "line\nbreak"]
    materials = [Material(name, (n / 10, 0.0, 0.0)) for n, name in enumerate(names)]
    original = Scene(
        Camera((0, -5, 1), (0, 0, 0), (0, 0, 1), 45), [Sphere((0, 0, 0), 1, material=one) for one in materials]
    )
    assert scene(dump_yaml(original)) == original


def test_different_materials_of_one_name_get_names_of_their_own():
    red, blue = Material("paint", (1.0, 0.0, 0.0)), Material("paint", (0.0, 0.0, 1.0))
    original = Scene(
        Camera((0, -5, 1), (0, 0, 0), (0, 0, 1), 45),
        [Sphere((0, 0, 0), 1, material=red), Sphere((1, 0, 0), 1, material=blue)],
    )
    found = scene(dump_yaml(original))
    assert [(one.name, one.colour) for one in found.materials] == [("paint", red.colour), ("paint 2", blue.colour)]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001),
        ("0010", 10),
        ("-.5", -0.5),
        ("+1.", 1.0),
        ("yes", "yes"),
        ("True", True),
        ("~", None),
        ("1:30", "1:30"),
        ("1_000", "1_000"),
        ("-.inf", -math.inf),
        ("9" * 5000, math.inf),
    ],
)
def test_scalars_follow_yaml_1_2(text, value):
    assert resolve_scalar(text) == value
    assert type(resolve_scalar(text)) is type(value)


def test_schema_is_json_and_knows_every_shape():
    schema = json.loads(json.dumps(scene_schema()))
    shapes = schema["properties"]["shapes"]["items"]["oneOf"]
    assert [shape["$ref"].rpartition("/")[2] for shape in shapes] == [
        "SphereShape",
        "CylinderShape",
        "ConeShape",
        "PolygonShape",
        "PatchShape",
    ]
    assert schema["additionalProperties"] is False
    assert schema["required"] == ["camera"]


def test_the_published_example_is_valid():
    text = (Path(__file__).parents[2] / "docs" / "scene-format.md").read_text(encoding="utf-8")
    example = text.split("```yaml\n")[1].split("```")[0]
    found = scene(example)
    assert len(found.shapes) == 5
    assert set(SceneModel.model_fields) >= {line.split(":")[0] for line in example.splitlines() if line[:1].isalpha()}
