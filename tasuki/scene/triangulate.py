"""Polygons become triangles: a fan where that keeps within the polygon, ear clipping elsewhere.

A fan from a corner of a simple polygon is right if and only if each of its triangles turns the way the polygon does. So
convex polygons, and many others, are cut by array operations alone, always from their first corner; four corners that
fail are cut along the other diagonal; the rest goes to `mapbox_earcut`, one polygon at a time.
"""

from __future__ import annotations

import numpy as np

from tasuki.scene.shapes import Polygons

BACKWARD = -1e-12
"""How far a fan's triangle may turn the wrong way, in units of the polygon's area: rounding of a straight angle."""

PLANAR = 1e-6
"""How far the corners of a flat quadrilateral may lie from a plane, in units of its size: rounded coordinates."""

FLAT = 1e-12
"""Triangles with less than this share of the polygon's area are left out: they stand at straight angles."""


def triangulate(polygons: Polygons) -> tuple[np.ndarray, np.ndarray]:
    """`corners` (t, 3), indices into `polygons.points`, and `owner` (t,), the polygon of each triangle.

    Triangles turn as their polygon does; they stand in the order of the polygons.
    """
    apex = np.zeros(len(polygons), np.intp)
    corners, owner, shares = _fans(polygons, apex)
    bad = _has_backward(shares, owner, len(polygons))
    apex[bad & (polygons.sizes == 4)] = 1
    if apex.any():
        corners, owner, shares = _fans(polygons, apex)
        bad = _has_backward(shares, owner, len(polygons))
    kept = ~bad[owner] & (shares > FLAT)
    corners, owner = corners[kept], owner[kept]
    if not bad.any():
        return corners, owner
    clipped = [_clip_ears(polygons, int(polygon)) for polygon in np.flatnonzero(bad)]
    owner = np.concatenate([owner, np.repeat(np.flatnonzero(bad), [len(one) for one in clipped])])
    order = np.argsort(owner, kind="stable")
    return np.concatenate([corners, *clipped])[order], owner[order]


def flat_convex_quads(polygons: Polygons) -> np.ndarray:
    """Which polygons have four corners, all of them convex, and all but in one plane; (n,) bool."""
    found = polygons.sizes == 4
    chosen = np.flatnonzero(found)
    around = polygons.starts[chosen, None] + np.arange(4)
    for first in range(4):
        corners = around[:, [first, (first + 1) % 4, (first + 2) % 4]]
        found[chosen] &= _shares(polygons, corners, chosen) > FLAT
    a, b, c, d = (polygons.points[around[:, corner]] for corner in range(4))
    normal = np.cross(c - a, d - b)
    height = np.abs(np.einsum("ij,ij->i", normal, b - a))
    size = np.linalg.norm(c - a, axis=1) + np.linalg.norm(d - b, axis=1)
    found[chosen] &= height <= PLANAR * size * np.linalg.norm(normal, axis=1)
    return found


def _fans(polygons: Polygons, apex: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every polygon as a fan from its corner `apex`: corners, owners, and each triangle's share of the area."""
    sizes = polygons.sizes
    counts = sizes - 2
    owner = np.repeat(np.arange(len(polygons)), counts)
    within = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    steps = apex[owner, None] + np.stack([np.zeros_like(within), within + 1, within + 2], axis=1)
    corners = polygons.starts[owner, None] + steps % sizes[owner, None]
    return corners, owner, _shares(polygons, corners, owner)


def _shares(polygons: Polygons, corners: np.ndarray, owner: np.ndarray) -> np.ndarray:
    a, b, c = (polygons.points[corners[:, corner]] for corner in range(3))
    whole = polygons.area_vectors[owner]
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), whole) / np.einsum("ij,ij->i", whole, whole)


def _has_backward(shares: np.ndarray, owner: np.ndarray, polygons: int) -> np.ndarray:
    return np.bincount(owner[shares < BACKWARD], minlength=polygons) > 0


def _clip_ears(polygons: Polygons, polygon: int) -> np.ndarray:
    """The triangles of one polygon, seen along the axis to which its normal is nearest."""
    import mapbox_earcut

    start, end = polygons.starts[polygon], polygons.starts[polygon + 1]
    axis = int(np.abs(polygons.area_vectors[polygon]).argmax())
    flat = np.ascontiguousarray(polygons.points[start:end, [(axis + 1) % 3, (axis + 2) % 3]])
    found = mapbox_earcut.triangulate_float64(flat, np.array([end - start], np.uint32)).astype(np.intp).reshape(-1, 3)
    corners = start + found
    shares = _shares(polygons, corners, np.full(len(corners), polygon))
    # Which way round ears come out is the library's choice; front is ours.
    corners[shares < 0.0] = corners[shares < 0.0][:, ::-1]
    return corners[np.abs(shares) > FLAT]
