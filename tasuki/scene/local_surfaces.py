"""Surfaces of users' kinds in memory: each is an object of one literal, in local coordinates, as users' solids are.

What solids leave to their object, such a surface's own record says, as that of any primitive that stands alone does:
its attribute, and whether it shows from both sides.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from tasuki.scene.kinds import PrimitiveKind
from tasuki.scene.lower import TWO_SIDED
from tasuki.scene.memory import Memory

SURFACE = 32
"""Flag of an object, as `tasuki.modules.records` gives it."""
WHAT, LITERAL = 3, 0
"""What a token is, as `tasuki.modules.formula` says."""


def is_local_surface(kind: PrimitiveKind) -> bool:
    """Whether primitives of a kind are surfaces in coordinates of their own."""
    return kind.sort == "surface" and not kind.is_built_in


def complete(memory: Memory, operands: Iterable[PrimitiveKind]) -> None:
    """Flag the objects that are surfaces, and fill in their records, where `operands` are the kinds of literals."""
    kinds = [kind for kind in operands if is_local_surface(kind)]
    if not kinds:
        return
    objects, tokens = memory.table("objects"), memory.table("tokens")
    first = tokens[objects["first"]]
    for kind in kinds:
        rows = np.flatnonzero((first["operator"] & WHAT == LITERAL) & (first["operand"] & 31 == kind.number))
        records, own = memory.table(kind.table_name), first["operand"][rows] >> 5
        records["attribute"][own] = objects["attribute"][rows]
        records["flags"][own] = objects["flags"][rows] & TWO_SIDED
        objects["flags"][rows] |= SURFACE
