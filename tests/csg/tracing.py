"""Formulas in memory without a scene around them, and the modules that find hits asked about them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np

from tasuki.language import f32, i32, module, vec3
from tasuki.mapping import map_module
from tasuki.modules.crossing import NOWHERE
from tasuki.modules.objects import object_facet, object_hit
from tasuki.renderers.fillers import Traits, default_fillers
from tasuki.scene import Camera, Material, Scene
from tasuki.scene.flatten import flatten
from tasuki.scene.kinds import lookup
from tasuki.scene.objects import Formulas, matrix_records
from tasuki.scene.tree import Node, Union
from tests.csg.trees import Branch, Leaf, Tree, columns_of, trees_in

OPERANDS = [lookup("plane"), lookup("quadric")]
FILLERS = default_fillers(Traits((), OPERANDS, transparent=False, nested=False))
SIZE = 16.0
"""That of the space in which solids and rays are."""
SIDES = (Material(), Material(two_sided=True))
"""The materials of formulas that show from outside, and from both sides."""
CAMERA = Camera((5.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 40.0)


@module
def met(index: i32, origin: vec3, direction: vec3, left: i32) -> tuple[f32, i32, i32, vec3]:
    """Of the first visible crossing of object `index`: t; the attribute, -1 where there is none; the code of the
    surface; the normal.
    """
    t = object_hit(index, origin, direction, left, NOWHERE)
    attribute = -1
    code = -1
    normal = vec3(0.0)
    if t < NOWHERE:
        facet = object_facet(index, origin, direction, t, left)
        attribute = facet.attribute
        code = facet.code
        normal = facet.geometry
    return t, attribute, code, normal


def roots_of(nodes: Sequence[Node]) -> list[Tree]:
    """The formulas of solids, as they are."""
    return trees_in(flatten(Scene(CAMERA, [Union((node,)) for node in nodes])))


def trees_of(nodes: Sequence[Node]) -> list[Tree]:
    """The formulas of solids; `material` of each leaf is its place in the text of its formula."""
    return [_labelled(root, count()) for root in roots_of(nodes)]


def _labelled(node: Tree, numbers: Iterator[int]) -> Tree:
    if isinstance(node, Leaf):
        return replace(node, material=next(numbers))
    return Branch(node.operation, tuple(_labelled(child, numbers) for child in node.children), node.inverted)


class Traced:
    """Formulas, packed together as the objects of one scene. Formula k shows from both sides if `two_sided[k]`.

    Those that are found to hold nothing, or everything, are left out: their `rows` are -1, and nothing meets them.
    """

    def __init__(self, trees: Sequence[Tree], two_sided: Sequence[bool] | None = None) -> None:
        sides = [False] * len(trees) if two_sided is None else two_sided
        flat, frames = columns_of(trees, [int(side) for side in sides])
        objects = Formulas(flat, SIDES, frames).lower(np.zeros(3), SIZE, {})
        self.rows = np.full(len(trees), -1, np.int32)
        self.rows[objects.numbers] = np.arange(len(objects.numbers))
        empty = {kind.table_name: np.zeros(0, kind.record.numpy_dtype()) for kind in OPERANDS}
        self.tables = {**empty, **objects.tables, "matrices": matrix_records(frames, np.zeros(3))}

    def met(self, number: Any, origin: np.ndarray, direction: np.ndarray, left: Any = -1, **options: Any) -> Any:
        """What module `met` gives for formula `number`: one for all rays, or one for each."""
        row = self.rows[number]
        if np.ndim(row) == 0 and row < 0:
            none = np.full(len(origin), -1, np.int32)
            return np.full(len(origin), np.inf, np.float32), none, none, np.zeros((len(origin), 3), np.float32)
        return map_module(met, row, origin, direction, left, fill=FILLERS, tables=self.tables, **options)
