"""A scene's polygons as one mesh: shared vertices and normals, faces that point to them, edges between two faces.

Found once for a scene, by sorting: what moves from frame to frame is a matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tasuki.modules import records as rec
from tasuki.modules.scanline import records as scan
from tasuki.scene.flatten import Flat
from tasuki.scene.pack import Packed
from tasuki.scene.shapes import Polygons
from tasuki.scene.triangulate import triangulate

HASH = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
"""Odd factors by which the words of a row are mixed, modulo 2**64."""


@dataclass(frozen=True)
class Mesh:
    """Structured arrays of `tasuki.modules.scanline.records`: Vertex, VertexNormal, Face and FaceEdge.

    Faces stand in the order of the scene's polygons.
    """

    vertices: np.ndarray
    normals: np.ndarray
    faces: np.ndarray
    edges: np.ndarray


def mesh_of(packed: Packed) -> Mesh:
    """The scene's polygons as triangles; coordinates count from `packed.origin`."""
    polygons = packed.flat.shapes.polygons
    corners, owner = triangulate(polygons)
    positions, position_of = welded(polygons.points - packed.origin)
    normals, normal_of = welded(corner_normals(polygons))
    faces = _zeros(scan.Face, len(corners))
    for corner, name in enumerate("abc"):
        faces[name] = position_of[corners[:, corner]]
        faces[f"normal_{name}"] = normal_of[corners[:, corner]]
    faces["attribute"] = polygons.material[owner]
    faces["flags"] = np.where(_two_sided(packed.flat)[owner], rec.TWO_SIDED, 0)
    return Mesh(
        _records(scan.Vertex, "position", positions),
        _records(scan.VertexNormal, "normal", normals),
        faces,
        shared_edges(np.stack([faces["a"], faces["b"], faces["c"]], axis=1)),
    )


def corner_normals(polygons: Polygons) -> np.ndarray:
    """The normal at every point, (m, 3): the face's, of unit length, unless a patch gives one other than zero."""
    area_vectors = polygons.area_vectors
    face = area_vectors / np.linalg.norm(area_vectors, axis=1)[:, None]
    given = (polygons.normals != 0.0).any(axis=1, keepdims=True)
    return np.where(given, polygons.normals, np.repeat(face, polygons.sizes, axis=0))


def _two_sided(scene: Flat) -> np.ndarray:
    """Which polygons show from both sides, (n,) bool."""
    polygons = scene.shapes.polygons
    plain = np.array([material.shows_both_sides() for material in scene.materials], bool)
    patch = np.array([material.shows_both_sides(smooth=True) for material in scene.materials], bool)
    return np.where(polygons.smooth, patch[polygons.material], plain[polygons.material])


def _records(record: Any, field: str, values: np.ndarray) -> np.ndarray:
    records = _zeros(record, len(values))
    records[field] = values
    return records


def _zeros(record: Any, count: int) -> np.ndarray:
    return np.zeros(count, record.numpy_dtype())


def welded(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The different rows of (n, 3) numbers, rounded to float32, in the order in which they first appear; and of each
    given row its number among them, (n,) int32.

    Rows are sorted by a hash. Where two different ones share it, some that are equal may stay apart: faces then do not
    share that vertex, and show as before.
    """
    # Adding zero makes -0.0 the same as 0.0.
    rounded = rows.astype(np.float32) + np.float32(0.0)
    words = np.ascontiguousarray(rounded).view(np.uint32).reshape(-1, 3)
    order = np.argsort(words.astype(np.uint64) @ HASH)
    ordered = words[order]
    new = np.ones(len(order), bool)
    new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    first = np.minimum.reduceat(order, np.flatnonzero(new)) if len(order) else order
    by_appearance = np.argsort(first)
    number = np.empty(len(first), np.int32)
    number[by_appearance] = np.arange(len(first), dtype=np.int32)
    index = np.empty(len(order), np.int32)
    index[order] = number[np.cumsum(new) - 1]
    return rounded[first[by_appearance]], index


def shared_edges(corners: np.ndarray) -> np.ndarray:
    """FaceEdge records of triangles with `corners` (n, 3): each edge once for every two triangles that meet there.

    Where three or more meet, they are taken two by two; it does not matter which.
    """
    count = len(corners)
    ends = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]).astype(np.int64)
    low, high = ends.min(axis=1), ends.max(axis=1)
    key = low << 32 | high
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    begins = np.ones(len(order), bool)
    begins[1:] = ordered[1:] != ordered[:-1]
    start = np.maximum.accumulate(np.where(begins, np.arange(len(order)), 0))
    leading = np.flatnonzero((np.arange(len(order)) - start) % 2 == 0)
    paired = np.zeros(len(order) + 1, bool)
    paired[:-1] = ~begins
    result = _zeros(scan.FaceEdge, len(leading))
    result["a"], result["b"] = low[order[leading]], high[order[leading]]
    face = np.append(order % max(count, 1), -1)
    result["first"] = face[leading]
    result["second"] = np.where(paired[leading + 1], face[leading + 1], -1)
    return result
