"""Formulas as trees, one at a time, as tests write and judge them; the way from a flat scene's columns, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np

from tasuki.scene import csg
from tasuki.scene.csg import FlatObjects, Join, Literals
from tasuki.scene.flatten import Flat
from tasuki.scene.placing import is_local


@dataclass(frozen=True, eq=False, slots=True)
class Leaf:
    """A literal: the inside of a surface, or, `inverted`, all but that; `values` as in `Literals`, in coordinates that
    `matrix` (4, 4) places in those of the scene.
    """

    kind: str
    values: np.ndarray | Mapping[str, Any]
    matrix: np.ndarray
    material: int
    inverted: bool = False


@dataclass(frozen=True, eq=False, slots=True)
class Branch:
    """The union or intersection of its children, of which there is at least one; or, `inverted`, all but that."""

    operation: Literal["union", "intersection"]
    children: Sequence[Tree]
    inverted: bool = False


Tree: TypeAlias = Leaf | Branch


def trees_in(flat: Flat) -> list[Tree]:
    """The formulas of a flat scene's objects."""
    frames = list(flat.frames)
    return [_tree(flat, frames, number) for number in range(len(flat.objects))]


def _tree(flat: Flat, frames: Sequence[np.ndarray], number: int) -> Tree:
    objects, stack = flat.objects, []
    for token in reversed(objects.forms[objects.form[number]]):
        if isinstance(token, Join):
            operands = tuple(stack[: -token.arity - 1 : -1])
            del stack[-token.arity :]
            stack.append(Branch(token.operation, operands, token.inverted))
        else:
            stack.append(_leaf(flat, frames, int(objects.starts[number]) + token.number, token))
    (tree,) = stack
    return tree


def _leaf(flat: Flat, frames: Sequence[np.ndarray], row: int, token: csg.Literal) -> Leaf:
    literals = flat.objects.literals
    assert token.kind == literals.kinds[literals.kind[row]]
    values = literals.values[literals.kind[row]][int(literals.index[row])]
    return Leaf(token.kind, values, frames[literals.frame[row]], int(literals.material[row]), token.inverted)


def columns_of(trees: Sequence[Tree], materials: Sequence[int]) -> tuple[FlatObjects, np.ndarray]:
    """Formulas as the objects of a flat scene, and its frames (k, 4, 4); `materials` are the media."""
    matrices: dict[int, tuple[int, np.ndarray]] = {}
    forms, leaves, starts = [], [], [0]
    for tree in trees:
        form, waiting = [], [tree]
        while waiting:
            node = waiting.pop()
            if isinstance(node, Branch):
                form.append(Join(node.operation, len(node.children), node.inverted))
                waiting += reversed(node.children)
                continue
            frame, _ = matrices.setdefault(id(node.matrix), (len(matrices), node.matrix))
            form.append(csg.Literal(len(leaves) - starts[-1], node.kind, frame, node.inverted))
            leaves.append(node)
        forms.append(tuple(form))
        starts.append(len(leaves))
    kinds = tuple(dict.fromkeys(leaf.kind for leaf in leaves))
    values = [[leaf.values for leaf in leaves if leaf.kind == kind] for kind in kinds]
    kind, each = np.array([kinds.index(leaf.kind) for leaf in leaves], np.intp), np.arange(len(leaves))
    index = np.zeros(len(leaves), np.intp)
    for number in range(len(kinds)):
        index[kind == number] = np.arange(len(values[number]))
    literals = Literals(
        kinds,
        tuple(one if is_local(name) else np.array(one) for name, one in zip(kinds, values, strict=True)),
        [None] * len(leaves),
        kind,
        index,
        np.array([matrices[id(leaf.matrix)][0] for leaf in leaves], np.intp),
        np.array([leaf.material for leaf in leaves], np.intp),
        each,
    )
    each, nothing, paths = np.arange(len(trees)), [None] * len(trees), [()] * len(trees)
    media = np.array(materials)
    objects = FlatObjects(forms, literals, each, np.array(starts), media, nothing, nothing, paths, nothing)
    return objects, np.array([matrix for _, matrix in matrices.values()]).reshape(-1, 4, 4)
