"""Objects in memory: their formulas as tokens, the surfaces of these, boxes, matrices, and the media they make.

The order of work: formulas are normalised; the surfaces of all literals are placed and merged; boxes are found from
them; tokens are written.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from tasuki.scene import surfaces
from tasuki.scene.bounds import EMPTY, EVERYTHING, Box, plane_boxes, quadric_boxes, transformed
from tasuki.scene.csg import PLANE, QUADRIC, Leaf, negated
from tasuki.scene.formula import INVERTED, Tokens, around_literals, literals, normalised, with_boxes
from tasuki.scene.kinds import OBJECT, PrimitiveKind, lookup, record_dtype
from tasuki.scene.material import Material

if TYPE_CHECKING:
    from tasuki.scene.flatten import FlatObject

TWO_SIDED = 1
UNION = 8
SHEET = 16
"""Flags of an object, as `tasuki.modules.records` gives them."""
FAR = 1.0e30
"""What stands for infinity in a box."""
SLACK = 2.0**-20
"""Of the scene's size: by how much boxes in formulas are widened, for the rounding of the slab test."""
COST, DEAREST = 2.0, 64
"""What a literal costs to intersect, in units of a triangle's; and beyond how many literals a formula costs no more."""


def _address(matrix: np.ndarray) -> int:
    return matrix.__array_interface__["data"][0]


class Matrices:
    """The matrices of local coordinates, those of the flat scene's `frames` (k, 4, 4) first, in their order.

    Each is kept once, by where it lies. Row k of the table is the inverse of the k-th.
    """

    def __init__(self, frames: np.ndarray) -> None:
        self.kept = list(frames)
        self._by_identity: dict[int, int] = {}
        self._by_address = {_address(matrix): number for number, matrix in enumerate(self.kept)}

    def number(self, matrix: np.ndarray) -> int:
        """The number of a matrix from local coordinates to those of the scene."""
        number = self._by_identity.get(id(matrix))
        if number is None:
            number = self._by_address.setdefault(_address(matrix), len(self.kept))
            if number == len(self.kept):
                self.kept.append(matrix)
            self._by_identity[id(matrix)] = number
        return number

    def to_scene(self) -> np.ndarray:
        """All of them, (n, 4, 4)."""
        return np.array(self.kept, np.float64).reshape(-1, 4, 4)

    def records(self, origin: np.ndarray) -> np.ndarray:
        """The table "matrices", for coordinates that count from `origin`."""
        records = np.zeros(len(self.kept), record_dtype("Matrix"))
        matrices = self.to_scene()
        matrices[:, :3, 3] -= origin
        with np.errstate(over="ignore"):
            records["m"] = np.linalg.inv(matrices)
        return records


@dataclass(frozen=True)
class Objects:
    """The tables of a scene's objects, by name: "objects", "tokens", "bounds", and the records of every kind of solid
    in `operands`. `numbers[i]` is the number of the object in row i, and `boxes` (n, 6) and `costs` (n,) are those of
    the rows. Of the surfaces of all `literals`, `merged` are one with another. `thin`: the numbers of objects with
    solids so thin for their size that from afar float32 cannot tell their faces apart.
    """

    tables: Mapping[str, np.ndarray]
    operands: tuple[PrimitiveKind, ...]
    numbers: np.ndarray
    boxes: np.ndarray
    costs: np.ndarray
    literals: int
    merged: int
    thin: np.ndarray

    @property
    def count(self) -> int:
        """How many objects there are in memory."""
        return len(self.numbers)


@dataclass(frozen=True)
class Faces:
    """Planes of objects' literals: `planes` (n, 4), their normals outward; `boxes` (n, 6) around what each bounds, of
    infinite sides where nothing does; and whether they show from both sides, `two_sided` (n,).
    """

    planes: np.ndarray
    boxes: np.ndarray
    two_sided: np.ndarray

    def take(self, rows: np.ndarray) -> Faces:
        """Those of the `rows`, (k,), in that order."""
        return Faces(self.planes[rows], self.boxes[rows], self.two_sided[rows])

    def joined(self, others: Faces) -> Faces:
        """These, and behind them the `others`."""
        names = [one.name for one in fields(self)]
        return Faces(**{name: np.concatenate([getattr(self, name), getattr(others, name)]) for name in names})


class Formulas:
    """The formulas of `objects`, with boxes, in the scene's coordinates.

    `numbers[i]` is the number of the i-th that is kept: opaque ones first, since where both are met at one t, what is
    opaque shows. What is empty, or everything, is left out; `left_out` has the numbers. `boxes` (n, 6) are around those
    that are kept.
    """

    def __init__(self, objects: Sequence[FlatObject], materials: Sequence[Material], matrices: Matrices) -> None:
        self.objects = objects
        self.materials = materials
        transparent = np.array([materials[one.material].transmission > 0.0 for one in objects], bool)
        order = np.argsort(transparent, kind="stable").tolist()
        roots = [normalised(objects[number].root) for number in order]
        leaves: list[Leaf] = []
        # How many leaves the formulas have, up to and with each.
        self._leaves_until: list[int] = []
        for root in roots:
            leaves += [part.leaf for part in literals(root) if part.leaf]
            self._leaves_until.append(len(leaves))
        self._order = np.array(order, np.intp)
        self.placing = _Placing(leaves, matrices)
        whole = [with_boxes(root, self.placing.boxes) for root in roots]
        sheets = [row for row, number in enumerate(order) if objects[number].sheet is not None]
        for row in sheets:
            whole[row].box = objects[order[row]].sheet.box  # type: ignore[union-attr]
        self.placing.surround([pair for root in whole for pair in around_literals(root)])
        kept = [row for row, root in enumerate(whole) if EMPTY not in (root.box, root.gap)]
        self.roots = [whole[row] for row in kept]
        self.numbers = np.array([order[row] for row in kept], np.intp)
        self.left_out = sorted(set(order) - set(self.numbers.tolist()))
        self.boxes = np.array([root.box for root in self.roots]).reshape(-1, 6)
        for box, number in zip(self.boxes, self.numbers, strict=True):
            if isinstance(objects[number].extent, tuple):
                centre, radius = np.array(objects[number].extent[0]), objects[number].extent[1]
                box[:3], box[3:] = np.maximum(box[:3], centre - radius), np.minimum(box[3:], centre + radius)

    def faces(self) -> Faces:
        """The planes of all literals."""
        rows, planes, boxes = self.placing.planes()
        sides = np.array([self.materials[one.material].shows_both_sides() for one in self.objects], bool)
        return Faces(planes, boxes, sides[self._owners(rows)])

    def _owners(self, leaves: np.ndarray) -> np.ndarray:
        """The numbers of the objects to which leaves belong, given their rows."""
        return self._order[np.searchsorted(self._leaves_until, leaves, side="right")]

    def lower(self, origin: np.ndarray, size: float, standing: Mapping[str, int]) -> Objects:
        """The tables, for coordinates that count from `origin`, of a scene of `size`, the camera's place included.

        `standing`: how many primitives of each kind, by name, stand alone, and so before the literals' surfaces.
        """
        surfaces_, merged = self.placing.lower(origin, size, standing)
        tokens = Tokens()
        spans = [tokens.write(root, lambda leaf: leaf.kind not in (PLANE, QUADRIC)) for root in self.roots]
        boxes = self.boxes - np.tile(origin, 2)
        tables = {
            "objects": self._records(spans, boxes),
            "tokens": _token_records(tokens, self.placing),
            "bounds": _bounds_records(tokens.bounds, origin, SLACK * size),
            **surfaces_,
        }
        costs = COST * np.minimum([len(literals(root)) for root in self.roots], DEAREST).astype(np.float32)
        thin = np.unique(self._owners(np.flatnonzero(self.placing.thin)))
        kinds, count = tuple(self.placing.kinds), len(self.placing.row)
        return Objects(tables, kinds, self.numbers, boxes, costs, count, merged, thin)

    def _records(self, spans: Sequence[tuple[int, int]], boxes: np.ndarray) -> np.ndarray:
        records = np.zeros(len(spans), record_dtype("Object"))
        media = [self.objects[number].material for number in self.numbers]
        sides = np.array([self.materials[medium].shows_both_sides() for medium in media], bool)
        unions = np.array([root.is_union for root in self.roots], bool)
        records["kind"], records["attribute"], records["matrix"] = OBJECT, media, -1
        records["flags"] = np.where(sides, TWO_SIDED, 0) + np.where(unions, UNION, 0)
        for row, number in enumerate(self.numbers.tolist()):
            if sheet := self.objects[number].sheet:
                records["flags"][row] = SHEET + TWO_SIDED * sheet.two_sided
        records["first"], records["end"] = np.array(spans, np.int32).reshape(-1, 2).T
        records["low"], records["high"] = np.clip(boxes[:, :3], -FAR, FAR), np.clip(boxes[:, 3:], -FAR, FAR)
        return records


class _Placing:
    """The leaves of all formulas in the scene: of each the boxes around it, and at last its surface's code."""

    def __init__(self, leaves: Sequence[Leaf], matrices: Matrices) -> None:
        self.row = {id(leaf): row for row, leaf in enumerate(leaves)}
        self.matrix = np.array([matrices.number(leaf.matrix) for leaf in leaves], np.int64)
        self.inverted = np.array([leaf.inverted for leaf in leaves], bool)
        # The leaves of one solid stand together.
        nodes = np.array([id(leaf.solid) for leaf in leaves], np.int64)
        alone = (nodes == id(None)) | (np.diff(nodes, prepend=0) != 0) | (np.diff(self.matrix, prepend=-1) != 0)
        self.solids = np.cumsum(alone)
        self.thin = np.zeros(len(leaves), bool)
        self.codes = np.zeros(len(leaves), np.int64)
        self.turned = np.zeros(len(leaves), bool)
        self.rows = surfaces.kinds_of(leaves)
        self.kinds = [lookup(name) for name in self.rows]
        self.placed: dict[str, surfaces.Placed] = {}
        self.kept: dict[str, np.ndarray] = {}
        # Of each leaf four boxes, (n, 4, 6), as `formula.LeafBoxes` has them.
        self._boxes = np.empty((len(leaves), 4, 6))
        self._around = np.tile(np.array(EVERYTHING), (len(leaves), 1))
        to_scene = matrices.to_scene()
        inverses = np.linalg.inv(to_scene)
        for kind in self.kinds:
            rows = self.rows[kind.name]
            mine, numbers = [leaves[row] for row in rows], self.matrix[rows]
            if kind.name in (PLANE, QUADRIC):
                self.placed[kind.name] = surfaces.placed(mine, kind.name, inverses[numbers], to_scene[numbers])
                self._find_boxes(kind, mine)
            else:
                self._keep(kind, mine, to_scene[numbers])

    def boxes(self, leaf: Leaf) -> tuple[Box, Box, Box, Box]:
        """As `formula.LeafBoxes` says."""
        box, gap, local_box, local_gap = map(tuple, self._boxes[self.row[id(leaf)]].tolist())
        return box, gap, local_box, local_gap

    def placed_surfaces(self, size: float) -> Callable[[Leaf], np.ndarray]:
        """What gives the coefficients of a plane or quadric in a scene of `size`, as in `Leaf.values`: the same for all
        leaves whose surfaces are merged, but for the sign.
        """
        classes = {name: self._classes(name, size) for name in self.placed}
        places = {name: {row: place for place, row in enumerate(self.rows[name].tolist())} for name in self.placed}

        def surface(leaf: Leaf) -> np.ndarray:
            place, mine = places[leaf.kind][self.row[id(leaf)]], classes[leaf.kind]
            values = self.placed[leaf.kind].values[mine.first[mine.number[place]]]
            return negated(values) if mine.turned[place] else values

        return surface

    def planes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of the leaves that are planes: their rows (n,), the planes (n, 4) with what is OUT before them, and the boxes
        (n, 6) around what they bound.
        """
        if PLANE not in self.placed:
            return np.zeros(0, np.intp), np.zeros((0, 4)), np.zeros((0, 6))
        rows = self.rows[PLANE]
        planes = np.where(self.inverted[rows, None], -1.0, 1.0) * self.placed[PLANE].values
        return rows, planes, self._around[rows]

    def surround(self, around: Sequence[tuple[Leaf, Box]]) -> None:
        """Take the boxes around what the leaves bound, as `formula.around_literals` has them."""
        for leaf, box in around:
            self._around[self.row[id(leaf)]] = box

    def lower(self, origin: np.ndarray, size: float, standing: Mapping[str, int]) -> tuple[dict[str, np.ndarray], int]:
        """The tables of all kinds of surfaces, by name, and how many surfaces were merged with others."""
        tables, merged = {}, 0
        for kind in self.kinds:
            rows, first = self.rows[kind.name], standing.get(kind.name, 0)
            if kind.name in self.kept:
                self.codes[rows] = (first + np.arange(len(rows))) * 32 + kind.number
                tables[kind.table_name] = self.kept[kind.name]
                continue
            classes = self._classes(kind.name, size)
            merged += len(rows) - len(classes.first)
            self.codes[rows] = (first + classes.number) * 32 + kind.number
            self.turned[rows] = classes.turned
            self.thin[rows] = classes.thin
            records = np.zeros(len(classes.first), kind.record.numpy_dtype())
            records["kind"], records["attribute"], records["matrix"] = kind.number, 0, -1
            tables[kind.table_name] = self.placed[kind.name].records(records, classes.first, origin)
        return tables, merged

    def _classes(self, name: str, size: float) -> surfaces.Merged:
        merge = surfaces.merged_planes if name == PLANE else surfaces.merged_quadrics
        rows = self.rows[name]
        return merge(self.placed[name].values, measures(self._around[rows], size, self.solids[rows]))

    def _find_boxes(self, kind: PrimitiveKind, leaves: Sequence[Leaf]) -> None:
        find = plane_boxes if kind.name == PLANE else quadric_boxes
        placed, local = self.placed[kind.name].values, np.array([leaf.values for leaf in leaves], np.float64)
        four = np.stack([find(values) for values in (placed, negated(placed), local, negated(local))], axis=1)
        inverted = self.inverted[self.rows[kind.name]]
        four[inverted] = four[inverted][:, [1, 0, 3, 2]]
        self._boxes[self.rows[kind.name]] = four

    def _keep(self, kind: PrimitiveKind, leaves: Sequence[Leaf], to_scene: np.ndarray) -> None:
        """Solids of users' kinds stay in their own coordinates; their boxes come from their own module."""
        rows = self.rows[kind.name]
        records = np.zeros(len(leaves), kind.record.numpy_dtype())
        records["kind"], records["matrix"] = kind.number, self.matrix[rows]
        for number, (row, leaf) in enumerate(zip(rows.tolist(), leaves, strict=True)):
            assert isinstance(leaf.values, Mapping)
            for name, value in leaf.values.items():
                records[name][number] = value
            local = local_box(kind, records[number])
            box = transformed(local, to_scene[number])
            four = (EVERYTHING, box, EVERYTHING, local) if leaf.inverted else (box, EVERYTHING, local, EVERYTHING)
            self._boxes[row] = four
        self.kept[kind.name] = records


def measures(boxes: np.ndarray, size: float, solids: np.ndarray) -> surfaces.Measures:
    """Of surfaces that bound what is within `boxes` (n, 6), in a scene of `size`, faces of the `solids` (n,).

    In a large scene small things keep their own measure; what has no bounds has the scene's.
    """
    reach = np.abs(np.where(np.isfinite(boxes), boxes, size)).max(axis=1, initial=0.0)
    return surfaces.Measures(np.minimum((boxes[:, 3:] - boxes[:, :3]).max(axis=1, initial=0.0), size), reach, solids)


def local_box(kind: PrimitiveKind, record: np.void) -> Box:
    """The box around one primitive of a user's kind, by its own module run as plain Python."""
    fields = {name: _plain(record[name]) for name in record.dtype.names or ()}
    low, high = kind.resolve("box")(kind.record(**fields))
    ends = [value if abs(value) < FAR else np.copysign(np.inf, value) for value in (*low, *high)]
    return tuple(map(float, ends))  # type: ignore[return-value]


def _plain(value: Any) -> Any:
    return tuple(value.tolist()) if value.ndim else value.item()


def _token_records(tokens: Tokens, placing: _Placing) -> np.ndarray:
    records = np.zeros(len(tokens), record_dtype("Token"))
    for name in ("operator", "operand", "skip", "rank", "ranked"):
        records[name] = getattr(tokens, name)
    records["attribute"] = records["matrix"] = -1
    rows = np.array([row for row, _ in tokens.leaves], np.int64)
    leaf_rows = np.array([placing.row[id(leaf)] for _, leaf in tokens.leaves], np.int64)
    records["operand"][rows] = placing.codes[leaf_rows]
    records["operator"][rows] ^= np.where(placing.turned[leaf_rows], INVERTED, 0).astype(np.int32)
    records["attribute"][rows] = [leaf.material for _, leaf in tokens.leaves]
    records["matrix"][rows] = placing.matrix[leaf_rows]
    return records


def _bounds_records(boxes: Sequence[Box], origin: np.ndarray, slack: float) -> np.ndarray:
    records = np.zeros(len(boxes), record_dtype("Bounds"))
    values = np.array(boxes, np.float64).reshape(-1, 6) - np.tile(origin, 2)
    records["low"], records["high"] = values[:, :3] - slack, values[:, 3:] + slack
    return records
