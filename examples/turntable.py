"""A mesh, or any bounded scene, turned once round its upward axis in 100 frames.

python examples/turntable.py mesh.glb frames

The mesh is found and the modules are compiled before the first frame; each frame changes one matrix.
"""

import sys
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np

from tasuki.programs import REPORT
from tasuki.renderers.options import RenderOptions
from tasuki.renderers.picture import Picture
from tasuki.renderers.scanline import ScanlineRenderer
from tasuki.scene import load_scene

FRAMES = 100
SIZE = 512


def turn(axis: np.ndarray, through: np.ndarray, angle: float) -> np.ndarray:
    """The rotation by `angle` radians about an axis of unit length through a point, (4, 4): Rodrigues' formula."""
    across = np.cross(np.eye(3), axis)
    rotation = np.eye(3) - np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = through - rotation @ through
    return matrix


def turntable(scene_file: Path, folder: Path, frames: int = FRAMES, size: int = SIZE) -> list[float]:
    """Render the frames into `folder` as PNG; the seconds that each took, without writing it."""
    scene = load_scene(scene_file)
    folder.mkdir(parents=True, exist_ok=True)
    renderer = ScanlineRenderer(scene, RenderOptions(size, size))
    points = renderer.mesh.vertices["position"] + renderer.origin
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
    up = np.array(scene.camera.up) / np.linalg.norm(scene.camera.up)
    seconds = []
    for frame in range(frames):
        started = perf_counter()
        renderer.place(turn(up, middle, 2.0 * np.pi * frame / frames))
        pixels = renderer.render()
        seconds.append(perf_counter() - started)
        Picture(pixels).save(folder / f"{frame:03}.png")
    return seconds


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python examples/turntable.py MESH FOLDER")
    times = turntable(Path(sys.argv[1]), Path(sys.argv[2]))
    print(f"{len(times)} frames: first {times[0] * 1e3:.1f} ms, median {median(times) * 1e3:.1f} ms; ", end="")
    print(f"{REPORT.programs} programs, {REPORT.compiled} of them compiled now, in {REPORT.seconds:.2f} s")
