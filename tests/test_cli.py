"""The command line: what it writes, what it says, and its exit codes."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner, Result

from tasuki.catalogue import all_modules
from tasuki.cli import app

DATA = Path(__file__).parent / "data"
SCENE = DATA / "still_life.nff"
PAVILION = DATA / "pavilion.yaml"

NFF = """\
b 0.1 0.2 0.3
v
from 0 -5 0
at 0 0 0
up 0 0 1
angle 40
hither 0.1
resolution 16 16
l 5 -5 5
f 1 0.5 0.2 1 0 0 0 1
s 0 0 0 1
"""

YAML = """\
camera: {eye: [0, -5, 0], at: [0, 0, 0], angle: 40, resolution: [16, 16]}
lights:
  - position: [5, -5, 5]
shapes:
  - sphere: {centre: [0, 0, 0], radius: 1}
"""

MODULES = """\
from tasuki.language import f32, i32, module, vec3
from tasuki.modules.records import Attribute, attributes

@module(fills="shading")
def flat(attribute: Attribute, normal: vec3, direction: vec3, to_light: vec3, light_colour: vec3) -> vec3:
    return vec3(0.5, 0.25, 1.0)

@module
def too_few(attribute: Attribute, normal: vec3) -> vec3:
    return normal

@module
def nan(attribute: Attribute, normal: vec3, direction: vec3, to_light: vec3, light_colour: vec3) -> vec3:
    zero = normal.x - normal.x
    return vec3(zero / zero)

@module
def astray(attribute: Attribute, normal: vec3, direction: vec3, to_light: vec3, light_colour: vec3) -> vec3:
    return attributes[1000000].colour

@module
def wrong(attribute: Attribute, normal: vec3, direction: vec3, to_light: vec3, light_colour: vec3) -> vec3:
    return attribute.hue

def plain(x):
    return x
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with `scene.nff`, `scene.yaml` and `mine.py`."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.nff").write_text(NFF)
    (tmp_path / "scene.yaml").write_text(YAML)
    (tmp_path / "mine.py").write_text(MODULES)
    return tmp_path


def tasuki(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def process(*arguments: object, **options) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "tasuki", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, **options)


# --- what goes well ---------------------------------------------------------------------------------------------------


def test_render_writes_the_picture_into_the_current_folder_and_sums_up(folder: Path):
    result = tasuki("render", SCENE, "--size", "48x32")
    assert result.exit_code == 0, result.stderr
    assert Image.open(folder / "still_life.png").size == (48, 32)
    assert len(result.stdout.splitlines()) == 1
    assert "still_life.png: 48x32" in result.stdout
    assert "rays" in result.stdout
    assert "render" in result.stdout


def test_quiet_says_nothing(folder: Path):
    result = tasuki("render", "scene.nff", "--quiet")
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", "")


def test_the_size_is_by_default_what_the_scene_says(folder: Path):
    tasuki("render", "scene.yaml", "-o", "out.png")
    assert Image.open("out.png").size == (16, 16)


def test_the_report_does_not_overwrite_the_picture(folder: Path):
    result = tasuki("render", "scene.nff", "-o", "one.png", "--stats", "one.png")
    assert result.exit_code == 2
    assert "would overwrite the picture" in result.stderr
    assert not (folder / "one.png").exists()


def test_stats(folder: Path):
    assert tasuki("render", "scene.nff", "--stats", "stats.json", "--threads", 2).exit_code == 0
    stats = json.loads((folder / "stats.json").read_text())
    assert {"version", "scene", "rays", "seconds", "machine", "modules", "pu"} <= set(stats)
    assert set(stats["rays"]) == {"eye", "eye_hits", "reflection", "refraction", "shadow"}
    assert stats["rays"]["eye"] == 256
    assert 0 < stats["rays"]["eye_hits"] < 256
    seconds = stats["seconds"]
    assert set(seconds) == {"load", "build", "compile", "render", "write", "total"}
    parts = sum(seconds[name] for name in ("load", "build", "compile", "render", "write"))
    assert 0 < seconds["render"] < parts <= seconds["total"]
    assert stats["search"]["accelerator"] == "bvh"
    assert stats["search"]["sampled_pixels"] == 256
    assert stats["pu"] is None
    assert stats["machine"]["name"] == "cpu"
    assert stats["machine"]["threads"] == 2
    filled = {(row["socket"], row["kind"], row["name"]) for row in stats["modules"]}
    assert ("shading", None, "diffuse_and_highlight") in filled
    assert {"primitive_hit", "primitive_surface", "primitive_bounds"} <= {socket for socket, _, _ in filled}


def test_a_module_of_ones_own_fills_a_socket(folder: Path):
    result = tasuki("render", "scene.nff", "--module", "shading=mine.py:flat", "-o", "flat.exr", "--stats", "s.json")
    assert result.exit_code == 0, result.stderr
    assert tasuki("render", "scene.nff", "-o", "usual.exr").exit_code == 0
    assert Path("flat.exr").read_bytes() != Path("usual.exr").read_bytes()
    modules = json.loads(Path("s.json").read_text())["modules"]
    assert [row["file"] for row in modules if row["socket"] == "shading"] == [str(folder / "mine.py")]


def test_profile_shows_what_each_module_costs(folder: Path):
    result = tasuki("render", "scene.nff", "--profile", "--quiet", "--stats", "stats.json")
    assert result.exit_code == 0, result.stderr
    heading = next(line for line in result.stdout.splitlines() if line.startswith("module"))
    assert heading.split() == ["module", "calls", "lanes", "cycles", "cycles", "per", "lane", "own", "share"]
    assert "bvh:nearest_intersection" in result.stdout
    rows = {row["module"]: row for row in json.loads(Path("stats.json").read_text())["profile"]}
    assert sum(row["own"] for row in rows.values()) == pytest.approx(1.0)
    # One call for each eye ray, 16 of which travel together.
    assert rows["tasuki.modules.directions:view_direction"]["lanes"] == 256


def test_a_region_is_that_part_of_the_whole_picture(folder: Path):
    tasuki("render", SCENE, "--size", "40x30", "-o", "whole.png")
    tasuki("render", SCENE, "--size", "40x30", "--region", "10,5,21,13", "-o", "part.png")
    whole, part = np.asarray(Image.open("whole.png")), np.asarray(Image.open("part.png"))
    np.testing.assert_array_equal(part, whole[5:18, 10:31])


@pytest.mark.parametrize("suffix", [".png", ".exr"])
def test_the_same_bytes_for_any_number_of_threads(folder: Path, suffix: str):
    def picture(threads: int) -> bytes:
        out = folder / f"{threads}{suffix}"
        options = ("--size", "61x47", "--samples", 2, "--threads", threads, "-o", out)
        assert tasuki("render", SCENE, *options).exit_code == 0
        return out.read_bytes()

    assert picture(1) == picture(2) == picture(3)


@pytest.mark.parametrize("scene", [SCENE, PAVILION], ids=lambda path: path.stem)
def test_ray_counts(folder: Path, scene: Path, golden: Callable[[Path, str], None]):
    # Looked at when they were written: the pictures are right.
    assert tasuki("render", scene, "--size", "64x64", "--stats", "stats.json").exit_code == 0
    rays = json.loads(Path("stats.json").read_text())["rays"]
    golden(DATA / f"{scene.stem}.rays.json", json.dumps(rays, indent=2) + "\n")


def test_info(folder: Path):
    result = tasuki("info", PAVILION)
    assert result.exit_code == 0
    assert "lights      3" in result.stdout
    content = json.loads(tasuki("info", PAVILION, "--json").stdout)
    assert {"camera", "shapes", "bounds", "lights", "materials", "warnings"} <= set(content)


def test_schema():
    result = tasuki("schema")
    assert result.exit_code == 0
    assert "camera" in json.loads(result.stdout)["properties"]


def test_modules(folder: Path):
    result = tasuki("modules", "--with", "mine.py")
    assert result.exit_code == 0, result.stderr
    lines = result.stdout.splitlines()
    assert lines[0].split() == ["number", "method", "module", "socket", "file"]
    assert any(line.split()[:3] == ["10", "raytrace", "quadric_intersection"] for line in lines)
    assert any(line.split() == ["flat", "shading", str(folder / "mine.py")] for line in lines)


def test_modules_as_json_tells_what_they_cost(folder: Path, monkeypatch):
    def few(files):
        return [module for module in all_modules(files) if module.name[0] in "anqw"]

    monkeypatch.setattr("tasuki.catalogue.all_modules", few)
    rows = json.loads(tasuki("modules", "--json", "--with", "mine.py").stdout)
    assert all({"number", "method", "name", "socket", "file", "pu", "cpu"} <= set(row) for row in rows)
    by_name = {row["name"]: row for row in rows}
    assert by_name["quadric_intersection"]["number"] == 10
    assert by_name["quadric_hit"]["socket"] == "primitive_hit"
    assert 0.1 < by_name["quadric_intersection"]["cpu"]["cycles"] < 1000
    costs = by_name["quadric_intersection"]["pu"]
    assert costs["words"] > costs["compact"]["words"] > 0
    assert costs["steps"]["min"] <= costs["steps"]["typical"] <= costs["steps"]["max"]
    assert costs["compact"]["steps"]["typical"] < costs["steps"]["typical"]
    # These read tables, so they cannot run alone.
    assert by_name["nearest_intersection"]["pu"]["words"] is None
    assert by_name["nearest_intersection"]["cpu"]["cycles"] is None
    assert by_name["astray"]["cpu"]["cycles"] is None
    assert "hue" in by_name["wrong"]["error"]


def test_the_machine_python_makes_the_same_bytes(folder: Path):
    assert tasuki("render", "scene.nff", "-o", "cpu.png").exit_code == 0
    result = tasuki("render", "scene.nff", "-o", "python.png", "--machine", "python", "--stats", "stats.json")
    assert result.exit_code == 0, result.stderr
    assert Path("python.png").read_bytes() == Path("cpu.png").read_bytes()
    assert json.loads(Path("stats.json").read_text())["machine"]["name"] == "python"


def test_explain(folder: Path):
    by_name = tasuki("explain", "quadric_hit")
    assert by_name.exit_code == 0, by_name.stderr
    assert by_name.stdout.startswith("quadric_hit(Quadric, vec3, vec3, bool) -> f32")
    mine = tasuki("explain", "mine.py:flat", "--section", "ir")
    assert mine.exit_code == 0, mine.stderr
    assert "return" in mine.stdout
    assert len(mine.stdout) < len(tasuki("explain", "mine.py:flat").stdout)


def test_explain_what_is_not_there(folder: Path):
    refuses(folder, tasuki("explain", "quadric_hut"), "no module `quadric_hut`", "did you mean `quadric_hit`?")
    refuses(folder, tasuki("explain", "mine.py:flad"), "no module `flad`")
    refuses(folder, tasuki("explain", "mine.py:wrong"), "mine.py:23", "hue")
    refuses(folder, tasuki("explain", "quadric_hit", "--section", "poetry"), "'poetry'", "assembly")


def test_version_and_wrong_options_import_nothing_that_costs(folder: Path):
    code = """
import sys
sys.argv = ["tasuki", *sys.argv[1:]]
from tasuki.cli import main
try:
    main()
finally:
    heavy = {"numpy", "llvmlite", "rich", "PIL"} & set(sys.modules)
    assert not heavy, heavy
"""

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True)

    version = run("--version")
    assert (version.returncode, version.stdout) == (0, "tasuki 0.1.0\n")
    for wrong in (["--size", "0x3"], ["-o", "x.gif"], ["--machine", "gpu"], ["--method", "magic"], ["--region", "1"]):
        result = run("render", "scene.nff", *wrong)
        assert result.returncode == 2
        assert "Assertion" not in result.stderr


# --- what goes wrong --------------------------------------------------------------------------------------------------


def refuses(folder: Path, result: Result, *said: str) -> None:
    """Exit code 2, a message that says all of `said`, no traceback, and no new file."""
    assert result.exit_code == 2, (result.stdout, result.stderr, result.exception)
    assert "Traceback" not in result.stderr
    assert "internal error" not in result.stderr
    assert result.stdout == ""
    for text in said:
        assert text in result.stderr
    files = {path.name for path in folder.iterdir()} - {"__pycache__"}
    assert files <= {"scene.nff", "scene.yaml", "mine.py", "bad.nff", "bad.yaml", "a_folder.png"}


BAD_NFF = {
    "empty": ("", "bad.nff"),
    "blank": ("\n\n", "bad.nff"),
    "truncated": (NFF.replace("s 0 0 0 1\n", "s 0 0"), "bad.nff:11"),
    "truncated view": (NFF[: NFF.index("angle")], "bad.nff"),
    "nan": (NFF.replace("s 0 0 0 1", "s 0 nan 0 1"), "bad.nff:11"),
    "infinity": (NFF.replace("s 0 0 0 1", "s 0 inf 0 1"), "bad.nff:11"),
    "no number": (NFF.replace("angle 40", "angle wide"), "bad.nff:6"),
    "along up": (NFF.replace("up 0 0 1", "up 0 1 0"), "bad.nff:5"),
    "unknown entity": (NFF + "torus 1 2 3\n", "bad.nff:12"),
    "eye at the point looked at": (NFF.replace("at 0 0 0", "at 0 -5 0"), "bad.nff:4"),
}

BAD_YAML = {
    "empty": ("", "bad.yaml"),
    "no yaml": ("camera: [1, 2\n", "bad.yaml:"),
    "unknown key": (YAML.replace("radius", "raidus"), "bad.yaml:5"),
    "unknown shape": (YAML.replace("sphere", "torus"), "bad.yaml:5"),
    "nan": (YAML.replace("radius: 1", "radius: .nan"), "bad.yaml:5"),
    "text for a number": (YAML.replace("radius: 1", "radius: big"), "bad.yaml:5"),
    "along up": (YAML.replace("at: [0, 0, 0]", "at: [0, -5, 3]"), "bad.yaml:1"),
    "size 0": (YAML.replace("[16, 16]", "[0, 16]"), "bad.yaml:1"),
}


@pytest.mark.parametrize("case", BAD_NFF)
def test_bad_nff_scenes(folder: Path, case: str):
    text, place = BAD_NFF[case]
    (folder / "bad.nff").write_text(text)
    refuses(folder, tasuki("render", "bad.nff"), place)


@pytest.mark.parametrize("case", BAD_YAML)
def test_bad_yaml_scenes(folder: Path, case: str):
    text, place = BAD_YAML[case]
    (folder / "bad.yaml").write_text(text)
    refuses(folder, tasuki("render", "bad.yaml"), place)


@pytest.mark.parametrize("suffix", ["nff", "yaml"])
def test_binary_scenes(folder: Path, suffix: str):
    (folder / f"bad.{suffix}").write_bytes(bytes(range(256)) * 10)
    refuses(folder, tasuki("render", f"bad.{suffix}"), f"bad.{suffix}")


def test_a_scene_that_is_missing(folder: Path):
    refuses(folder, tasuki("render", "scen.nff"), "there is no file 'scen.nff'", "did you mean 'scene.nff'?")


def test_a_scene_of_an_unknown_format(folder: Path):
    refuses(folder, tasuki("render", "mine.py"), "'mine.py'", ".nff, .obj, .ply, .stl, .yaml")


def test_a_folder_as_scene(folder: Path):
    refuses(folder, tasuki("render", folder), "is a directory")


WRONG_OPTIONS = {
    "size 0": (["--size", "0x16"], ["width is out of range", "found: 0"]),
    "size too large": (["--size", "1000000x1000000"], ["width is out of range", "found: 1000000"]),
    "too many pixels": (["--size", "60000x60000"], ["too many pixels", "60000 x 60000"]),
    "size without x": (["--size", "16"], ["--size", "WxH", "'16'"]),
    "negative size": (["--size", "-1x16"], ["--size", "'-1x16'"]),
    "samples": (["--samples", "0"], ["samples is out of range"]),
    "depth": (["--depth", "0"], ["depth is out of range"]),
    "cutoff": (["--cutoff", "2"], ["cutoff is out of range", "0 to 1"]),
    "depth that is no number": (["--depth", "deep"], ["--depth", "integer"]),
    "threads": (["--threads", "0"], ["threads is out of range"]),
    "region outside": (["--region", "10,10,10,10"], ["region is not a part of the picture", "10,10,10,10", "16x16"]),
    "region empty": (["--region", "0,0,0,5"], ["region is empty", "0,0,0,5"]),
    "region text": (["--region", "everything"], ["--region", "X,Y,W,H", "'everything'"]),
    "unknown suffix": (["-o", "picture.gif"], ["'picture.gif'", ".png or .exr"]),
    "no suffix": (["-o", "picture"], ["'picture'", "no suffix"]),
    "no folder": (["-o", "nowhere/picture.png"], ["nowhere/picture.png", "there is no folder"]),
    "unwritable folder": (["-o", "/proc/picture.png"], ["cannot write '/proc/picture.png'"]),
    "a folder as output": (["-o", "a_folder.png"], ["'a_folder.png' is a directory"]),
    "no folder for the report": (["--stats", "nowhere/stats.json"], ["nowhere/stats.json"]),
    "unknown method": (["--method", "magic"], ["unknown method 'magic'", "raytrace"]),
    "unknown machine": (["--machine", "abacus"], ["unknown machine 'abacus'", "cpu"]),
    "machine to come": (["--machine", "gpu"], ["has not the machine 'gpu' yet"]),
    "unknown accelerator": (["--accelerator", "grid"], ["'grid'", "bvh"]),
    "unknown option": (["--sise", "16x16"], ["--sise", "--size"]),
    "unknown socket": (["--module", "shadign=mine.py:flat"], ["no socket `shadign`", "expected: facet_of", "shading"]),
    "socket filled by kinds": (["--module", "primitive_hit=mine.py:flat"], ["`primitive_hit`", "kind of primitive"]),
    "file without that module": (["--module", "shading=mine.py:flad"], ["no module `flad`", "did you mean `flat`?"]),
    "no module": (["--module", "shading=mine.py:plain"], ["`plain` in `mine.py` is not a module"]),
    "no such file": (["--module", "shading=yours.py:flat"], ["no file `yours.py`"]),
    "no name": (["--module", "shading=mine.py"], ["FILE.py:NAME"]),
    "no socket": (["--module", "mine.py:flat"], ["--module", "SOCKET=FILE.py:NAME"]),
    "socket filled twice": (["--module", "shading=mine.py:flat"] * 2, ["filled twice"]),
    "wrong signature": (
        ["--module", "shading=mine.py:too_few"],
        ["mine.py:8", "(Attribute, vec3) -> vec3", "(Attribute, vec3, vec3, vec3, vec3) -> vec3"],
    ),
    "wrong module": (["--module", "shading=mine.py:wrong"], ["mine.py:23", "hue"]),
    "module that makes NaN": (["--module", "shading=mine.py:nan"], ["not a number", "first pixel (", "nan"]),
    "module that strays": (
        ["--module", "shading=mine.py:astray"],
        ["outside table `attributes`", "`astray`", "1000000"],
    ),
    "missing file to run": (["--with", "yours.py"], ["no file `yours.py`"]),
}


@pytest.mark.parametrize("case", WRONG_OPTIONS)
def test_wrong_options(folder: Path, case: str):
    options, said = WRONG_OPTIONS[case]
    (folder / "a_folder.png").mkdir()
    refuses(folder, tasuki("render", "scene.nff", *options), *said)


def test_a_file_to_run_that_fails(folder: Path):
    (folder / "mine.py").write_text("x = 1\ny = x / 0\n")
    refuses(folder, tasuki("render", "scene.nff", "--with", "mine.py"), "mine.py:2", "ZeroDivisionError")


@pytest.mark.skipif(os.getuid() == 0, reason="to the superuser every folder is writable")
def test_a_folder_without_write_permission(folder: Path):
    folder.chmod(0o555)
    try:
        refuses(folder, tasuki("render", "scene.nff"), "cannot write 'scene.png'")
    finally:
        folder.chmod(0o755)


def test_every_fault_of_a_scene_is_told_at_once(folder: Path):
    (folder / "bad.yaml").write_text(YAML.replace("radius: 1", "radius: .nan, size: 3").replace("lights", "lamps"))
    result = tasuki("render", "bad.yaml")
    refuses(folder, result, "bad.yaml:2", "bad.yaml:5")
    assert result.stderr.count("error:") == 3


def test_debug_shows_the_traceback(folder: Path):
    result = process("render", "missing.nff", "--debug")
    assert result.returncode == 2
    assert "Traceback" in result.stderr
    assert "there is no file 'missing.nff'" in result.stderr


def test_faults_of_ours_are_one_line(folder: Path, monkeypatch: pytest.MonkeyPatch):
    def broken(path: Path, **options: bool) -> None:
        raise KeyError("a\nfault")

    monkeypatch.setattr("tasuki.scene.load_scene", broken)
    result = tasuki("info", "scene.nff")
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
    assert "internal error: KeyError" in result.stderr
    assert "--debug" in result.stderr


def test_an_old_picture_outlives_a_failure(folder: Path):
    tasuki("render", "scene.nff")
    before = (folder / "scene.png").read_bytes()
    assert tasuki("render", "scene.nff", "--module", "shading=mine.py:nan").exit_code == 2
    assert (folder / "scene.png").read_bytes() == before


# --- interruption, and readers that go away ---------------------------------------------------------------------------


def test_ctrl_c_stops_at_once_and_keeps_what_is_done(folder: Path):
    command = [sys.executable, "-m", "tasuki", "render", str(SCENE), "--size", "256x256", "--samples", "100000"]
    running = subprocess.Popen([*command, "-o", "picture.png"], stderr=subprocess.PIPE, text=True)
    assert running.stderr is not None
    # Progress is shown once pixels are being rendered.
    said = ""
    while "rendering: " not in said:
        line = running.stderr.readline()
        assert line, said
        said += line
    assert " left" in said
    running.send_signal(signal.SIGINT)
    began = time.perf_counter()
    rest = running.communicate(timeout=30)[1]
    assert time.perf_counter() - began < 5.0
    assert running.returncode == 130
    assert "picture.partial.png" in rest
    assert "Traceback" not in rest
    assert Image.open(folder / "picture.partial.png").size == (256, 256)
    assert not (folder / "picture.png").exists()
    assert np.asarray(Image.open(folder / "picture.partial.png")).any()


def test_ctrl_c_while_loading(folder: Path, monkeypatch: pytest.MonkeyPatch):
    def interrupted(path: Path, **options: bool) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("tasuki.scene.importers.load_scene", interrupted)
    result = tasuki("render", "scene.nff")
    assert result.exit_code == 130
    assert "stopped" in result.stderr
    assert not (folder / "scene.png").exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full, a device that is always full")
@pytest.mark.parametrize("arguments", [["schema"], ["--version"], ["render", "--help"]])
def test_output_that_cannot_be_written(arguments: list[str]):
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "tasuki", *arguments]
        result = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True)
    assert result.returncode == 2
    assert result.stderr.splitlines() == ["error: [Errno 28] No space left on device"]


def test_a_reader_that_goes_away_is_no_fault():
    command = [sys.executable, "-m", "tasuki", "schema"]
    reading, writing = os.pipe()
    os.close(reading)
    result = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, text=True)
    os.close(writing)
    assert result.returncode == 141
    assert result.stderr == ""
