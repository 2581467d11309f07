"""Microcode by hand in pictures: the picture stays, the steps change, and what cannot stand in is named."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import tasuki
from tasuki.cli import app
from tasuki.diagnostics import LinkError, SceneError, SourceError

ROOT = Path(__file__).parents[2]
SCENE = ROOT / "tests" / "data" / "still_life.nff"
FILE = ROOT / "examples" / "pu" / "reflection_direction.macro"
MIRROR = "tasuki.modules.directions:reflection_direction"
TOON = ROOT / "examples" / "toon.py"
SIZE = (24, 18)


@pytest.mark.parametrize("method", ["raytrace", "scanline"])
@pytest.mark.parametrize("name", ["reflection_direction", MIRROR])
def test_a_picture_with_a_stand_in_is_the_picture(method, name):
    options = {"method": method, "machine": "pu", "size": SIZE, "depth": 3}
    by_compiler = tasuki.render(SCENE, **options)
    by_hand = tasuki.render(SCENE, microcode={name: FILE}, **options)
    assert np.array_equal(by_hand.pixels, by_compiler.pixels)
    assert by_hand.stats["pu"]["steps"] > by_compiler.stats["pu"]["steps"]
    assert by_hand.stats["pu"]["microcode"] == {MIRROR: str(FILE)}
    assert by_compiler.stats["pu"]["microcode"] == {}


def test_a_module_of_a_users_is_named_by_its_file(tmp_path):
    (tmp_path / "flat.macro").write_text("        xyz.op=copy xyz.a=lit lit=0.5 xyz.rd=R0 xyz.w=result\n")
    (tmp_path / "flat.py").write_text(
        "from tasuki.language import module, vec3\n"
        "from tasuki.modules.records import Attribute\n\n\n"
        "@module\n"
        "def flat(material: Attribute, light: vec3, normal: vec3, to_light: vec3, to_eye: vec3) -> vec3:\n"
        "    return vec3(0.25)\n"
    )
    module = f"{tmp_path}/flat.py:flat"
    options = {"machine": "pu", "size": SIZE, "depth": 1, "modules": {"shading": module}}
    dark = tasuki.render(SCENE, **options)
    bright = tasuki.render(SCENE, microcode={module: tmp_path / "flat.macro"}, **options)
    assert (bright.pixels >= dark.pixels).all()
    assert bright.pixels.mean() > dark.pixels.mean()
    [name] = bright.stats["pu"]["microcode"]
    assert name.endswith(":flat")


WRONG = {
    "another machine": ({"machine": "cpu"}, {MIRROR: FILE}, SceneError, "expected: the machine pu\n  found: cpu"),
    "no such module": ({}, {"reflection_directoin": FILE}, LinkError, "did you mean `reflection_direction`"),
    "a module of another method": ({}, {"clip_face": FILE}, LinkError, "no module `clip_face` takes part"),
    "no such module in a file": ({}, {f"{TOON}:tune": FILE}, SourceError, "has no module `tune`"),
    "no such file": ({}, {MIRROR: Path("no.macro")}, SourceError, "no.macro: there is no such file"),
    "one module twice": ({}, {MIRROR: FILE, MIRROR.rpartition(":")[2]: FILE}, LinkError, "two files stand in"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_stand_in_is_named(case):
    options, microcode, error, message = WRONG[case]
    with pytest.raises(error, match=message):
        tasuki.render(SCENE, **{"machine": "pu", "size": SIZE, "microcode": microcode, **options})


def test_the_command_line_says_so_too(tmp_path):
    stats, out = tmp_path / "stats.json", tmp_path / "out.png"
    bad = tmp_path / "bad.macro"
    bad.write_text("        halt\n")

    def run(*microcode: str):
        options = [part for one in microcode for part in ("--microcode", one)]
        command = ["render", SCENE, "--machine", "pu", "--size", "8x6", "-o", out, "--stats", stats, *options]
        return CliRunner().invoke(app, [str(part) for part in command])

    assert run(f"reflection_direction={FILE}").exit_code == 0
    assert json.loads(stats.read_text())["pu"]["microcode"] == {MIRROR: str(FILE)}
    for given, message in (
        (["reflection_direction"], "expected MODULE=FILE"),
        ([f"{MIRROR}={FILE}"] * 2, "two files stand in for"),
        ([f"{MIRROR}={bad}"], f"{bad}:1:"),
    ):
        result = run(*given)
        assert result.exit_code == 2
        assert message in result.stderr
        assert "Traceback" not in result.stderr
