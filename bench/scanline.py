"""The scanline method beside Mesa's llvmpipe: same mesh, same view, same threads. `python -m bench.scanline`.

Both draw a bumpy sphere with smooth normals at 1024 x 1024: depth decided, back faces culled, Phong's shading at every
pixel, the picture in memory at the end. llvmpipe is driven through EGL by `moderngl` (package extra "bench"; Debian
`libegl1 libgl1-mesa-dri`) and gives 4 bytes a pixel, ours 16. Frames are timed one by one inside one process, after the
first. Writes `bench/results/scanline.json`.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from functools import partial
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from bench.measure import Report, Table, alternate, ratio, rounds_argument, spread
from bench.mesh import CAMERA, LIGHT, bumpy_sphere
from tasuki.renderers.mesh import welded
from tasuki.renderers.options import RenderOptions
from tasuki.renderers.scanline import ScanlineRenderer
from tasuki.scene.model import Camera, Scene, default_intensity
from tasuki.scene.shapes import POLYGON, Material, Polygons, Shapes

SIZE = 1024
THREADS = 2
TRIANGLES = (5_000, 80_000, 330_000, 1_300_000)
MATERIAL = Material(colour=(0.8, 0.5, 0.3), diffuse=0.8, specular=0.3, exponent=20.0, two_sided=False)

VERTEX_SHADER = """
#version 330
uniform mat4 clip_from_scene;
in vec3 position;
in vec3 normal;
out vec3 at;
out vec3 across;
void main() {
    at = position;
    across = normal;
    gl_Position = clip_from_scene * vec4(position, 1.0);
}
"""
FRAGMENT_SHADER = """
#version 330
uniform vec3 eye, lamp, light, colour;
uniform float ambient, diffuse, specular, exponent;
in vec3 at;
in vec3 across;
out vec4 shown;
void main() {
    vec3 n = normalize(across);
    vec3 to_light = normalize(lamp - at);
    vec3 sum = ambient * colour;
    if (dot(n, to_light) > 0.0) {
        vec3 mirrored = reflect(normalize(at - eye), n);
        float highlight = specular * pow(max(dot(mirrored, to_light), 0.0), exponent);
        sum += light * (diffuse * dot(n, to_light) * colour + vec3(highlight));
    }
    shown = vec4(sum, 1.0);
}
"""


def smooth_mesh(triangles: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points and unit normals (v, 3) float32 of the bumpy sphere, and corners (n, 3)."""
    soup = bumpy_sphere(triangles)
    points, index = welded(soup.reshape(-1, 3))
    corners = index.reshape(-1, 3)
    a, b, c = (points[corners[:, corner]].astype(np.float64) for corner in range(3))
    across = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    normals = np.stack([np.bincount(index, across[:, axis], len(points)) for axis in range(3)], axis=1)
    return points, (normals / np.linalg.norm(normals, axis=1)[:, None]).astype(np.float32), corners


def smooth_scene(points: np.ndarray, normals: np.ndarray, corners: np.ndarray) -> Scene:
    """The mesh as one-sided patches."""
    count = len(corners)
    nothing = Shapes.of([])
    zeros = np.zeros(count, np.int32)
    flat = corners.reshape(-1)
    around = points[flat].astype(np.float64), normals[flat].astype(np.float64)
    polygons = Polygons(zeros, zeros, *around, 3 * np.arange(count + 1), np.ones(count, bool))
    sorts = np.full(count, POLYGON, np.uint8)
    shapes = Shapes([MATERIAL], sorts, nothing.spheres, nothing.cones, polygons)
    return Scene(Camera(CAMERA.eye, CAMERA.at, CAMERA.up, CAMERA.angle, (SIZE, SIZE)), shapes, [LIGHT])


class LLVMpipe:
    """The same picture through OpenGL, on Mesa's renderer in software."""

    def __init__(self, points: np.ndarray, normals: np.ndarray, corners: np.ndarray) -> None:
        os.environ["LIBGL_ALWAYS_SOFTWARE"] = "1"
        os.environ["LP_NUM_THREADS"] = str(THREADS)
        import moderngl

        settings: Any = {"backend": "egl"}
        gl = self.gl = moderngl.create_context(standalone=True, **settings)
        if "llvmpipe" not in gl.info["GL_RENDERER"]:
            raise SystemExit(f"cannot measure: OpenGL runs on {gl.info['GL_RENDERER']}, not on llvmpipe")
        self.target = gl.framebuffer(gl.renderbuffer((SIZE, SIZE)), gl.depth_renderbuffer((SIZE, SIZE)))
        self.target.use()
        gl.enable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        program = gl.program(VERTEX_SHADER, FRAGMENT_SHADER)
        for name, value in self.uniforms().items():
            program[name] = value
        vertices = gl.buffer(np.concatenate([points, normals], axis=1).astype("f4").tobytes())
        indices = gl.buffer(corners.astype("i4").tobytes())
        self.mesh = gl.vertex_array(program, [(vertices, "3f 3f", "position", "normal")], indices)

    @staticmethod
    def uniforms() -> dict[str, Any]:
        """The camera, the lamp and the material, as the scene has them."""
        near, far = 1.0, 10.0
        scale = 1.0 / np.tan(np.radians(CAMERA.angle) / 2.0)
        projection = np.diag([scale, scale, (far + near) / (near - far), 0.0])
        projection[2, 3], projection[3, 2] = 2.0 * far * near / (near - far), -1.0
        move = np.eye(4)
        move[:3, 3] = -np.array(CAMERA.eye)
        grey = default_intensity(1)
        return {
            "clip_from_scene": tuple((projection @ move).T.reshape(-1)),
            "eye": CAMERA.eye,
            "lamp": LIGHT.position,
            "light": (grey, grey, grey),
            "colour": MATERIAL.colour,
            "ambient": MATERIAL.diffuse * grey,
            "diffuse": MATERIAL.diffuse,
            "specular": MATERIAL.specular,
            "exponent": MATERIAL.exponent,
        }

    def render(self) -> np.ndarray:
        """One frame, read back: (height, width, 4) uint8, the upper row first."""
        self.target.clear(0.0, 0.0, 0.0, 0.0, 1.0)
        self.mesh.render()
        return np.frombuffer(self.target.read(components=4), np.uint8).reshape(SIZE, SIZE, 4)[::-1]


def seconds(draw: Callable[[], object]) -> float:
    started = perf_counter()
    draw()
    return perf_counter() - started


def measure(report: Report, table: Table, triangles: int) -> None:
    mesh = smooth_mesh(triangles)
    ours = ScanlineRenderer(smooth_scene(*mesh), RenderOptions(SIZE, SIZE, threads=THREADS))
    theirs = LLVMpipe(*mesh)
    check_pictures(ours.render(), theirs.render())
    contenders = {"Tasuki": partial(seconds, ours.render), "llvmpipe": partial(seconds, theirs.render)}
    samples = alternate(contenders, report.rounds, warm_up=2)
    report.samples[f"{len(mesh[2])} triangles"] = samples
    noise = max(spread(one) for one in samples.values())
    faster = ratio(samples["llvmpipe"], samples["Tasuki"])
    cells = [f"{median(samples[name]) * 1e3:.1f}" for name in contenders]
    table.add(f"{len(mesh[2]):,}", *cells, f"{faster:.2f}", f"{noise:.0%}")


def check_pictures(ours: np.ndarray, theirs: np.ndarray) -> None:
    """The end of the program where the two do not show the same, but for pixels at outlines."""
    difference = np.abs(np.clip(ours, 0.0, 1.0) * 255.0 - theirs).max(axis=-1)
    share = float((difference > 3.0).mean())
    if share > 0.005:
        raise SystemExit(f"cannot measure: {share:.1%} of the pixels differ")


def main() -> None:
    parser = argparse.ArgumentParser(description="The scanline method beside llvmpipe.")
    parser.add_argument("--rounds", type=rounds_argument, default=15)
    options = parser.parse_args()
    columns = ["triangles", "Tasuki, ms", "llvmpipe, ms", "times faster", "noise"]
    table = Table(f"A frame of {SIZE} x {SIZE}, {THREADS} threads", columns)
    report = Report("scanline", options.rounds, [table])
    for triangles in TRIANGLES:
        measure(report, table, triangles)
    report.publish()


if __name__ == "__main__":
    main()
