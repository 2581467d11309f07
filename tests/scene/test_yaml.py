"""The own format: what it says, and that nothing is lost on the way through it."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tasuki.diagnostics import SceneError
from tasuki.language import Table, f32, i32, module, record, vec3
from tasuki.scene import Camera, Material, PointLight, Scene, Shapes, Texture, kinds, load_scene, solids, textures, tree
from tasuki.scene.importers.nff import read as read_nff
from tasuki.scene.model import DirectionalLight
from tasuki.scene.schema import SceneModel, scene_schema
from tasuki.scene.schema_nodes import BUILT_IN, node_models
from tasuki.scene.solids import Box, Cone, Cylinder, Polygon, Solid, Sphere
from tasuki.scene.source import SourceText
from tasuki.scene.transforms import IDENTITY, matrix, rotate, scale, translate
from tasuki.scene.tree import Extent, Formula, Group, Instance
from tasuki.scene.yaml_format import dump_yaml, read
from tasuki.scene.yaml_format.nodes import resolve_scalar
from tasuki.scene.yaml_format.tree import CLASSES
from tests.scene.strategies import nff_scenes, nff_text

DATA = Path(__file__).parents[1] / "data"
DOCUMENTATION = Path(__file__).parents[2] / "docs" / "scene-format.md"
CAMERA = "camera: {eye: [0, -5, 1], at: [0, 0, 0]}\n"
VIEW = Camera((0.0, -5.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 45.0)
ORIGIN, TOP = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def scene(text):
    return read(SourceText.from_bytes("test.yaml", text.encode()))


def nodes(text):
    """The nodes that `text`, a list, says."""
    lines = "".join(f"  {line}\n" for line in text.strip("\n").splitlines())
    return list(scene(f"{CAMERA}shapes:\n{lines}").shapes)


def test_defaults():
    found = scene(CAMERA)
    assert found == Scene(VIEW, [])
    assert found.camera.angle_between == "edges"
    assert found.camera.resolution == (512, 512)


def test_camera_lights_materials_and_surfaces():
    text = """
version: 1
camera: {eye: [0, -5, 1], at: [0, 0, 0], up: [0, 1, 0], angle: 30, angle_between: centres,
         resolution: [64, 48], hither: 0.5}
background: [0.1, 0.2, 0.3]
lights:
  - {position: [1, 2, 3]}
  - {direction: [4, 5, 6], colour: [1, 0.5, 0.25]}
materials:
  no: {colour: [1, 0, 0], ambient: 0.1, diffuse: 0.2, specular: 0.3, exponent: 4, reflection: 0.5,
       transmission: 0.6, index: 1.5, transmittance: [0.7, 0.8, 0.9], two_sided: true}
shapes:
  - sphere: {centre: [0, 0, 0], radius: 1e-3, material: no}
  - cylinder: {base: [0, 0, 0], apex: [0, 0, 1], radius: -2, open: true}
  - cone: {base: [0, 0, 0], base_radius: 1, apex: [0, 0, 1], open: true}
  - polygon: {points: [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}
  - patch: {points: [[0, 0, 0], [1, 0, 0], [0, 1, 0]], normals: [[0, 0, 1], [0, 0, 2], [0, 0, 3]]}
"""
    red = Material("no", (1.0, 0.0, 0.0), 0.1, 0.2, 0.3, 4.0, 0.5, 0.6, 1.5, (0.7, 0.8, 0.9), True)
    plain = Material()
    corners = (ORIGIN, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    found = scene(text)
    assert found.camera == Camera((0.0, -5.0, 1.0), ORIGIN, (0.0, 1.0, 0.0), 30.0, (64, 48), 0.5, "centres")
    assert found.background == (0.1, 0.2, 0.3)
    assert found.lights == (PointLight((1.0, 2.0, 3.0)), DirectionalLight((4.0, 5.0, 6.0), (1.0, 0.5, 0.25)))
    assert list(found.shapes) == [
        Sphere(ORIGIN, 1e-3, material=red),
        Cylinder(ORIGIN, TOP, -2.0, open=True, material=plain),
        Cone(ORIGIN, 1.0, TOP, 0.0, open=True, material=plain),
        Polygon(corners, material=plain),
        Polygon(corners, (TOP, (0.0, 0.0, 2.0), (0.0, 0.0, 3.0)), material=plain),
    ]
    assert found.shapes[1].place.line == 14


def test_set_operations_in_every_form():
    box, ball = Box(ORIGIN, (1.0, 1.0, 1.0)), Sphere(ORIGIN, 1.0)
    texts = ("box: {low: [0, 0, 0], high: [1, 1, 1]}", "sphere: {centre: [0, 0, 0], radius: 1}")
    for key, operation in [("union", box | ball), ("intersection", box & ball), ("difference", box - ball)]:
        short, long = nodes(f"""
- {key}: [{{{texts[0]}}}, {{{texts[1]}}}]
- {key}:
    name: both
    extent: {{centre: [0, 0, 0], radius: 2}}
    children:
      - {texts[0]}
      - {texts[1]}
""")
        assert short == operation
        assert long == type(operation)((box, ball), name="both", extent=Extent(ORIGIN, 2.0))
    assert nodes(f"- complement: {{child: {{{texts[0]}}}}}") == [~box]
    infix, polish = nodes(f"""
- object: {{parts: &parts {{a: {{{texts[0]}}}, b: {{{texts[1]}}}}}, formula: a - ~b}}
- object: {{parts: *parts, polish: "- a ~b", extent: auto}}
""")
    assert infix == Formula({"a": box, "b": ball}, formula="a - ~b")
    assert polish == Formula({"a": box, "b": ball}, polish="- a ~b", extent="auto")


def test_steps_of_a_transformation_are_applied_in_their_order():
    (found,) = nodes("""
- box:
    low: [0, 0, 0]
    high: [1, 1, 1]
    transform:
      - translate: [1, 2, 3]
      - rotate: {axis: z, angle: 90}
      - rotate: {axis: [1, 1, 0], angle: 20}
      - scale: 2
      - scale: [1, 2, -3]
      - matrix: [[1, 0, 0.5], [0, 1, 0], [0, 0, 1]]
      - matrix: [[1, 0, 0, 4], [0, 1, 0, 5], [0, 0, 1, 6], [0, 0, 0, 1]]
""")
    assert found == (
        Box(ORIGIN, (1.0, 1.0, 1.0))
        .translate(1, 2, 3)
        .rotate("z", 90)
        .rotate((1, 1, 0), 20)
        .scale(2)
        .scale(1, 2, -3)
        .transformed([[1, 0, 0.5], [0, 1, 0], [0, 0, 1]])
        .translate(4, 5, 6)
    )


def test_instances_share_their_definition_and_definitions_stand_in_any_order():
    found = scene(
        CAMERA
        + """
materials: {brass: {colour: [1, 0.8, 0]}}
definitions:
  hand: {group: [{instance: {of: finger}}, {instance: {of: finger, transform: [{translate: [1, 0, 0]}]}}]}
  finger: {sphere: {centre: [0, 0, 0], radius: 1}}
shapes:
  - instance: {of: hand, material: brass}
  - instance: {of: hand}
"""
    ).shapes
    finger = Sphere(ORIGIN, 1.0)
    hand = Group([Instance(finger), Instance(finger).translate(1, 0, 0)])
    assert list(found) == [Instance(hand, material=Material("brass", (1.0, 0.8, 0.0))), Instance(hand)]
    assert found[0].of is found[1].of
    assert found[0].of.children[0].of is found[0].of.children[1].of


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


lengths = st.floats(1e-3, 1e3)
coordinates = st.floats(-1e3, 1e3, allow_subnormal=False)
vectors = st.tuples(coordinates, coordinates, coordinates)
radii = st.tuples(lengths, lengths, lengths)
normals = st.sampled_from([(1.0, 0.0, 0.0), (0.5, -2.0, 0.25), TOP])
similarities = st.one_of(
    st.builds(translate, *[coordinates] * 3),
    st.builds(rotate, st.sampled_from(["x", "y", "z", (1.0, -2.0, 0.5)]), st.floats(-400.0, 400.0)),
    st.builds(scale, st.sampled_from([2.0, 0.1, -1.0])),
)
steps = st.one_of(
    similarities,
    st.builds(scale, *[st.sampled_from([2.0, 0.1, -1.0])] * 3),
    st.just(matrix([[1.0, 0.5, 0.0, 3.0], [0.0, -1.0, 0.0, 1e-7], [0.0, 0.25, 2.0, -0.0]])),
)
MATERIALS = [Material("brass", (1.0, 0.8, 0.0)), Material("glass", transmission=0.9, index=1.5)]


@st.composite
def common(draw, steps=steps):
    """What every node may have, most often little of it."""
    given = {"material": draw(st.none() | st.sampled_from(MATERIALS)), "name": draw(st.none() | st.text(max_size=5))}
    given["transform"] = IDENTITY
    for step in draw(st.lists(steps, max_size=2)):
        given["transform"] = given["transform"].then(step)
    return given


extents = st.sampled_from([None, "auto"]) | st.builds(Extent, vectors, lengths)


@st.composite
def leaves(draw):
    ends = (ORIGIN, (0.5, 0.25, draw(lengths)))
    corners = (draw(st.tuples(*[st.floats(-9.0, -1.0)] * 3)), draw(st.tuples(*[st.floats(1.0, 9.0)] * 3)))
    size = draw(lengths)
    rows = ((1.0, 0.0, size), (0.0, 4.0, 0.0), (size, 0.0, 9.0))
    made = draw(
        st.sampled_from(
            [
                Sphere(draw(vectors), size),
                solids.Ellipsoid(draw(vectors), draw(radii)),
                Box(*corners),
                Cylinder(*ends, size),
                Cone(ends[0], size, ends[1], draw(lengths | st.just(0.0))),
                solids.Hyperboloid(draw(vectors), draw(radii), draw(st.sampled_from([1, 2]))),
                solids.Paraboloid(draw(vectors), draw(radii)[:2]),
                solids.HalfSpace(draw(normals), draw(vectors)),
                solids.Slab(draw(normals), draw(vectors), size),
                solids.Wedge(*corners),
                solids.Quadric(rows, draw(vectors), draw(vectors), draw(coordinates)),
                solids.RoundedBox(*corners, 0.5),
                solids.Tube(*ends, size, size / 2.0),
            ]
        )
    )
    return replace(made, extent=draw(extents), **draw(common()))


@st.composite
def surfaces(draw):
    given = draw(common(similarities))
    ends = (ORIGIN, (0.5, 0.25, draw(lengths)))
    corners = (ORIGIN, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    choice = draw(st.integers(0, 4))
    if choice == 0:
        return Cylinder(*ends, -draw(lengths), open=True, **given)
    if choice == 1:
        return Cone(ends[0], draw(lengths), ends[1], 0.0, open=True, **given)
    if choice == 2:
        return Sphere(draw(vectors), -draw(lengths), **given)
    return Polygon(corners, draw(st.none() | st.just((TOP, (0.5, 0.0, 1.0), TOP))), **given)


@st.composite
def operations(draw, operand):
    """A set operation on operands that `operand` draws."""
    given = draw(common())
    choice = draw(st.integers(0, 4))
    if choice == 0:
        return tree.Complement(draw(operand), **given)
    if choice == 1:
        parts = {"a": draw(operand), "棒_2": draw(operand)}
        text = draw(st.sampled_from([{"formula": "a - (~棒_2\n∪ a) & 棒_2"}, {"polish": "\\ a ~棒_2"}]))
        return Formula(parts, **text, **given)
    operation = (tree.Union, tree.Intersection, tree.Difference)[choice - 2]
    return operation(draw(st.lists(operand, min_size=1, max_size=3)), **given)


solid_trees = st.recursive(leaves(), operations, max_leaves=6)


@st.composite
def groups(draw, member):
    given = draw(common(similarities))
    if draw(st.booleans()):
        return Instance(draw(member), **given)
    members = draw(st.lists(member, max_size=3))
    if members:
        given["extent"] = draw(extents)
        members += [Instance(members[0]), Instance(members[0]).translate(1, 2, 3)]
    return Group(members, **given)


trees = st.recursive(solid_trees | surfaces(), groups, max_leaves=4)


@given(st.lists(trees, max_size=4))
def test_every_tree_survives_yaml(shapes):
    original = Scene(VIEW, shapes, [DirectionalLight((1.0, 0.0, -1.0)), PointLight(TOP, (1.0, 0.5, 0.0))])
    text = dump_yaml(original)
    found = scene(text)
    assert found == original
    assert dump_yaml(found) == text


def test_batches_within_groups_are_written_one_by_one():
    spheres = [Sphere(ORIGIN, 1.0, material=MATERIALS[0]), Sphere(TOP, 2.0, material=MATERIALS[0])]
    found = scene(dump_yaml(Scene(VIEW, [Group([Shapes.of(spheres)]), Group([Shapes.of([])])])))
    assert list(found.shapes) == [Group(spheres), Group()]


def test_aliases_repeat_values():
    found = scene(CAMERA + "background: &grey [0.5, 0.5, 0.5]\nlights: [{position: [0, 0, 0], colour: *grey}]")
    assert found.lights[0].colour == (0.5, 0.5, 0.5)


def test_names_may_be_any_text():
    names = ["no", "1", "a: b", "真鍮", 'quo"te', "", "null", "a #b", "line\nbreak", "\\", "😀", "\x85", "a "]
    materials = [Material(name, (n / 20, 0.0, 0.0)) for n, name in enumerate(names)]
    original = Scene(VIEW, [Sphere(ORIGIN, 1, material=one, name=one.name) for one in materials])
    assert scene(dump_yaml(original)) == original


def test_different_materials_of_one_name_get_names_of_their_own():
    red, blue = Material("paint", (1.0, 0.0, 0.0)), Material("paint", (0.0, 0.0, 1.0))
    original = Scene(VIEW, [Sphere(ORIGIN, 1, material=red), Sphere((1, 0, 0), 1, material=blue)])
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


def references(schema):
    if isinstance(schema, dict):
        yield from (value for key, value in schema.items() if key == "$ref")
        schema = list(schema.values())
    for part in schema if isinstance(schema, list) else ():
        yield from references(part)


def test_schema_is_json_whole_and_knows_every_node():
    schema = json.loads(json.dumps(scene_schema()))
    assert schema["properties"]["shapes"]["items"] == {"$ref": "#/$defs/Node"}
    assert schema["$defs"]["GroupModel"]["properties"]["children"]["items"] == {"$ref": "#/$defs/Node"}
    keys = [key for node in schema["$defs"]["Node"]["oneOf"] for key in node["properties"]]
    assert keys == list(BUILT_IN)
    assert set(keys) == set(CLASSES)
    assert set(references(schema)) <= {f"#/$defs/{name}" for name in schema["$defs"]}
    assert schema["additionalProperties"] is False
    assert schema["required"] == ["camera"]


@pytest.mark.parametrize("key", [key for key in CLASSES if key != "patch"])
def test_models_have_the_fields_of_the_nodes(key):
    own = {name for base in CLASSES[key].__mro__ for name in getattr(base, "__slots__", ())} - {"place"}
    # What a mesh's file holds stands there.
    own -= {"shapes"}
    assert set(BUILT_IN[key].model_fields) == own - ({"normals"} if key == "polygon" else set())


@pytest.fixture
def registry(monkeypatch):
    monkeypatch.setattr(kinds, "_KINDS", kinds._KINDS.copy())
    monkeypatch.setattr(textures, "_KINDS", textures._KINDS.copy())


@record
class Torus:
    kind: i32
    attribute: i32
    matrix: i32
    flags: i32
    centre: vec3
    major: f32
    axis: vec3
    minor: f32
    turns: i32


def register_torus(name):
    kinds.register(kinds.PrimitiveKind(name, "solid", Table(Torus), box="a:b", span="a:b", normal="a:b", inside="a:b"))


@pytest.mark.usefixtures("registry")
def test_a_users_solid_is_a_node_under_its_name():
    register_torus("torus")
    numbers = "centre: [0, 0, 0], major: 2, axis: [0, 0, 1], minor: 0.5, turns: 3"
    (found,) = nodes(f"- difference: [{{torus: {{{numbers}, extent: auto}}}}, {{torus: {{{numbers}}}}}]")
    torus = Solid("torus", centre=ORIGIN, major=2.0, axis=TOP, minor=0.5, turns=3)
    assert found == replace(torus, extent="auto") - torus
    original = Scene(VIEW, [found])
    assert scene(dump_yaml(original)) == original
    assert {"torus": {"$ref": "#/$defs/torus"}} in [
        node["properties"] for node in scene_schema()["$defs"]["Node"]["oneOf"]
    ]
    with pytest.raises(SceneError, match=r"shapes\[0\].torus.turns: this is missing"):
        nodes("- torus: {centre: [0, 0, 0], major: 2, axis: [0, 0, 1], minor: 0.5}")


@pytest.mark.usefixtures("registry")
def test_a_users_solid_may_not_hide_a_node():
    register_torus("box")
    with pytest.raises(SceneError, match="the primitive kind 'box' needs another name"):
        node_models()


@record
class Checker:
    size: f32
    other: vec3


@module
def checker_colour(checker: Checker, colour: vec3, point: vec3, normal: vec3) -> vec3:
    return checker.other


@pytest.fixture
def checker(registry):
    kinds_of = {"size": "f32", "other": "vec3", "picture": "file"}
    defaults = {"other": (0.0, 0.0, 0.0)}
    kind = textures.TextureKind("checker", Table(Checker), checker_colour, kinds_of, defaults, dict)
    return textures.register(kind)


@pytest.mark.usefixtures("checker")
def test_a_users_texture_and_its_file_from_the_folder_of_the_scene(tmp_path):
    path = tmp_path / "scene.yaml"
    text = "materials: {tiles: {texture: {checker: {size: 2, other: [1, 0, 0], picture: tiles.png}}}}\n"
    path.write_text(CAMERA + text)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert f"{path}:2:77: error: materials.tiles.texture.checker.picture: the texture's file" in str(caught.value)
    (tmp_path / "tiles.png").touch()
    original = load_scene(path)
    values = {"size": 2, "other": (1, 0, 0), "picture": str(tmp_path / "tiles.png")}
    assert original.materials == (Material("tiles", texture=Texture("checker", values)),)
    again = dump_yaml(original).encode()
    assert read(SourceText.from_bytes(str(path), again)) == original
    with pytest.raises(SceneError, match=r"checker.picture: this file lies outside the scene's folder"):
        read(SourceText.from_bytes("test.yaml", again))
    assert read(SourceText.from_bytes("test.yaml", again, allow_outside=True)) == original
    published = scene_schema()["$defs"]["Texture"]["oneOf"]
    assert published[-1]["properties"]["checker"]["required"] == ["size", "picture"]


@pytest.mark.usefixtures("checker")
@pytest.mark.parametrize(
    ("texture", "message"),
    [
        ("{chequer: {}}", "materials.m.texture.chequer: there is no texture 'chequer'"),
        ("{checker: {sise: 1}}", "materials.m.texture.checker.sise: a texture 'checker' has no 'sise'"),
        ("{checker: {size: [1]}}", "materials.m.texture.checker.size: no such value for a texture"),
        ("{checker: {size: {a: 1}}}", "materials.m.texture.checker.size: no such parameter of a texture"),
        ("{checker: {}, marble: {}}", "materials.m.texture: this mapping has the wrong length"),
        ("{checker: 3}", "materials.m.texture.checker: this is of the wrong type"),
        ("checker", "materials.m.texture: this is of the wrong type"),
    ],
)
def test_what_is_wrong_with_a_texture(texture, message):
    with pytest.raises(SceneError) as caught:
        scene(f"{CAMERA}materials: {{m: {{texture: {texture}}}}}")
    assert message in str(caught.value)


def chain(levels):
    """A text of `levels` groups, one in another, around a sphere."""
    return "{group: [" * levels + "{sphere: {centre: [0, 0, 0], radius: 1}}" + "]}" * levels


def test_trees_of_a_thousand_levels_work():
    text = f"{CAMERA}shapes: [{chain(tree.MOST_LEVELS - 1)}]"
    found = scene(text)
    assert scene(dump_yaml(found)) == found


def examples():
    return re.findall(r"```yaml\n(.*?)```", DOCUMENTATION.read_text(encoding="utf-8"), re.DOTALL)


def test_the_published_examples_are_valid():
    whole, *parts = examples()
    assert len(scene(whole).shapes) == 3
    assert set(SceneModel.model_fields) == {line.split(":")[0] for line in whole.splitlines() if line[:1].isalpha()}
    for part in parts:
        assert nodes(part) if part.startswith("- ") else scene(CAMERA + part).shapes


def test_the_documentation_names_every_node_and_field():
    text = DOCUMENTATION.read_text(encoding="utf-8")
    words = set(re.findall(r"\w+", text))
    for key, model in BUILT_IN.items():
        assert {key, *model.model_fields} <= words, key


def test_the_published_python_makes_a_scene():
    (code,) = re.findall(r"```python\n(.*?)```", DOCUMENTATION.read_text(encoding="utf-8"), re.DOTALL)
    made: dict = {}
    exec(code, made)
    assert scene(made["text"]) == made["scene"]
    assert np.isfinite(made["scene"].shapes.nodes[0].children[1].transform.matrix).all()
