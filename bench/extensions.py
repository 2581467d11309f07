"""What the examples bring beside what the package has: `python -m bench.extensions`.

Frames on all threads, each contender in turn; a ratio is a contender's time over that of the first of its table.
Solids: 125 of one kind in a lattice, turned and stretched. Textures: marble, checkers, a picture, or none, on a floor
and balls. The grid: the scene that comes with it. Users' modules run checked, as they do by default, except where it
says otherwise. Writes `bench/results/extensions.json`.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from functools import partial

from bench.measure import ROOT, Report, Table, alternate, ratio, require, rounds_argument, spread
from bench.raytrace import milliseconds
from tasuki.renderers.extensions import load_extensions
from tasuki.renderers.options import RenderOptions
from tasuki.renderers.raytrace import RayTracer
from tasuki.scene import (
    Box,
    Camera,
    Cylinder,
    Ellipsoid,
    Material,
    PointLight,
    Polygon,
    Scene,
    Solid,
    Sphere,
    load_scene,
)
from tasuki.scene.material import Texture
from tasuki.scene.tree import Node

EXAMPLES = ROOT / "examples"
CAMERA = Camera(eye=(9.0, -14.0, 9.0), at=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), angle=32.0)
LIGHTS = (PointLight((10.0, -9.0, 14.0)), PointLight((-8.0, -12.0, 9.0)))
SOLIDS: Mapping[str, Node] = {
    "ellipsoid": Ellipsoid((0.0, 0.0, 0.0), (0.7, 0.7, 0.25)),
    "box": Box((-0.6, -0.6, -0.2), (0.6, 0.6, 0.2)),
    "cylinder": Cylinder((0.0, 0.0, -0.2), (0.0, 0.0, 0.2), 0.7),
}
TEXTURES: Mapping[str, Texture | None] = {
    "no texture": None,
    "checker": Texture("checker", {"size": 0.5}),
    "image": Texture("image", {"file": str(EXAMPLES / "seigaiha.png")}),
    "marble": Texture("marble"),
}


def main() -> None:
    parser = argparse.ArgumentParser(description="Solids, textures and an accelerator of users' beside built-in ones.")
    parser.add_argument("--rounds", type=rounds_argument, default=7)
    parser.add_argument("--size", type=int, default=512, help="pixels along each side of the picture")
    options = parser.parse_args()
    load_extensions(require(EXAMPLES / f"{name}.py") for name in ("torus", "textures", "image_texture", "grid"))
    report = Report("extensions", options.rounds)
    torus = {"torus": Solid("torus", major=0.5, minor=0.2)}
    solids = {name: tracer(lattice(node), options.size) for name, node in {**SOLIDS, **torus}.items()}
    solids["torus, unchecked"] = tracer(lattice(torus["torus"]), options.size, unchecked=True)
    textures = {name: tracer(balls(texture), options.size) for name, texture in TEXTURES.items()}
    crystal = load_scene(require(EXAMPLES / "grid.yaml"))
    grids = {name: tracer(crystal, options.size, accelerator=name) for name in ("bvh", "grid")}
    for what, contenders in (("solids", solids), ("textures", textures), ("accelerators", grids)):
        measure(what, contenders, options.size, report)
    report.publish()


def measure(what: str, contenders: Mapping[str, RayTracer], size: int, report: Report) -> None:
    """A table of one sort of contenders."""
    samples = alternate({name: partial(frame_seconds, one) for name, one in contenders.items()}, report.rounds)
    report.samples[what] = samples
    table = Table(f"{what}: frames of {size} x {size} pixels, depth 5", ["", "ms", "ratio", "noise"])
    report.tables.append(table)
    first = next(iter(samples.values()))
    for name, seconds in samples.items():
        table.add(name, milliseconds(seconds), f"{ratio(seconds, first):.2f}", f"{spread(seconds):.0%}")


def tracer(scene: Scene, size: int, *, accelerator: str = "bvh", unchecked: bool = False) -> RayTracer:
    return RayTracer(scene, RenderOptions(size, size, accelerator=accelerator, unchecked=unchecked))


def frame_seconds(one: RayTracer) -> float:
    one.render()
    return one.seconds["render"]


def lattice(node: Node) -> Scene:
    """5 x 5 x 5 of a solid, each turned and stretched in its own way."""
    places = [(x, y, z) for z in range(5) for y in range(5) for x in range(5)]
    nodes = [
        node.scale(1.0, 0.8, 1.2).rotate((1.0, y, z), 37.0 * k).translate(1.6 * x - 3.2, 1.6 * y - 3.2, 1.6 * z - 3.2)
        for k, (x, y, z) in enumerate(places)
    ]
    return Scene(CAMERA, nodes, LIGHTS)


def balls(texture: Texture | None) -> Scene:
    """A floor and balls, all of one texture."""
    material = Material(colour=(0.9, 0.8, 0.7), texture=texture)
    floor = Polygon(((-9, -9, -1), (9, -9, -1), (9, 9, -1), (-9, 9, -1)), material=material)
    spheres = [Sphere((x, y, 0.0), 1.0, material=material) for x in (-3.0, 0.0, 3.0) for y in (-3.0, 0.0, 3.0)]
    return Scene(CAMERA, [floor, *spheres], LIGHTS)


if __name__ == "__main__":
    main()
