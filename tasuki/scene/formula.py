"""Formulas of set operations made ready to be written: n of one form at a time, by array operations.

Complements are pushed down to the literals, and operators of one sort joined (`normalised`); then every part gets a box
around it, or around its complement (`with_boxes`). Both without recursion: formulas may be of any depth.
`tasuki.scene.tokens` writes them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from tasuki.scene.bounds import (
    EVERYTHING,
    intersected,
    is_bounded,
    is_empty,
    joint_boxes,
    plane_boxes,
    principal_axes,
    quadric_boxes,
    transformed,
    united,
)
from tasuki.scene.csg import PLANE, QUADRIC, Form, Literal, negated

MOST_TURNS = 8
"""Quadrics along whose axes bounds are sought."""
VOID, CLOSED, LOOSE = range(3)
"""What of an operand matters, as its box tells: nothing at all, something within bounds, something without."""


SHAPES = {PLANE: (4,), QUADRIC: (4, 4)}
"""Of the coefficients of surfaces."""


@dataclass(slots=True, eq=False)
class Part:
    """A literal (`leaf`), or the union or intersection of at least two parts; of n formulas of one form.

    `boxes` (n, 6) are around the parts, `gaps` around their complements. Of an operator `states` (k, n) say what
    matters of its operands: of a union's what they hold, of an intersection's what they leave out. `waiting`: operators
    that must wait on the stack for it.
    """

    leaf: Literal | None = None
    is_union: bool = False
    parts: list[Part] = field(default_factory=list)
    waiting: int = 0
    boxes: np.ndarray = field(default_factory=lambda: np.zeros((0, 6)))
    gaps: np.ndarray = field(default_factory=lambda: np.zeros((0, 6)))
    states: np.ndarray = field(default_factory=lambda: np.zeros((0, 0), np.uint8))


def normalised(form: Form) -> Part:
    """The form with complements at its literals only, every operator's operands literals or of the other sort.

    By De Morgan's laws, and since operators of one sort join in any order.
    """
    root = Part()
    # Of every operator whose operands follow: how many still do, whether their complements are meant, what they join.
    open_: list[tuple[int, bool, Part]] = [(1, False, root)]
    for token in form:
        count, complement, above = open_.pop()
        if count > 1:
            open_.append((count - 1, complement, above))
        inverted = token.inverted != complement
        if isinstance(token, Literal):
            above.parts.append(Part(leaf=token._replace(inverted=inverted)))
            continue
        is_union = (token.operation == "union") != inverted
        into = above
        if token.arity > 1 and (above is root or above.is_union != is_union):
            into = Part(is_union=is_union)
            above.parts.append(into)
        open_.append((token.arity, inverted, into))
    for part in parents_last(root.parts[0]):
        if not part.leaf:
            part.parts, part.waiting = _longest_first(part.parts)
    return root.parts[0]


def parents_last(root: Part) -> list[Part]:
    """All parts of a formula, each behind those that it is made of."""
    order, waiting = [], [root]
    while waiting:
        part = waiting.pop()
        order.append(part)
        waiting += part.parts
    return order[::-1]


def _longest_first(parts: list[Part]) -> tuple[list[Part], int]:
    """The operands, that which needs the deepest stack before all others, and how deep a stack they need together.

    The first operand needs nothing kept for it (A. P. Ershov, 1958; R. Sethi, J. D. Ullman, 1970).
    """
    longest = max(range(len(parts)), key=lambda i: (not parts[i].leaf, parts[i].waiting, -i))
    ordered = parts if parts[longest].leaf else [parts[longest], *parts[:longest], *parts[longest + 1 :]]
    rest = max((one.waiting + 1 for one in ordered[1:] if not one.leaf), default=0)
    return ordered, max(ordered[0].waiting, rest)


# --- boxes ------------------------------------------------------------------------------------------------------------


class Placed(Protocol):
    """The literals of n formulas of one form, in their places."""

    def boxes(self, literal: Literal) -> np.ndarray:
        """The boxes around one of them and around its complement, in the scene's coordinates; and the same in its own:
        (4, n, 6).
        """

    def surfaces(self, literals: Sequence[Literal]) -> np.ndarray:
        """The local coefficients of k planes, (k, n, 4), or of k quadrics, (k, n, 4, 4), signs as they are given."""

    def matrices(self, literal: Literal) -> np.ndarray:
        """From the coordinates of one of them to the scene's, (n, 4, 4)."""


def with_boxes(root: Part, placed: Placed) -> Part:
    """`root`, the `boxes`, `gaps` and `states` of every part found, from the literals up."""
    for part in parents_last(root):
        if part.leaf:
            part.boxes, part.gaps = placed.boxes(part.leaf)[:2]
            continue
        boxes, gaps = np.stack([one.boxes for one in part.parts]), np.stack([one.gaps for one in part.parts])
        if part.is_union:
            part.boxes, part.gaps = united(boxes), _common(part, gaps, placed, complement=True)
        else:
            part.boxes, part.gaps = _common(part, boxes, placed, complement=False), united(gaps)
        part.states = states_of(boxes if part.is_union else gaps)
    return root


def around_literals(root: Part) -> Iterator[tuple[Literal, np.ndarray]]:
    """Of each literal the boxes (n, 6) of the smallest part of its formula that has bounds, or whose complement has;
    EVERYTHING where none has. The boxes of `root` have been found.
    """
    waiting = [(root, np.tile(EVERYTHING, (len(root.boxes), 1)))]
    while waiting:
        part, around = waiting.pop()
        for boxes in (part.gaps, part.boxes):
            around = np.where(np.isfinite(boxes).all(axis=1)[:, None], boxes, around)
        if part.leaf:
            yield part.leaf, around
        waiting += [(one, around) for one in part.parts]


def states_of(boxes: np.ndarray) -> np.ndarray:
    """What matters of operands, as their boxes (..., 6) tell: VOID, CLOSED or LOOSE, (...)."""
    states = np.where(np.isfinite(boxes).all(axis=-1), CLOSED, LOOSE).astype(np.uint8)
    states[is_empty(boxes)] = VOID
    return states


def _common(part: Part, boxes: np.ndarray, placed: Placed, *, complement: bool) -> np.ndarray:
    """Around what lies in all of `boxes` (k, n, 6); for literals that share coordinates tighter, in those."""
    common = intersected(boxes)
    for literals in in_one_frame(part):
        common = intersected(np.stack([common, transformed(*local_boxes(literals, placed, complement=complement))]))
    return common


def in_one_frame(part: Part) -> list[list[Literal]]:
    """The literals among a part's operands that have their local coordinates in common, where there are several."""
    frames: dict[int, list[Literal]] = {}
    for one in part.parts:
        if one.leaf:
            frames.setdefault(one.leaf.frame, []).append(one.leaf)
    return [literals for literals in frames.values() if len(literals) > 1]


def local_boxes(
    literals: Sequence[Literal], placed: Placed, *, complement: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """The boxes (n, 6) around what lies in all of `literals` (`complement`: around what lies in none), and the matrices
    (n, 4, 4) from their coordinates to the scene's: those that the literals have in common, or, where they have no
    bounds in these, such as are turned along the axes of one of the quadrics (those of a slanting cylinder between
    planes).
    """
    matrices = placed.matrices(literals[0])
    quadrics, planes = (_insides(literals, kind, placed, complement=complement) for kind in (QUADRIC, PLANE))
    boxes = np.stack([placed.boxes(literal)[3 if complement else 2] for literal in literals])
    found = joint_boxes(boxes, quadrics, planes)
    loose = np.flatnonzero(~is_bounded(found))
    tried = np.zeros(len(found), np.intp)
    for quadric in quadrics:
        loose = loose[tried[loose] < MOST_TURNS]
        if not len(loose):
            break
        closes, turns = principal_axes(quadric[loose])
        rows = loose[closes]
        tried[rows] += 1
        along = _turned_boxes(quadrics[:, rows], planes[:, rows], turns)
        fits = is_bounded(along)
        found[rows[fits]], matrices[rows[fits]] = along[fits], matrices[rows[fits]] @ turns[fits]
        loose = np.setdiff1d(loose, rows[fits], assume_unique=True)
    return found, matrices


def _turned_boxes(quadrics: np.ndarray, planes: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """The boxes (n, 6) around what lies in quadrics (q, n, 4, 4) and planes (p, n, 4), in coordinates that are `turns`
    (n, 4, 4) from theirs.
    """
    quadrics = turns.swapaxes(1, 2) @ quadrics @ turns
    planes = (planes[:, :, None, :] @ turns)[:, :, 0]
    boxes = [
        quadric_boxes(quadrics.reshape(-1, 4, 4)).reshape(*quadrics.shape[:2], 6),
        plane_boxes(planes.reshape(-1, 4)).reshape(*planes.shape[:2], 6),
    ]
    return joint_boxes(np.concatenate(boxes), quadrics, planes)


def _insides(literals: Sequence[Literal], kind: str, placed: Placed, *, complement: bool) -> np.ndarray:
    """The surfaces of a kind, as `Placed.surfaces`, their signs such that what counts is where they are negative."""
    mine = [literal for literal in literals if literal.kind == kind]
    if not mine:
        return np.zeros((0, len(placed.matrices(literals[0])), *SHAPES[kind]))
    surfaces = placed.surfaces(mine)
    turned = [literal.inverted != complement for literal in mine]
    surfaces[turned] = negated(surfaces[turned], kind)
    return surfaces
