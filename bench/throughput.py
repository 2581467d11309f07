"""Plain ray throughput beside Embree: `python -m bench.throughput`, with `embreex` installed (the extra `bench`).

A mesh of about 100,000 triangles. Primary rays come from one eye, in the order in which the ray tracer sends them
(tiles of 4 x 4 pixels); random rays begin anywhere in the box around the mesh and go anywhere; sorted ones are the same
rays in an order in which neighbours begin and go alike (the sorting is not timed). Both contenders get arrays of rays
and give arrays of results: the distance of the nearest hit (ours also which primitive), or whether there is any. Embree
is called through its Python binding, which traces ray by ray on one thread. The answers are compared before anything is
timed. Figures are million rays in a second, of one core. Writes `bench/results/throughput.json`.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from bench.measure import Report, Samples, Table, alternate, ratio, rounds_argument
from bench.mesh import bumpy_sphere, mesh_scene
from tasuki.machines.cpu.machine import Argument, Executable, Items, Same
from tasuki.modules.bvh import nearest_intersection, shadow_intersection
from tasuki.modules.crossing import NOWHERE
from tasuki.modules.search import NOTHING
from tasuki.programs import Options, executable
from tasuki.renderers.options import RenderOptions
from tasuki.renderers.raytrace import RayTracer, pixel_places

SIZE = 512
SEED = 1986
NO_HIT = 1e29
"""Distances above this mean that nothing was hit, in Embree's answers and in ours."""
MORTON_BITS = 6
"""Of each dimension, when rays are sorted."""
TOLERATED = 1e-4
"""Share of the rays on which the two may disagree: those that graze an edge."""


@dataclass(frozen=True)
class Rays:
    """Origins and unit directions, (n, 3) float32."""

    origins: np.ndarray
    directions: np.ndarray

    def __len__(self) -> int:
        return len(self.origins)


class Ours:
    """The search modules on a scene's hierarchy, compiled for arrays of rays."""

    def __init__(self, tracer: RayTracer) -> None:
        nearest = Options(("items", "items", "same"), checked=False)
        shadow = Options(("items", "items", "same", "same"), checked=False)
        self._tables = tracer.prepared.tables()
        self._nearest = executable(nearest_intersection, nearest, tracer.prepared.fillers())
        self._shadow = executable(shadow_intersection, shadow, tracer.prepared.fillers())

    def nearest(self, rays: Rays, threads: int) -> np.ndarray:
        """The distance of every ray's nearest hit."""
        return self._run(self._nearest, rays, threads)

    def occluded(self, rays: Rays, threads: int) -> np.ndarray:
        """Whether anything lies on a ray."""
        return self._run(self._shadow, rays, threads, Same([NOWHERE]))

    def _run(self, program: Executable, rays: Rays, threads: int, *more: Same) -> np.ndarray:
        vectors = [Items(list(array.T)) for array in (rays.origins, rays.directions)]
        arguments: list[Argument] = [*vectors, Same([NOTHING]), *more]
        return program.run(arguments, len(rays), tables=self._tables, threads=threads)[0]


class Embree:
    """The same questions, answered by Embree."""

    def __init__(self, triangles: np.ndarray) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._scene: Any = EmbreeScene()
        self._mesh = TriangleMesh(self._scene, triangles)

    def nearest(self, rays: Rays) -> np.ndarray:
        return self._scene.run(rays.origins, rays.directions, query="DISTANCE")

    def occluded(self, rays: Rays) -> np.ndarray:
        return self._scene.run(rays.origins, rays.directions, query="OCCLUDED") >= 0


def primary_rays(tracer: RayTracer) -> Rays:
    """Through the pixels' middles, in the ray tracer's order."""
    frame = tracer.scene.camera.frame(SIZE, SIZE)
    places = pixel_places(tracer.options.region)
    x, y = (places & 0xFFFF) + 0.5, (places >> 16) + 0.5
    directions = frame.corner + x[:, None] * frame.right + y[:, None] * frame.down
    return Rays(np.broadcast_to(np.float32(frame.eye), directions.shape).copy(), unit(directions))


def random_rays(count: int, triangles: np.ndarray) -> Rays:
    random = np.random.default_rng(SEED)
    corners = triangles.reshape(-1, 3)
    origins = random.uniform(corners.min(axis=0), corners.max(axis=0), (count, 3)).astype(np.float32)
    return Rays(origins, unit(random.normal(size=(count, 3))))


def sorted_rays(rays: Rays) -> Rays:
    """The same rays along a Morton curve through the six dimensions of origin and direction."""
    places = np.concatenate([rays.origins, rays.directions], axis=1).astype(np.float64)
    low, high = places.min(axis=0), places.max(axis=0)
    cells = ((places - low) / (high - low) * (2**MORTON_BITS - 1)).astype(np.int64)
    codes = np.zeros(len(rays), np.int64)
    for bit in reversed(range(MORTON_BITS)):
        for dimension in range(cells.shape[1]):
            codes = (codes << 1) | ((cells[:, dimension] >> bit) & 1)
    order = np.argsort(codes, kind="stable")
    return Rays(rays.origins[order], rays.directions[order])


def unit(vectors: np.ndarray) -> np.ndarray:
    return (vectors / np.linalg.norm(vectors, axis=1, keepdims=True)).astype(np.float32)


def compare(name: str, ours: Ours, embree: Embree, rays: Rays) -> None:
    """End the program where the contenders do not answer the same: then their times mean nothing."""
    distances, expected = ours.nearest(rays, 1), embree.nearest(rays)
    wrong = (distances < NO_HIT) != (expected < NO_HIT)
    both = (distances < NO_HIT) & (expected < NO_HIT)
    wrong |= both & (np.abs(distances - expected) > 1e-3 * np.maximum(1.0, expected))
    wrong |= ours.occluded(rays, 1) != embree.occluded(rays)
    if wrong.mean() > TOLERATED:
        raise SystemExit(f"{name} rays: ours and Embree's answers differ for {wrong.sum()} of {len(rays)} rays")
    print(f"{name} rays: {both.sum()} of {len(rays)} hit; answers differ for {wrong.sum()}")


def timed(call: Callable[[], object]) -> float:
    started = perf_counter()
    call()
    return perf_counter() - started


def measure(ours: Ours, embree: Embree, rays: Rays, query: str, rounds: int) -> Samples:
    """Seconds of each contender for all rays."""
    searching, peer = getattr(ours, query), getattr(embree, query)
    contenders = {
        "ours, 1 thread": partial(timed, partial(searching, rays, 1)),
        "Embree": partial(timed, partial(peer, rays)),
        "ours, 2 threads": partial(timed, partial(searching, rays, 2)),
    }
    return alternate(contenders, rounds)


def main() -> None:
    parser = argparse.ArgumentParser(description="Rays per second beside Embree.")
    parser.add_argument("--rounds", type=rounds_argument, default=11)
    parser.add_argument("--triangles", type=int, default=100_000)
    options = parser.parse_args()
    triangles = bumpy_sphere(options.triangles)
    tracer = RayTracer(mesh_scene(triangles, SIZE), RenderOptions(SIZE, SIZE))
    ours, embree = Ours(tracer), Embree(triangles)
    table = Table(
        f"Million rays per second and core, {len(triangles)} triangles",
        ["rays", "query", "1 thread", "2 threads", "Embree", "ratio of 1 thread"],
    )
    report = Report("throughput", options.rounds, [table])
    scattered = random_rays(SIZE * SIZE, triangles)
    kinds = {"primary": primary_rays(tracer), "random": scattered, "random, sorted": sorted_rays(scattered)}
    for name, rays in kinds.items():
        compare(name, ours, embree, rays)
        for query in ("nearest", "occluded"):
            samples = measure(ours, embree, rays, query, options.rounds)
            report.samples[f"{name}, {query}"] = samples
            one, peer, two = (len(rays) / median(seconds) / 1e6 for seconds in samples.values())
            gain = ratio(samples["Embree"], samples["ours, 1 thread"])
            table.add(name, query, f"{one:.1f}", f"{two / 2:.1f}", f"{peer:.1f}", f"{gain:.2f}")
    report.publish()


if __name__ == "__main__":
    main()
