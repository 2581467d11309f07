"""Moves that happen all at once, as moves one after another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from tasuki.machines.pu.lower.places import SPARES, Fixed, Location, Spilled, reload_register


@dataclass(frozen=True)
class Move:
    """`target` becomes what `source` was before all moves."""

    target: Location
    source: Location | float | int


def in_order(moves: Sequence[Move]) -> list[Move]:
    """The moves in an order in which none destroys what another still wants; cycles go through spare registers.

    The first register kept for reloading stays free: a move between rows of memory goes through it.
    """
    waiting = [move for move in moves if move.target != move.source]
    ordered: list[Move] = []
    while waiting:
        free = next((m for m in waiting if not any(_meet(m.target, o.source) for o in waiting if o is not m)), None)
        if free is not None:
            waiting.remove(free)
            ordered.append(free)
            continue
        held = next(m.source for m in waiting if any(_meet(o.target, m.source) for o in waiting if o is not m))
        assert isinstance(held, Fixed | Spilled), "a number waits for nobody"
        saved = _spare(held.banks, waiting)
        ordered.append(Move(saved, held))
        waiting = [replace(move, source=saved) if move.source == held else move for move in waiting]
    return ordered


def _spare(banks: str, waiting: Sequence[Move]) -> Fixed:
    """A register kept for reloading in which nothing waits."""
    choices = (reload_register(banks, position) for position in range(1, SPARES))
    return next(one for one in choices if not any(_meet(one, move.source) for move in waiting))


def _meet(one: Location, other: Location | float | int) -> bool:
    """Whether two places share a word."""
    if isinstance(one, Fixed) and isinstance(other, Fixed):
        return bool(one.cells & other.cells)
    return isinstance(one, Spilled) and isinstance(other, Spilled) and one.row == other.row
