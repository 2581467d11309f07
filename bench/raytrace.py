"""Frames of the Standard Procedural Databases beside POV-Ray 3.7 and the prototype: `python -m bench.raytrace`.

512 x 512 pixels, one ray through each, depth 5, one and two threads. Ours and the prototype's are the time from the
start of a frame to its end, several frames in one process; POV-Ray's is the trace time of its own statistics (a process
each time), without parsing and bounding. A ratio is the peer's time over ours: above 1 we are faster. Writes
`bench/results/raytrace.json`.
"""

from __future__ import annotations

import argparse
import contextlib
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median
from time import process_time

from bench.measure import ROOT, SCENES, Report, Samples, Table, alternate, ratio, require, rounds_argument, spread
from bench.nff_to_pov import translate
from bench.prototype import CLOCKS, Prototype
from tasuki.renderers.options import RenderOptions
from tasuki.renderers.raytrace import RayTracer
from tasuki.scene import load_scene

SIZE = 512
PROTOTYPE = ROOT / ".." / "shared" / "prototype"
PROTOTYPE_SCENE = "balls"
DATABASES = ("balls", "gears", "mount", "rings", "teapot", "tetra", "tree")
TRACE_TIME = {
    "wall": re.compile(r"Trace Time:.*\(([0-9.]+) seconds\)"),
    "cpu": re.compile(r"Trace Time:[^\n]*\n.*with ([0-9.]+) CPU-seconds"),
}
"""In POV-Ray's statistics."""


@dataclass(frozen=True)
class Frames:
    """How much is measured."""

    threads: tuple[int, ...]
    rounds: int
    frames: int
    clock: str


def main() -> None:
    parser = argparse.ArgumentParser(description="Frames per second beside POV-Ray and the prototype.")
    parser.add_argument("scenes", nargs="*", default=list(DATABASES), help=f"of {', '.join(DATABASES)}")
    parser.add_argument("--rounds", type=rounds_argument, default=7)
    parser.add_argument("--frames", type=int, default=5, help="frames of ours and the prototype's in each round")
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--clock", choices=CLOCKS, default="wall", help="cpu: all threads' processor time")
    options = parser.parse_args()
    frames = Frames(tuple(options.threads), options.rounds, options.frames, options.clock)
    report = Report("raytrace", options.rounds)
    table = Table(
        f"Frames of {SIZE} x {SIZE} pixels, depth 5, {options.clock} time",
        ["scene", "threads", "ms", "noise", "Mray/s", "POV-Ray ms", "ratio", "prototype ms", "ratio"],
    )
    report.tables.append(table)
    for scene in options.scenes:
        measure_scene(scene, frames, report, table)
    report.publish()


def measure_scene(name: str, frames: Frames, report: Report, table: Table) -> None:
    """All contenders on one scene, with every number of threads."""
    path = require(SCENES / f"{name}.nff")
    tracers = {threads: our_tracer(path, threads) for threads in frames.threads}
    rays = count_rays(next(iter(tracers.values())))
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        scene = folder / f"{name}.pov"
        # Both follow the same sorts of rays: where ours leaves out refraction, POV-Ray does.
        scene.write_text(translate(path.read_text(), SIZE, SIZE, refraction=rays["refraction"] > 0))
        prototype = None
        if name == PROTOTYPE_SCENE and PROTOTYPE.exists():
            prototype = stack.enter_context(Prototype(PROTOTYPE))
        for threads in frames.threads:
            contenders: dict[str, Callable[[], float]] = {"ours": partial(our_frame, tracers[threads], frames)}
            if shutil.which("povray"):
                contenders["POV-Ray"] = partial(povray_frame, scene, threads, frames.clock)
            if prototype:
                contenders["prototype"] = partial(prototype.seconds, threads, frames.frames, frames.clock)
            samples = alternate(contenders, frames.rounds)
            report.samples[f"{name}, {threads} threads"] = samples
            add_row(table, name, threads, samples, traced_rays(rays))


def our_tracer(path: Path, threads: int) -> RayTracer:
    return RayTracer(load_scene(str(path)), RenderOptions(SIZE, SIZE, threads=threads))


def our_frame(tracer: RayTracer, frames: Frames) -> float:
    """The median of some frames, in seconds."""
    seconds = []
    for _ in range(frames.frames):
        started = process_time()
        tracer.render()
        # Processor time includes the list of pixels, about a millisecond, which the tracer's own clock leaves out.
        seconds.append(tracer.seconds["render"] if frames.clock == "wall" else process_time() - started)
    return median(seconds)


def count_rays(tracer: RayTracer) -> dict[str, int]:
    tracer.render()
    return tracer.ray_counts()


def traced_rays(counts: dict[str, int]) -> int:
    """All rays of a frame; "eye_hits" are among the eye rays."""
    return sum(count for name, count in counts.items() if name != "eye_hits")


def povray_frame(scene: Path, threads: int, clock: str) -> float:
    """POV-Ray's own trace time of one frame, in seconds."""
    command = ["povray", f"+I{scene}", "-F", f"+W{SIZE}", f"+H{SIZE}", "-A", "-D", "-V", f"+WT{threads}"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=scene.parent)
    found = TRACE_TIME[clock].search(done.stderr)
    if done.returncode or not found:
        raise SystemExit(f"{' '.join(command)} failed:\n{done.stderr[-2000:]}")
    return float(found[1])


def add_row(table: Table, scene: str, threads: int, samples: Samples, rays: int) -> None:
    ours = samples["ours"]
    cells = [scene, threads, milliseconds(ours), f"{spread(ours):.0%}", f"{rays / median(ours) / 1e6:.1f}"]
    for peer in ("POV-Ray", "prototype"):
        times = samples.get(peer)
        cells += [milliseconds(times), f"{ratio(times, ours):.2f}"] if times else ["", ""]
    table.add(*cells)


def milliseconds(seconds: Sequence[float]) -> str:
    return f"{median(seconds) * 1e3:.1f}"


if __name__ == "__main__":
    main()
