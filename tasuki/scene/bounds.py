"""Boxes around solids, in float64: of surfaces' insides, of polytopes, of boxes under matrices.

A box is (low x, low y, low z, high x, high y, high z); infinite where it has no bound. `EMPTY` holds nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import inf, isfinite, sqrt
from typing import TypeAlias

import numpy as np

Box: TypeAlias = tuple[float, float, float, float, float, float]

EVERYTHING: Box = (-inf, -inf, -inf, inf, inf, inf)
EMPTY: Box = (inf, inf, inf, -inf, -inf, -inf)
FLAT = 1e-12
"""Eigenvalues and components below this share of the largest are zero but for rounding."""
MOST_TURNS = 8
"""Quadrics along whose axes bounds are sought."""
MOST_POLYTOPE_PLANES = 32
"""Corners are sought among all triples of planes; beyond this number that takes too long."""


def is_bounded(box: Box) -> bool:
    """Whether the box ends in every direction. An empty one does."""
    return box == EMPTY or all(map(isfinite, box))


def intersected(a: Box, b: Box) -> Box:
    """What lies in both; EMPTY where nothing does."""
    low, high = tuple(map(max, a[:3], b[:3])), tuple(map(min, a[3:], b[3:]))
    if low[0] > high[0] or low[1] > high[1] or low[2] > high[2]:
        return EMPTY
    return (*low, *high)  # type: ignore[return-value]


def united(a: Box, b: Box) -> Box:
    """The box around both."""
    return (*map(min, a[:3], b[:3]), *map(max, a[3:], b[3:]))  # type: ignore[return-value]


def transformed(box: Box, matrix: np.ndarray) -> Box:
    """The box around a box under an affine (4, 4) matrix, by intervals (J. Arvo, Graphics Gems, 1990)."""
    if box in (EMPTY, EVERYTHING):
        return box
    low, high = [], []
    for row in matrix[:3].tolist():
        least = greatest = row[3]
        for factor, a, b in zip(row, box[:3], box[3:], strict=False):
            if factor:
                least += min(factor * a, factor * b)
                greatest += max(factor * a, factor * b)
        low.append(least)
        high.append(greatest)
    return (*low, *high)  # type: ignore[return-value]


def plane_boxes(planes: np.ndarray) -> np.ndarray:
    """Boxes (n, 6) of half-spaces n . P + d < 0, given as (n, 4): of those along an axis, one side."""
    boxes = np.tile(np.array(EVERYTHING), (len(planes), 1))
    normals, axis = planes[:, :3], np.abs(planes[:, :3]).argmax(axis=1)
    rows = np.arange(len(planes))
    size = normals[rows, axis]
    along = np.abs(normals).sum(axis=1) <= np.abs(size) * (1.0 + FLAT)
    side = -planes[:, 3] / np.where(size == 0.0, 1.0, size)
    above, below = along & (size > 0.0), along & (size < 0.0)
    boxes[rows[above], axis[above] + 3] = side[above]
    boxes[rows[below], axis[below]] = side[below]
    return boxes


def quadric_boxes(quadrics: np.ndarray) -> np.ndarray:
    """Boxes (n, 6) of the insides of quadrics (n, 4, 4), as in `csg.Leaf`: of ellipsoids, of cylinders and parallel
    planes across.

    With the square completed at p, along axis i an inside reaches sqrt(r pinv(Q)_ii) from p; a direction that Q
    leaves free has no bound, but for the opening of a paraboloid, which lies on one side of its vertex.
    """
    q, linear = quadrics[:, :3, :3], quadrics[:, :3, 3] / 2.0
    values, vectors = np.linalg.eigh(q)
    least = FLAT * np.abs(values).max(axis=1, initial=1e-300)
    zero = np.abs(values) <= least[:, None]
    inverse = np.einsum("nij,nj,nkj->nik", vectors, np.where(zero, 0.0, 1.0 / np.where(zero, 1.0, values)), vectors)
    middle = -np.einsum("nij,nj->ni", inverse, linear)
    rest = linear + np.einsum("nij,nj->ni", q, middle)
    constant = quadrics[:, 3, 3] - np.einsum("ni,ni->n", middle, linear + rest)
    boxes = np.tile(np.array(EVERYTHING), (len(quadrics), 1))
    opens = np.abs(rest).max(axis=1, initial=0.0) > 1e-9 * np.abs(quadrics[:, :3]).max(axis=(1, 2), initial=0.0)
    round_ = (values >= -least[:, None]).all(axis=1) & ~opens
    reach = np.sqrt(np.maximum(constant, 0.0)[:, None] * np.maximum(np.einsum("nii->ni", inverse), 0.0))
    free = np.einsum("nij,nj->ni", vectors**2, zero.astype(float)) > FLAT
    boxes[:, :3] = np.where(round_[:, None] & ~free, middle - reach, -inf)
    boxes[:, 3:] = np.where(round_[:, None] & ~free, middle + reach, inf)
    boxes[round_ & (constant <= 0.0) & ~zero.all(axis=1)] = EMPTY
    bowl = (values >= -least[:, None]).all(axis=1) & opens
    for i in np.flatnonzero(bowl):
        half_space = np.concatenate([2.0 * rest[i], [-constant[i] - 2.0 * rest[i] @ middle[i]]])
        boxes[i] = plane_boxes(half_space[None])[0]
    return boxes + np.tile(quadrics[:, 3, :3], 2)


def principal_axes(quadrics: np.ndarray) -> np.ndarray:
    """Of quadrics (n, 4, 4) that close around an axis (cylinders, cones, paraboloids) the matrices (k, 4, 4) from
    coordinates along their axes; of the first few.
    """
    values, vectors = np.linalg.eigh(quadrics[:, :3, :3])
    closing = np.flatnonzero(values[:, 1] > FLAT * np.abs(values).max(axis=1))[:MOST_TURNS]
    turns = np.tile(np.eye(4), (len(closing), 1, 1))
    turns[:, :3, :3] = vectors[closing]
    return turns


def joint_box(boxes: Sequence[Box], quadrics: Sequence[np.ndarray], planes: Sequence[np.ndarray]) -> Box:
    """What lies in all of `boxes`; where that has no bounds, as far as the surfaces around it, insides negative, give
    it some together.
    """
    box = EVERYTHING
    for one in boxes:
        box = intersected(box, one)
    if not is_bounded(box):
        for quadric in 2 * list(quadrics):
            box = contracted(box, quadric)
    if not is_bounded(box) and len(planes) > 3:
        box = polytope_box(planes, box)
    return box


def contracted(box: Box, quadric: np.ndarray) -> Box:
    """What of a box may lie inside of a quadric without mixed terms: q x^2 + 2 l x on each axis is at most minus the
    least that the other axes give (a cone between two planes is so bounded).
    """
    q, linear, centre = np.diagonal(quadric)[:3], quadric[:3, 3] / 2.0, quadric[3, :3]
    if np.abs(quadric[:3, :3] - np.diag(q)).max() > FLAT * np.abs(quadric[:3]).max():
        return box
    around = np.array(box).reshape(2, 3) - centre
    least = [_least(a, b, low, high) for a, b, low, high in zip(q, linear, *around.tolist(), strict=True)]
    for axis in range(3):
        others = sum(least[other] for other in range(3) if other != axis) - quadric[3, 3]
        if q[axis] > 0.0 and isfinite(others):
            root = linear[axis] ** 2 - q[axis] * others
            if root < 0.0:
                return EMPTY
            bounds = list(EVERYTHING)
            bounds[axis] = centre[axis] + (-linear[axis] - sqrt(root)) / q[axis]
            bounds[axis + 3] = centre[axis] + (-linear[axis] + sqrt(root)) / q[axis]
            box = intersected(box, tuple(bounds))  # type: ignore[arg-type]
    return box


def polytope_box(planes: Sequence[np.ndarray], within: Box) -> Box:
    """The box around what lies in all half-spaces (n, d) and in `within`, from the corners where three planes meet."""
    sides = [np.array([*np.eye(3)[axis], -within[axis + 3]]) for axis in range(3) if isfinite(within[axis + 3])]
    sides += [np.array([*-np.eye(3)[axis], within[axis]]) for axis in range(3) if isfinite(within[axis])]
    every = np.array([*planes, *sides])
    if not 4 <= len(every) <= MOST_POLYTOPE_PLANES or not _surrounds(every[:, :3]):
        return within
    every = every / np.linalg.norm(every[:, :3], axis=1)[:, None]
    triples = np.array(list(combinations(range(len(every)), 3)))
    normals, offsets = every[triples][:, :, :3], every[triples][:, :, 3]
    meets = np.abs(np.linalg.det(normals)) > 1e-9
    corners = np.linalg.solve(normals[meets], -offsets[meets][:, :, None])[:, :, 0]
    size = np.abs(corners).max(initial=1.0)
    inside = (corners @ every[:, :3].T + every[:, 3] <= 1e-9 * size).all(axis=1)
    if not inside.any():
        return EMPTY
    low, high = corners[inside].min(axis=0), corners[inside].max(axis=0)
    return intersected(within, (*low.tolist(), *high.tolist()))


def _surrounds(normals: np.ndarray) -> bool:
    """Whether no direction stays in all half-spaces with these normals: no ray along the lines where two meet does."""
    if np.linalg.matrix_rank(normals) < 3:
        return False
    pairs = np.array(list(combinations(range(len(normals)), 2)))
    lines = np.cross(normals[pairs[:, 0]], normals[pairs[:, 1]])
    lengths = np.linalg.norm(lines, axis=1)
    lines = lines[lengths > 1e-9] / lengths[lengths > 1e-9, None]
    rises = np.concatenate([lines, -lines]) @ normals.T
    return not (rises <= 1e-9).all(axis=1).any()


def _least(q: float, linear: float, low: float, high: float) -> float:
    """The least value of q x^2 + 2 l x for low <= x <= high."""
    if q == 0.0 and linear == 0.0:
        return 0.0
    if q > 0.0:
        x = min(max(-linear / q, low), high)
        return q * x * x + 2.0 * linear * x if isfinite(x) else inf
    ends = [q * x * x + 2.0 * linear * x if isfinite(x) else -inf for x in (low, high)]
    return min(ends)
