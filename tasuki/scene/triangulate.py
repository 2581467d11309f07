"""Polygons become triangles: a fan where that keeps within the polygon, ear clipping elsewhere.

A fan from a corner of a simple polygon is right if and only if each of its triangles turns the way the polygon does. So
convex polygons, and many others, are cut by array operations alone, always from their first corner; four corners that
fail are cut along the other diagonal; the rest goes to `mapbox_earcut`, one polygon at a time.

A fan, and ears as they come, are slivers as long as the polygon, whose boxes all overlap. So a convex polygon of many
corners loses every second one again and again instead, and ears of a concave one exchange their diagonals for shorter
ones: then few triangles are large.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from tasuki.scene.quads import with_pairs_together
from tasuki.scene.shapes import Polygons

BACKWARD = -1e-12
"""How far a fan's triangle may turn the wrong way, in units of the polygon's area: rounding of a straight angle."""

LARGE = 7
"""Corners from which on a convex polygon is halved instead of fanned."""

SHORTER = 1.0 - 1e-9
"""What a new diagonal may have of the old one's length, so that no two are exchanged for ever."""

FLAT = 1e-12
"""Triangles with less than this share of the polygon's area are left out: they stand at straight angles."""


def triangulate(polygons: Polygons) -> tuple[np.ndarray, np.ndarray]:
    """`corners` (t, 3), indices into `polygons.points`, and `owner` (t,), the polygon of each triangle.

    Triangles turn as their polygon does; they stand in the order of the polygons, neighbours that make a convex
    quadrilateral one after the other (see `tasuki.scene.quads`).
    """
    apex = np.zeros(len(polygons), np.intp)
    corners, owner, shares = _fans(polygons, apex)
    bad = _has_backward(shares, owner, len(polygons))
    apex[bad & (polygons.sizes == 4)] = 1
    if apex.any():
        corners, owner, shares = _fans(polygons, apex)
        bad = _has_backward(shares, owner, len(polygons))
    corners, shares = _halved(polygons, corners, owner, shares, ~bad)
    kept = ~bad[owner] & (shares > FLAT)
    corners, owner = corners[kept], owner[kept]
    if not bad.any():
        return corners, owner
    known: Known = {}
    clipped = [_clip_ears(polygons, int(polygon), known) for polygon in np.flatnonzero(bad)]
    owner = np.concatenate([owner, np.repeat(np.flatnonzero(bad), [len(one) for one in clipped])])
    order = np.argsort(owner, kind="stable")
    return np.concatenate([corners, *clipped])[order], owner[order]


def _fans(polygons: Polygons, apex: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every polygon as a fan from its corner `apex`: corners, owners, and each triangle's share of the area."""
    sizes = polygons.sizes
    counts = sizes - 2
    owner = np.repeat(np.arange(len(polygons)), counts)
    within = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    steps = apex[owner, None] + np.stack([np.zeros_like(within), within + 1, within + 2], axis=1)
    corners = polygons.starts[owner, None] + steps % sizes[owner, None]
    return corners, owner, _shares(polygons, corners, owner)


def _halved(
    polygons: Polygons, corners: np.ndarray, owner: np.ndarray, shares: np.ndarray, right: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The fans `corners` with their shares, but those of large convex polygons cut by halving instead.

    A polygon with a right fan (the mask `right`) is convex where it turns to its front at every corner.
    """
    large = np.flatnonzero(right & (polygons.sizes >= LARGE))
    for size in np.unique(polygons.sizes[large]):
        alike = large[polygons.sizes[large] == size]
        around = polygons.starts[alike, None] + np.arange(size)
        turns = np.stack([around, np.roll(around, -1, axis=1), np.roll(around, -2, axis=1)], axis=2)
        convex = _shares(polygons, turns.reshape(-1, 3), np.repeat(alike, size)).reshape(-1, size).min(axis=1) > 0.0
        if convex.any():
            mine = np.isin(owner, alike[convex])
            corners[mine] = (polygons.starts[alike[convex], None, None] + _halving(int(size))).reshape(-1, 3)
            shares[mine] = _shares(polygons, corners[mine], owner[mine])
    return corners, shares


def _halving(size: int) -> np.ndarray:
    """Triangles that take every second corner of a convex polygon away, until three are left."""
    triangles: list[tuple[int, int, int]] = []
    left = list(range(size))
    while len(left) > 3:
        triangles += zip(left[:-2:2], left[1:-1:2], left[2::2], strict=True)
        left = left[::2] if len(left) % 2 else [*left[::2], left[-1]]
    return with_pairs_together([*triangles, (left[0], left[1], left[2])])


def _shares(polygons: Polygons, corners: np.ndarray, owner: np.ndarray) -> np.ndarray:
    a, b, c = (polygons.points[corners[:, corner]] for corner in range(3))
    whole = polygons.area_vectors[owner]
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), whole) / np.einsum("ij,ij->i", whole, whole)


def _has_backward(shares: np.ndarray, owner: np.ndarray, polygons: int) -> np.ndarray:
    return np.bincount(owner[shares < BACKWARD], minlength=polygons) > 0


Known: TypeAlias = dict[bytes, np.ndarray]
"""Triangles, as numbers of corners, of polygons by their outline: machine parts repeat the same ones."""


def _clip_ears(polygons: Polygons, polygon: int, known: Known) -> np.ndarray:
    """The triangles of one polygon, seen along the axis to which its normal is nearest."""
    start, end = polygons.starts[polygon], polygons.starts[polygon + 1]
    outline = _outline(polygons.points[start:end])
    if outline not in known:
        axis = int(np.abs(polygons.area_vectors[polygon]).argmax())
        flat = np.ascontiguousarray(polygons.points[start:end, [(axis + 1) % 3, (axis + 2) % 3]])
        known[outline] = _ears(flat)
    corners = start + known[outline]
    shares = _shares(polygons, corners, np.full(len(corners), polygon))
    # Which way round ears come out is the library's choice; front is ours.
    corners[shares < 0.0] = corners[shares < 0.0][:, ::-1]
    return corners[np.abs(shares) > FLAT]


def _outline(points: np.ndarray) -> bytes:
    """What congruent polygons have in common: rounded distances from each corner to the next two."""
    steps = [np.linalg.norm(np.roll(points, -n, axis=0) - points, axis=1) for n in (1, 2, len(points) // 2)]
    return np.round(np.array(steps) / max(np.max(steps), 1e-300) * 1e7).astype(np.int64).tobytes()


def _ears(points: np.ndarray) -> np.ndarray:
    """The triangles (t, 3) of a simple polygon in the plane, with diagonals as short as exchanges make them."""
    import mapbox_earcut

    found = mapbox_earcut.triangulate_float64(points, np.array([len(points)], np.uint32)).reshape(-1, 3)
    return with_short_diagonals(points, found.astype(np.intp))


def with_short_diagonals(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """`triangles` (t, 3) over `points` (n, 2), diagonals exchanged while the other one of a convex quadrilateral is
    shorter (C. L. Lawson's flips, 1977, for the least length instead of the Delaunay angle).
    """
    places = [complex(x, y) for x, y in points.tolist()]
    corners = [list(triangle) for triangle in triangles.tolist()]
    for triangle in corners:
        a, b, c = (places[corner] for corner in triangle)
        if ((b - a).conjugate() * (c - a)).imag < 0.0:
            triangle.reverse()
    edges = {(t[i], t[i - 2]): number for number, t in enumerate(corners) for i in range(3)}
    waiting = [edge for edge in edges if edge[0] < edge[1] and edge[::-1] in edges]
    while waiting:
        a, b = waiting.pop()
        left, right = edges.get((a, b)), edges.get((b, a))
        if left is None or right is None:
            continue
        c, d = sum(corners[left]) - a - b, sum(corners[right]) - a - b
        if abs(places[c] - places[d]) < abs(places[a] - places[b]) * SHORTER and _convex(places, a, d, b, c):
            corners[left], corners[right] = [a, d, c], [d, b, c]
            del edges[a, b], edges[b, a]
            for number in (left, right):
                t = corners[number]
                edges.update({(t[i], t[i - 2]): number for i in range(3)})
            waiting += [(a, d), (d, b), (b, c), (c, a)]
    return with_pairs_together(corners, lambda around: _convex(places, *around))


def _convex(places: list[complex], *around: int) -> bool:
    """Whether corners, counterclockwise, all turn left."""
    a, b, c, d = (places[corner] for corner in around)
    turns = ((q - p).conjugate() * (r - q) for p, q, r in ((a, b, c), (b, c, d), (c, d, a), (d, a, b)))
    return all(turn.imag > 0.0 for turn in turns)
