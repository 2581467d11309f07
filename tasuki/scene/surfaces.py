"""The surfaces of all literals, placed in the scene in float64, and those that are one surface merged.

Surfaces that coincide must be crossed at one t, whatever matrices brought them there. So every plane and quadric gets
a canonical number; what lies within `TOLERANCE` of another, relative to the size of the smaller of what they bound,
shares its number, and a literal is a surface and a side of it. Only the faces of one solid are never one surface,
however thin it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.scene.csg import PLANE, QUADRIC, Leaf, negated
from tasuki.scene.kinds import UNIT_MATRIX

TOLERANCE = 2.0**-20
"""Of the size of what is bounded, and of a unit normal: what float32 cannot tell apart along a ray."""
ROUNDING = 2.0**-40
"""Of the largest coordinate, and of a unit normal: what float64 leaves between surfaces of one solid that coincide."""


@dataclass(frozen=True)
class Placed:
    """Surfaces of one kind, in the scene's coordinates: `values` (n, 4) or (n, 4, 4) as in `Leaf`, float64."""

    values: np.ndarray

    def records(self, records: np.ndarray, rows: np.ndarray, origin: np.ndarray) -> np.ndarray:
        """`records`, (k,), with the equations of the surfaces `rows` filled in, for points that count from `origin`."""
        values = self.values[rows]
        if values.ndim == 2:
            records["normal"], records["d"] = values[:, :3], values[:, 3] + values[:, :3] @ origin
            return records
        values[:, 3, :3] -= origin
        return _quadric_records(records, values)


@dataclass(frozen=True)
class Merged:
    """`first[k]` is the row of the surface that stands for canonical surface k; `number` (n,) is that of each row, and
    `turned` (n,) tells where its inside is the other's outside; `thin` (n,) what is so near another face of its solid
    that its measure alone would have merged them.
    """

    first: np.ndarray
    number: np.ndarray
    turned: np.ndarray
    thin: np.ndarray


@dataclass(frozen=True)
class Measures:
    """What surfaces bound: `sizes` (n,), the largest coordinate in `reach` (n,), and the number of the solid whose
    face each is, `solids` (n,).
    """

    sizes: np.ndarray
    reach: np.ndarray
    solids: np.ndarray


def placed(leaves: Sequence[Leaf], kind: str, inverses: np.ndarray, matrices: np.ndarray) -> Placed:
    """The surfaces of `leaves`, all of `kind`; `matrices` (n, 4, 4) are their own, to the scene, and `inverses` back.

    Normals and Q go by the transpose of the inverse. SceneError where numbers are too large or too small for that.
    """
    shape = (-1, 4) if kind == PLANE else (-1, 4, 4)
    values = np.array([leaf.values for leaf in leaves], np.float64).reshape(shape)
    with np.errstate(all="ignore"):
        if kind == PLANE:
            values = np.einsum("nji,nj->ni", inverses, values)
            values = values / np.linalg.norm(values[:, :3], axis=1, keepdims=True)
        else:
            values = _placed_quadrics(values, inverses[:, :3, :3], matrices)
    finite = np.isfinite(values).reshape(len(values), -1).all(axis=1)
    for number in np.flatnonzero(~finite)[:1]:
        expected = "sizes and places whose squares are within the range of float64"
        raise SceneError(str(Diagnostic("this solid cannot be placed", leaves[number].place, expected, "infinity")))
    return Placed(_cleaned(values, kind))


def _placed_quadrics(values: np.ndarray, inverses: np.ndarray, matrices: np.ndarray) -> np.ndarray:
    """Quadrics (n, 4, 4) in the scene's coordinates, their largest |Q| 1. `inverses` (n, 3, 3)."""
    found = np.empty_like(values)
    found[:, :3, :3] = np.einsum("nji,njk,nkl->nil", inverses, values[:, :3, :3], inverses)
    found[:, :3, 3] = np.einsum("nji,nj->ni", inverses, values[:, :3, 3])
    found[:, 3, 3] = values[:, 3, 3]
    largest = np.abs(found[:, :3, :3]).max(axis=(1, 2))
    # Without Q it is a plane, in an equation that Q is no measure of.
    found /= np.where(largest > 0.0, largest, np.linalg.norm(found[:, :3, 3], axis=1))[:, None, None]
    found[:, 3, :3] = np.einsum("nij,nj->ni", matrices[:, :3, :3], values[:, 3, :3]) + matrices[:, :3, 3]
    return found


def _cleaned(values: np.ndarray, kind: str) -> np.ndarray:
    """Without what rounding alone left of normals' components and of Q: a turn by 90 degrees is one."""
    part = values[:, :3] if kind == PLANE else values[:, :3, :3]
    part[np.abs(part) < 1e-14] = 0.0
    return values


def merged_planes(planes: np.ndarray, measures: Measures) -> Merged:
    """Planes (n, 4) with unit normals, merged."""
    turned = _signs(planes[:, :3]) < 0.0
    planes = np.where(turned[:, None], -planes, planes)
    return _merged(planes[:, :3], planes[:, 3:], measures, turned)


def merged_quadrics(quadrics: np.ndarray, measures: Measures) -> Merged:
    """Quadrics (n, 4, 4), their largest |Q| 1, merged: alike in Q, middle, opening, and the root of the constant."""
    turned = _signs(np.array([q[np.triu_indices(3)] for q in quadrics[:, :3, :3]]).reshape(-1, 6)) < 0.0
    quadrics = np.where(turned[:, None, None], negated(quadrics), quadrics)
    middle, opening, constant = completed(quadrics, np.zeros(3))
    lengths = np.sign(constant) * np.sqrt(np.abs(constant))
    upper = quadrics[:, *np.triu_indices(3)]
    return _merged(upper, np.column_stack([middle, opening, lengths]), measures, turned)


def completed(quadrics: np.ndarray, near: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """p, l, r of (P-p)^T Q (P-p) + l . (P-p) = r, for quadrics (n, 4, 4) as in `Leaf`: p the nearest to `near` of all
    middles.

    Where a linear term remains (a paraboloid), p moves along it until r is 0. All is found about the p that is given,
    and moved from there only along what leaves the equation as it is.
    """
    q, linear, given = quadrics[:, :3, :3], quadrics[:, :3, 3] / 2.0, quadrics[:, 3, :3]
    values, axes = np.linalg.eigh(q)
    free = np.abs(values) <= 1e-12 * np.abs(values).max(axis=1, initial=0.0, keepdims=True)
    inverse = np.einsum("nij,nj,nkj->nik", axes, np.where(free, 0.0, 1.0 / np.where(free, 1.0, values)), axes)
    middle = -np.einsum("nij,nj->ni", inverse, linear)
    rest = np.einsum("nij,nj->ni", q, middle) + linear
    scale = np.abs(linear).max(axis=1, initial=0.0) + np.abs(middle).max(axis=1, initial=0.0)
    rest[np.abs(rest) <= 1e-12 * scale[:, None]] = 0.0
    constant = quadrics[:, 3, 3] - np.einsum("ni,ni->n", middle, np.einsum("nij,nj->ni", q, middle) + 2.0 * linear)
    square = np.einsum("ni,ni->n", rest, rest)
    opens = square > 0.0
    square = np.where(opens, square, 1.0)
    middle = middle + np.where(opens, constant / (2.0 * square), 0.0)[:, None] * rest
    # Along the axes that Q leaves free, but not along the linear term.
    away = np.einsum("nij,nj,nkj,nk->ni", axes, free.astype(float), axes, near - given - middle)
    away = away - (np.einsum("ni,ni->n", away, rest) / square)[:, None] * rest
    return given + middle + away, 2.0 * rest, np.where(opens, 0.0, constant)


def _signs(values: np.ndarray) -> np.ndarray:
    """The sign of the first of each row's values that is more than rounding: it does not change under small errors."""
    first = (np.abs(values) > 1e-3).argmax(axis=1)
    return np.sign(values[np.arange(len(values)), first])


def _merged(ratios: np.ndarray, lengths: np.ndarray, measures: Measures, turned: np.ndarray) -> Merged:
    """Rows (n, ...) whose ratios are all within TOLERANCE of each other, and their lengths within that of the lesser
    of their sizes, directly or from neighbour to neighbour.

    Where faces of one solid are among them, what lies between those is the measure.
    """
    features = np.column_stack([ratios, lengths])
    allowed, rounding = (
        share * np.column_stack([np.ones_like(ratios), np.broadcast_to(measure[:, None], lengths.shape)])
        for share, measure in ((TOLERANCE, measures.sizes), (ROUNDING, measures.reach))
    )
    thin = np.zeros(len(features), bool)
    number = _classes(features, allowed)
    rows, gaps = _own_faces(features, number, measures.solids, rounding)
    while len(rows):
        thin[rows] = True
        least = np.full((number.max() + 1, features.shape[1]), np.inf)
        np.minimum.at(least, number[rows], gaps)
        finer = np.minimum(allowed / 2.0, least[number] / 8.0)
        allowed = np.where(np.isfinite(least[number]), finer, allowed)
        number = _classes(features, allowed)
        rows, gaps = _own_faces(features, number, measures.solids, rounding)
    _, first, number = np.unique(number, return_index=True, return_inverse=True)
    by_place = np.argsort(first)
    number = np.argsort(by_place)[number]
    first = first[by_place]
    return Merged(first, number, turned != turned[first[number]], thin)


def _classes(features: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """The class of each row, (n,): along each feature in turn the rows of a class are parted where they leave a gap
    larger than is `allowed`, (n, ...); until no class has one.
    """
    number = np.zeros(len(features), np.int64)
    count = 0
    while len(features) and number.max() + 1 > count:
        count = number.max() + 1
        for column, tolerance in zip(features.T, allowed.T, strict=True):
            order = np.lexsort((column, number))
            gaps = np.diff(column[order]) > np.minimum(tolerance[order][1:], tolerance[order][:-1])
            parted = np.concatenate([[0], np.cumsum(gaps | (np.diff(number[order]) != 0))])
            number[order] = parted
    return number


def _own_faces(
    features: np.ndarray, number: np.ndarray, solids: np.ndarray, rounding: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The rows (k,) which are in one class with another row of their solid that differs by more than `rounding`; and by
    how much, (k, ...), infinite where a feature is the same.
    """
    shared = np.flatnonzero(np.bincount(number)[number] > 1) if len(number) else number
    order = shared[np.lexsort((solids[shared], number[shared]))]
    own = (number[order[1:]] == number[order[:-1]]) & (solids[order[1:]] == solids[order[:-1]])
    pairs = np.stack([order[1:][own], order[:-1][own]])
    gaps = np.abs(features[pairs[0]] - features[pairs[1]])
    differ = gaps > rounding[pairs[0]]
    apart = differ.any(axis=1)
    gaps = np.where(differ, gaps, np.inf)[apart]
    return pairs[:, apart].reshape(-1), np.concatenate([gaps, gaps])


def _quadric_records(records: np.ndarray, quadrics: np.ndarray) -> np.ndarray:
    """`records` with the equations of `quadrics` (n, 4, 4), the square completed; spheres are flagged."""
    middle, linear, constant = completed(quadrics, quadrics[:, 3, :3])
    q = quadrics[:, :3, :3]
    is_sphere = np.abs(q - np.eye(3)).max(axis=(1, 2), initial=0.0) < 1e-12
    records["centre"], records["constant"] = middle, constant
    for column in range(3):
        records[f"q{column + 1}"] = q[:, :, column]
        records[f"l{column + 1}"] = linear[:, column]
    records["flags"] = np.where(is_sphere & (linear == 0.0).all(axis=1), UNIT_MATRIX, 0)
    return records


def kinds_of(leaves: Sequence[Leaf]) -> dict[str, np.ndarray]:
    """Which leaves are of which kind: their indices, by kind, planes and quadrics first."""
    kinds = [leaf.kind for leaf in leaves]
    names = sorted(set(kinds), key=lambda name: (name != PLANE, name != QUADRIC, name))
    every = np.array(kinds, dtype=object)
    return {name: np.flatnonzero(every == name) for name in names}
