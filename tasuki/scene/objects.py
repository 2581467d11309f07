"""Objects in memory: their formulas as tokens, the surfaces of these, boxes, and the table of matrices.

The order of work: the surfaces of all literals are placed; form by form, formulas are normalised, their boxes found and
their tokens laid out; surfaces that coincide are merged; tokens are written.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.scene.bounds import is_empty
from tasuki.scene.csg import PLANE, FlatObjects, Sphered
from tasuki.scene.formula import Part, around_literals, normalised, with_boxes
from tasuki.scene.kinds import OBJECT, PrimitiveKind, record_dtype
from tasuki.scene.material import Material
from tasuki.scene.placing import FAR, Coded, PlacedLiterals, Placing, is_local
from tasuki.scene.surfaces import Merged
from tasuki.scene.tokens import INVERTED, Layout, layouts

TWO_SIDED = 1
UNION = 8
SHEET = 16
"""Flags of an object, as `tasuki.modules.records` gives them."""
SLACK = 2.0**-20
"""Of the scene's size: by how much boxes in formulas are widened, for the rounding of the slab test."""
COST, DEAREST = 2.0, 64
"""What a literal costs to intersect, in units of a triangle's; and beyond how many literals a formula costs no more."""
DEEPEST = 24
"""Operators that may wait for one another."""
AT_A_TIME = 1 << 18
"""Literals whose boxes are found in one go: a bound on the memory that this takes."""


def matrix_records(frames: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """The table "matrices", of the inverses of `frames` (k, 4, 4), for coordinates that count from `origin`."""
    records = np.zeros(len(frames), record_dtype("Matrix"))
    matrices = frames.copy()
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


@dataclass(frozen=True, eq=False)
class Batch:
    """Formulas of one form: their places in `Formulas.order`, `members` (n,); the whole, with boxes; their literals."""

    members: np.ndarray
    root: Part
    placed: PlacedLiterals


class Formulas:
    """The formulas of `objects`, with boxes, in the scene's coordinates; `frames` (k, 4, 4) are the flat scene's.

    `order` has their numbers, those of opaque objects first, since where both are met at one t, what is opaque shows.
    What is empty, or everything, is left out; `left_out` has the numbers. Of the i-th that is kept `rows[i]` is the
    place in that order, `numbers[i]` the number; `around` (n, 6) are boxes around what is kept, `boxes` no larger than
    around the extents that users gave.
    """

    def __init__(self, objects: FlatObjects, materials: Sequence[Material], frames: np.ndarray) -> None:
        transparent = np.array([material.transmission > 0.0 for material in materials], bool)[objects.material]
        self.order = np.argsort(transparent, kind="stable")
        self.objects = objects.take(self.order) if transparent.any() else objects
        self.placing = Placing(self.objects.literals, frames)
        self._two_sided = np.array([material.shows_both_sides() for material in materials], bool)[self.objects.material]
        self._around = np.empty((len(self.objects.literals), 6))
        self._inverted = np.empty(len(self.objects.literals), bool)
        self._layouts: list[Layout] = []
        boxes, kept = np.empty((len(objects), 6)), np.zeros(len(objects), bool)
        for batch in self.batches():
            boxes[batch.members] = batch.root.boxes
            kept[batch.members] = ~(is_empty(batch.root.boxes) | is_empty(batch.root.gaps))
            self._take(batch, np.flatnonzero(kept[batch.members]))
        self.rows = np.flatnonzero(kept)
        self.numbers = self.order[self.rows]
        self.left_out = np.sort(self.order[~kept]).tolist()
        self.around = boxes[self.rows]
        self.boxes = _within_extents(self.around.copy(), [self.objects.extents[row] for row in self.rows.tolist()])

    def batches(self) -> Iterator[Batch]:
        """All formulas, those of one form together unless they are too many, with boxes."""
        waiting, count = [], 0
        for members in self.objects.by_form():
            size = int(self.objects.sizes[members[0]])
            step = max(1, AT_A_TIME // size)
            for first in range(0, len(members), step):
                waiting.append(members[first : first + step])
                count += size * len(waiting[-1])
                if count >= AT_A_TIME:
                    yield from self._with_boxes(waiting)
                    waiting, count = [], 0
        yield from self._with_boxes(waiting)

    def _with_boxes(self, groups: Sequence[np.ndarray]) -> Iterator[Batch]:
        """Formulas with boxes; those of their literals are found for all `groups`, each of one form, at once."""
        starts, sizes = self.objects.starts, self.objects.sizes
        rows = [starts[members] + np.arange(sizes[members[0]])[:, None] for members in groups]
        ends = np.cumsum([one.size for one in rows]).tolist()
        boxes = self.placing.boxes(np.concatenate([one.reshape(-1) for one in rows])) if rows else np.zeros((4, 0, 6))
        for members, mine, end in zip(groups, rows, ends, strict=True):
            placed = PlacedLiterals(self.placing, mine, boxes[:, end - mine.size : end].reshape(4, *mine.shape, 6))
            root = with_boxes(normalised(self.objects.forms[self.objects.form[members[0]]]), placed)
            for row, number in enumerate(members.tolist()):
                if sheet := self.objects.sheets[number]:
                    root.boxes[row] = sheet.box
            yield Batch(members, root, placed)

    def merged(self, size: float) -> dict[str, Merged]:
        """The surfaces of all literals, by kind, those merged that coincide in a scene of `size`."""
        return self.placing.merged(self._around, size)

    def faces(self) -> Faces:
        """The planes of all literals."""
        if PLANE not in self.placing.placed:
            return Faces(np.zeros((0, 4)), np.zeros((0, 6)), np.zeros(0, bool))
        rows = self.placing.rows[PLANE]
        planes = np.where(self._inverted[rows, None], -1.0, 1.0) * self.placing.placed[PLANE].values
        return Faces(planes, self._around[rows], self._two_sided[self._owners(rows)])

    def _owners(self, literals: np.ndarray) -> np.ndarray:
        """The places of the objects to which literals belong, given their rows."""
        return np.searchsorted(self.objects.starts, literals, side="right") - 1

    def lower(self, origin: np.ndarray, size: float, standing: Mapping[str, int]) -> Objects:
        """The tables, for coordinates that count from `origin`, of a scene of `size`, the camera's place included.

        `standing`: how many primitives of each kind, by name, stand alone, and so before the literals' surfaces.
        SceneError where operators would have to wait for more others than readers can keep.
        """
        deepest = max((layout.waiting for layout in self._layouts), default=0)
        if deepest > DEEPEST:
            expected = f"at most {DEEPEST} operators that wait for one another"
            raise SceneError(str(Diagnostic("a formula is too deep", None, expected, str(deepest))))
        merged = self.merged(size)
        coded = self.placing.tables(merged, origin, standing)
        boxes = self.boxes - np.tile(origin, 2)
        first = _starts(len(self.objects), [(layout.members, len(layout)) for layout in self._layouts])
        tables = {
            "objects": self._records(first, boxes),
            "tokens": self._token_records(first, coded),
            "bounds": self._bounds_records(origin, SLACK * size),
            **coded.tables,
        }
        costs = COST * np.minimum(self.objects.sizes[self.rows], DEAREST).astype(np.float32)
        lost = sum(len(one.number) - len(one.first) for one in merged.values())
        thin = np.unique(self.order[self._owners(np.flatnonzero(coded.thin))])
        kinds, count = tuple(self.placing.kinds), len(self.objects.literals)
        return Objects(tables, kinds, self.numbers, boxes, costs, count, lost, thin)

    def _records(self, first: np.ndarray, boxes: np.ndarray) -> np.ndarray:
        records = np.zeros(len(self.numbers), record_dtype("Object"))
        unions = np.zeros(len(self.objects), bool)
        for layout in self._layouts:
            unions[layout.members] = layout.is_union
        media, two_sided = self.objects.material[self.rows], self._two_sided[self.rows]
        records["kind"], records["attribute"], records["matrix"] = OBJECT, media, -1
        records["flags"] = np.where(two_sided, TWO_SIDED, 0) + np.where(unions[self.rows], UNION, 0)
        for row, number in enumerate(self.rows.tolist()):
            if sheet := self.objects.sheets[number]:
                records["flags"][row] = SHEET + TWO_SIDED * sheet.two_sided
        records["first"], records["end"] = first[self.rows], first[self.rows + 1]
        records["low"], records["high"] = np.clip(boxes[:, :3], -FAR, FAR), np.clip(boxes[:, 3:], -FAR, FAR)
        return records

    def _token_records(self, first: np.ndarray, coded: Coded) -> np.ndarray:
        records = np.zeros(first[-1], record_dtype("Token"))
        records["attribute"] = records["matrix"] = -1
        first_box = self._first_boxes()
        literals = self.objects.literals
        for layout in self._layouts:
            begin = first[layout.members, None]
            rows = begin + np.arange(len(layout))
            for name, column in layout.columns.items():
                before = {"operand": first_box[layout.members, None], "skip": begin, "ranked": begin}.get(name, 0)
                records[name][rows] = np.where(column >= 0, column + before, -1)
            leaves, mine = begin + layout.leaves, self.objects.starts[layout.members, None] + layout.literals
            records["operand"][leaves] = coded.codes[mine]
            records["operator"][leaves] ^= np.where(coded.turned[mine], INVERTED, 0).astype(np.int32)
            records["attribute"][leaves], records["matrix"][leaves] = literals.material[mine], literals.frame[mine]
        return records

    def _bounds_records(self, origin: np.ndarray, slack: float) -> np.ndarray:
        first = self._first_boxes()
        boxes = np.empty((first[-1], 6))
        for layout in self._layouts:
            boxes[first[layout.members] + np.arange(len(layout.boxes))[:, None]] = layout.boxes
        boxes -= np.tile(origin, 2)
        records = np.zeros(len(boxes), record_dtype("Bounds"))
        records["low"], records["high"] = boxes[:, :3] - slack, boxes[:, 3:] + slack
        return records

    def _first_boxes(self) -> np.ndarray:
        """Of every object the first of its boxes in the table "bounds"."""
        return _starts(len(self.objects), [(layout.members, len(layout.boxes)) for layout in self._layouts])

    def _take(self, batch: Batch, kept: np.ndarray) -> None:
        """Note what is needed of a batch later: the tokens of what is `kept`, and what its literals bound."""
        for literal, around in around_literals(batch.root):
            self._around[batch.placed.rows[literal.number]] = around
            self._inverted[batch.placed.rows[literal.number]] = literal.inverted
        if len(kept):
            for layout in layouts(batch.root, kept, lambda literal: is_local(literal.kind)):
                self._layouts.append(replace(layout, members=batch.members[layout.members]))


def _starts(count: int, sizes: Sequence[tuple[np.ndarray, int]]) -> np.ndarray:
    """Where what each of `count` objects has begins, and the last ends, (count + 1,); `sizes` are of some each."""
    each = np.zeros(count, np.intp)
    for members, size in sizes:
        each[members] = size
    return np.concatenate([[0], np.cumsum(each)])


def _within_extents(boxes: np.ndarray, extents: Sequence[Sphered]) -> np.ndarray:
    """Boxes (n, 6), no larger than around the extents that users gave."""
    for box, extent in zip(boxes, extents, strict=True):
        if isinstance(extent, tuple):
            centre, radius = np.array(extent[0]), extent[1]
            box[:3], box[3:] = np.maximum(box[:3], centre - radius), np.minimum(box[3:], centre + radius)
    return boxes
