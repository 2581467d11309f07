"""What `tasuki info` says of a scene."""

from pathlib import Path

import pytest

from tasuki.renderers.info import info
from tasuki.scene import Box, Camera, Scene, Sphere, load_scene

DATA = Path(__file__).parent / "data"


def test_info_counts_shapes_primitives_and_materials():
    found = info(load_scene(DATA / "still_life.nff"))
    assert found["shapes"] == {"total": 32, "sphere": 14, "cylinder": 1, "cone": 9, "polygon": 8}
    assert found["primitives"] == {"quadric": 14, "cone": 9 + 1, "triangle": 2, "quad": 7 + 3}
    assert sum(material["shapes"] for material in found["materials"]) == 32
    assert found["bounds"]["low"][2] == -3.0
    assert len(found["lights"]) == 3
    assert found["warnings"] == []


def test_a_scene_of_nothing_has_no_bounds():
    camera = Camera(eye=(0.0, 0.0, 5.0), at=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), angle=45.0)
    assert info(Scene(camera, []))["bounds"] is None
    ball = info(Scene(camera, [Sphere((1.0, 2.0, 3.0), 0.5)]))["bounds"]
    assert ball is not None
    assert ball["low"] == pytest.approx([0.5, 1.5, 2.5], abs=1e-5)
    assert ball["high"] == pytest.approx([1.5, 2.5, 3.5], abs=1e-5)


def test_info_tells_of_formulas_and_what_was_merged():
    camera = Camera(eye=(0.0, -9.0, 5.0), at=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), angle=45.0)
    low = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    high = low.translate(0.0, 0.0, 1.0)
    found = info(Scene(camera, [low | high, low & low.translate(5.0, 0.0, 0.0)]))
    assert found["shapes"] == {"total": 2, "object": 2}
    assert found["primitives"] == {"object": 1}
    # Of the four boxes' faces across x, y, z there are 4, 2 and 3 different ones.
    assert found["formulas"] == {"literals": 24, "surfaces": 9, "merged": 15}
    assert found["warnings"][0].startswith("shapes[1]: warning: this object is empty")
