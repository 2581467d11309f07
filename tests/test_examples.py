"""The examples: every command of their page runs, and shows all that the scene is about; scripts do what they say."""

from __future__ import annotations

import itertools
import json
import re
import runpy
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from tasuki.cli import app
from tasuki.scene import Node, Scene, load_scene
from tests.extending import registries

ROOT = Path(__file__).parent.parent
EXAMPLES = ROOT / "examples"
PAGE = (EXAMPLES / "README.md").read_text()
COMMANDS = [shlex.split(line) for line in re.findall(r"^    tasuki (render .*)", PAGE, re.MULTILINE)]
SMALL = ("--size", "64x48", "--samples", "1", "--depth", "4", "--quiet")


def scene_of(command: list[str]) -> str:
    return command[1]


def test_the_page_shows_every_scene():
    scenes = {str(path.relative_to(ROOT)) for path in EXAMPLES.rglob("*.yaml")}
    assert sorted(map(scene_of, COMMANDS)) == sorted(scenes)


def test_the_page_shows_pictures_that_are_there_and_not_heavy():
    pictures = re.findall(r"!\[.+?\]\((.+?)\)", PAGE)
    assert len(pictures) == len(COMMANDS) + 1, "one of each command, and one of both methods"
    for picture in pictures:
        assert (EXAMPLES / picture).stat().st_size < 150 * 1024, picture


def test_the_page_leads_to_files_that_are_there():
    for link in re.findall(r"[^!]\[.+?\]\((.+?)\)", PAGE):
        assert (EXAMPLES / link).exists(), link


@pytest.mark.parametrize("command", COMMANDS, ids=scene_of)
def test_every_command_of_the_page_makes_a_picture(command, tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    picture, stats = tmp_path / "picture.png", tmp_path / "stats.json"
    with registries():
        result = CliRunner().invoke(app, [*command, *SMALL, "--output", str(picture), "--stats", str(stats)])
    assert result.exit_code == 0, result.stderr
    report = json.loads(stats.read_text())
    assert report["rays"]["eye_hits"] > 700
    assert ("examples" in {Path(row["file"]).parent.name for row in report["modules"]}) == ("--with" in command)
    pixels = np.asarray(Image.open(picture).convert("RGB"))
    assert pixels.shape == (48, 64, 3)
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 100, "the picture is nearly of one colour"


@pytest.mark.parametrize("generator", sorted(EXAMPLES.rglob("make_*.py")), ids=lambda path: path.stem)
def test_a_scene_is_what_its_generator_writes(generator):
    written = subprocess.run([sys.executable, generator], capture_output=True, text=True, check=True).stdout
    assert written == generator.with_name(f"{generator.stem.removeprefix('make_')}.yaml").read_text()


def nodes(scene: Scene) -> list[Node]:
    """All nodes of a scene, in preorder."""
    found, stack = [], list(reversed(scene.shapes))
    while stack:
        found.append(stack.pop())
        stack += reversed(found[-1].inner)
    return found


def test_poses_of_the_arm_differ_in_the_matrices_of_its_joints_alone():
    arm = runpy.run_path(str(EXAMPLES / "robot_arm.py"))
    scene = load_scene(arm["SCENE"])
    for angles in arm["POSES"]:
        pairs = list(zip(nodes(scene), nodes(arm["in_pose"](scene, angles)), strict=True))
        assert sorted(one.name for one, other in pairs if one.transform != other.transform) == sorted(angles)
        assert all(type(one) is type(other) and one.material == other.material for one, other in pairs)
    pictures = [np.asarray(picture) for picture in arm["poses"]((48, 48))]
    assert all(not np.array_equal(one, other) for one, other in itertools.combinations(pictures, 2))


def test_both_methods_show_the_same_part():
    both = runpy.run_path(str(EXAMPLES / "both_methods.py"))["side_by_side"](samples=1, size=(84, 72))
    rays, rows = (half.astype(int) for half in np.split(both, 2, axis=1))
    assert both.shape == (72, 168, 3)
    # They differ by the shadows alone, in which the ray tracer's is darker.
    assert (rays <= rows + 6).all(axis=2).mean() > 0.99
    assert (np.abs(rays - rows).max(axis=2) <= 3).mean() > 0.5
