"""Code with the registers that were chosen: loads and stores around what lives in memory, arguments put in place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Protocol

from tasuki.machines.pu.lower.code import CallSite, Instruction, Item, Label, Operand, Origin, Place, Register, Word
from tasuki.machines.pu.lower.moves import Move, in_order
from tasuki.machines.pu.lower.places import (
    SPARES,
    Cell,
    Final,
    FinalItem,
    Fixed,
    Location,
    Spilled,
    reload_register,
)


class Callee(Protocol):
    """What a caller must know of a subroutine."""

    label: str
    parameters: list[Location]
    results: list[Location]


class Rewriting:
    """Rewrites one piece of code. `taken` are the registers kept for reloading that it uses."""

    def __init__(self, places: Mapping[Register, Location], routines: Mapping[str, Callee]) -> None:
        self.places, self.routines = places, routines
        self.items: list[FinalItem] = []
        self.taken: set[Cell] = set()
        self.origin = Origin("", None)

    def run(self, items: Sequence[Item]) -> list[FinalItem]:
        for item in items:
            if isinstance(item, Label):
                self.items.append(item)
                continue
            self.origin = item.origin
            if isinstance(item, CallSite):
                self.call(item)
            elif item.name != "undefined":
                self.instruction(item)
        return _without_idle(self.items)

    def add(self, name: str, *operands: Fixed | float | int | Word) -> None:
        self.items.append(Final(name, operands, self.origin))

    def instruction(self, item: Instruction) -> None:
        reloaded: dict[Register, Fixed] = {}
        for register in _registers((*item.reads, *item.writes)):
            place = self.places[register]
            if isinstance(place, Spilled):
                reloaded[register] = self.spare(place.banks, reloaded.values())
        for register in _registers(item.reads):
            self.bring(register, reloaded)
        self.add(item.name, *(self.final(one, reloaded) for one in item.operands))
        for register in _registers(item.writes):
            place = self.places[register]
            if isinstance(place, Spilled):
                self.store(place, reloaded[register])

    def bring(self, register: Register, reloaded: Mapping[Register, Fixed]) -> None:
        place = self.places[register]
        if isinstance(place, Spilled):
            self.move(reloaded[register], place)

    def spare(self, banks: str, used: Iterable[Fixed]) -> Fixed:
        """A register for reloading that shares nothing with those in use."""
        taken = {cell for one in used for cell in one.cells}
        choices = (reload_register(banks, position) for position in range(SPARES))
        fixed = next(one for one in choices if not one.cells & taken)
        self.taken |= fixed.cells
        return fixed

    def final(self, operand: Operand, reloaded: Mapping[Register, Fixed]) -> Fixed | float | int | Word:
        if not isinstance(operand, Place):
            return operand
        place = reloaded.get(operand.register) or self.places[operand.register]
        assert isinstance(place, Fixed)
        return Fixed(operand.banks, place.number)

    # --- memory and moves ---------------------------------------------------------------------------------------------

    def store(self, spilled: Spilled, fixed: Fixed) -> None:
        self.add(_memory_macro("put", spilled.banks), _frame_row(spilled), fixed)

    def move(self, target: Fixed, source: Location | float | int) -> None:
        if isinstance(source, Spilled):
            self.add("fetch", _frame_row(source))
            self.add(_memory_macro("take", source.banks), target)
        else:
            self.add("move" if len(target.banks) == 1 else f"move{len(target.banks)}", target, source)

    # --- calls --------------------------------------------------------------------------------------------------------

    def call(self, item: CallSite) -> None:
        routine = self.routines[item.routine]
        arguments = [self.where(one) for one in item.arguments]
        self.transfer([Move(*pair) for pair in zip(routine.parameters, arguments, strict=True)])
        self.add("call", Word(routine.label, "label"))
        targets = [replace(self.places[place.register], banks=place.banks) for place in item.writes]
        self.transfer([Move(*pair) for pair in zip(targets, routine.results, strict=True)])

    def where(self, operand: Operand) -> Location | float | int:
        if isinstance(operand, Place):
            return replace(self.places[operand.register], banks=operand.banks)
        assert not isinstance(operand, Word)
        return operand

    def transfer(self, moves: Sequence[Move]) -> None:
        """Moves that happen all at once."""
        for move in in_order(moves):
            target, source = move.target, move.source
            if isinstance(target, Fixed):
                self.taken |= target.cells
                self.move(target, source)
                continue
            if not (isinstance(source, Fixed) and source.banks == target.banks):
                work = reload_register(target.banks, 0)
                self.taken |= work.cells
                self.move(work, source)
                source = work
            self.store(target, source)


def _registers(places: Iterable[Place]) -> list[Register]:
    return list(dict.fromkeys(place.register for place in places))


def _memory_macro(name: str, banks: str) -> str:
    if len(banks) > 1:
        return f"{name}{len(banks)}"
    return f"{name}_{'s' if banks == 'i' else banks}"


def _frame_row(spilled: Spilled) -> Word:
    return Word(f"frame+{spilled.row}", "integer")


def _without_idle(items: Sequence[FinalItem]) -> list[FinalItem]:
    """Without copies from a register to itself, jumps to what comes next, and labels to which nothing goes."""
    kept: list[FinalItem] = []
    for item in items:
        if isinstance(item, Final) and item.name.startswith("move") and item.operands[0] == item.operands[1]:
            continue
        if isinstance(item, Label):
            last = next((i for i in reversed(range(len(kept))) if isinstance(kept[i], Final)), None)
            if last is not None and _jumps_to(kept[last], item.name):
                del kept[last]
        kept.append(item)
    wanted = {one.text for item in kept if isinstance(item, Final) for one in item.operands if isinstance(one, Word)}
    return [item for item in kept if isinstance(item, Final) or item.name in wanted]


def _jumps_to(item: FinalItem, label: str) -> bool:
    return isinstance(item, Final) and item.name == "jump" and item.operands == (Word(label, "label"),)
