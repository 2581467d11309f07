"""What `--with FILE.py` brings: the examples as users run them, a grid beside our accelerators, and what goes wrong."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from tasuki import render
from tasuki.cli import app
from tasuki.diagnostics import SceneError, SourceError
from tasuki.language.load import load_file
from tasuki.renderers.extensions import load_extensions
from tasuki.renderers.options import RenderOptions
from tasuki.renderers.raytrace import RayTracer
from tasuki.renderers.search_counts import search_counts
from tasuki.scene import Camera, HalfSpace, Material, PointLight, Scene, Solid, Sphere, load_scene
from tasuki.scene.kinds import kinds, lookup
from tasuki.scene.textures import textures
from tests.extending import EXAMPLES, brought, registries

DATA = Path(__file__).parent / "data"
CAMERA = Camera(eye=(1.0, -9.0, 4.0), at=(0.0, 0.0, 1.0), up=(0.0, 0.0, 1.0), angle=40.0, resolution=(48, 36))
LIGHTS = (PointLight((3.0, -5.0, 6.0)),)


STRAYING = """
from tasuki.language import Table, f32, module, record, vec3
from tasuki.scene.textures import TextureKind, register

@record
class Stripes:
    size: f32

stripes = Table(Stripes)

@module
def striped(one: Stripes, colour: vec3, point: vec3, normal: vec3) -> vec3:
    return colour * stripes[1000000].size

register(TextureKind("stripes", stripes, striped))
"""
STRIPED = """
camera: {eye: [0, -5, 0], at: [0, 0, 0], resolution: [16, 16]}
materials: {striped: {texture: {stripes: {size: 1}}}}
shapes: [{sphere: {centre: [0, 0, 0], radius: 1, material: striped}}]
"""


@pytest.fixture(autouse=True)
def _registries():
    with registries():
        yield


def tasuki(*arguments: str) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def picture(scene: Scene, accelerator: str) -> RayTracer:
    width, height = scene.camera.resolution
    tracer = RayTracer(scene, RenderOptions(width, height, accelerator=accelerator))
    tracer.render()
    return tracer


# --- the examples -----------------------------------------------------------------------------------------------------


def test_no_example_has_a_hundred_lines():
    for file in EXAMPLES.glob("*.py"):
        assert len(file.read_text().splitlines()) < 100, file


def test_info_schema_and_modules_know_what_is_brought():
    torus = EXAMPLES / "torus.py"
    known = json.loads(tasuki("info", EXAMPLES / "torus.yaml", "--with", torus, "--json").stdout)
    assert known["primitives"]["object"] == 6
    schema = tasuki("schema", "--with", torus, "--with", EXAMPLES / "textures.py").stdout
    assert '"major"' in schema
    assert '"turbulence"' in schema
    assert "torus_span" in tasuki("modules", "--with", torus).stdout


def test_python_takes_the_same_files():
    # The name of the solid is known only when the files have been run.
    found = render(EXAMPLES / "torus.yaml", with_files=[EXAMPLES / "torus.py"], size=(30, 20))
    again = render(EXAMPLES / "torus.yaml", with_files=[EXAMPLES / "torus.py"], size=(30, 20))
    assert np.array_equal(found.pixels, again.pixels)


def test_the_page_of_what_can_be_brought_tells_the_truth(tmp_path):
    page = (EXAMPLES.parent / "docs" / "extending.md").read_text()
    [code] = re.findall(r"```python\n(from tasuki.*?)```", page, re.DOTALL)
    [materials] = re.findall(r"```yaml\n(materials:.*?)```", page, re.DOTALL)
    (tmp_path / "stripes.py").write_text(code)
    scene = re.sub("materials:.*\n", materials, STRIPED).replace("material: striped", "material: awning")
    (tmp_path / "scene.yaml").write_text(scene)
    result = tasuki("render", tmp_path / "scene.yaml", "--with", tmp_path / "stripes.py", "-o", tmp_path / "out.png")
    assert result.exit_code == 0, result.stderr


# --- the grid ---------------------------------------------------------------------------------------------------------


def spread() -> Scene:
    """Things of all sizes, some of them without bounds, some in one another."""
    draw = np.random.default_rng(3)
    balls = [
        Sphere(tuple(draw.uniform(-3.0, 3.0, 3).tolist()), float(np.exp(draw.uniform(-4.0, 0.3))), material=material)
        for material in (Material(reflection=0.4), Material(transmission=0.8, index=1.3), Material()) * 40
    ]
    return Scene(CAMERA, [*balls, HalfSpace((0.1, 0.0, 1.0), (0.0, 0.0, -1.5)), Sphere((0, 0, 40), 38.0)], LIGHTS)


def small(name: str) -> Scene:
    scene = load_scene(DATA / name)
    return Scene(Camera(**{**vars(scene.camera), "resolution": (48, 36)}), scene.shapes, scene.lights, scene.background)


GRIDS = {
    "still life": lambda: small("still_life.nff"),
    "pavilion": lambda: small("pavilion.yaml"),
    "things of all sizes": spread,
    "one thing": lambda: Scene(CAMERA, [Sphere((0.0, 0.0, 1.0), 1.0)], LIGHTS),
    "one thing without bounds": lambda: Scene(CAMERA, [HalfSpace((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))], LIGHTS),
    "nothing": lambda: Scene(CAMERA, [], LIGHTS),
}


@pytest.mark.parametrize("scene", GRIDS)
def test_the_grid_shows_in_no_picture(scene):
    with brought("grid"):
        expected, found = (picture(GRIDS[scene](), accelerator) for accelerator in ("bvh", "grid"))
        assert np.array_equal(expected.pixels(), found.pixels())
        assert expected.ray_counts() == found.ray_counts()
        assert found.prepared.checked
        assert not expected.prepared.checked


def test_the_grid_searches_less_than_all():
    with brought("grid"):
        counts = search_counts(picture(spread(), "grid"))
    assert counts["accelerator"] == "grid"
    assert counts["tests_per_ray"] < 40
    assert counts["steps_per_ray"] > 1


def test_a_torus_in_the_grid():
    with brought("grid", "torus"):
        rings = [
            Solid("torus", major=1.0, minor=0.3).rotate("x", 40.0 * k).translate(k - 2.0, 0.2 * k, 1.0)
            for k in range(5)
        ]
        scene = Scene(CAMERA, rings, LIGHTS)
        assert np.array_equal(picture(scene, "bvh").pixels(), picture(scene, "grid").pixels())


# --- what goes wrong --------------------------------------------------------------------------------------------------

WRONG = {
    "missing": (None, ["there is no file", "mine.py"]),
    "no Python": ("def", ["mine.py:1", "this is not Python"]),
    "fails": ("x = 1\ny = x / 0\n", ["mine.py:2", "ZeroDivisionError"]),
    "registers nothing": ("x = 1\n", ["mine.py' registers nothing", "expected: a call of `register`"]),
    "a kind of ours": (
        "from tasuki.scene.kinds import lookup, register\nregister(lookup('cone'))\n",
        ["mine.py:2", "there is a primitive kind 'cone' already", "| register(lookup('cone'))"],
    ),
    "an accelerator of ours": (
        "from tasuki.renderers.accelerators import lookup, register\nregister(lookup('bvh'))\n",
        ["mine.py:2", "there is an accelerator 'bvh' already", "found: one that comes with Tasuki"],
    ),
    "a solid without an inside": (
        "from tasuki.scene.kinds import PrimitiveKind, register\nregister(PrimitiveKind('knot', 'solid', 't', 'b'))\n",
        ["mine.py:2", "'knot' is inconsistent", "expected: a solid has the modules", "found: no span"],
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_files_that_cannot_be_brought(case, tmp_path):
    text, said = WRONG[case]
    if text is not None:
        (tmp_path / "mine.py").write_text(text)
    result = tasuki("render", DATA / "still_life.nff", "--with", tmp_path / "mine.py", "-o", tmp_path / "out.png")
    assert result.exit_code == 2
    assert not (tmp_path / "out.png").exists()
    assert "Traceback" not in result.stderr
    for text in said:
        assert text in result.stderr


def test_a_module_of_a_users_that_strays_is_told(tmp_path):
    """Not only modules that fill sockets are checked: those of kinds, textures and accelerators too."""
    (tmp_path / "mine.py").write_text(STRAYING)
    (tmp_path / "scene.yaml").write_text(STRIPED)
    arguments = ["render", tmp_path / "scene.yaml", "--with", tmp_path / "mine.py", "-o", tmp_path / "out.png"]
    result = tasuki(*arguments)
    assert result.exit_code == 2
    assert "outside table `stripes`" in result.stderr
    assert "mine.py:13" in result.stderr


def test_a_file_that_was_run_before_is_known(tmp_path):
    (tmp_path / "mine.py").write_text(STRAYING)
    load_file(tmp_path / "mine.py")
    load_extensions([tmp_path / "mine.py", tmp_path / "mine.py"])
    assert [kind.name for kind in textures()] == ["stripes"]


# --- a file that is changed and loaded again --------------------------------------------------------------------------


def test_a_changed_file_replaces_what_it_brought(tmp_path):
    mine, scene = tmp_path / "mine.py", tmp_path / "scene.yaml"
    mine.write_text(STRAYING.replace("stripes[1000000].size", "one.size"))
    scene.write_text(STRIPED)
    first = render(scene, with_files=[mine])
    before = load_scene(scene)
    mine.write_text(STRAYING.replace("stripes[1000000].size", "(0.5 * one.size)"))
    second = render(scene, with_files=[mine])
    assert [kind.name for kind in textures()] == ["stripes"]
    np.testing.assert_allclose(second.pixels[..., :3], 0.5 * first.pixels[..., :3], rtol=1e-6)
    assert np.array_equal(render(before).pixels, second.pixels)


def test_a_changed_file_leaves_the_numbers_of_kinds_as_they_are(tmp_path):
    mine = tmp_path / "mine.py"
    kind = "from tasuki.scene.kinds import PrimitiveKind, lookup, register\n"
    kind += "".join(
        f"register(PrimitiveKind('{name}', 'surface', 'table', 'box', hit='hit', surface='surface'))\n"
        for name in ("disc", "patch")
    )
    mine.write_text(kind)
    load_extensions([mine])
    numbers = {one.name: one.number for one in kinds()}
    mine.write_text(kind.replace("'hit'", "'another'"))
    load_extensions([mine])
    assert {one.name: one.number for one in kinds()} == numbers
    assert lookup("disc").hit == lookup("patch").hit == "another"


def test_a_file_that_failed_can_be_mended(tmp_path):
    mine = tmp_path / "mine.py"
    mine.write_text(STRAYING + "1 / 0\n")
    with pytest.raises(SourceError, match="ZeroDivisionError"):
        load_extensions([mine])
    mine.write_text(STRAYING)
    load_extensions([mine])
    assert [kind.name for kind in textures()] == ["stripes"]


def test_another_file_cannot_take_the_name(tmp_path):
    first, second = tmp_path / "first.py", tmp_path / "second.py"
    first.write_text(STRAYING)
    second.write_text("\n" + STRAYING)
    load_extensions([first])
    with pytest.raises(SceneError) as caught:
        load_extensions([second])
    said = str(caught.value)
    assert f"{second}:16:1: error: there is a texture 'stripes' already" in said
    assert f"{first}:15:1: note: it was registered here first" in said
