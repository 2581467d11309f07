"""One scene by both methods, side by side: python examples/both_methods.py OUT.png

On the left rays meet the surfaces themselves, with shadows; on the right the same solids, as triangles, row by row.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

import tasuki
from tasuki.scene import Box, Camera, Cylinder, Group, Material, PointLight, RoundedBox, Scene, Sphere, Tube

BRASS = Material("brass", (0.9, 0.7, 0.35), diffuse=0.8, specular=0.4, exponent=60)
STEEL = Material("steel", (0.62, 0.66, 0.7), diffuse=0.9, specular=0.3, exponent=40)
BENCH = Material("bench", (0.5, 0.42, 0.36))


def bearing_block() -> Group:
    """A pillow block: a foot, a drilled and hollowed body, a bush, four bolts."""
    foot = RoundedBox((-2.4, -1.0, 0.0), (2.4, 1.0, 0.6), 0.15)
    body = Cylinder((0.0, -0.8, 1.5), (0.0, 0.8, 1.5), 1.2) | Box((-1.2, -0.8, 0.3), (1.2, 0.8, 1.5))
    holes = [
        Cylinder((x, y, -1.0), (x, y, 2.0), 0.18) | Cylinder((x, y, 0.45), (x, y, 2.0), 0.32)
        for x in (-1.9, 1.9)
        for y in (-0.55, 0.55)
    ]
    bore = Cylinder((0.0, -2.0, 1.5), (0.0, 2.0, 1.5), 0.8)
    dent = Sphere((0.0, 0.0, 2.9), 0.5)
    bush = Tube((0.0, -1.0, 1.5), (0.0, 1.0, 1.5), 0.8, 0.6, material=BRASS)
    return Group(((foot | body) - (bore | dent | holes[0] | holes[1] | holes[2] | holes[3]), bush), material=STEEL)


def scene() -> Scene:
    bench = Box((-6.0, -6.0, -0.3), (6.0, 6.0, 0.0), material=BENCH)
    camera = Camera((5.0, -8.0, 6.0), (0.0, 0.0, 0.9), (0.0, 0.0, 1.0), 32.0, (420, 360))
    lights = [PointLight((2.0, -9.0, 9.0)), PointLight((-8.0, -4.0, 7.0), (0.3, 0.3, 0.4))]
    return Scene(camera, [bearing_block(), bench], lights, (0.75, 0.8, 0.85))


def side_by_side(samples: int = 16, size: tuple[int, int] | None = None) -> np.ndarray:
    """Both pictures, (height, 2 * width, 3) uint8."""
    methods = ("raytrace", "scanline")
    return np.concatenate(
        [tasuki.render(scene(), method=method, samples=samples, size=size).srgb() for method in methods], axis=1
    )


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "both_methods.png")
    Image.fromarray(side_by_side()).save(out)
