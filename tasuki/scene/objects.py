"""Objects in memory: their formulas as tokens, the surfaces of these, boxes, matrices, and the media they make.

The order of work: formulas are normalised; the surfaces of all literals are placed and merged; boxes are found from
them; tokens are written.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from tasuki.scene import surfaces
from tasuki.scene.bounds import EMPTY, EVERYTHING, Box, plane_boxes, quadric_boxes, transformed
from tasuki.scene.csg import PLANE, QUADRIC, Leaf
from tasuki.scene.formula import INVERTED, Tokens, literals, normalised, with_boxes
from tasuki.scene.kinds import OBJECT, UNIT_MATRIX, PrimitiveKind, lookup, record_dtype
from tasuki.scene.material import Material

if TYPE_CHECKING:
    from tasuki.scene.flatten import FlatObject

TWO_SIDED = 1
UNION = 8
"""Flags of an object, as `tasuki.modules.records` gives them."""
FAR = 1.0e30
"""What stands for infinity in a box."""
SLACK = 2.0**-20
"""Of the scene's size: by how much boxes in formulas are widened, for the rounding of the slab test."""
DEAREST = 64.0


@dataclass(frozen=True)
class Objects:
    """The tables of a scene's objects, by name: "objects", "tokens", "bounds", and the records of every kind of solid
    in `operands`. `numbers[i]` is the number in the flat scene of the object in row i; objects that are empty,
    or everything, are left out (`empty`). `boxes` (n, 6) and `costs` (n,) are those of the rows; `merged`: how many surfaces were merged.
    """

    tables: Mapping[str, np.ndarray]
    operands: tuple[PrimitiveKind, ...]
    numbers: np.ndarray
    empty: Sequence[int]
    boxes: np.ndarray
    costs: np.ndarray
    merged: int


@dataclass
class Matrices:
    """The matrices of local coordinates: each once, by identity. Row k of the table is the inverse of the k-th."""

    origin: np.ndarray
    numbers: dict[int, int] = field(default_factory=dict)
    kept: list[np.ndarray] = field(default_factory=list)

    def number(self, matrix: np.ndarray) -> int:
        """The number of a matrix from local coordinates to those of the scene."""
        if id(matrix) not in self.numbers:
            self.numbers[id(matrix)] = len(self.kept)
            self.kept.append(matrix)
        return self.numbers[id(matrix)]

    def to_memory(self) -> np.ndarray:
        """All of them (n, 4, 4), to coordinates that count from the origin."""
        matrices = np.array(self.kept, np.float64).reshape(-1, 4, 4)
        matrices[:, :3, 3] -= self.origin
        return matrices

    def records(self) -> np.ndarray:
        """The table "matrices"."""
        records = np.zeros(len(self.kept), record_dtype("Matrix"))
        records["m"] = np.linalg.inv(self.to_memory())
        return records


def lower_objects(
    objects: Sequence[FlatObject], materials: Sequence[Material], matrices: Matrices, size: float
) -> Objects:
    """The tables of `objects`, opaque ones first: where both are met at one t, what is opaque shows.

    `size` is that of the scene, the camera's place included.
    """
    transparent = np.array([materials[one.material].transmission > 0.0 for one in objects], bool)
    order = np.argsort(transparent, kind="stable")
    roots = [normalised(objects[number].root) for number in order]
    every = [part.leaf for root in roots for part in literals(root) if part.leaf]
    placing = _Placing(every, matrices, size)
    whole = [with_boxes(root, placing.boxes) for root in roots]
    kept = [row for row, root in enumerate(whole) if EMPTY not in (root.box, root.gap)]
    tokens = Tokens()
    spans = [tokens.write(whole[row], lambda leaf: leaf.kind not in (PLANE, QUADRIC)) for row in kept]
    numbers = order[kept]
    boxes = np.array([whole[row].box for row in kept]).reshape(-1, 6)
    boxes = _with_extents(boxes, [objects[number] for number in numbers], matrices.origin)
    records = np.zeros(len(kept), record_dtype("Object"))
    records["kind"], records["matrix"] = OBJECT, -1
    records["attribute"] = [objects[number].material for number in numbers]
    sides = [TWO_SIDED * materials[objects[number].material].shows_both_sides() for number in numbers]
    records["flags"] = sides + UNION * np.array([whole[row].is_union for row in kept], int)
    records["first"], records["end"] = np.array(spans, np.int32).reshape(-1, 2).T
    records["low"], records["high"] = np.clip(boxes[:, :3], -FAR, FAR), np.clip(boxes[:, 3:], -FAR, FAR)
    tables = {
        "objects": records,
        "tokens": _token_records(tokens, placing),
        "bounds": _bounds_records(tokens.bounds, SLACK * size),
        **placing.tables,
    }
    costs = np.minimum([len(literals(whole[row])) for row in kept], DEAREST).astype(np.float32) * 2.0
    empty = sorted(set(order.tolist()) - set(numbers.tolist()))
    return Objects(tables, tuple(placing.kinds), numbers, empty, boxes, costs, placing.merged)


class _Placing:
    """The leaves of all formulas: of each its surface's code, and boxes around it."""

    def __init__(self, leaves: Sequence[Leaf], matrices: Matrices, size: float) -> None:
        self.leaves = leaves
        self.row = {id(leaf): row for row, leaf in enumerate(leaves)}
        self.matrix = np.array([matrices.number(leaf.matrix) for leaf in leaves], np.int64)
        to_memory = matrices.to_memory()
        inverses = np.linalg.inv(to_memory)
        self.codes = np.zeros(len(leaves), np.int64)
        self.turned = np.zeros(len(leaves), bool)
        self.merged = 0
        self.tables: dict[str, np.ndarray] = {}
        self.kinds: list[PrimitiveKind] = []
        self._boxes: list[tuple[Box, Box, Box, Box]] = [(EVERYTHING,) * 4] * len(leaves)
        for name, rows in surfaces.kinds_of(leaves).items():
            kind = lookup(name)
            self.kinds.append(kind)
            mine, numbers = [leaves[row] for row in rows], self.matrix[rows]
            if name in (PLANE, QUADRIC):
                placed = surfaces.placed(mine, name, inverses[numbers], to_memory[numbers])
                self._merge(kind, rows, placed, size)
                self._find_boxes(kind, rows, placed, mine)
            else:
                self._keep(kind, rows, mine, to_memory[numbers])

    def boxes(self, leaf: Leaf) -> tuple[Box, Box, Box, Box]:
        """As `formula.LeafBoxes` says."""
        return self._boxes[self.row[id(leaf)]]

    def _merge(self, kind: PrimitiveKind, rows: np.ndarray, placed: surfaces.Placed, size: float) -> None:
        merge = surfaces.merged_planes if kind.name == PLANE else surfaces.merged_quadrics
        merged = merge(placed.values, size)
        self.merged += len(rows) - len(merged.first)
        self.codes[rows] = merged.number * 32 + kind.number
        self.turned[rows] = merged.turned
        values, records = placed.values[merged.first], np.zeros(len(merged.first), kind.record.numpy_dtype())
        if kind.name == PLANE:
            surfaces.plane_records(records, values)
        else:
            surfaces.quadric_records(records, values, placed.middle[merged.first], UNIT_MATRIX)
        records["kind"], records["matrix"] = kind.number, -1
        self.tables[kind.table_name] = records

    def _find_boxes(
        self, kind: PrimitiveKind, rows: np.ndarray, placed: surfaces.Placed, leaves: Sequence[Leaf]
    ) -> None:
        find = plane_boxes if kind.name == PLANE else quadric_boxes
        local = np.array([leaf.values for leaf in leaves], np.float64)
        columns = [find(values).tolist() for values in (placed.values, -placed.values, local, -local)]
        for row, leaf, *four in zip(rows.tolist(), leaves, *columns, strict=True):
            box, gap, local_box, local_gap = map(tuple, four)
            in_order = (gap, box, local_gap, local_box) if leaf.inverted else (box, gap, local_box, local_gap)
            self._boxes[row] = in_order  # type: ignore[assignment]

    def _keep(self, kind: PrimitiveKind, rows: np.ndarray, leaves: Sequence[Leaf], to_memory: np.ndarray) -> None:
        """Solids of users' kinds stay in their own coordinates; their boxes come from their own module."""
        records = np.zeros(len(leaves), kind.record.numpy_dtype())
        for number, leaf in enumerate(leaves):
            assert isinstance(leaf.values, Mapping)
            for name, value in leaf.values.items():
                records[name][number] = value
        records["kind"], records["matrix"] = kind.number, self.matrix[rows]
        self.codes[rows] = np.arange(len(rows)) * 32 + kind.number
        self.tables[kind.table_name] = records
        for number, (row, leaf) in enumerate(zip(rows.tolist(), leaves, strict=True)):
            local = local_box(kind, records[number])
            box = transformed(local, to_memory[number])
            four = (EVERYTHING, box, EVERYTHING, local) if leaf.inverted else (box, EVERYTHING, local, EVERYTHING)
            self._boxes[row] = four


def local_box(kind: PrimitiveKind, record: np.void) -> Box:
    """The box around one primitive of a user's kind, by its own module run as plain Python."""
    fields = {name: _plain(record[name]) for name in record.dtype.names or ()}
    low, high = kind.resolve("box")(kind.record(**fields))
    ends = [value if abs(value) < FAR else np.copysign(np.inf, value) for value in (*low, *high)]
    return tuple(map(float, ends))  # type: ignore[return-value]


def _plain(value: Any) -> Any:
    return tuple(value.tolist()) if value.ndim else value.item()


def _with_extents(boxes: np.ndarray, objects: Sequence[FlatObject], origin: np.ndarray) -> np.ndarray:
    """The boxes, cut to the spheres that users promise to be around objects."""
    boxes = boxes.copy()
    for box, one in zip(boxes, objects, strict=True):
        if isinstance(one.extent, tuple):
            centre, radius = np.array(one.extent[0]) - origin, one.extent[1]
            box[:3], box[3:] = np.maximum(box[:3], centre - radius), np.minimum(box[3:], centre + radius)
    return boxes


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


def _bounds_records(boxes: Sequence[Box], slack: float) -> np.ndarray:
    records = np.zeros(len(boxes), record_dtype("Bounds"))
    values = np.array(boxes, np.float64).reshape(-1, 6)
    records["low"], records["high"] = values[:, :3] - slack, values[:, 3:] + slack
    return records

