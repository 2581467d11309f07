"""Pictures, as files and as values; and the function that makes them."""

import io
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from tasuki import (
    Camera,
    LinkError,
    MachineError,
    Material,
    OutputError,
    Picture,
    PointLight,
    Scene,
    SceneError,
    Sphere,
    module,
    render,
)
from tasuki.language import vec3
from tasuki.modules.records import Attribute
from tasuki.renderers.files import check_writable, written_aside


@module
def white(attribute: Attribute, normal: vec3, direction: vec3, to_light: vec3, light_colour: vec3) -> vec3:
    return vec3(1.0)


@module
def no_shading(normal: vec3) -> vec3:
    return normal


@pytest.fixture
def pixels() -> np.ndarray:
    random = np.random.default_rng(1)
    return random.uniform(-0.5, 2.0, (5, 7, 4)).astype(np.float32)


@pytest.fixture
def scene() -> Scene:
    camera = Camera(eye=(0.0, -5.0, 0.0), at=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), angle=40.0, resolution=(12, 8))
    ball = Sphere((0.0, 0.0, 0.0), 1.0, material=Material("red", colour=(1.0, 0.0, 0.0)))
    return Scene(camera, [ball], [PointLight((5.0, -5.0, 5.0))], background=(0.0, 0.0, 1.0))


def srgb(linear: float) -> int:
    """IEC 61966-2-1, in float64."""
    clamped = min(max(linear, 0.0), 1.0)
    curve = 12.92 * clamped if clamped <= 0.0031308 else 1.055 * clamped ** (1 / 2.4) - 0.055
    return int(curve * 255.0 + 0.5)


def test_png_is_clamped_srgb(tmp_path: Path, pixels: np.ndarray):
    Picture(pixels).save(tmp_path / "picture.png")
    found = Image.open(tmp_path / "picture.png")
    assert (found.mode, found.size, found.info) == ("RGB", (7, 5), {})
    expected = [[[srgb(float(value)) for value in pixel[:3]] for pixel in row] for row in pixels]
    # A value may lie so near the middle between two steps that float32 decides otherwise.
    assert np.abs(np.asarray(found).astype(int) - expected).max() <= 1
    assert (np.asarray(found) == expected).mean() > 0.98


def test_every_step_of_srgb_survives():
    steps = np.arange(256)
    values = steps / 255.0
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    picture = Picture(np.repeat(linear, 4).reshape(1, 256, 4))
    np.testing.assert_array_equal(picture.srgb()[0, :, 0], steps)


def test_exr_is_linear_and_exact(tmp_path: Path, pixels: np.ndarray):
    Picture(pixels).save(tmp_path / "picture.EXR")
    with OpenEXR.File(str(tmp_path / "picture.EXR")) as file:
        found = file.channels()["RGB"].pixels
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, pixels[..., :3])


@pytest.mark.parametrize("name", ["a.png", "a.exr"])
def test_equal_pictures_make_equal_files(tmp_path: Path, pixels: np.ndarray, name: str):
    Picture(pixels).save(tmp_path / name)
    first = (tmp_path / name).read_bytes()
    Picture(pixels.copy()).save(tmp_path / name)
    assert (tmp_path / name).read_bytes() == first
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_picture_is_an_array_of_its_own(pixels: np.ndarray):
    picture = Picture(pixels)
    pixels[:] = 0.0
    assert (picture.width, picture.height) == (7, 5)
    assert np.asarray(picture).shape == (5, 7, 4)
    assert np.asarray(picture).any()
    assert np.asarray(picture, np.float64).dtype == np.float64


def test_notebooks_show_it(pixels: np.ndarray):
    assert Image.open(io.BytesIO(Picture(pixels)._repr_png_())).size == (7, 5)


def test_saving_tells_how_long_it_took(tmp_path: Path, pixels: np.ndarray):
    picture = Picture(pixels)
    picture.save(tmp_path / "picture.png")
    assert picture.stats["seconds"]["write"] > 0.0


def test_nan_is_no_picture(pixels: np.ndarray):
    pixels[2, 3, 1] = np.nan
    pixels[4, 0, 0] = np.nan
    with pytest.raises(MachineError, match=r"2 of 35 pixels are not a number, first pixel \(3, 2\)"):
        Picture(pixels)


@pytest.mark.parametrize("shape", [(4, 4), (4, 4, 3), (0, 4, 4), (2, 4, 4, 4)])
def test_other_shapes_are_no_picture(shape: tuple[int, ...]):
    with pytest.raises(ValueError, match="height, width, 4"):
        Picture(np.zeros(shape))


def test_a_failure_leaves_the_old_file(tmp_path: Path):
    path = tmp_path / "file.png"
    path.write_bytes(b"old")

    def interrupted() -> None:
        with written_aside(path) as aside:
            aside.write_bytes(b"ne")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_bytes() == b"old"
    assert [found.name for found in tmp_path.iterdir()] == ["file.png"]


def test_checking_leaves_everything_as_it_was(tmp_path: Path):
    path = tmp_path / "file.png"
    check_writable(path)
    assert not any(tmp_path.iterdir())
    path.write_bytes(b"old")
    check_writable(path)
    assert path.read_bytes() == b"old"


def test_a_link_is_written_through(tmp_path: Path, pixels: np.ndarray):
    (tmp_path / "link.png").symlink_to(tmp_path / "there.png")
    Picture(pixels).save(tmp_path / "link.png")
    assert (tmp_path / "link.png").is_symlink()
    assert Image.open(tmp_path / "there.png").size == (7, 5)


def test_pictures_go_into_regular_files_only(tmp_path: Path, pixels: np.ndarray):
    folder = tmp_path / "folder.png"
    folder.mkdir()
    with pytest.raises(OutputError, match="there is no folder"):
        Picture(pixels).save(tmp_path / "nowhere" / "picture.png")
    with pytest.raises(OutputError, match="is a directory"):
        Picture(pixels).save(folder)
    with pytest.raises(OutputError, match="not a regular file"):
        check_writable("/dev/null", suffixes=())


# --- tasuki.render ----------------------------------------------------------------------------------------------------


def test_render_a_scene(scene: Scene):
    picture = render(scene)
    assert (picture.width, picture.height) == (12, 8)
    middle, corner = picture.pixels[4, 6], picture.pixels[0, 0]
    assert middle[0] > 0.1
    assert middle[3] == 1.0
    np.testing.assert_array_equal(corner, [0.0, 0.0, 1.0, 0.0])
    assert picture.stats["scene"]["file"] is None
    assert picture.stats["rays"]["eye"] == 96
    assert picture.stats["rays"]["eye_hits"] == (picture.pixels[..., 3] == 1.0).sum()


def test_more_samples_smooth_the_outline(scene: Scene):
    coverage = render(scene, size=(24, 16), samples=8).pixels[..., 3]
    assert ((coverage > 0.0) & (coverage < 1.0)).any()


def test_pictures_do_not_share_memory(scene: Scene):
    first = render(scene)
    before = first.pixels.copy()
    render(scene, modules={"shading": white})
    np.testing.assert_array_equal(first.pixels, before)


def test_render_with_a_module_of_ones_own(scene: Scene):
    lit = render(scene, modules={"shading": white}).pixels[..., 1]
    assert lit.max() >= 1.0
    assert render(scene).pixels[..., 1].max() < 1.0


def test_a_region_of_the_picture(scene: Scene):
    whole = render(scene).pixels
    part = render(scene, region=(3, 2, 5, 4)).pixels
    np.testing.assert_array_equal(part, whole[2:6, 3:8])


def test_a_very_high_picture(scene: Scene):
    """Rows beyond 32768, whose place in a word has its sign bit set."""
    whole = render(scene, size=(2, 40000))
    part = render(scene, size=(2, 40000), region=(0, 39980, 2, 20))
    np.testing.assert_array_equal(whole.pixels[39980:], part.pixels)
    assert whole.stats["rays"]["eye_hits"] == np.count_nonzero(whole.pixels[..., 3])


def test_plain_python_makes_the_same_picture(scene: Scene):
    plain = render(scene, machine="python")
    np.testing.assert_array_equal(plain.pixels, render(scene).pixels)
    assert plain.stats["machine"]["name"] == "python"


def test_progress_is_told(scene: Scene):
    told = []
    render(scene, progress=lambda doing, share: told.append((doing, share)))
    assert [doing for doing, _ in told[:2]] == ["loading", "preparing"]


def test_profiling_changes_no_bit(scene: Scene):
    np.testing.assert_array_equal(render(scene, profile=True).pixels, render(scene).pixels)


WRONG_ARGUMENTS = {
    "a number for a scene": ({"scene": 3}, SceneError, "this is no scene"),
    "half a pixel": ({"size": (2.5, 3)}, SceneError, "width is out of range"),
    "one side": ({"size": 5}, SceneError, "this is no size"),
    "samples in words": ({"samples": "four"}, SceneError, "samples is out of range"),
    "threads in words": ({"threads": "two"}, SceneError, "threads is out of range"),
    "three of four": ({"region": (1, 2, 3)}, SceneError, "this is no region"),
    "a region of half pixels": ({"region": (0, 0, 1.5, 1)}, SceneError, "not in whole pixels"),
    "a region above": ({"region": (0, -1, 2, 2)}, SceneError, "not a part of the picture"),
    "a number for a module": ({"modules": {"shading": 3}}, LinkError, "this cannot fill socket `shading`"),
}


@pytest.mark.parametrize("case", WRONG_ARGUMENTS)
def test_arguments_of_a_wrong_type_are_told(scene: Scene, case: str):
    arguments, error, message = WRONG_ARGUMENTS[case]
    with pytest.raises(error, match=message):
        render(**{"scene": scene, **arguments})


def test_what_cannot_be_rendered(scene: Scene):
    with pytest.raises(SceneError, match="has not the machine 'gpu' yet"):
        render(scene, machine="gpu")
    with pytest.raises(SceneError, match="this machine cannot be profiled"):
        render(scene, machine="python", profile=True)
    with pytest.raises(SceneError, match="unknown method 'magic'"):
        render(scene, method="magic")
    with pytest.raises(LinkError, match="no socket `paint`"):
        render(scene, modules={"paint": white})
    with pytest.raises(LinkError, match="`no_shading` cannot fill socket `shading`"):
        render(scene, modules={"shading": no_shading})
