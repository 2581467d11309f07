"""What comes before the first picture: building, compiling, starting. `python -m bench.build`.

Building (packing and the bounding volume hierarchy) is measured inside this process, compiling and the whole command on
processes of their own: first with an empty cache folder each time, then with a full one. Peak memory is the command's
resident set. Writes `bench/results/build.json`.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median
from time import perf_counter

from bench.measure import SCENES, Report, Table, alternate, require, rounds_argument, spread
from bench.mesh import bumpy_sphere, mesh_scene
from tasuki.renderers.options import RenderOptions
from tasuki.renderers.raytrace import RayTracer
from tasuki.scene import load_scene
from tasuki.scene.model import Scene

SIZE = 512
TRIANGLES = 100_000
MEGABYTE = 1e6


@dataclass(frozen=True)
class Run:
    """One run of the command: seconds by the clock and of processor time, peak memory in bytes, seconds compiling."""

    wall: float
    processor: float
    memory: float
    compiling: float


@dataclass(frozen=True)
class Figure:
    """A figure with the limit that it is to keep, in `unit`; `scale` turns samples into that unit."""

    name: str
    unit: str
    scale: float
    limit: float | None = None

    def add_to(self, table: Table, samples: Sequence[float]) -> None:
        value = median(samples) * self.scale
        limit, kept = ("", "") if self.limit is None else (f"{self.limit:g}", "yes" if value < self.limit else "no")
        table.add(f"{self.name}, {self.unit}", f"{value:.3g}", f"{spread(samples):.0%}", limit, kept)


def build_seconds(scene: Scene) -> float:
    """Seconds of packing a scene and building its hierarchy. The builder has been compiled in the warm-up round."""
    return RayTracer(scene, RenderOptions(SIZE, SIZE)).seconds["build"]


def measure_building(report: Report, table: Table) -> None:
    scenes = {
        Figure("build, balls", "ms", 1e3, 30.0): load_scene(str(require(SCENES / "balls.nff"))),
        Figure(f"build, {TRIANGLES} triangles", "ms", 1e3, 500.0): mesh_scene(bumpy_sphere(TRIANGLES), SIZE),
    }
    contenders = {figure.name: partial(build_seconds, scene) for figure, scene in scenes.items()}
    samples = alternate(contenders, report.rounds)
    report.samples |= {"build": samples}
    for figure in scenes:
        figure.add_to(table, samples[figure.name])


def run_command(scene: Path, cache: Path) -> Run:
    """`tasuki render` of a scene at 512 x 512, with its cache in `cache`."""
    with tempfile.TemporaryDirectory() as folder:
        statistics = Path(folder) / "statistics.json"
        command = [str(Path(sys.executable).parent / "tasuki"), "render", str(scene), "--quiet"]
        command += ["--size", f"{SIZE}x{SIZE}", "-o", str(Path(folder) / "picture.png"), "--stats", str(statistics)]
        started = perf_counter()
        process = subprocess.Popen(command, env=os.environ | {"TASUKI_CACHE": str(cache)})
        _, status, usage = os.wait4(process.pid, 0)
        wall = perf_counter() - started
        if status:
            raise SystemExit(f"{' '.join(command)} failed")
        compiling = json.loads(statistics.read_text())["seconds"]["compile"]
        # Linux counts the resident set in units of 1024 bytes.
        return Run(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024.0, compiling)


def measure_command(report: Report, table: Table) -> None:
    """First runs (an empty cache) and warm ones, in alternation."""
    scene = require(SCENES / "balls.nff")
    first: list[Run] = []
    warm: list[Run] = []
    with tempfile.TemporaryDirectory() as full:
        run_command(scene, Path(full))
        for _ in range(report.rounds):
            with tempfile.TemporaryDirectory() as empty:
                first.append(run_command(scene, Path(empty)))
            warm.append(run_command(scene, Path(full)))
    figures = {
        Figure("first run, compiling", "s", 1.0, 1.5): [run.compiling for run in first],
        Figure("first run, whole command", "s", 1.0): [run.wall for run in first],
        Figure("warm run, compiling", "s", 1.0): [run.compiling for run in warm],
        Figure("warm run, whole command", "s", 1.0, 0.8): [run.wall for run in warm],
        Figure("warm run, processor time", "s", 1.0): [run.processor for run in warm],
        Figure("warm run, peak memory", "MB", 1.0 / MEGABYTE, 300.0): [run.memory for run in warm],
    }
    for figure, samples in figures.items():
        figure.add_to(table, samples)
    report.samples["command"] = {figure.name: samples for figure, samples in figures.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description="Building, compiling and starting.")
    parser.add_argument("--rounds", type=rounds_argument, default=7)
    options = parser.parse_args()
    table = Table("Before the first picture", ["figure", "median", "noise", "limit", "kept"])
    report = Report("build", options.rounds, [table])
    measure_building(report, table)
    measure_command(report, table)
    report.publish()


if __name__ == "__main__":
    main()
