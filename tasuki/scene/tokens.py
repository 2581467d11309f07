"""Formulas of set operations as rows of tokens, in the order in which the modules read them; n of one form at a time.

Formulas of one form have one layout of tokens, unless their boxes tell operands to be left out or grouped: operands of
one operator that lie together are grouped under a box. All of it without recursion: formulas may be of any depth.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from tasuki.scene.bounds import is_bounded, united
from tasuki.scene.csg import Literal
from tasuki.scene.formula import CLOSED, LOOSE, VOID, Part, parents_last

LITERAL, GROUP, OPERATOR, END = range(4)
INVERTED, UNION, OPENS_UNION, SAVED, LOCAL = 4, 8, 16, 32, 64
"""What tokens are, and their flags: `tasuki.modules.formula` says what they mean."""
GROUP_SIZE = 2
"""Operands that lie together under one box."""


@dataclass(frozen=True, eq=False)
class Layout:
    """The tokens of the formulas `members` (n,) of one form: a column (k,) for each field, rows and boxes counted from
    the first that each of them has. The boxes to which they point are `boxes` (b, n, 6).

    Operand, attribute and matrix of a literal are those of its surface: `leaves` has the row of each, (j,), by its
    number in `literals`, (j,). `waiting` as in `Part`, of the whole.
    """

    members: np.ndarray
    columns: Mapping[str, np.ndarray]
    leaves: np.ndarray
    literals: np.ndarray
    boxes: np.ndarray
    is_union: bool
    waiting: int

    def __len__(self) -> int:
        return len(self.columns["operator"])


def layouts(root: Part, members: np.ndarray, is_local: Callable[[Literal], bool]) -> Iterator[Layout]:
    """The layouts of those of the formulas with boxes whose rows are `members`: few, for many that differ little."""
    for mine in _alike(root, members):
        yield _Writer(root, int(mine[0]), is_local).layout(mine)


def _alike(root: Part, members: np.ndarray) -> list[np.ndarray]:
    """`members`, those together whose boxes lead to the same tokens."""
    operators = [part for part in parents_last(root) if not part.leaf]
    if not operators:
        return [members]
    bounded = [is_bounded(boxes)[None] for part in operators[:-1] for boxes in (part.boxes, part.gaps)]
    states = np.concatenate([*(part.states for part in operators), *bounded])[:, members]
    classes = [members]
    if (states != states[:, :1]).any():
        _, number = np.unique(states, axis=1, return_inverse=True)
        order = np.argsort(number.reshape(-1), kind="stable")
        classes = np.split(members[order], np.flatnonzero(np.diff(number.reshape(-1)[order])) + 1)
    return [one for mine in classes for one in (mine[:, None] if _has_groups(operators, mine[0]) else [mine])]


def _has_groups(operators: Sequence[Part], member: int) -> bool:
    """Whether operands may be grouped; how, their boxes say, which no two formulas have in common."""
    return any((part.states[:, member] == CLOSED).sum() > GROUP_SIZE for part in operators)


class _Writer:
    """Writes formulas of one form, as the boxes of one of them tell: that of `member`. `ends` holds, for each operator
    that is open, the rows from which its END is reached.
    """

    def __init__(self, root: Part, member: int, is_local: Callable[[Literal], bool]) -> None:
        self.root = root
        self.member = member
        self.is_local = is_local
        self.operators: list[int] = []
        self.operands: list[int] = []
        self.skips: list[int] = []
        self.boxes: list[np.ndarray] = []
        self.leaves: list[tuple[int, int]] = []
        self.ends: list[list[int]] = []
        self.steps: list[Callable[[], None]] = []

    def layout(self, members: np.ndarray) -> Layout:
        """The tokens, for all of `members`."""
        self.write()
        # Operands that never matter have been left out: the others are ranked anew.
        leaves, literals = np.array(sorted(self.leaves, key=lambda leaf: leaf[1]), np.intp).reshape(-1, 2).T
        rank, ranked = np.full((2, len(self.operators)), -1)
        rank[leaves], ranked[: len(leaves)] = np.arange(len(leaves)), leaves
        columns = {"operator": self.operators, "operand": self.operands, "skip": self.skips}
        return Layout(
            members,
            {**{name: np.array(column, np.int32) for name, column in columns.items()}, "rank": rank, "ranked": ranked},
            leaves,
            literals,
            np.array([boxes[members] for boxes in self.boxes]).reshape(-1, len(members), 6),
            self.root.is_union,
            self.root.waiting,
        )

    def write(self) -> None:
        root = self.root
        self.ends.append([])
        self.steps.append(partial(self.operands_of, grouped(root, self.member), root.is_union, 0))
        while self.steps:
            self.steps.pop()()
        self.reach_end(len(self.operators))

    def append(self, operator: int, operand: int = -1) -> int:
        """Append one token; its row."""
        self.operators.append(operator)
        self.operands.append(operand)
        self.skips.append(-1)
        return len(self.operators) - 1

    def box(self, boxes: np.ndarray) -> int:
        """The index of boxes (n, 6), -1 of such as are not bounded."""
        if not is_bounded(boxes[self.member]):
            return -1
        self.boxes.append(boxes)
        return len(self.boxes) - 1

    def operands_of(self, members: Sequence[Part | Group], in_union: bool, begin: int) -> None:
        """Write the operands of an operator whose first would stand in row `begin`."""
        for member in reversed(members):
            kind = self.group if isinstance(member, Group) else self.literal if member.leaf else self.operator
            self.steps.append(partial(kind, member, in_union, begin))  # type: ignore[arg-type]

    def literal(self, part: Part, in_union: bool, begin: int) -> None:
        leaf = part.leaf
        assert leaf is not None
        flags = INVERTED * leaf.inverted | UNION * in_union | LOCAL * self.is_local(leaf)
        row = self.append(LITERAL | flags)
        self.leaves.append((row, leaf.number))
        self.ends[-1].append(row)

    def group(self, group: Group, in_union: bool, begin: int) -> None:
        box = self.box(np.broadcast_to(group.box, self.root.boxes.shape))
        row = self.append(GROUP | UNION * in_union | INVERTED * (not in_union), box)
        self.steps.append(partial(self.pass_over, row))
        self.operands_of(group.members, in_union, row + 1 if row == begin else begin)

    def pass_over(self, row: int) -> None:
        """What stands in `row` is passed over to the row that comes next."""
        self.skips[row] = len(self.operators)

    def operator(self, part: Part, in_union: bool, begin: int) -> None:
        has_box = bool(is_bounded(part.boxes[self.member]))
        saved = SAVED * (len(self.operators) != begin)
        flags = UNION * in_union | OPENS_UNION * part.is_union | saved | INVERTED * (not has_box)
        row = self.append(OPERATOR | flags, self.box(part.boxes if has_box else part.gaps))
        self.ends.append([])
        self.steps += [partial(self.pass_over, row), partial(self.close, UNION * in_union | saved)]
        self.operands_of(grouped(part, self.member), part.is_union, row + 1)

    def close(self, flags: int) -> None:
        row = self.append(END | flags)
        self.reach_end(row)
        self.ends[-1].append(row)

    def reach_end(self, end: int) -> None:
        for row in self.ends.pop():
            self.skips[row] = end


# --- groups -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Group:
    """Operands of one operator which lie together: beyond the box none of them matters."""

    box: np.ndarray
    members: Sequence[Part | Group]


def grouped(part: Part, member: int) -> Sequence[Part | Group]:
    """The operands of an operator, those that have boxes in a tree of groups, behind all others; as the boxes of one
    `member` tell.

    What matters of a union's operand is the box around it, of an intersection's that around its complement; where that
    is empty the operand is left out.
    """
    if part.leaf:
        return [part]
    others = [pair for pair in zip(part.parts, part.states[:, member].tolist(), strict=True) if pair[1] != VOID]
    first = [others.pop(0)[0]] if others and others[0][0].waiting else []
    loose = [one for one, state in others if state == LOOSE]
    bounded = [one for one, state in others if state == CLOSED]
    if len(bounded) <= GROUP_SIZE:
        return [*first, *loose, *bounded]
    boxes = np.array([(one.boxes if part.is_union else one.gaps)[member] for one in bounded])
    return [*first, *loose, _group(np.arange(len(bounded)), boxes, bounded)]


def _group(indices: np.ndarray, boxes: np.ndarray, parts: Sequence[Part]) -> Part | Group:
    """A tree of groups over the parts `indices`, halved again and again."""
    if len(indices) == 1:
        return parts[indices[0]]
    mine = boxes[indices]
    box = united(mine)
    if len(indices) <= GROUP_SIZE:
        return Group(box, [parts[i] for i in indices])
    left = _left_half(mine, box)
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
