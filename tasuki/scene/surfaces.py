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
from tasuki.scene.csg import PLANE, QUADRIC, Literals, negated
from tasuki.scene.kinds import UNIT_MATRIX

TOLERANCE = 2.0**-20
"""Of the size of what is bounded, and of a unit normal: what float32 cannot tell apart along a ray."""


ROUNDING = 2.0**-40
"""Of the largest coordinate, and of a unit normal: what float64 leaves between surfaces of one solid that coincide."""
AT_A_TIME = 1 << 16
"""Surfaces that are placed in one go: a bound on the memory for their matrices."""


@dataclass(frozen=True)
class Placed:
    """Surfaces of one kind, in the scene's coordinates: `values` (n, 4) or (n, 4, 4) as in `Literals`, float64."""

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


def placed(literals: Literals, kind: str, frames: np.ndarray) -> Placed:
    """The surfaces of all planes, or quadrics, among the literals; `frames` (k, 4, 4) place their coordinates in the
    scene's.

    Normals and Q go by the transpose of the inverse. SceneError where numbers are too large or too small for that.
    """
    rows, inverses = literals.of_kind(kind), np.linalg.inv(frames)
    values, frame = literals.values_of(kind, rows), literals.frame[rows]
    for first in range(0, len(rows), AT_A_TIME):
        here = slice(first, first + AT_A_TIME)
        with np.errstate(all="ignore"):
            if kind == PLANE:
                values[here] = _placed_planes(values[here], inverses[frame[here]])
            else:
                values[here] = _placed_quadrics(values[here], inverses[frame[here], :3, :3], frames[frame[here]])
        finite = np.isfinite(values[here]).reshape(len(values[here]), -1).all(axis=1)
        for number in np.flatnonzero(~finite)[:1]:
            expected = "sizes and places whose squares are within the range of float64"
            place = literals.place(rows[first + number])
            raise SceneError(str(Diagnostic("this solid cannot be placed", place, expected, "infinity")))
    return Placed(_cleaned(values, kind))


def _placed_planes(values: np.ndarray, inverses: np.ndarray) -> np.ndarray:
    """Planes (n, 4) in the scene's coordinates, with unit normals. `inverses` (n, 4, 4)."""
    values = np.einsum("nji,nj->ni", inverses, values)
    return values / np.linalg.norm(values[:, :3], axis=1, keepdims=True)


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
    turned = _signs(quadrics[:, *np.triu_indices(3)]) < 0.0
    quadrics = np.where(turned[:, None, None], negated(quadrics, QUADRIC), quadrics)
    middle, opening, constant = completed(quadrics, np.zeros(3))
    lengths = np.sign(constant) * np.sqrt(np.abs(constant))
    upper = quadrics[:, *np.triu_indices(3)]
    return _merged(upper, np.column_stack([middle, opening, lengths]), measures, turned)


def completed(quadrics: np.ndarray, near: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """p, l, r of (P-p)^T Q (P-p) + l . (P-p) = r, for quadrics (n, 4, 4) as in `Literals`: p the nearest to `near` of
    all middles.

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
    features = [*ratios.T, *lengths.T]
    ones, sizes = np.broadcast_to(1.0, len(turned)), measures.sizes * TOLERANCE
    allowed = [np.broadcast_to(TOLERANCE, len(turned))] * ratios.shape[1] + [sizes] * lengths.shape[1]
    reach = [ones] * ratios.shape[1] + [measures.reach] * lengths.shape[1]
    thin = np.zeros(len(turned), bool)
    number = _classes(features, allowed)
    rows, gaps = _own_faces(features, number, measures.solids, reach)
    while len(rows):
        thin[rows] = True
        least = np.full((len(turned), len(features)), np.inf)
        np.minimum.at(least, number[rows], gaps)
        least = least[number]
        finer = zip(allowed, least.T, strict=True)
        allowed = [np.where(np.isfinite(gap), np.minimum(wide / 2.0, gap / 8.0), wide) for wide, gap in finer]
        number = _classes(features, allowed)
        rows, gaps = _own_faces(features, number, measures.solids, reach)
    first = np.flatnonzero(number == np.arange(len(number)))
    number = np.searchsorted(first, number)
    return Merged(first, number, turned != turned[first[number]], thin)


def _classes(features: Sequence[np.ndarray], allowed: Sequence[np.ndarray]) -> np.ndarray:
    """The class of each row, called by its first row, (n,): along each feature (n,) in turn the rows of a class are
    parted where they leave a gap larger than is `allowed`, (n,); until no class has one.
    """
    number, rows = np.zeros(len(features[0]), np.intp), np.arange(len(features[0]))
    whole = 0
    while len(rows) and whole < len(features):
        for column, tolerance in zip(features, allowed, strict=True):
            rows, is_parted = _parted(number, rows, column[rows], tolerance[rows])
            whole = 0 if is_parted else whole + 1
    return number


def _parted(
    number: np.ndarray, rows: np.ndarray, column: np.ndarray, tolerance: np.ndarray
) -> tuple[np.ndarray, bool]:
    """Part the classes of `rows`, called by `number`, where their values in `column` leave a gap: those of `rows` that
    are not alone in their class then, and whether any class was parted.
    """
    order = np.lexsort((column, number[rows]))
    column, tolerance, here = column[order], tolerance[order], rows[order]
    gaps = np.diff(column, prepend=-np.inf) > np.minimum(tolerance, np.append(np.inf, tolerance[:-1]))
    others = np.diff(number[here], prepend=-1) != 0
    first = np.flatnonzero(gaps | others)
    sizes = np.diff(first, append=len(here))
    if len(first):
        number[here] = np.repeat(np.minimum.reduceat(here, first), sizes)
    together = np.zeros(len(rows), bool)
    together[order] = np.repeat(sizes > 1, sizes)
    return rows[together], bool((gaps & ~others).any())


def _own_faces(
    features: Sequence[np.ndarray], number: np.ndarray, solids: np.ndarray, reach: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """The rows (k,) which are in one class with another row of their solid that differs by more than rounding, a share
    of `reach`; and by how much, (k, ...), infinite where a feature is the same.
    """
    shared = np.flatnonzero(np.bincount(number)[number] > 1) if len(number) else number
    order = shared[np.lexsort((solids[shared], number[shared]))]
    own = (number[order[1:]] == number[order[:-1]]) & (solids[order[1:]] == solids[order[:-1]])
    one, other = order[1:][own], order[:-1][own]
    gaps = np.column_stack([np.abs(column[one] - column[other]) for column in features])
    differ = gaps > ROUNDING * np.column_stack([column[one] for column in reach])
    apart = differ.any(axis=1)
    gaps = np.where(differ, gaps, np.inf)[apart]
    return np.concatenate([one[apart], other[apart]]), np.concatenate([gaps, gaps])


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
