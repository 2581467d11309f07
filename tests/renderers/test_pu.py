"""Pictures by processor units: the interpreter's under the PU's arithmetic, close to the CPU's, and their report."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tasuki
from tasuki.diagnostics import SceneError
from tasuki.ir.interpret import interpret
from tasuki.machines.pu.lower import ARITHMETIC
from tasuki.modules.raytrace import trace_pixel
from tasuki.programs import link_program
from tasuki.renderers import pu
from tasuki.renderers.options import Region, RenderOptions
from tasuki.renderers.raytrace import RayTracer, pixel_places
from tasuki.scene import load_scene

ROOT = Path(__file__).parents[2]
DATA = ROOT / "tests" / "data"
SCENES = [*sorted((ROOT / "examples" / "scenes").glob("*.yaml")), DATA / "still_life.nff", DATA / "pavilion.yaml"]
SIZE = (48, 36)


def near(a: tasuki.Picture, b: tasuki.Picture) -> np.ndarray:
    """Whether pixels are within two levels of each other, as PNG has them."""
    return np.abs(a.srgb().astype(int) - b.srgb().astype(int)).max(axis=2) <= 2


@pytest.mark.parametrize("scene", SCENES, ids=lambda path: path.stem)
def test_a_scene_is_close_to_the_cpus_picture(scene):
    options = {"size": SIZE, "depth": 4}
    mine = tasuki.render(scene, machine="pu", **options)
    cpu = tasuki.render(scene, **options)
    assert near(mine, cpu).mean() >= 0.99
    sent, expected = (sum(picture.stats["rays"].values()) for picture in (mine, cpu))
    # On few pixels a thousandth is a handful of rays: those of one pixel that sees something else.
    assert abs(sent - expected) <= 0.001 * expected + 10


@pytest.mark.parametrize("schedule", ["macro", "compact"])
def test_a_picture_is_the_interpreters(schedule):
    options = RenderOptions(24, 18, depth=3, region=Region(3, 2, 14, 11), machine="pu", schedule=schedule)
    tracer = RayTracer(load_scene(DATA / "pavilion.yaml"), options)
    found, counts = tracer.render().copy(), tracer.ray_counts()
    program, places = link_program(trace_pixel, tracer.prepared.fillers()), pixel_places(options.region)
    tracer.pixels()[:] = -1.0
    interpret(program, [[places]], lanes=len(places), tables=tracer.prepared.tables(), arithmetic=ARITHMETIC)
    assert np.array_equal(found.view(np.uint32), tracer.pixels().view(np.uint32))
    assert counts == tracer.ray_counts()


def test_a_module_of_a_users_runs_unchanged():
    arguments = {"size": SIZE, "modules": {"shading": str(ROOT / "examples" / "toon.py") + ":toon"}}
    mine = tasuki.render(DATA / "still_life.nff", machine="pu", **arguments)
    cpu = tasuki.render(DATA / "still_life.nff", **arguments)
    plain = tasuki.render(DATA / "still_life.nff", size=SIZE)
    # Toon shading has edges: a pixel on one of them may fall to either side.
    assert near(mine, cpu).mean() >= 0.99
    assert near(mine, plain).mean() < 0.9
    assert any(row["module"].endswith(":toon") and row["steps"] for row in mine.stats["pu"]["modules"])


def test_pixels_cost_the_same_whoever_computes_them(monkeypatch):
    options = {"size": SIZE, "machine": "pu", "depth": 2}
    whole = tasuki.render(DATA / "still_life.nff", **options)
    monkeypatch.setattr(pu, "CHUNK", 100)
    parts = tasuki.render(DATA / "still_life.nff", **options)
    assert np.array_equal(whole.pixels, parts.pixels)
    assert whole.stats["pu"]["steps_per_pixel"] == parts.stats["pu"]["steps_per_pixel"]
    assert whole.stats["pu"]["makespan"] == parts.stats["pu"]["makespan"]


def test_the_report_adds_up():
    reports = [
        tasuki.render(
            DATA / "still_life.nff", size=SIZE, machine="pu", pus=7, clock=10.0, distribution=distribution, work=work
        ).stats["pu"]
        for distribution in ("static", "dynamic")
        for work in (1, "scanline")
    ]
    for report in reports:
        assert report["steps"] == sum(report["units"]["work"]) == reports[0]["steps"]
        assert report["seconds"] == report["makespan"] / 10e6
        assert report["efficiency"] == report["makespan_of_one"] / (7 * report["makespan"])
        assert 0.0 < report["efficiency"] <= 1.0
        assert report["fpp_busy"] == pytest.approx(sum(report["busy"][unit] for unit in "xyzs"))
        assert sum(row["share"] for row in report["modules"]) == pytest.approx(1.0)
        # The program sets its tables up before the first pixel: steps that belong to no pixel.
        assert report["steps"] < sum(row["steps"] for row in report["modules"]) <= report["steps"] + 200
        spent = [sum(steps) for steps in zip(*report["units"].values(), strict=True)]
        assert max(spent) + report["broadcast"] == report["makespan"]
    static = [report for report in reports if report["distribution"] == "static"]
    assert all(not any(report["units"]["request"]) for report in static)
    assert all(report["saturating_units"]["control_processor"] is None for report in static)


def test_free_places_at_the_end_of_a_table_are_not_sent():
    tracer = RayTracer(load_scene(DATA / "still_life.nff"), RenderOptions(4, 3, machine="pu"))
    sent = tracer.microcode.scene_rows()
    free = len(tracer.memory.table("bvh_nodes")) - tracer.nodes
    assert free > 0
    tracer.memory.table("bvh_nodes")["right_high"][-1] = 1.0
    assert tracer.microcode.scene_rows() == sent + free * 4


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"pus": 0}, "pus is out of range"),
        ({"pus": 1.5}, "pus is out of range"),
        ({"schedule": "loose"}, "unknown schedule 'loose'"),
        ({"distribution": "fair"}, "unknown distribution 'fair'"),
        ({"work": "tiles"}, "no such piece of work"),
        ({"work": 0}, "no such piece of work"),
        ({"clock": 0.0}, "the clock is out of range"),
        ({"clock": float("nan")}, "the clock is out of range"),
        ({"method": "scanline", "pus": 2}, "the scanline method runs on one processor unit"),
    ],
)
def test_wrong_options_are_named(options, message):
    with pytest.raises(SceneError, match=message):
        tasuki.render(DATA / "still_life.nff", size=SIZE, machine="pu", **options)
