"""How values lie in registers: a value is a list of parts, and a part is what one register holds.

A scalar f32 is a register of one bank, an i32 or bool one of the ALU's, a vec3 a row of the banks X, Y, Z (bank S of
the same number stays free for a scalar), a vec4 a whole row. Matrices (four columns), records and tuples are the parts
of their members, one after another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tasuki.ir.paths import at_path
from tasuki.ir.types import Scalar, Type, Vector

COMPONENTS = "xyzw"
BANK_OF = dict(zip(COMPONENTS, "xyzs", strict=True))
"""Component of a vector -> its bank."""


def parts(type_: Type) -> tuple[Type, ...]:
    """The scalars and vectors that a value of this type consists of."""
    if isinstance(type_, Scalar | Vector):
        return (type_,)
    return tuple(part for _, member in type_.members for part in parts(member))


def banks_of(part: Type) -> str:
    """The banks that a part takes, where no other bank is asked for."""
    if isinstance(part, Vector):
        return "xyzs"[: part.size]
    return "s" if str(part) == "f32" else "i"


@dataclass(frozen=True)
class Selection:
    """What a path leads to: parts `start` to `stop` of the whole value; with `bank`, one component of part `start`."""

    type: Type
    start: int
    stop: int
    bank: str | None = None


def select(whole: Type, path: Sequence[str]) -> Selection:
    """The parts of a value of type `whole` that `path` leads to."""
    type_, leaves = at_path(whole, path)
    starts = part_starts(whole)
    if leaves.start in starts and (len(leaves) == 0 or leaves.stop in {*starts, len(whole.leaves)}):
        start = starts.index(leaves.start)
        return Selection(type_, start, start + len(parts(type_)))
    start = max(i for i, leaf in enumerate(starts) if leaf <= leaves.start)
    return Selection(type_, start, start + 1, BANK_OF[COMPONENTS[leaves.start - starts[start]]])


def part_starts(whole: Type) -> list[int]:
    """For each part the first of its leaves."""
    starts, leaf = [], 0
    for part in parts(whole):
        starts.append(leaf)
        leaf += len(part.leaves)
    return starts
