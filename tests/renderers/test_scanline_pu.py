"""Scanline pictures by the processor unit: the interpreter's bit for bit, close to the CPU's; what reports count."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tasuki
from tasuki.diagnostics import SceneError
from tasuki.ir.interpret import interpret
from tasuki.machines.pu.lower import ARITHMETIC
from tasuki.programs import link_program
from tasuki.renderers.options import Region, RenderOptions
from tasuki.renderers.scanline import ScanlineRenderer
from tasuki.renderers.scanline_pu import MicrocodeScanline
from tasuki.scene import Camera, Material, PointLight, Polygon, Scene, load_scene
from tests.renderers.test_scanline import coloured

ROOT = Path(__file__).parents[2]
DATA = ROOT / "tests" / "data"
SIZE = (32, 24)
CAMERA = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 40.0, SIZE)
LIGHTS = [PointLight((3.0, 5.0, 6.0)), PointLight((-4.0, 2.0, 5.0))]


class Interpreted(MicrocodeScanline):
    """The same passes by the interpreter, under the processor unit's arithmetic."""

    def _run(self, entry, items):
        if items:
            program = link_program(entry, self.fillers())
            numbers = np.arange(items, dtype=np.int32)
            interpret(program, [[numbers]], lanes=items, width=1, tables=self.tables, arithmetic=ARITHMETIC)


def some_triangles(count: int, seed: int, reach: float) -> Scene:
    """Triangles through each other, some across the sides of the view or the eye's plane where `reach` is large."""
    corners = np.random.default_rng(seed).uniform(-reach, reach, (count, 3, 3))
    material = Material("shiny", (0.8, 0.5, 0.3), diffuse=0.7, specular=0.3, exponent=9.0, two_sided=True)
    return Scene(CAMERA, [Polygon(tuple(map(tuple, one)), material=material) for one in corners.tolist()], LIGHTS)


def squares(depths: list[float], half: float = 0.5) -> Scene:
    """Squares before each other, all of which cover the same pixels: larger as they are farther away."""
    shapes = []
    for number, depth in enumerate(depths):
        side = half * (4.0 - depth) / 4.0
        corners = [(-side, -side, depth), (side, -side, depth), (side, side, depth), (-side, side, depth)]
        shapes.append(Polygon(tuple(corners), material=coloured(number)))
    return Scene(CAMERA, shapes, LIGHTS)


def drawn(scene: Scene, kind: type[ScanlineRenderer] = MicrocodeScanline, modules=None, **options):
    renderer = kind(scene, RenderOptions(*SIZE, machine="pu", **options), modules)
    renderer.render()
    return renderer


def near(a: ScanlineRenderer, b: ScanlineRenderer) -> np.ndarray:
    """Whether pixels are within two levels of each other, as PNG has them."""
    levels = [tasuki.Picture(one.pixels()).srgb().astype(int) for one in (a, b)]
    return np.abs(levels[0] - levels[1]).max(axis=2) <= 2


@pytest.mark.parametrize("name", ["still_life.nff", "pavilion.yaml"])
def test_a_scene_is_close_to_the_cpus_picture(name):
    scene = load_scene(DATA / name)
    mine, cpu = drawn(scene), drawn(scene, ScanlineRenderer)
    assert (mine.pixels()[..., 3] > 0.0).any()
    assert near(mine, cpu).mean() >= 0.99
    assert (mine.visible() == cpu.visible()).mean() >= 0.99


@pytest.mark.parametrize(("schedule", "reach", "samples"), [("macro", 0.9, 2), ("compact", 6.0, 1)])
def test_every_pass_is_the_interpreters(schedule, reach, samples):
    options = {"schedule": schedule, "samples": samples, "region": Region(3, 2, 19, 17)}
    scene = some_triangles(9, 1, reach)
    mine, theirs = (drawn(scene, kind, **options) for kind in (MicrocodeScanline, Interpreted))
    assert mine.tables.keys() == theirs.tables.keys()
    for name in mine.tables:
        assert np.array_equal(mine.tables[name].words, theirs.tables[name].words), name
    assert (mine.counted("partial") > 0) == (reach > 1.0)


@pytest.mark.parametrize("reach", [0.9, 6.0])
def test_a_depth_buffer_shows_the_same_faces(reach):
    renderer = drawn(some_triangles(20, 5, reach))
    display = renderer.report()["display"]
    assert (renderer.depths.visible == renderer.visible()).mean() >= 0.99
    covered = int((renderer.visible() >= 0).sum())
    assert SIZE[0] * SIZE[1] + covered < display["depth_buffer_writes"]


def test_each_pixel_is_written_once():
    samples = 2
    depths = [-1.0, -0.5, 0.0, 0.5]
    back_to_front, front_to_back = (
        drawn(squares(order), samples=samples).report()["display"] for order in (depths, depths[::-1])
    )
    pixels = SIZE[0] * SIZE[1] * samples
    assert back_to_front["writes"] == front_to_back["writes"] == pixels
    reads = back_to_front["depth_buffer_reads"]
    assert reads == front_to_back["depth_buffer_reads"] > 0
    # From the back every face is written over by the next, from the front only the first is written.
    assert back_to_front["depth_buffer_writes"] == pixels + reads
    assert front_to_back["depth_buffer_writes"] == pixels + reads / len(depths)


def test_the_report_adds_up():
    report = tasuki.render(DATA / "still_life.nff", size=SIZE, method="scanline", machine="pu", clock=10.0).stats["pu"]
    for rows in (report["passes"], report["modules"]):
        assert sum(row["steps"] for row in rows) == report["steps"]
        assert sum(row["words"] for row in rows) == report["words"]
    assert sum(row["share"] for row in report["modules"]) == pytest.approx(1.0)
    assert report["fpp_busy"] == pytest.approx(sum(report["busy"][unit] for unit in "xyzs"))
    assert report["seconds"] == report["steps"] / 10e6
    numbered = {
        *("reference_matrix", "light_to_reference", "vertex_to_reference", "clip_face", "face_normal"),
        *("vertex_normal", "perspective", "construct_edge", "sort_edge", "begin_active_edges"),
        *("update_active_edge", "sort_active_edge", "phong_luminance"),
    }
    assert numbered <= {row["module"].split(":")[-1] for row in report["modules"] if row["steps"]}


def test_a_picture_costs_the_same_again():
    renderer = drawn(squares([0.0]))
    first, report = renderer.pixels().copy(), renderer.report()
    assert np.array_equal(renderer.render(), first)
    assert renderer.report() == report


def test_a_module_of_a_users_runs_unchanged():
    options = {"size": SIZE, "method": "scanline"}
    toon = options | {"modules": {"shading": str(ROOT / "examples" / "toon.py") + ":toon"}}
    mine = tasuki.render(DATA / "still_life.nff", machine="pu", **toon)
    levels = [
        one.srgb().astype(int)
        for one in (mine, *(tasuki.render(DATA / "still_life.nff", **given) for given in (toon, options)))
    ]
    # Toon shading has edges: a pixel on one of them may fall to either side.
    assert (np.abs(levels[0] - levels[1]).max(axis=2) <= 2).mean() >= 0.99
    assert (np.abs(levels[0] - levels[2]).max(axis=2) <= 2).mean() < 0.9


def test_an_empty_view_is_background():
    behind = Polygon(((0.0, 0.0, 9.0), (1.0, 0.0, 9.0), (0.0, 1.0, 9.0)), material=coloured(1))
    renderer = drawn(Scene(CAMERA, [behind], LIGHTS))
    assert (renderer.visible() == -1).all()
    pixels = SIZE[0] * SIZE[1]
    assert renderer.report()["display"] == {
        "writes": pixels,
        "depth_buffer_writes": pixels,
        "depth_buffer_reads": 0,
    }


def test_more_units_than_one_are_refused():
    with pytest.raises(SceneError, match="the scanline method runs on one processor unit"):
        drawn(squares([0.0]), pus=2)
