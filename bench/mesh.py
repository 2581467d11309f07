"""A mesh that needs no file: a sphere with bumps, of about as many triangles as are asked for."""

from __future__ import annotations

import numpy as np

from tasuki.scene.model import Camera, PointLight, Scene
from tasuki.scene.shapes import POLYGON, Material, Polygons, Shapes

BUMP = 0.1
"""Height of the bumps; the sphere's radius is 1."""
CAMERA = Camera(eye=(0.0, 0.0, 4.0), at=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), angle=35.0)
LIGHT = PointLight((5.0, 5.0, 5.0))


def bumpy_sphere(triangles: int) -> np.ndarray:
    """About `triangles` triangles, (n, 3, 3) float32: a grid of latitude and longitude, single triangles at its poles.

    Shared corners are equal to the last bit, so that the mesh has no cracks.
    """
    cells = max(3, round((triangles / 2) ** 0.5))
    latitude, longitude = np.meshgrid(
        np.linspace(0.0, np.pi, cells + 1), np.linspace(0.0, 2.0 * np.pi, cells, endpoint=False), indexing="ij"
    )
    radius = 1.0 + BUMP * np.sin(9.0 * latitude) * np.sin(11.0 * longitude)
    flat = radius * np.sin(latitude)
    points = np.stack([flat * np.cos(longitude), flat * np.sin(longitude), radius * np.cos(latitude)], axis=-1)
    here = np.arange(cells * cells).reshape(cells, cells)
    east = np.roll(here, -1, axis=1)
    south, southeast = here + cells, east + cells
    corners = np.concatenate([_triples(here, south, east)[cells:], _triples(east, south, southeast)[:-cells]])
    return points.reshape(-1, 3).astype(np.float32)[corners]


def mesh_scene(triangles: np.ndarray, size: int) -> Scene:
    """The triangles, (n, 3, 3), as a scene of two-sided polygons, seen in a picture of `size` x `size` pixels."""
    count = len(triangles)
    nothing = Shapes.of([])
    zeros = np.zeros(count, np.int32)
    points = triangles.reshape(-1, 3).astype(np.float64)
    starts = 3 * np.arange(count + 1)
    polygons = Polygons(zeros, zeros, points, np.zeros_like(points), starts, np.zeros(count, bool))
    sorts = np.full(count, POLYGON, np.uint8)
    shapes = Shapes([Material(two_sided=True)], sorts, nothing.spheres, nothing.cones, polygons)
    camera = Camera(CAMERA.eye, CAMERA.at, CAMERA.up, CAMERA.angle, (size, size))
    return Scene(camera, shapes, [LIGHT])


def _triples(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    return np.stack([a.ravel(), b.ravel(), c.ravel()], axis=1)
