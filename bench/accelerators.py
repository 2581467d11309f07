"""Accelerators on the Standard Procedural Databases, by counts and by time: `python -m bench.accelerators`.

Tests and steps per ray are V. Havran's counts ("Heuristic Ray Shooting Algorithms", 2000), taken one ray at a time
over a regular sample of pixels (`tasuki.renderers.search_counts`). Seconds are those of building (packing the scene
included) and of rendering, in packets on all threads, each contender in turn; a ratio is a contender's time over that
of the bvh. The databases' files are flat lists; "extents, in groups" has their shapes in groups of eight, in the order
of the file, and these in groups of eight again, up to one. Writes `bench/results/accelerators.json`.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from functools import partial
from typing import Any

from bench.measure import ROOT, SCENES, Report, Samples, Table, alternate, ratio, require, rounds_argument, spread
from bench.raytrace import DATABASES, milliseconds
from tasuki.language.load import load_file
from tasuki.renderers.options import RenderOptions
from tasuki.renderers.raytrace import RayTracer
from tasuki.renderers.search_counts import search_counts
from tasuki.scene import Group, Scene, load_scene

SIZE = 128
MEMBERS = 8
PEER = "bvh"
GROUPED = "extents, in groups"
CONTENDERS = (PEER, "grid", "extents", GROUPED)
GRID = ROOT / "examples" / "grid.py"


def main() -> None:
    parser = argparse.ArgumentParser(description="bvh, grid and extents: tests and steps per ray, seconds.")
    parser.add_argument("scenes", nargs="*", default=list(DATABASES), help=f"of {', '.join(DATABASES)}")
    parser.add_argument("--rounds", type=rounds_argument, default=5)
    parser.add_argument("--size", type=int, default=SIZE, help="pixels along each side of the picture")
    options = parser.parse_args()
    load_file(require(GRID))
    report = Report("accelerators", options.rounds)
    table = Table(
        f"Frames of {options.size} x {options.size} pixels, depth 5",
        ["scene, accelerator", "tests/ray", "steps/ray", "build ms", "ratio", "render ms", "ratio", "noise"],
    )
    report.tables.append(table)
    for name in options.scenes:
        measure_scene(name, options.size, report, table)
    report.publish()


def measure_scene(name: str, size: int, report: Report, table: Table) -> None:
    """All contenders on one scene."""
    scene = load_scene(require(SCENES / f"{name}.nff"))
    makers = {one: partial(tracer_of, scene, one, size) for one in CONTENDERS}
    tracers = {one: make() for one, make in makers.items()}
    building = alternate({one: partial(build_seconds, make) for one, make in makers.items()}, report.rounds)
    rendering = alternate({one: partial(frame_seconds, tracer) for one, tracer in tracers.items()}, report.rounds)
    counts = {one: search_counts(tracer) for one, tracer in tracers.items()}
    for what, samples in (("build", building), ("render", rendering)):
        report.samples[f"{name}, {what}"] = samples
    for one in CONTENDERS:
        table.add(f"{name}, {one}", *cells(counts[one], building, rendering, one))


def tracer_of(scene: Scene, contender: str, size: int) -> Any:
    """A ray tracer with the contender's accelerator, its scene in groups if it is to be."""
    accelerator, shapes = (contender, scene) if contender != GROUPED else ("extents", in_groups(scene))
    return RayTracer(shapes, RenderOptions(size, size, accelerator=accelerator))


def in_groups(scene: Scene) -> Scene:
    """The same things in a tree of groups, by their order alone."""
    nodes = list(scene.shapes)
    while len(nodes) > 1:
        nodes = [Group(nodes[first : first + MEMBERS]) for first in range(0, len(nodes), MEMBERS)]
    return Scene(scene.camera, nodes, scene.lights, scene.background)


def build_seconds(make: Any) -> float:
    return make().seconds["build"]


def frame_seconds(tracer: RayTracer) -> float:
    tracer.render()
    return tracer.seconds["render"]


def cells(counts: Mapping[str, Any], building: Samples, rendering: Samples, one: str) -> list[str]:
    """A row of the table, without its name."""
    times = [
        text
        for samples in (building, rendering)
        for text in (milliseconds(samples[one]), f"{ratio(samples[one], samples[PEER]):.2f}")
    ]
    return [f"{counts['tests_per_ray']:.2f}", f"{counts['steps_per_ray']:.1f}", *times, f"{spread(rendering[one]):.0%}"]


if __name__ == "__main__":
    main()
