"""The literals of a scene's formulas in their places: boxes around them, and the tables of their surfaces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tasuki.scene import surfaces
from tasuki.scene.bounds import EVERYTHING, plane_boxes, quadric_boxes, transformed
from tasuki.scene.csg import PLANE, QUADRIC, Literal, Literals, negated
from tasuki.scene.kinds import PrimitiveKind, lookup

FAR = 1.0e30
"""What stands for infinity in a box."""


class Placing:
    """`literals` placed by `frames` (k, 4, 4) in the scene. Planes and quadrics are `placed` in its coordinates; solids
    of users' kinds stay in their own, and have boxes by their own modules.
    """

    def __init__(self, literals: Literals, frames: np.ndarray) -> None:
        names = [literals.kinds[number] for number in np.unique(literals.kind)]
        names.sort(key=lambda name: (name != PLANE, name != QUADRIC, name))
        self.literals = literals
        self.frames = frames
        self.kinds = [lookup(name) for name in names]
        self.rows = {name: literals.of_kind(name) for name in names}
        self.placed = {name: surfaces.placed(literals, name, frames) for name in names if not is_local(name)}
        self._kept = {kind.name: self._records(kind) for kind in self.kinds if is_local(kind.name)}
        self._local_boxes = {
            kind.name: np.array([local_box(kind, record) for record in self._kept[kind.name]])
            for kind in self.kinds
            if is_local(kind.name)
        }

    @cached_property
    def position(self) -> np.ndarray:
        """The place of each literal among those of its kind, (n,)."""
        position = np.empty(len(self.literals), np.int32)
        for rows in self.rows.values():
            position[rows] = np.arange(len(rows))
        return position

    def boxes(self, rows: np.ndarray) -> np.ndarray:
        """Of the surfaces of the literals `rows`, (n,), the boxes (4, n, 6) around their insides and outsides, in the
        scene's coordinates, then in their own.
        """
        found = np.empty((4, len(rows), 6))
        for name in self.rows:
            here = np.flatnonzero(self.literals.kind[rows] == self.literals.kinds.index(name))
            position = self.position[rows[here]]
            if is_local(name):
                local = self._local_boxes[name][position]
                around = transformed(local, self.frames[self.literals.frame[rows[here]]])
                four = [around, EVERYTHING, local, EVERYTHING]
            else:
                find = plane_boxes if name == PLANE else quadric_boxes
                placed, own = self.placed[name].values[position], self.literals.values_of(name, rows[here])
                four = [find(values) for values in (placed, negated(placed, name), own, negated(own, name))]
            for number, boxes in enumerate(four):
                found[number, here] = boxes
        return found

    def merged(self, around: np.ndarray, size: float) -> dict[str, surfaces.Merged]:
        """Of planes and quadrics those surfaces merged that coincide in a scene of `size`, where what literals bound is
        within the boxes `around` (n, 6).
        """
        merge = {PLANE: surfaces.merged_planes, QUADRIC: surfaces.merged_quadrics}
        found = {}
        for name, placed in self.placed.items():
            rows = self.rows[name]
            found[name] = merge[name](placed.values, measures(around[rows], size, self.literals.solid[rows]))
        return found

    def canonical(self, merged: Mapping[str, surfaces.Merged], row: int) -> np.ndarray:
        """The coefficients of a literal that is a plane or quadric: the same for all literals whose surfaces are
        `merged`, but for the sign.
        """
        name = self.literals.kinds[self.literals.kind[row]]
        position, mine = self.position[row], merged[name]
        values = self.placed[name].values[mine.first[mine.number[position]]]
        return negated(values, name) if mine.turned[position] else values

    def tables(self, merged: Mapping[str, surfaces.Merged], origin: np.ndarray, standing: Mapping[str, int]) -> Coded:
        """The surfaces in memory, for coordinates that count from `origin`; `standing` says how many primitives of each
        kind, by name, come before them.
        """
        tables = {}
        codes, turned, thin = (np.zeros(len(self.literals), dtype) for dtype in (np.int64, bool, bool))
        for kind in self.kinds:
            rows, first = self.rows[kind.name], standing.get(kind.name, 0)
            if kind.name in self._kept:
                codes[rows] = (first + np.arange(len(rows))) * 32 + kind.number
                tables[kind.table_name] = self._kept[kind.name]
                continue
            mine = merged[kind.name]
            codes[rows], turned[rows] = (first + mine.number) * 32 + kind.number, mine.turned
            thin[rows] = mine.thin
            records = np.zeros(len(mine.first), kind.record.numpy_dtype())
            records["kind"], records["attribute"], records["matrix"] = kind.number, 0, -1
            tables[kind.table_name] = self.placed[kind.name].records(records, mine.first, origin)
        return Coded(tables, codes, turned, thin)

    def _records(self, kind: PrimitiveKind) -> np.ndarray:
        """The records of all solids of a user's kind."""
        rows = self.rows[kind.name]
        records = np.zeros(len(rows), kind.record.numpy_dtype())
        records["kind"], records["matrix"] = kind.number, self.literals.frame[rows]
        fields: Any = self.literals.values[self.literals.kinds.index(kind.name)]
        for record, index in zip(records, self.literals.index[rows].tolist(), strict=True):
            for name, value in fields[index].items():
                record[name] = value
        return records


@dataclass(frozen=True)
class Coded:
    """The `tables` of all kinds of surfaces, by name; of each literal the code (n,) of its surface, whether its inside
    is the surface's outside, `turned` (n,), and `thin` (n,) as in `surfaces.Merged`.
    """

    tables: Mapping[str, np.ndarray]
    codes: np.ndarray
    turned: np.ndarray
    thin: np.ndarray


class PlacedLiterals:
    """The literals of n formulas of one form (`tasuki.scene.formula.Placed`): `rows` (k, n) of them, and what
    `Placing.boxes` has of these, (4, k, n, 6).
    """

    def __init__(self, placing: Placing, rows: np.ndarray, boxes: np.ndarray) -> None:
        self.placing = placing
        self.rows = rows
        self._boxes = boxes

    def boxes(self, literal: Literal) -> np.ndarray:
        found = self._boxes[:, literal.number]
        return found[[1, 0, 3, 2]] if literal.inverted else found

    def surfaces(self, literals: Sequence[Literal]) -> np.ndarray:
        rows = self.rows[[literal.number for literal in literals]]
        return self.placing.literals.values_of(literals[0].kind, rows)

    def positions(self, literal: Literal) -> np.ndarray:
        """The places of one of them among all literals of its kind, (n,)."""
        return self.placing.position[self.rows[literal.number]]

    def matrices(self, literal: Literal) -> np.ndarray:
        return self.placing.frames[self.placing.literals.frame[self.rows[literal.number]]]


def is_local(kind: str) -> bool:
    """Whether solids of a kind stay in their own coordinates."""
    return kind not in (PLANE, QUADRIC)


def measures(boxes: np.ndarray, size: float, solids: np.ndarray) -> surfaces.Measures:
    """Of surfaces that bound what is within `boxes` (n, 6), in a scene of `size`, faces of the `solids` (n,).

    In a large scene small things keep their own measure; what has no bounds has the scene's.
    """
    reach = np.abs(np.where(np.isfinite(boxes), boxes, size)).max(axis=1, initial=0.0)
    return surfaces.Measures(np.minimum((boxes[:, 3:] - boxes[:, :3]).max(axis=1, initial=0.0), size), reach, solids)


def local_box(kind: PrimitiveKind, record: np.void) -> np.ndarray:
    """The box (6,) around one primitive of a user's kind, by its own module run as plain Python."""
    fields = {name: _plain(record[name]) for name in record.dtype.names or ()}
    low, high = kind.resolve("box")(kind.record(**fields))
    return np.array([value if abs(value) < FAR else np.copysign(np.inf, value) for value in (*low, *high)], np.float64)


def _plain(value: Any) -> Any:
    return tuple(value.tolist()) if value.ndim else value.item()
