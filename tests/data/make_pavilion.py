"""Writes pavilion.yaml: a round temple on a mirror, its dome of patches with normals.

python tests/data/make_pavilion.py > tests/data/pavilion.yaml
"""

import math

from tasuki.scene import Camera, Cone, Material, PointLight, Polygon, Scene, Sphere
from tasuki.scene.yaml_format import dump_yaml

COLUMNS = 8
MERIDIANS = 24
PARALLELS = 6
DOME_RADIUS = 2.1
DOME_FOOT = 2.78

MARBLE = Material("marble", colour=(0.90, 0.87, 0.81), diffuse=0.85, specular=0.12, exponent=40.0)
COPPER = Material("copper green", colour=(0.33, 0.60, 0.54), diffuse=0.8, specular=0.25, exponent=25.0)
GOLD = Material("gold", colour=(0.95, 0.70, 0.25), diffuse=0.5, specular=0.6, exponent=90.0, reflection=0.3)
WATER = Material("water", colour=(0.10, 0.22, 0.30), diffuse=0.5, specular=0.3, exponent=300.0, reflection=0.55)
LAWN = Material("lawn", colour=(0.34, 0.46, 0.20), diffuse=0.9)
GLASS = Material("glass", diffuse=0.02, specular=0.2, exponent=400.0, reflection=0.1, transmission=0.88, index=1.5)


def around(radius, height, angle):
    """The point at `angle` (in turns) of a horizontal circle about the axis, to five digits."""
    x, y = math.cos(math.tau * angle), math.sin(math.tau * angle)
    return round(radius * x, 5), round(radius * y, 5), round(height, 5)


def disc(radius, height, corners, material):
    return Polygon(tuple(around(radius, height, i / corners) for i in range(corners)), material=material)


def upright(radius, low, high, material, apex_radius=None, x=0.0, y=0.0):
    top = radius if apex_radius is None else apex_radius
    return Cone((x, y, low), radius, (x, y, high), top, open=True, material=material)


def column(angle):
    x, y, _ = around(1.8, 0.0, angle)
    yield upright(0.26, 0.30, 0.38, MARBLE, 0.19, x, y)
    yield upright(0.17, 0.36, 2.36, MARBLE, 0.14, x, y)
    yield upright(0.14, 2.34, 2.5, MARBLE, 0.27, x, y)


def dome():
    """A hemisphere of quadrilateral patches, which narrow to triangles at the top."""

    def on_dome(i, j):
        latitude = j / PARALLELS / 4.0
        radius, height = math.cos(math.tau * latitude), math.sin(math.tau * latitude)
        return around(DOME_RADIUS * radius, DOME_FOOT + DOME_RADIUS * height, i / MERIDIANS), around(
            radius, height, i / MERIDIANS
        )

    for j in range(PARALLELS):
        for i in range(MERIDIANS):
            corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            if j == PARALLELS - 1:
                corners = [(i, j), (i + 1, j), (i + 0.5, j + 1)]
            points, normals = zip(*(on_dome(*corner) for corner in corners), strict=True)
            yield Polygon(points, normals, material=COPPER)


def shapes():
    yield Polygon(((-60.0, -60.0, 0.0), (60.0, -60.0, 0.0), (60.0, 60.0, 0.0), (-60.0, 60.0, 0.0)), material=LAWN)
    yield disc(9.2, 0.02, 48, MARBLE)
    yield disc(8.8, 0.04, 48, WATER)
    for radius, top in ((2.6, 0.15), (2.3, 0.30)):
        yield upright(radius, 0.0, top, MARBLE)
        yield disc(radius, top, 48, MARBLE)
    for i in range(COLUMNS):
        yield from column((i + 0.5) / COLUMNS)
    yield upright(2.1, 2.5, DOME_FOOT, MARBLE)
    yield upright(-1.55, 2.5, DOME_FOOT, MARBLE)
    yield from dome()
    yield upright(0.12, DOME_FOOT + 2.05, DOME_FOOT + 2.35, MARBLE)
    yield Sphere((0.0, 0.0, DOME_FOOT + 2.5), 0.22, material=GOLD)
    yield upright(0.42, 0.30, 0.75, MARBLE, 0.30)
    yield disc(0.30, 0.75, 24, MARBLE)
    yield Sphere((0.0, 0.0, 1.18), 0.43, material=GOLD)
    yield Sphere((-2.5, -3.9, 0.54), 0.50, material=GLASS)


SCENE = Scene(
    camera=Camera(eye=(3.0, -12.4, 2.7), at=(0.0, 0.0, 1.15), up=(0.0, 0.0, 1.0), angle=41.0, resolution=(640, 560)),
    shapes=shapes(),
    lights=[
        PointLight((-30.0, -40.0, 45.0), (0.75, 0.68, 0.58)),
        PointLight((40.0, -25.0, 20.0), (0.16, 0.20, 0.28)),
        PointLight((0.0, -0.9, 2.2), (0.22, 0.18, 0.10)),
    ],
    background=(0.52, 0.68, 0.86),
)

if __name__ == "__main__":
    print("# A round temple on a mirror of water. Made by make_pavilion.py.")
    print(dump_yaml(SCENE), end="")
