"""Virtual registers to registers of the machine, or to rows of memory where there are too few.

Registers that are copied from one to the other, and never live at the same time, become one, so that the copy goes
away (coalescing; G. Chaitin, "Register Allocation and Spilling via Graph Coloring", 1982). Every register of the
machine has a set of positions at which it is taken (`liveness`). Virtual registers, those that are used most for their
length first, take the first register that is free wherever they live, before all one in which a subroutine expects or
leaves them (a colouring by priority after F. Chow and J. Hennessy, "The Priority-Based Coloring Approach to Register
Allocation", 1990). One that finds none lives in a row of memory: it is loaded before each use and stored after each
write, through registers that are kept for this.

A subroutine's registers are its own: a caller's values that live on behind a call keep out of all that the subroutine,
and what it calls, may change. Arguments go straight into the parameters' places, results out of theirs.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tasuki.machines.pu.lower.code import CallSite, Instruction, Item, Label, Place, Register
from tasuki.machines.pu.lower.liveness import MIDDLE, STRIDE, live_blocks, lives, without_dead
from tasuki.machines.pu.lower.places import INTEGERS, ROWS, Cell, FinalItem, Fixed, Location, Spilled
from tasuki.machines.pu.lower.rewrite import Callee, Rewriting

MOST_LEVELS = 4
"""Loops around an instruction that count for its weight."""


@dataclass
class Allocated:
    """A piece of code with registers: the entry, or a subroutine with the places of its parameters and results."""

    label: str
    items: list[FinalItem]
    parameters: list[Location]
    results: list[Location]
    taken: set[Cell]
    """What a call of it may change."""
    frame_end: int
    """The first row that is free behind those in which registers live."""


def allocate(
    label: str,
    items: Sequence[Item],
    parameters: Sequence[Place],
    results: Sequence[Place],
    routines: Mapping[str, Allocated],
    frame_start: int,
) -> Allocated:
    """Code with registers. Registers that find none live in rows from `frame_start` on."""
    wanted = [place.register for place in results]
    kept = without_dead(items, wanted)
    allocation = _Allocation(kept, [place.register for place in parameters], wanted, routines)
    frame_end = allocation.choose(frame_start)
    callees: Mapping[str, Callee] = routines
    rewriting = Rewriting(allocation.places, callees)
    final = rewriting.run(kept)
    given = [allocation.places[place.register] for place in parameters]
    made = [allocation.places[place.register] for place in results]
    return Allocated(label, final, given, made, allocation.taken | rewriting.taken, frame_end)


class _Allocation:
    def __init__(
        self,
        items: list[Item],
        parameters: list[Register],
        results: list[Register],
        routines: Mapping[str, Allocated],
    ) -> None:
        self.items, self.routines = items, routines
        self.life = lives(items, live_blocks(items, results))
        # Parameters are written together before the code begins, results read together behind its end.
        for register in parameters:
            self.life[register] = self.life.get(register, 0) | 1
        for register in results:
            self.life[register] = self.life.get(register, 0) | 1 << STRIDE * len(items)
        self.depths = _loop_depths(items)
        self.joined: dict[Register, Register] = {}
        self.occupied: defaultdict[Cell, int] = defaultdict(int)
        self.taken: set[Cell] = set()
        self.places: dict[Register, Location] = {}

    def choose(self, frame_start: int) -> int:
        """A place for every register; the first row behind those of the registers that live in memory."""
        self.coalesce()
        self.wishes = self.wishes_of_calls()
        self.avoid_calls()
        frame = frame_start
        for register in self.by_priority():
            number = self.free_number(register)
            if number is None:
                self.places[register] = Spilled(register.banks, frame)
                frame += 1
            else:
                self.take(register, number)
        for register in self.joined:
            self.places[register] = self.places[self.root(register)]
        return frame

    def root(self, register: Register) -> Register:
        """What a register has become."""
        while register in self.joined:
            register = self.joined[register]
        return register

    def coalesce(self) -> None:
        """Joins registers that are copied, those in the innermost loops first."""
        copies = [i for i, item in enumerate(self.items) if isinstance(item, Instruction) and _is_copy(item)]
        for i in sorted(copies, key=lambda i: -self.depths[i]):
            target, source = (self.root(one.register) for one in self.items[i].operands)  # type: ignore[union-attr]
            if target is not source and not self.life[target] & self.life[source]:
                self.joined[source] = target
                self.life[target] |= self.life.pop(source)

    def wishes_of_calls(self) -> dict[Register, list[Fixed]]:
        """For each register where subroutines expect it, or leave it."""
        found: defaultdict[Register, list[Fixed]] = defaultdict(list)
        for item in self.items:
            if isinstance(item, CallSite):
                routine = self.routines[item.routine]
                pairs = [*zip(item.arguments, routine.parameters, strict=True)]
                for operand, place in [*pairs, *zip(item.writes, routine.results, strict=True)]:
                    if isinstance(operand, Place) and not operand.is_part and isinstance(place, Fixed):
                        found[self.root(operand.register)].append(place)
        return found

    def avoid_calls(self) -> None:
        """What lives through a call keeps out of the registers that it changes."""
        for i, item in enumerate(self.items):
            if isinstance(item, CallSite):
                changed = self.routines[item.routine].taken
                self.taken |= changed
                for cell in changed:
                    self.occupied[cell] |= 1 << STRIDE * i + MIDDLE

    def by_priority(self) -> list[Register]:
        """Those first that are used most, for the length of their life."""
        uses: Counter[Register] = Counter()
        for item, level in zip(self.items, self.depths, strict=True):
            if isinstance(item, Instruction):
                for place in (*item.writes, *item.reads):
                    uses[self.root(place.register)] += 10 ** min(level, MOST_LEVELS)
        order = {register: i for i, register in enumerate(self.life)}
        return sorted(self.life, key=lambda one: (-uses[one] / self.life[one].bit_count(), order[one]))

    def free_number(self, register: Register) -> int | None:
        """The number of a register that is free wherever this one lives."""
        count = INTEGERS if register.banks == "i" else ROWS
        for number in (*(fixed.number for fixed in self.wishes.get(register, ())), *range(count)):
            if all(not self.occupied[bank, number] & self.life[register] for bank in register.banks):
                return number
        return None

    def take(self, register: Register, number: int) -> None:
        fixed = Fixed(register.banks, number)
        self.places[register] = fixed
        self.taken |= fixed.cells
        for cell in fixed.cells:
            self.occupied[cell] |= self.life[register]


def _is_copy(item: Instruction) -> bool:
    """A whole register becomes another of the same banks."""
    if not item.name.startswith("move"):
        return False
    places = [one for one in item.operands if isinstance(one, Place) and not one.is_part]
    return len(places) == 2 and places[0].banks == places[1].banks


def _loop_depths(items: Sequence[Item]) -> list[int]:
    """For each item the number of loops around it: stretches from a label to the last jump back to it."""
    at = {item.name: i for i, item in enumerate(items) if isinstance(item, Label)}
    ends: dict[int, int] = {}
    for i, item in enumerate(items):
        if isinstance(item, Instruction) and item.target and at[item.target] <= i:
            ends[at[item.target]] = i
    depths = [0] * len(items)
    for start, end in ends.items():
        for i in range(start, end + 1):
            depths[i] += 1
    return depths
