"""Formulas of set operations as rows of tokens, in the order in which the modules read them.

In three steps: complements are pushed down to the literals and operators of one sort joined (`normalised`); every part
gets a box around it, or around its complement (`with_boxes`); tokens are written, operands of one operator that lie
together grouped under a box (`Tokens.write`). All of it without recursion: formulas may be of any depth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.scene.bounds import (
    EMPTY,
    EVERYTHING,
    Box,
    intersected,
    is_bounded,
    joint_box,
    plane_boxes,
    principal_axes,
    quadric_boxes,
    transformed,
    united,
)
from tasuki.scene.csg import PLANE, QUADRIC, Leaf, Tree, negated

LITERAL, GROUP, OPERATOR, END = range(4)
INVERTED, UNION, OPENS_UNION, SAVED, LOCAL = 4, 8, 16, 32, 64
"""What tokens are, and their flags: `tasuki.modules.formula` says what they mean."""
DEEPEST = 24
GROUP_SIZE = 2
"""Operands that lie together under one box."""


@dataclass(slots=True)
class Part:
    """A literal (`leaf`), or the union or intersection of at least two parts. `rank` is the place of a literal among
    those of its formula.

    `box` is around the part, `gap` around its complement. `waiting`: operators that must wait on the stack for it.
    """

    leaf: Leaf | None = None
    is_union: bool = False
    parts: list[Part] = field(default_factory=list)
    rank: int = 0
    box: Box = EVERYTHING
    gap: Box = EVERYTHING
    waiting: int = 0


def normalised(tree: Tree) -> Part:
    """The formula with complements at its literals only, every operator's operands literals or of the other sort.

    By De Morgan's laws, and since operators of one sort join in any order. A literal's complement is kept in its
    `Leaf.inverted`.
    """
    root = Part()
    waiting: list[tuple[Tree, bool, Part]] = [(tree, False, root)]
    rank = 0
    while waiting:
        node, complement, above = waiting.pop()
        inverted = node.inverted != complement
        if isinstance(node, Leaf):
            above.parts.append(Part(leaf=_turned(node, inverted), rank=rank))
            rank += 1
            continue
        is_union = (node.operation == "union") != inverted
        into = above
        if len(node.children) > 1 and (above is root or above.is_union != is_union):
            into = Part(is_union=is_union)
            above.parts.append(into)
        # Last in, first out: the first operand is taken first, so that ranks follow the text.
        waiting += [(child, inverted, into) for child in reversed(node.children)]
    return root.parts[0]


def _turned(leaf: Leaf, inverted: bool) -> Leaf:
    if leaf.inverted == inverted:
        return leaf
    return Leaf(leaf.kind, leaf.values, leaf.matrix, leaf.material, leaf.solid, inverted)


def literals(root: Part) -> list[Part]:
    """The literals of a formula, by rank."""
    return sorted((part for part in parents_last(root) if part.leaf), key=lambda part: part.rank)


def parents_last(root: Part) -> list[Part]:
    """All parts of a formula, each behind those that it is made of."""
    order, waiting = [], [root]
    while waiting:
        part = waiting.pop()
        order.append(part)
        waiting += part.parts
    return order[::-1]


# --- boxes ------------------------------------------------------------------------------------------------------------

LeafBoxes = Callable[[Leaf], tuple[Box, Box, Box, Box]]
"""Of a leaf: the box around it and around its complement, in the scene's coordinates; and the same in its own."""


def with_boxes(root: Part, leaf_boxes: LeafBoxes) -> Part:
    """`root`, every part's `box`, `gap` and `waiting` found, from the literals up."""
    for part in parents_last(root):
        if part.leaf:
            part.box, part.gap = leaf_boxes(part.leaf)[:2]
            continue
        boxes, gaps = [one.box for one in part.parts], [one.gap for one in part.parts]
        if part.is_union:
            part.box = _around_all(boxes)
            part.gap = _common(part, gaps, leaf_boxes, complement=True)
        else:
            part.box = _common(part, boxes, leaf_boxes, complement=False)
            part.gap = _around_all(gaps)
        part.parts, part.waiting = _longest_first(part.parts)
    return root


def around_literals(root: Part) -> list[tuple[Leaf, Box]]:
    """Of each literal the box of the smallest part of its formula that has bounds, or whose complement has; EVERYTHING
    where none has. Boxes of `root` have been found.
    """
    found, waiting = [], [(root, EVERYTHING)]
    while waiting:
        part, box = waiting.pop()
        box = next((one for one in (part.box, part.gap) if one != EMPTY and is_bounded(one)), box)
        if part.leaf:
            found.append((part.leaf, box))
        waiting += [(one, box) for one in part.parts]
    return found


def _around_all(boxes: Sequence[Box]) -> Box:
    around = EMPTY
    for box in boxes:
        around = united(around, box)
    return around


def _common(part: Part, boxes: Sequence[Box], leaf_boxes: LeafBoxes, *, complement: bool) -> Box:
    """The box around what lies in all of `boxes`; tighter, for literals that share coordinates, in those."""
    common = EVERYTHING
    for box in boxes:
        common = intersected(common, box)
    for leaves in in_one_frame(part):
        common = intersected(common, transformed(*local_box(leaves, leaf_boxes, complement=complement)))
    return common


def in_one_frame(part: Part) -> list[list[Leaf]]:
    """The literals among a part's operands that have their local coordinates in common, where there are several."""
    frames: dict[int, list[Leaf]] = {}
    for one in part.parts:
        if one.leaf:
            frames.setdefault(id(one.leaf.matrix), []).append(one.leaf)
    return [leaves for leaves in frames.values() if len(leaves) > 1]


def local_box(leaves: Sequence[Leaf], leaf_boxes: LeafBoxes, *, complement: bool = False) -> tuple[Box, np.ndarray]:
    """The box around what lies in all of `leaves` (`complement`: around what lies in none), and the matrix from its
    coordinates to the scene's: those that the leaves have in common, or, where it has no bounds in these, such as are
    turned along the axes of one of the quadrics (those of a slanting cylinder between planes).
    """
    matrix = leaves[0].matrix
    quadrics, planes = (_insides(leaves, kind, complement=complement) for kind in (QUADRIC, PLANE))
    box = joint_box([leaf_boxes(leaf)[3 if complement else 2] for leaf in leaves], quadrics, planes)
    if is_bounded(box) or not quadrics:
        return box, matrix
    for turn in principal_axes(np.array(quadrics)):
        turned = [turn.T @ quadric @ turn for quadric in quadrics], [plane @ turn for plane in planes]
        boxes = [*quadric_boxes(np.array(turned[0])), *plane_boxes(np.array(turned[1]).reshape(-1, 4))]
        along = joint_box([tuple(one.tolist()) for one in boxes], *turned)
        if is_bounded(along):
            return along, matrix @ turn
    return box, matrix


def _insides(leaves: Sequence[Leaf], kind: str, *, complement: bool) -> list[np.ndarray]:
    """The values of all surfaces of a kind, their signs such that what counts is where they are negative."""
    return [
        negated(np.asarray(leaf.values)) if leaf.inverted != complement else np.asarray(leaf.values)
        for leaf in leaves
        if leaf.kind == kind
    ]


def _longest_first(parts: list[Part]) -> tuple[list[Part], int]:
    """The operands, that which needs the deepest stack before all others, and how deep a stack they need together.

    The first operand needs nothing kept for it (A. P. Ershov, 1958; R. Sethi, J. D. Ullman, 1970).
    """
    longest = max(range(len(parts)), key=lambda i: (not parts[i].leaf, parts[i].waiting, -i))
    ordered = parts if parts[longest].leaf else [parts[longest], *parts[:longest], *parts[longest + 1 :]]
    rest = max((one.waiting + 1 for one in ordered[1:] if not one.leaf), default=0)
    return ordered, max(ordered[0].waiting, rest)


# --- tokens -----------------------------------------------------------------------------------------------------------


@dataclass
class Tokens:
    """The tokens of all formulas, a list of each field, and the boxes to which they point.

    A literal's operand, attribute and matrix are those of its leaf: `leaves` has the row of each.
    """

    operator: list[int] = field(default_factory=list)
    operand: list[int] = field(default_factory=list)
    skip: list[int] = field(default_factory=list)
    rank: list[int] = field(default_factory=list)
    ranked: list[int] = field(default_factory=list)
    bounds: list[Box] = field(default_factory=list)
    leaves: list[tuple[int, Leaf]] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.operator)

    def write(self, root: Part, is_local: Callable[[Leaf], bool]) -> tuple[int, int]:
        """Append the tokens of a formula with boxes; its first row, and that after its last.

        SceneError where operators would have to wait for more others than readers can keep.
        """
        if root.waiting > DEEPEST:
            expected, found = f"at most {DEEPEST} operators that wait for one another", str(root.waiting)
            raise SceneError(str(Diagnostic("a formula is too deep", None, expected, found)))
        return _Writer(self, is_local).write(root)

    def append(self, operator: int, operand: int = -1, rank: int = -1) -> int:
        """Append one token; its row."""
        self.operator.append(operator)
        self.operand.append(operand)
        self.skip.append(-1)
        self.rank.append(rank)
        self.ranked.append(-1)
        return len(self.operator) - 1

    def box(self, box: Box) -> int:
        """The index among `bounds` of a box, -1 for one that is not bounded."""
        if not is_bounded(box):
            return -1
        self.bounds.append(box)
        return len(self.bounds) - 1


class _Writer:
    """Writes one formula. `ends` holds, for each operator that is open, the rows from which its END is reached."""

    def __init__(self, tokens: Tokens, is_local: Callable[[Leaf], bool]) -> None:
        self.tokens = tokens
        self.is_local = is_local
        self.ends: list[list[int]] = []
        self.steps: list[Callable[[], None]] = []

    def write(self, root: Part) -> tuple[int, int]:
        tokens, first, begun = self.tokens, len(self.tokens), len(self.tokens.leaves)
        self.ends.append([])
        self.steps.append(partial(self.operands, [root] if root.leaf else grouped(root), root.is_union, first))
        while self.steps:
            self.steps.pop()()
        self.reach_end(len(tokens))
        # Operands that never matter have been left out: the others are ranked anew.
        rows = sorted((row for row, _ in tokens.leaves[begun:]), key=tokens.rank.__getitem__)
        for rank, row in enumerate(rows):
            tokens.rank[row], tokens.ranked[first + rank] = rank, row
        return first, len(tokens)

    def operands(self, members: Sequence[Part | Group], in_union: bool, begin: int) -> None:
        """Write the operands of an operator whose first would stand in row `begin`."""
        for member in reversed(members):
            kind = self.group if isinstance(member, Group) else self.literal if member.leaf else self.operator
            self.steps.append(partial(kind, member, in_union, begin))  # type: ignore[arg-type]

    def literal(self, part: Part, in_union: bool, begin: int) -> None:
        leaf = part.leaf
        assert leaf is not None
        flags = INVERTED * leaf.inverted | UNION * in_union | LOCAL * self.is_local(leaf)
        row = self.tokens.append(LITERAL | flags, rank=part.rank)
        self.tokens.leaves.append((row, leaf))
        self.ends[-1].append(row)

    def group(self, group: Group, in_union: bool, begin: int) -> None:
        row = self.tokens.append(GROUP | UNION * in_union | INVERTED * (not in_union), self.tokens.box(group.box))
        self.steps.append(partial(self.pass_over, row))
        self.operands(group.members, in_union, row + 1 if row == begin else begin)

    def pass_over(self, row: int) -> None:
        """What stands in `row` is passed over to the row that comes next."""
        self.tokens.skip[row] = len(self.tokens)

    def operator(self, part: Part, in_union: bool, begin: int) -> None:
        tokens = self.tokens
        has_box = is_bounded(part.box)
        saved = SAVED * (len(tokens) != begin)
        flags = UNION * in_union | OPENS_UNION * part.is_union | saved | INVERTED * (not has_box)
        row = tokens.append(OPERATOR | flags, tokens.box(part.box if has_box else part.gap))
        self.ends.append([])
        self.steps += [partial(self.pass_over, row), partial(self.close, UNION * in_union | saved)]
        self.operands(grouped(part), part.is_union, row + 1)

    def close(self, flags: int) -> None:
        row = self.tokens.append(END | flags)
        self.reach_end(row)
        self.ends[-1].append(row)

    def reach_end(self, end: int) -> None:
        for row in self.ends.pop():
            self.tokens.skip[row] = end


# --- groups -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Group:
    """Operands of one operator which lie together: beyond the box none of them matters."""

    box: Box
    members: Sequence[Part | Group]


def grouped(part: Part) -> Sequence[Part | Group]:
    """The operands of an operator, those that have boxes in a tree of groups, behind all others.

    What matters of a union's operand is the box around it, of an intersection's that around its complement; where that
    is empty the operand is left out.
    """
    others = [one for one in part.parts if (one.box if part.is_union else one.gap) != EMPTY]
    first = [others.pop(0)] if others and others[0].waiting else []
    boxes = [one.box if part.is_union else one.gap for one in others]
    bounded = [i for i, box in enumerate(boxes) if is_bounded(box)]
    loose = [one for one, box in zip(others, boxes, strict=True) if not is_bounded(box)]
    if len(bounded) <= GROUP_SIZE:
        return [*first, *loose, *(others[i] for i in bounded)]
    return [*first, *loose, _group(np.array(bounded), np.array(boxes), others)]


def _group(indices: np.ndarray, boxes: np.ndarray, parts: Sequence[Part]) -> Part | Group:
    """A tree of groups over the parts `indices`, halved again and again."""
    if len(indices) == 1:
        return parts[indices[0]]
    mine = boxes[indices]
    box: Box = (*mine[:, :3].min(axis=0).tolist(), *mine[:, 3:].max(axis=0).tolist())  # type: ignore[assignment]
    if len(indices) <= GROUP_SIZE:
        return Group(box, [parts[i] for i in indices])
    left = _left_half(mine, np.array(box))
    return Group(box, [_group(indices[left], boxes, parts), _group(indices[~left], boxes, parts)])


def _left_half(boxes: np.ndarray, around: np.ndarray) -> np.ndarray:
    """Which boxes go into the first of two groups: by the surface area heuristic over all cuts between their middles.

    Boxes that reach all the way through the whole along different axes are parted by that axis first, since cuts
    across would leave each of them on both sides.
    """
    size = boxes[:, 3:] - boxes[:, :3]
    spans = size >= 0.9 * (around[3:] - around[:3])
    only = np.where(spans.sum(axis=1) == 1, spans.argmax(axis=1), -1)
    if (only >= 0).all() and (only != only[0]).any():
        return only == only[0]
    best, chosen = np.inf, np.arange(len(boxes)) < len(boxes) // 2
    for axis in range(3):
        order = np.argsort(boxes[:, axis] + boxes[:, axis + 3], kind="stable")
        areas = _areas(boxes[order])[:-1] + _areas(boxes[order][::-1])[::-1][1:]
        cut = int(areas.argmin())
        if areas[cut] < best:
            best, chosen = areas[cut], np.zeros(len(boxes), bool)
            chosen[order[: cut + 1]] = True
    return chosen


def _areas(boxes: np.ndarray) -> np.ndarray:
    """Surface times number of the first 1, 2, ... boxes."""
    size = np.maximum.accumulate(boxes[:, 3:]) - np.minimum.accumulate(boxes[:, :3])
    area = size[:, 0] * size[:, 1] + size[:, 1] * size[:, 2] + size[:, 2] * size[:, 0]
    return area * np.arange(1, len(boxes) + 1)
