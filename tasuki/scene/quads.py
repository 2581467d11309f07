"""Pairs of triangles that are one flat convex quadrilateral: as one primitive they cost little more than one of them.

Two steps, since congruent polygons are many and their places differ. `with_pairs_together` orders the triangles of one
outline so that partners stand side by side; `flat_convex_quads` takes those partners together that make a flat convex
quadrilateral of the coordinates as they are rounded.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from tasuki.scene.shapes import Polygons

PLANAR = 1e-6
"""How far the corners of a flat quadrilateral may lie from a plane, in units of its size: rounded coordinates."""

CONVEX = 1e-5
"""The least area of the triangle at a corner, in units of the quadrilateral's: at a corner that rounding bent inwards,
the planes of its edges would leave a crack.
"""

Corners = tuple[int, int, int, int]


def with_pairs_together(
    triangles: Sequence[Sequence[int]], convex: Callable[[Corners], bool] = lambda corners: True
) -> np.ndarray:
    """`triangles` (n, 3) of a simple polygon, as many as possible in pairs of neighbours, first and second; then the
    others.

    `convex` tells of the corners around two neighbours, the first and third on their common edge, whether they may be a
    pair. Neighbourhood in a triangulated polygon is a tree: who pairs its leaves with their only neighbours, again and
    again, finds the most pairs (R. M. Karp, M. Sipser, "Maximum Matching in Sparse Random Graphs", 1981).
    """
    edges = {(t[i], t[(i + 1) % 3]): (number, t[i - 1]) for number, t in enumerate(triangles) for i in range(3)}
    neighbours: list[set[int]] = [set() for _ in triangles]
    for (a, b), (number, c) in edges.items():
        other, d = edges.get((b, a), (number, c))
        if other > number and convex((a, d, b, c)):
            neighbours[number].add(other)
            neighbours[other].add(number)
    order: list[int] = []
    leaves = [number for number, near in enumerate(neighbours) if len(near) == 1]
    while leaves:
        leaf = leaves.pop()
        if neighbours[leaf]:
            (partner,) = neighbours[leaf]
            order += [leaf, partner]
            for near in neighbours[partner]:
                neighbours[near].discard(partner)
                if len(neighbours[near]) == 1:
                    leaves.append(near)
            neighbours[partner] = set()
    alone = sorted(set(range(len(triangles))) - set(order))
    return np.array([triangles[number] for number in order + alone], np.intp).reshape(-1, 3)


def flat_convex_quads(
    polygons: Polygons, corners: np.ndarray, owner: np.ndarray, rounded: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """`quads` (q, 4), the corners around pairs of the triangles `corners` (t, 3), and the number of the first triangle
    of each, (q,); its partner is the next. The common edge runs from the first corner to the third.

    `owner` is the polygon of each triangle, `rounded` (m, 3) the polygons' points as the primitives will have them.
    """
    first = np.flatnonzero(owner[:-1] == owner[1:])
    quads, joined = _around(corners[first], corners[first + 1])
    first, quads = first[joined], quads[joined]
    good = _is_convex(rounded.astype(np.float64), quads) & _is_flat(polygons.points, quads)
    first, quads = first[good], quads[good]
    chosen = _every_second(first)
    return quads[chosen], first[chosen]


def _around(left: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The corners around each two triangles, (n, 4), and whether they have an edge in common, (n,)."""
    quads = np.zeros((len(left), 4), np.intp)
    joined = np.zeros(len(left), bool)
    for i in range(3):
        for j in range(3):
            a, b, c, d = left[:, i], left[:, (i + 1) % 3], left[:, i - 1], right[:, j - 1]
            common = (a == right[:, (j + 1) % 3]) & (b == right[:, j])
            quads[common] = np.stack([b, c, a, d], axis=1)[common]
            joined |= common
    return quads, joined


def _is_convex(points: np.ndarray, quads: np.ndarray) -> np.ndarray:
    a, b, c, d = (points[quads[:, corner]] for corner in range(4))
    normal = np.cross(c - a, d - b)
    turns = [np.cross(q - p, r - q) for p, q, r in ((a, b, c), (b, c, d), (c, d, a), (d, a, b))]
    least = np.min([np.einsum("ij,ij->i", turn, normal) for turn in turns], axis=0, initial=np.inf)
    return least > CONVEX * np.einsum("ij,ij->i", normal, normal)


def _is_flat(points: np.ndarray, quads: np.ndarray) -> np.ndarray:
    a, b, c, d = (points[quads[:, corner]] for corner in range(4))
    normal = np.cross(c - a, d - b)
    height = np.abs(np.einsum("ij,ij->i", normal, b - a))
    size = np.linalg.norm(c - a, axis=1) + np.linalg.norm(d - b, axis=1)
    return height <= PLANAR * size * np.linalg.norm(normal, axis=1)


def _every_second(numbers: np.ndarray) -> np.ndarray:
    """Of ascending numbers a mask without two that follow one another: in a row of such the first, third, ..."""
    begins = np.diff(numbers, prepend=-2) != 1
    places = np.arange(len(numbers))
    return (places - np.maximum.accumulate(np.where(begins, places, 0))) % 2 == 0
