"""Whether what modules found along rays is what the oracle finds; and how often there was nothing to compare."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

from tests.csg.oracle import Hits, Oracle


def agrees(found: Any, hits: Hits) -> np.ndarray:
    """Of which rays t, within its error, and the owner, which leaves' materials name, are the oracle's."""
    t, owner = found[:2]
    nowhere = np.isinf(t) & np.isinf(hits.t)
    with np.errstate(invalid="ignore"):
        return (nowhere | (np.abs(t - hits.t) <= hits.error)) & (owner == hits.owner)


def agrees_on_a_side(
    found: Any, oracle: Oracle, origin: np.ndarray, direction: np.ndarray, *, two_sided: bool
) -> tuple[np.ndarray, np.ndarray]:
    """For rays in surfaces: of which rays the answer is right for one choice of sides, the same for all literals of a
    surface; and which are decided.
    """
    right, decided = np.zeros(len(origin), bool), np.ones(len(origin), bool)
    lie_in, group = np.unique(oracle.lie_in(origin, direction), axis=0, return_inverse=True)
    for number, surfaces in enumerate(lie_in):
        mine = group == number
        for beside in _choices(np.flatnonzero(surfaces).tolist()):
            hits = oracle.first_hits(origin[mine], direction[mine], two_sided=two_sided, beside=beside)
            right[mine] |= agrees([leaf[mine] for leaf in found], hits)
            decided[mine] &= hits.decided
    return right, decided


def _choices(bits: Sequence[int]) -> Iterator[int]:
    """Every number made of some of the bits."""
    for chosen in product((0, 1), repeat=len(bits)):
        yield sum(one << bit for one, bit in zip(chosen, bits, strict=True))


@dataclass
class Tally:
    """What came of many rays: how many there were, how many are undecided, and which of the others were wrong."""

    rays: int = 0
    undecided: int = 0
    wrong: dict[str, list[int]] = field(default_factory=dict)

    def add(self, name: str, right: np.ndarray, decided: np.ndarray) -> None:
        """Count the rays of formula `name`."""
        self.rays += len(right)
        self.undecided += int((~decided).sum())
        if not right[decided].all():
            self.wrong[name] = np.flatnonzero(decided & ~right).tolist()

    def require(self, few: float) -> None:
        """None wrong, and at most the share `few` undecided, of a number worth counting."""
        assert not self.wrong
        assert self.rays > 1000
        assert self.undecided <= few * self.rays
