"""Set operations beside POV-Ray 3.7: `python -m bench.csg`.

The Menger sponge as one difference, a box minus 27, 219 or 1755 bars (depth 2, 3, 4), and unions and differences of
many spheres; 512 x 512 pixels, one ray through each, two lights with shadows. Ours is the time from the start of a
frame to its end, POV-Ray's the trace time of its own statistics. Writes `bench/results/csg.json`.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from bench.measure import Report, Table, alternate, ratio, rounds_argument, spread
from bench.raytrace import SIZE, Frames, milliseconds, our_frame, povray_frame
from tasuki.renderers.options import RenderOptions
from tasuki.renderers.raytrace import RayTracer
from tasuki.scene import Box, Camera, Difference, Material, PointLight, Scene, Sphere, Union
from tasuki.scene.model import ViewFrame

EYE, AT = (1.9, -1.6, 1.7), (0.5, 0.5, 0.45)
LIGHTS = ((3.0, -4.0, 6.0), (0.0, -5.0, 2.0))
COLOUR, BACKGROUND = (0.9, 0.75, 0.5), (0.3, 0.4, 0.5)
BALLS = 1000
DEEPEST_FOR_POVRAY = 3
"""Beyond this depth one of POV-Ray's frames takes most of a minute."""


def main() -> None:
    parser = argparse.ArgumentParser(description="Set operations beside POV-Ray.")
    parser.add_argument("--rounds", type=rounds_argument, default=5)
    parser.add_argument("--frames", type=int, default=5, help="frames of ours in each round")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--deep", action="store_true", help="POV-Ray at depth 4, too: 40 s a frame")
    options = parser.parse_args()
    report = Report("csg", options.rounds)
    title = f"Frames of {SIZE} x {SIZE} pixels, {options.threads} threads"
    table = Table(title, ["scene", "literals", "ms", "noise", "POV-Ray ms", "ratio"])
    report.tables.append(table)
    frames = Frames((options.threads,), options.rounds, options.frames, "wall")
    for depth in (2, 3, 4):
        bars = menger_bars(depth)
        peer = options.deep or depth <= DEEPEST_FOR_POVRAY
        measure(f"Menger {depth}, {len(bars)} bars", Difference((CUBE, *bars)), frames, report, peer=peer)
    balls = random_balls()
    measure(f"cube minus {BALLS} spheres", Difference((CUBE, *balls)), frames, report)
    measure(f"union of {BALLS} spheres", Union(tuple(balls)), frames, report)
    report.publish()


CUBE = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


def menger_bars(depth: int) -> list[Box]:
    """The bars that a unit cube loses on the way to a Menger sponge, each but once."""
    bars = []
    for level in range(depth):
        side = 1.0 / 3**level
        for i, j in np.ndindex(3**level, 3**level):
            if not _is_gone(i, j, level):
                u, v, past = (i + 1 / 3) * side, (j + 1 / 3) * side, side / 3
                bars += [_bar(axis, u, v, past) for axis in range(3)]
    return bars


def _is_gone(i: int, j: int, level: int) -> bool:
    """Whether a square of a level lies within one that a level before took away."""
    return any(i // 3**k % 3 == 1 and j // 3**k % 3 == 1 for k in range(level))


def _bar(axis: int, u: float, v: float, past: float) -> Box:
    low, high = np.roll([-0.1, u, v], axis), np.roll([1.1, u + past, v + past], axis)
    return Box(tuple(low.tolist()), tuple(high.tolist()))


def random_balls() -> list[Sphere]:
    random = np.random.default_rng(1)
    places, radii = random.uniform(0.0, 1.0, (BALLS, 3)), random.uniform(0.01, 0.05, BALLS)
    return [Sphere(tuple(place), radius) for place, radius in zip(places.tolist(), radii.tolist(), strict=True)]


def measure(name: str, solid: Union | Difference, frames: Frames, report: Report, *, peer: bool = True) -> None:
    """One solid, ours and POV-Ray's in turn."""
    threads = frames.threads[0]
    camera = Camera(EYE, AT, (0.0, 0.0, 1.0), 40.0)
    material = Material("sand", colour=COLOUR)
    scene = Scene(camera, [Union((solid,), material=material)], [PointLight(place) for place in LIGHTS], BACKGROUND)
    tracer = RayTracer(scene, RenderOptions(SIZE, SIZE, threads=threads))
    contenders: dict[str, Callable[[], float]] = {"ours": partial(our_frame, tracer, frames)}
    with tempfile.TemporaryDirectory() as folder:
        if peer and shutil.which("povray"):
            path = Path(folder) / "solid.pov"
            path.write_text(povray_text(camera.frame(SIZE, SIZE), solid))
            contenders["POV-Ray"] = partial(povray_frame, path, threads, frames.clock)
        samples = alternate(contenders, frames.rounds)
    report.samples[name] = samples
    ours, theirs = samples["ours"], samples.get("POV-Ray")
    literals = tracer.prepared.packed.objects.literals
    cells = [name, literals, milliseconds(ours), f"{spread(ours):.0%}"]
    cells += [milliseconds(theirs), f"{ratio(theirs, ours):.1f}"] if theirs else ["", ""]
    report.tables[0].add(*cells)


def povray_text(view: ViewFrame, solid: Union | Difference) -> str:
    """The same solid, view and lights for POV-Ray; its subtrahends as one union, with which it is fastest."""
    first, *others = map(_povray_shape, solid.children)
    if isinstance(solid, Difference):
        made = f"difference {{ {first} union {{ {' '.join(others)} }} "
    else:
        made = f"union {{ {first} {' '.join(others)} "
    texture = f"texture {{ pigment {{ rgb {_vector(COLOUR)} }} finish {{ ambient 0.35 diffuse 1 }} }}"
    right, up = SIZE * view.right, -SIZE * view.down
    lights = [f"light_source {{ {_vector(place)} rgb 0.353553 }}" for place in LIGHTS]
    return "\n".join(
        [
            "#version 3.7; global_settings { assumed_gamma 1 }",
            f"background {{ rgb {_vector(BACKGROUND)} }}",
            f"camera {{ location {_vector(view.eye)} right {_vector(right)} up {_vector(up)}",
            f"  direction {_vector(view.corner + (right - up) / 2)} }}",
            *lights,
            f"{made} {texture} }}",
        ]
    )


def _povray_shape(shape: object) -> str:
    if isinstance(shape, Box):
        return f"box {{ {_vector(shape.low)}, {_vector(shape.high)} }}"
    assert isinstance(shape, Sphere)
    return f"sphere {{ {_vector(shape.centre)}, {shape.radius!r} }}"


def _vector(values: object) -> str:
    return "<" + ", ".join(f"{value:.12g}" for value in np.asarray(values, np.float64)) + ">"


if __name__ == "__main__":
    main()
