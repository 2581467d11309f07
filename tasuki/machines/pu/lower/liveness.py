"""When the registers of a piece of code hold something that is still wanted, and code that nobody wants.

Positions: instruction i reads at `STRIDE * i`, is in the middle of its work one later, and writes two later. What a
register's life covers is a set of positions, kept as the bits of one integer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tasuki.machines.pu.lower.code import Instruction, Item, Label, Register

STRIDE = 3
MIDDLE, WRITE = 1, 2
"""Positions of an instruction, behind that where it reads."""


@dataclass
class Block:
    """Items `start` to `end` without a jump into or out of their midst. `after`: the blocks that may come next."""

    start: int
    end: int
    after: list[int]
    live_out: frozenset[Register] = frozenset()


def without_dead(items: Sequence[Item], results: Sequence[Register]) -> list[Item]:
    """The items without instructions whose results nobody reads, and without what these alone had wanted."""
    kept = list(items)
    while True:
        blocks = live_blocks(kept, results)
        alive: list[Item] = []
        for block in blocks:
            alive += _wanted(kept[block.start : block.end], block.live_out)
        if len(alive) == len(kept):
            return kept
        kept = alive


def _wanted(items: Sequence[Item], live_out: frozenset[Register]) -> list[Item]:
    """A row that is fetched is taken in the same block, or by nobody."""
    live, wanted, taken = set(live_out), [], False
    for item in reversed(items):
        if isinstance(item, Instruction):
            if item.name == "fetch":
                if not taken:
                    continue
                taken = False
            elif not item.effect and not any(place.register in live for place in item.writes):
                continue
            taken = taken or item.name.startswith("take")
            step(item, live)
        wanted.append(item)
    return wanted[::-1]


def step(item: Instruction, live: set[Register]) -> None:
    """What lives before an instruction, from what lives behind it."""
    live.difference_update(place.register for place in item.writes)
    live.update(place.register for place in item.reads)


def live_blocks(items: Sequence[Item], results: Sequence[Register]) -> list[Block]:
    """The blocks of code with what lives behind each; `results` live behind the end."""
    blocks = _blocks(items)
    uses = [_uses(items[block.start : block.end]) for block in blocks]
    live_in: list[frozenset[Register]] = [frozenset()] * len(blocks)
    changed = True
    while changed:
        changed = False
        for i in reversed(range(len(blocks))):
            block = blocks[i]
            out = set().union(*(live_in[j] if j < len(blocks) else results for j in block.after))
            reads, writes = uses[i]
            before = frozenset(reads | (out - writes))
            if before != live_in[i] or len(out) != len(block.live_out):
                live_in[i], block.live_out, changed = before, frozenset(out), True
    return blocks


def _blocks(items: Sequence[Item]) -> list[Block]:
    starts = {0}
    for i, item in enumerate(items):
        if isinstance(item, Label):
            starts.add(i)
        elif item.target or item.ends:
            starts.add(i + 1)
    bounds = sorted(starts - {len(items)})
    number = {start: i for i, start in enumerate(bounds)}
    labels = {item.name: number[i] for i, item in enumerate(items) if isinstance(item, Label) and i in number}
    # Several labels may stand at one place, each a block of its own.
    blocks = [Block(start, end, []) for start, end in zip(bounds, [*bounds[1:], len(items)], strict=True)]
    for i, block in enumerate(blocks):
        last = items[block.end - 1]
        if isinstance(last, Instruction) and last.target:
            block.after.append(labels[last.target])
        if not (isinstance(last, Instruction) and last.ends):
            block.after.append(i + 1)
    return blocks


def _uses(items: Sequence[Item]) -> tuple[set[Register], set[Register]]:
    """Registers that a block reads before it writes them, and all that it writes."""
    reads: set[Register] = set()
    writes: set[Register] = set()
    for item in items:
        if isinstance(item, Instruction):
            reads.update(place.register for place in item.reads if place.register not in writes)
            writes.update(place.register for place in item.writes)
    return reads, writes


def lives(items: Sequence[Item], blocks: Sequence[Block]) -> dict[Register, int]:
    """For each register the positions where it must not be disturbed."""
    found: dict[Register, int] = {}
    for block in blocks:
        ends = dict.fromkeys(sorted(block.live_out, key=lambda one: one.age), STRIDE * block.end)
        for i in reversed(range(block.start, block.end)):
            item = items[i]
            if isinstance(item, Instruction):
                _live_through(item, STRIDE * i, ends, found)
        for register, end in ends.items():
            _cover(found, register, STRIDE * block.start, end)
    return found


def _live_through(item: Instruction, at: int, ends: dict[Register, int], found: dict[Register, int]) -> None:
    read = {place.register for place in item.reads}
    for register in {place.register for place in item.writes}:
        _cover(found, register, at + WRITE, ends.pop(register, at + STRIDE))
        if register in read:
            ends[register] = at + WRITE
    for register in read:
        ends.setdefault(register, at + (WRITE + 1 if item.distinct else 1))


def _cover(found: dict[Register, int], register: Register, start: int, end: int) -> None:
    found[register] = found.get(register, 0) | (1 << end) - (1 << start)
