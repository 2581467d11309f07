"""Solids as set operations on surfaces: what a constructor, a formula and a flat object are made of.

A literal is one side of a surface, in coordinates of its own; branches join literals. Imported by the scene's
constructors, which make these trees, and by what bounds, merges and packs them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from tasuki.diagnostics import Span
    from tasuki.scene.tree import Node

PLANE, QUADRIC = "plane", "quadric"
"""The kinds of surfaces whose literals any matrix moves into the scene's coordinates; those of others keep theirs."""


@dataclass(frozen=True, eq=False, slots=True)
class Leaf:
    """A literal: the inside of a surface, or, `inverted`, all but that.

    `values` of a plane are (n, d), shape (4,), IN where n . P + d < 0; of a quadric the rows (Q, l), (p, r), shape
    (4, 4), Q symmetric, IN where (P - p)^T Q (P - p) + l . (P - p) < r, so that r is not lost beside squares of a p
    that is far away; of any other kind the fields of its record by name. All float64, in local coordinates, which
    `matrix` (4, 4) places in those of the scene. `material` is an index into the flat scene's materials. The literals
    of one solid have the node `solid` in common, and the matrix.
    """

    kind: str
    values: np.ndarray | Mapping[str, Any]
    matrix: np.ndarray
    material: int
    solid: Node | None = None
    inverted: bool = False

    @property
    def place(self) -> Span | None:
        """Where the solid stands in its file."""
        return self.solid.place if self.solid is not None else None


@dataclass(frozen=True, eq=False, slots=True)
class Branch:
    """The union or intersection of its children, of which there is at least one; or, `inverted`, all but that."""

    operation: Literal["union", "intersection"]
    children: Sequence[Tree]
    inverted: bool = False


Tree: TypeAlias = Leaf | Branch


def negated(values: np.ndarray) -> np.ndarray:
    """The values of a plane or quadric, or of many, whose inside is the outside of these. As in `Leaf.values`."""
    turned = -values
    if values.shape[-2:] == (4, 4):
        turned[..., 3, :3] = values[..., 3, :3]
    return turned


@dataclass(frozen=True, slots=True)
class Sheet:
    """What makes a formula a polygon: of the solid only its first literal, a plane, shows, within `box` (low and high
    corner, in the scene's coordinates); from both sides if `two_sided`.
    """

    box: tuple[float, float, float, float, float, float]
    two_sided: bool
