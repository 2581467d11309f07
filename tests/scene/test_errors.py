"""What users are told about wrong scene files, held by golden texts: errors/FILE, and FILE.txt beside it."""

import contextlib
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tasuki.diagnostics import SceneError
from tasuki.scene import load_scene
from tasuki.scene.importers.nff import read as read_nff
from tasuki.scene.pack import pack
from tasuki.scene.source import SourceText
from tasuki.scene.yaml_format import read as read_yaml

FILES = sorted(path for path in (Path(__file__).parent / "errors").iterdir() if path.suffix in (".nff", ".yaml"))
DATA = Path(__file__).parents[1] / "data"
EXAMPLE = Path(__file__).parent / "errors" / "wrong_numbers.yaml"
NESTED = Path(__file__).parent / "errors" / "formula_unknown_part.yaml"
CAMERA = "camera: {eye: [0, -5, 1], at: [0, 0, 0]}\n"
READERS = {".nff": read_nff, ".yaml": read_yaml}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_error_text(path, golden):
    with pytest.raises(SceneError) as caught:
        READERS[path.suffix](SourceText.from_bytes(path.name, path.read_bytes()))
    golden(path.with_name(path.name + ".txt"), f"{caught.value}\n")


PIECES = [
    "v",
    "from",
    "at",
    "up",
    "angle",
    "hither",
    "resolution",
    "b",
    "l",
    "f",
    "c",
    "s",
    "p",
    "pp",
    "ppp",
    "x",
    "円",
]
PIECES += ["0", "1", "-1", "3", "4", "0.5", "1e999", "nan", "-inf", "1.2.3", "--", "#", "\n", "\r\n", "\x01", "9" * 400]
VIEW = "v\nfrom 0 0 5\nat 0 0 0\nup 0 1 0\nangle 45\nhither 0\nresolution 64 64\n"


@given(st.lists(st.sampled_from(PIECES), max_size=40), st.booleans())
def test_no_nff_raises_anything_else(pieces, with_view):
    text = (VIEW if with_view else "") + " ".join(pieces)
    with contextlib.suppress(SceneError):
        pack(read_nff(SourceText.from_bytes("random.nff", text.encode())))


MARKS = [*"[]{}:,-&*!|>'\"%@`?\n ", "  - ", ": ", "camera", "shapes", "sphere", "1", ".nan", "~", "&a", "*a", "円"]
MARKS += ["definitions", "instance", "of", "group", "union", "object", "parts", "formula", "transform", "scale", "x"]
SHAPES = ["sphere: {centre: [0, 0, 0], radius: 1}", "union", "group", "complement", "child", "children", "object"]
SHAPES += ["parts", "a", "formula", "polish", "a - a", "transform", "scale", "2", "extent", "auto", "instance", "of"]


@given(st.lists(st.sampled_from(MARKS), max_size=40))
@example(["?", ": "])
def test_no_yaml_raises_anything_else(pieces):
    with contextlib.suppress(SceneError):
        read_yaml(SourceText.from_bytes("random.yaml", "".join(pieces).encode()))


@given(st.lists(st.sampled_from([*"[]{}:,", ": ", ", ", ": {", ": [", "}, ", "], ", *SHAPES]), max_size=40))
def test_no_tree_raises_anything_else(pieces):
    text = f"{CAMERA}definitions: {{a: {{group: []}}}}\nshapes: [{{group: [{{{''.join(pieces)}"
    for end in ("", "}]}]", "]}}]}]"):
        with contextlib.suppress(SceneError):
            pack(read_yaml(SourceText.from_bytes("random.yaml", (text + end).encode())))


def test_every_cut_and_every_lost_character_of_a_scene_is_survived():
    for path, read in ((DATA / "still_life.nff", read_nff), (EXAMPLE, read_yaml), (NESTED, read_yaml)):
        data = path.read_bytes()
        for place in range(0, len(data), 7):
            for text in (data[:place], data[:place] + data[place + 1 :]):
                with contextlib.suppress(SceneError):
                    pack(read(SourceText.from_bytes(path.name, text)))


def message(path) -> str:
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    return str(caught.value)


def test_a_missing_file_names_one_like_it(tmp_path):
    (tmp_path / "still_life.nff").write_text("")
    text = message(tmp_path / "still_live.nff")
    assert "there is no file" in text
    assert "did you mean 'still_life.nff'?" in text


def test_a_directory_is_no_scene(tmp_path):
    (tmp_path / "scene.nff").mkdir()
    assert "is a directory" in message(tmp_path / "scene.nff")
    assert "is a directory" in message(tmp_path)


def test_an_unknown_suffix_lists_the_known_ones(tmp_path):
    text = message(tmp_path / "scene.nf")
    assert "expected: a file ending in " in text
    assert ".nff, " in text
    assert ".yaml, .yml" in text
    assert "found: '.nf'" in text
    assert "no suffix" in message(tmp_path / "scene")


@pytest.mark.parametrize("suffix", ["nff", "yaml"])
def test_binary_and_foreign_encodings_are_refused(tmp_path, suffix):
    path = tmp_path / f"scene.{suffix}"
    path.write_bytes(b"\x7fELF\0\0\1")
    assert "not a text file" in message(path)
    path.write_bytes("# 正\nb 0 0 0\n".encode() + "# é".encode("latin-1"))
    text = message(path)
    assert f"{path}:3:3: error: this is not UTF-8" in text
    assert "found: byte 0xe9" in text


def test_an_unreadable_path_is_an_error_not_a_crash():
    assert "cannot read" in message("bad\0name.nff")


def test_deep_nesting_is_refused_quickly(tmp_path):
    path = tmp_path / "deep.yaml"
    path.write_text("[" * 100_000)
    assert "nested too deeply" in message(path)


def test_trees_that_are_too_deep_are_refused(tmp_path):
    path = tmp_path / "deep.yaml"
    for levels, expected in ((10_000, "nested too deeply"), (1_005, "nodes are nested too deeply here")):
        path.write_text(f"{CAMERA}shapes: [{'{group: [' * levels + ']}' * levels}]")
        text = message(path)
        assert expected in text
        assert len(text) < 1000
    chain = "".join(f"  d{n}: {{group: [{{instance: {{of: d{n + 1}}}}}]}}\n" for n in range(5_000))
    end = "  d5000: {sphere: {centre: [0, 0, 0], radius: 1}}\n"
    path.write_text(f"{CAMERA}definitions:\n{chain}{end}shapes: [{{instance: {{of: d0}}}}]")
    assert "shapes[0]: nodes are nested too deeply here" in message(path)


def test_an_extent_of_something_unbounded_is_refused(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(
        f"""{CAMERA}shapes:
  - group:
      - union:
          extent: auto
          children:
            - half_space: {{normal: [0, 0, 1], point: [0, 0, 0]}}
            - box: {{low: [0, 0, 0], high: [1, 1, 1]}}
"""
    )
    with pytest.raises(SceneError) as caught:
        pack(load_scene(path))
    text = str(caught.value)
    assert f"{path}:4" in text
    assert "shapes[0].children[0].extent: this object has no bounds, so it can have no extent" in text


def test_an_empty_scene_is_drawn_with_a_warning(tmp_path):
    path = tmp_path / "empty.yaml"
    path.write_text(CAMERA)
    assert any("the scene has no shapes" in warning for warning in load_scene(path).warnings)


def test_errors_quote_the_text_that_was_read_without_control_characters(tmp_path):
    path = tmp_path / "scene.nff"
    path.write_text("s 0 0 \x1b[31mred 1\n")
    assert "\x1b" not in message(path)
