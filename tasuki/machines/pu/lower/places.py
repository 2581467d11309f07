"""Where values live once registers are chosen, and which registers there are for that."""

from __future__ import annotations

from dataclasses import dataclass

from tasuki.machines.pu.lower.code import Label, Origin, Word

ROWS = 43
INTEGERS = 27
"""Registers of the banks, and of the ALU, in which values may live."""
RELOAD_ROWS = range(43, 48)
RELOAD_INTEGERS = range(27, 32)
"""Registers through which values go that live in memory. (The library's macros have those of the banks from 48 on.)"""
SPARES = len(RELOAD_ROWS)
Cell = tuple[str, int]
"""A register of one bank: its bank and its number."""


@dataclass(frozen=True)
class Fixed:
    """A register of the machine, in one bank or several."""

    banks: str
    number: int

    @property
    def cells(self) -> set[Cell]:
        return {(bank, self.number) for bank in self.banks}


@dataclass(frozen=True)
class Spilled:
    """A row of the program's own memory in which a virtual register lives; an integer lives in bank S of its row."""

    banks: str
    row: int


Location = Fixed | Spilled


@dataclass(frozen=True)
class Final:
    """A macro call as it will be written; `operands` name registers of the machine."""

    name: str
    operands: tuple[Fixed | float | int | Word, ...]
    origin: Origin


FinalItem = Final | Label


def reload_register(banks: str, position: int) -> Fixed:
    """The `position`-th register of these banks that is kept for values that live in memory."""
    return Fixed(banks, (RELOAD_INTEGERS if banks == "i" else RELOAD_ROWS)[position])
