"""Boxes around solids, in float64: of surfaces' insides, of polytopes, of boxes under matrices; of many at once.

A box is a row (low x, low y, low z, high x, high y, high z); infinite where it has no bound. `EMPTY` holds nothing.
"""

from __future__ import annotations

from itertools import combinations
from math import inf

import numpy as np

EVERYTHING = np.array([-inf, -inf, -inf, inf, inf, inf])
EMPTY = -EVERYTHING
FLAT = 1e-12
"""Eigenvalues and components below this share of the largest are zero but for rounding."""
MOST_POLYTOPE_PLANES = 32
"""Corners are sought among all triples of planes; beyond this number that takes too long."""
AT_A_TIME = 1 << 18
"""Triples of planes whose corners are sought in one go: a bound on the memory that this takes."""


def is_empty(boxes: np.ndarray) -> np.ndarray:
    """Which boxes (..., 6) are EMPTY."""
    return (boxes == EMPTY).all(axis=-1)


def is_bounded(boxes: np.ndarray) -> np.ndarray:
    """Which boxes (..., 6) end in every direction. An empty one does."""
    return np.isfinite(boxes).all(axis=-1) | is_empty(boxes)


def intersected(boxes: np.ndarray) -> np.ndarray:
    """What lies in all of k boxes, (k, ..., 6); EMPTY where nothing does."""
    low, high = boxes[..., :3].max(axis=0), boxes[..., 3:].min(axis=0)
    common = np.concatenate([low, high], axis=-1)
    common[(low > high).any(axis=-1)] = EMPTY
    return common


def united(boxes: np.ndarray) -> np.ndarray:
    """The boxes around k boxes, (k, ..., 6)."""
    return np.concatenate([boxes[..., :3].min(axis=0), boxes[..., 3:].max(axis=0)], axis=-1)


def transformed(boxes: np.ndarray, matrices: np.ndarray) -> np.ndarray:
    """Boxes (n, 6) around boxes under affine matrices (n, 4, 4), by intervals (J. Arvo, Graphics Gems, 1990)."""
    low = matrices[:, :3, 3].copy()
    high = low.copy()
    with np.errstate(invalid="ignore"):
        for axis in range(3):
            factor = matrices[:, :3, axis]
            ends = [np.where(factor == 0.0, 0.0, factor * boxes[:, axis + side, None]) for side in (0, 3)]
            low, high = low + np.minimum(*ends), high + np.maximum(*ends)
    ends_nowhere = (boxes == EVERYTHING).all(axis=1) | is_empty(boxes)
    return np.where(ends_nowhere[:, None], boxes, np.concatenate([low, high], axis=1))


def plane_boxes(planes: np.ndarray) -> np.ndarray:
    """Boxes (n, 6) of half-spaces n . P + d < 0, given as (n, 4): of those along an axis, one side."""
    boxes = np.tile(EVERYTHING, (len(planes), 1))
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
    """Boxes (n, 6) of the insides of quadrics (n, 4, 4), as in `csg.Literals`: of ellipsoids, of cylinders and parallel
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
    boxes = np.tile(EVERYTHING, (len(quadrics), 1))
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


def principal_axes(quadrics: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which of quadrics (n, 4, 4) close around an axis (cylinders, cones, paraboloids do), (n,); and of these the
    matrices (k, 4, 4) from coordinates along their axes.
    """
    values, vectors = np.linalg.eigh(quadrics[:, :3, :3])
    closes = values[:, 1] > FLAT * np.abs(values).max(axis=1)
    turns = np.tile(np.eye(4), (int(closes.sum()), 1, 1))
    turns[:, :3, :3] = vectors[closes]
    return closes, turns


def joint_boxes(boxes: np.ndarray, quadrics: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """Of n solids each what lies in all of its boxes (k, n, 6); where that has no bounds, as far as the surfaces around
    it, insides negative, give it some together: quadrics (q, n, 4, 4) and planes (p, n, 4).
    """
    found = intersected(boxes)
    loose = np.flatnonzero(~is_bounded(found))
    if len(quadrics) and len(loose):
        contracting = found[loose]
        for quadric in (*quadrics, *quadrics):
            contracting = contracted(contracting, quadric[loose])
        found[loose] = contracting
        loose = loose[~is_bounded(contracting)]
    if len(planes) > 3 and len(loose):
        found[loose] = polytope_boxes(planes[:, loose], found[loose])
    return found


def contracted(boxes: np.ndarray, quadrics: np.ndarray) -> np.ndarray:
    """What of boxes (n, 6) may lie inside of quadrics (n, 4, 4), those without mixed terms: q x^2 + 2 l x on each axis
    is at most minus the least that the other axes give (a cone between two planes is so bounded).
    """
    q, linear, centre = np.einsum("nii->ni", quadrics)[:, :3], quadrics[:, :3, 3] / 2.0, quadrics[:, 3, :3]
    mixed = np.abs(quadrics[:, :3, :3] - q[:, :, None] * np.eye(3)).max(axis=(1, 2))
    found = boxes
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        least = _least(q, linear, boxes[:, :3] - centre, boxes[:, 3:] - centre)
        for axis in range(3):
            one, other = (n for n in range(3) if n != axis)
            others = least[:, one] + least[:, other] - quadrics[:, 3, 3]
            square = linear[:, axis] ** 2 - q[:, axis] * others
            bounds = np.tile(EVERYTHING, (len(boxes), 1))
            applies = (q[:, axis] > 0.0) & np.isfinite(others)
            for end, sign in ((axis, -1.0), (axis + 3, 1.0)):
                reach = (-linear[:, axis] + sign * np.sqrt(np.maximum(square, 0.0))) / q[:, axis]
                bounds[applies, end] = (centre[:, axis] + reach)[applies]
            bounds[applies & (square < 0.0)] = EMPTY
            found = intersected(np.stack([found, bounds]))
    unmixed = mixed <= FLAT * np.abs(quadrics[:, :3]).max(axis=(1, 2))
    return np.where(unmixed[:, None], found, boxes)


def _least(q: np.ndarray, linear: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The least values of q x^2 + 2 l x for low <= x <= high."""

    def value(x: np.ndarray, beyond: float) -> np.ndarray:
        return np.where(np.isfinite(x), q * x * x + 2.0 * linear * x, beyond)

    lowest = np.minimum(np.maximum(-linear / q, low), high)
    least = np.where(q > 0.0, value(lowest, inf), np.minimum(value(low, -inf), value(high, -inf)))
    return np.where((q == 0.0) & (linear == 0.0), 0.0, least)


def polytope_boxes(planes: np.ndarray, within: np.ndarray) -> np.ndarray:
    """Boxes (n, 6) around what lies in all half-spaces (p, n, 4), rows (n, d), and in `within` (n, 6), from the corners
    where three planes meet.
    """
    found = within.copy()
    sides = np.isfinite(within)
    # Those that are bounded on the same sides have equally many planes.
    _, pattern = np.unique(sides @ (1 << np.arange(6)), return_inverse=True)
    for number in range(pattern.max(initial=-1) + 1):
        rows = np.flatnonzero(pattern == number)
        every = np.concatenate([planes[:, rows], _sides(within[rows], sides[rows[0]])]).swapaxes(0, 1)
        count = every.shape[1]
        if 4 <= count <= MOST_POLYTOPE_PLANES:
            step = max(1, AT_A_TIME // count**3)
            for first in range(0, len(rows), step):
                mine = rows[first : first + step]
                found[mine] = _around_corners(every[first : first + step], within[mine])
    return found


def _sides(boxes: np.ndarray, is_side: np.ndarray) -> np.ndarray:
    """The half-spaces (k, n, 4) of which n boxes consist that end on the sides where the mask (6,) is true, the high
    ones first.
    """
    order = [side for side in (3, 4, 5, 0, 1, 2) if is_side[side]]
    half_spaces = np.zeros((len(order), len(boxes), 4))
    for half_space, side in zip(half_spaces, order, strict=True):
        sign = 1.0 if side >= 3 else -1.0
        half_space[:, side % 3], half_space[:, 3] = sign, -sign * boxes[:, side]
    return half_spaces


def _around_corners(planes: np.ndarray, within: np.ndarray) -> np.ndarray:
    """Boxes (n, 6) around what lies in all half-spaces (n, p, 4) and in `within`; the latter where that has no end."""
    closed = _surround(planes[:, :, :3])
    lengths = np.linalg.norm(planes[:, :, :3], axis=2, keepdims=True)
    planes = planes / np.where(lengths > 0.0, lengths, 1.0)
    triples = np.array(list(combinations(range(planes.shape[1]), 3)))
    normals, offsets = planes[:, triples, :3], planes[:, triples, 3]
    meets = (np.abs(np.linalg.det(normals)) > 1e-9) & closed[:, None]
    corners = np.zeros((*meets.shape, 3))
    corners[meets] = np.linalg.solve(normals[meets], -offsets[meets][:, :, None])[:, :, 0]
    size = np.maximum(np.abs(corners).max(axis=(1, 2)), 1.0)
    above = corners @ planes[:, :, :3].swapaxes(1, 2) + planes[:, None, :, 3]
    inside = meets & (above <= 1e-9 * size[:, None, None]).all(axis=2)
    low = np.where(inside[:, :, None], corners, inf).min(axis=1)
    high = np.where(inside[:, :, None], corners, -inf).max(axis=1)
    return np.where(closed[:, None], intersected(np.stack([within, np.concatenate([low, high], axis=1)])), within)


def _surround(normals: np.ndarray) -> np.ndarray:
    """Of which half-spaces, their normals (n, p, 3), no direction stays in all: no ray along the lines where two meet
    does.
    """
    first, second = np.array(list(combinations(range(normals.shape[1]), 2))).T
    lines = np.cross(normals[:, first], normals[:, second])
    lengths = np.linalg.norm(lines, axis=2, keepdims=True)
    meet = lengths[:, :, 0] > 1e-9
    lines = lines / np.where(lengths > 1e-9, lengths, 1.0)
    rises = lines @ normals.swapaxes(1, 2)
    stays = meet & ((rises <= 1e-9).all(axis=2) | (rises >= -1e-9).all(axis=2))
    return (np.linalg.matrix_rank(normals) == 3) & ~stays.any(axis=1)
