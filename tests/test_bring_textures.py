"""Textures that examples bring: they stick to what they are on, are read from scene files, and say what is wrong."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tasuki.diagnostics import SceneError
from tasuki.renderers.options import RenderOptions
from tasuki.renderers.raytrace import RayTracer
from tasuki.scene import Box, Camera, Difference, Group, Material, PointLight, Polygon, Scene, Sphere, load_scene
from tasuki.scene.kinds import lookup
from tasuki.scene.material import Texture
from tasuki.scene.textures import lower_textures, placed, register, textures
from tasuki.scene.transforms import Transform, rotate, translate
from tests.extending import EXAMPLES, brought, registries

CAMERA = Camera(eye=(2.0, -6.0, 3.0), at=(0.0, 0.0, 0.5), up=(0.0, 0.0, 1.0), angle=36.0, resolution=(96, 72))
CHECKER = Texture("checker", {"other": (0.1, 0.2, 0.6), "size": 0.4})
MARBLE = Texture("marble", {"veins": (0.3, 0.0, 0.0), "size": 0.7})


@pytest.fixture(scope="module", autouse=True)
def _brought():
    with brought("textures", "image_texture"):
        yield


def painted(texture: Texture | None, **more) -> Material:
    return Material(colour=(0.9, 0.8, 0.7), ambient=0.3, texture=texture, **more)


def picture(scene: Scene, **options) -> np.ndarray:
    width, height = scene.camera.resolution
    return RayTracer(scene, RenderOptions(width, height, **options)).render()[..., :3].copy()


def waves(folder: Path) -> Texture:
    """A picture of 5 x 3 colours."""
    colours = np.random.default_rng(1).integers(0, 256, (3, 5, 3), np.uint8)
    Image.fromarray(colours).save(folder / "colours.png")
    return Texture("image", {"file": str(folder / "colours.png"), "width": 1.3})


def things() -> Group:
    """One of each: a sphere, a polygon, a solid with a cut, each in coordinates of its own."""
    ball = Sphere((0.0, 0.0, 0.0), 0.7).rotate("x", 20.0).translate(-1.0, 0.0, 0.7)
    floor = Polygon(((-3.0, -3.0, 0.0), (3.0, -3.0, 0.0), (3.0, 3.0, 0.0), (-3.0, 3.0, 0.0))).rotate("z", 10.0)
    block = Difference([Box((-0.6, -0.6, 0.0), (0.6, 0.6, 1.2)), Sphere((0.0, -0.6, 1.2), 0.7)])
    return Group([ball, floor, block.scale(1.0, 1.2, 0.8).rotate("z", 30.0).translate(1.0, 0.3, 0.0)])


def moved(point, by: Transform) -> tuple[float, ...]:
    return tuple((by.matrix @ (*point, 1.0))[:3].tolist())


@pytest.mark.parametrize("texture", [CHECKER, MARBLE, "image"], ids=["checker", "marble", "image"])
def test_a_texture_moves_with_what_it_is_on(texture, tmp_path):
    texture = waves(tmp_path) if texture == "image" else texture
    by = rotate((1.0, 0.3, 2.0), 73.0).then(translate(5.0, -2.0, 3.0))
    node = replace(things(), material=painted(texture))
    light = (3.0, -4.0, 6.0)
    here = Scene(CAMERA, [node], [PointLight(light)])
    up = tuple((by.matrix[:3, :3] @ CAMERA.up).tolist())
    camera = replace(CAMERA, eye=moved(CAMERA.eye, by), at=moved(CAMERA.at, by), up=up)
    there = Scene(camera, [node.transformed(by)], [PointLight(moved(light, by))])
    difference = np.abs(picture(here) - picture(there)).max(axis=2)
    # At an edge, of things or of colours, a ray may fall to either side.
    assert (difference > 0.01).mean() < 0.01
    plain = Scene(CAMERA, [replace(node, material=painted(None))], [PointLight(light)])
    assert (np.abs(picture(here) - picture(plain)).max(axis=2) > 0.01).mean() > 0.2


def test_a_checker_has_the_colours_where_it_says():
    floor = Polygon(((-9.0, -9.0, 0.0), (9.0, -9.0, 0.0), (9.0, 9.0, 0.0), (-9.0, 9.0, 0.0)))
    scene = Scene(CAMERA, [replace(floor, material=replace(painted(CHECKER), ambient=1.0, diffuse=0.0))], ())
    found = picture(scene)
    view = CAMERA.frame(96, 72)
    x, y = np.meshgrid(np.arange(96) + 0.5, np.arange(72) + 0.5)
    way = view.corner + x[..., None] * view.right + y[..., None] * view.down
    hit = view.eye - view.eye[2] / way[..., 2:] * way
    cells = np.floor(hit / 0.4 + 0.001)
    odd = (cells[..., 0] + cells[..., 1]) % 2 == 1
    expected = np.where(odd[..., None], (0.1, 0.2, 0.6), (0.9, 0.8, 0.7))
    on_floor = (np.abs(hit[..., :2]) < 9.0).all(axis=-1) & (way[..., 2] < 0.0)
    assert on_floor.mean() > 0.5
    assert (np.abs(found - expected).max(axis=-1) > 1e-5)[on_floor].mean() < 0.002


def test_an_image_shows_its_pixels(tmp_path):
    texture = waves(tmp_path)
    with Image.open(tmp_path / "colours.png") as image:
        levels = np.asarray(image, np.float64) / 255.0
    linear = np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)
    size = 1.3 / 5
    # From straight above, a pixel of the picture in the middle of each pixel of the image.
    camera = Camera((0.65, 1.5 * size, 10.0), (0.65, 1.5 * size, 0.0), (0.0, 1.0, 0.0), 8.0, (5, 3))
    camera = replace(camera, angle=float(2.0 * np.degrees(np.arctan(1.5 * size / 10.0))))
    page = Polygon(((-9.0, -9.0, 0.0), (9.0, -9.0, 0.0), (9.0, 9.0, 0.0), (-9.0, 9.0, 0.0)))
    material = Material(ambient=1.0, diffuse=0.0, texture=texture)
    assert picture(Scene(camera, [replace(page, material=material)], ())) == pytest.approx(linear, abs=1e-4)


def test_nothing_of_textures_is_linked_without_any():
    with_, without = (
        RayTracer(Scene(CAMERA, [Sphere((0, 0, 0), 1.0, material=painted(texture))], ()), RenderOptions(16, 12))
        for texture in (CHECKER, None)
    )
    assert with_.prepared.checked
    assert not without.prepared.checked
    assert "texture_colour" in with_.prepared.fillers()
    assert "texture_colour" not in without.prepared.fillers()
    assert with_.render().shape == without.render().shape


def test_equal_textures_stand_in_memory_once(tmp_path):
    image = waves(tmp_path)
    again = Texture("image", dict(image.values))
    other = Texture("image", {**image.values, "width": 2.0})
    found = lower_textures([painted(one) for one in (CHECKER, None, image, MARBLE, again, other)])
    checker, none, first, marble, second, third = found.codes
    assert (none, first, checker & 31, marble & 31) == (-1, second, 0, 1)
    assert [third >> 5, first >> 5, checker >> 5] == [1, 0, 0]
    assert len(found.tables["texels"]) == 30
    assert found.tables["pictures"]["texels"].tolist() == [0, 15]


def test_files_are_named_from_the_folder_of_the_scene():
    scene = load_scene(EXAMPLES / "image_texture.yaml")
    files = {material.texture.values["file"] for material in scene.materials if material.texture}
    assert files == {str(EXAMPLES / "seigaiha.png")}
    assert placed(Texture("unknown", {"file": "x"}), Path("/y")).values == {"file": "x"}


WRONG = {
    "chequer: {size: 1}": "there is no texture 'chequer'.*expected: checker, marble, image",
    "checker: {sise: 1}": "a texture 'checker' has no 'sise'; did you mean 'size'",
    "checker: {size: big}": "no such value.*expected: a number.*found: 'big'",
    "checker: {size: .inf}": "expected: a number",
    "marble: {veins: [1, 2]}": r"expected: 3 numbers\n  found: \[1, 2\]",
    "image: {width: 1}": "needs this.*expected: a value for 'file'",
    "image: {file: no.png}": "no.png' is missing",
    "image: {file: .}": "is missing.*found: a folder",
    "image: {file: 3}": "the name of a file",
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_wrong_is_shown_where_it_stands(text, tmp_path):
    file = tmp_path / "scene.yaml"
    file.write_text(f"camera: {{eye: [0, -5, 1], at: [0, 0, 0]}}\nmaterials:\n  m: {{texture: {{{text}}}}}\n")
    with pytest.raises(SceneError) as caught:
        load_scene(file)
    assert f"{file}:3:" in str(caught.value)
    assert re.search(WRONG[text], str(caught.value), re.DOTALL)


def test_a_file_that_is_no_picture(tmp_path):
    (tmp_path / "words.png").write_text("words")
    texture = Texture("image", {"file": str(tmp_path / "words.png")})
    with pytest.raises(SceneError, match=r"words.png' is no picture"):
        picture(Scene(CAMERA, [Sphere((0, 0, 0), 1.0, material=painted(texture))], ()))


def test_what_cannot_be_registered():
    with registries():
        checker = next(one for one in textures() if one.name == "checker")
        with pytest.raises(SceneError, match="there is a texture 'checker' already"):
            register(checker)
        with pytest.raises(SceneError, match="cannot have a parameter 'm' of this type"):
            register(replace(checker, name="matrix", parameters={"m": "mat4"}))
        for number in range(32 - len(textures())):
            register(replace(checker, name=f"checker {number}"))
        with pytest.raises(SceneError, match="no room"):
            register(replace(checker, name="one too many"))
    assert lookup("plane").number == 0
