"""A microinstruction as the simulators see it: decoded once, by mnemonics, its faults found beforehand."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import lru_cache

from tasuki.machines.pu import isa

FPP = isa.FPPS
BANKS = "xyzs"
FILES = tuple(isa.DEFAULT.register_counts)
"""Register files: x, y, z, s, alu, br, ir, ar."""

SELECT_FLAGS = {"sellt": ("lt",), "selle": ("lt", "eq"), "seleq": ("eq",)}
"""Operations of an FPP that choose by its flags: a where one of these is set."""
CONDITION_FLAGS = {"le": ("lt", "eq"), "ule": ("ult", "eq")}
"""Conditions that are not a flag: they hold where one of these is set."""


@dataclass(frozen=True)
class Instruction:
    """One microinstruction.

    `name[field]` is the mnemonic of a choice field ("" where the code is undefined), `number[field]` the number of any
    field. `problems` says why it traps whenever it is executed. `banks` are the enabled memory banks.
    """

    word: int
    name: dict[str, str]
    number: dict[str, int]
    problems: tuple[isa.Problem, ...]
    banks: tuple[str, ...]

    @property
    def accesses_memory(self) -> bool:
        """It uses its row to address the data memory: an access with no bank enabled does not."""
        return self.name["mem.op"] != "none" and bool(self.banks)

    @property
    def accesses_display(self) -> bool:
        """It uses its row to address the display memory."""
        return self.name["disp.op"] == "pixel"


@lru_cache(maxsize=1 << 15)
def instruction(word: isa.Word) -> Instruction:
    """Decode a microinstruction. An undefined one is no error here: it traps when it is executed."""
    number = isa.decode(word)
    name = {}
    for one in isa.DEFAULT.fields:
        if one.kind == "choice":
            value = one.by_code.get(number[one.name])
            name[one.name] = value.name if value else ""
    problems = isa.undefined(number) or isa.conflicts(number)
    banks = tuple(bank for bank, bit in zip(BANKS, (8, 4, 2, 1), strict=True) if number["mem.on"] & bit)
    return Instruction(word, name, number, tuple(problems), banks)


@dataclass(frozen=True)
class Cost:
    """What one execution of a microinstruction adds to the counters: it does not depend on the machine's state."""

    busy: tuple[str, ...]
    rows_read: int
    rows_written: int
    words_read: int
    words_written: int
    transfers: tuple[tuple[tuple[str, str], int], ...]
    pixels: int


def cost(one: Instruction) -> Cost:
    """What `one` keeps busy and moves."""
    name = one.name
    idle = {**{f"{unit}.op": "nop" for unit in (*FPP, "alu")}, "tab.op": "none", "ag.mode": "hold"}
    busy = [field.split(".")[0] for field, nothing in idle.items() if name[field] != nothing]
    if one.accesses_memory:
        busy.append("mem")
    if name["disp.op"] != "none":
        busy.append("disp")
    reads = int(name["mem.op"] == "read" and bool(one.banks))
    writes = int(name["mem.op"] == "write" and bool(one.banks))
    words = len(one.banks)
    transfers = tuple(sorted(Counter(isa.transfers(one.number)).items()))
    return Cost(tuple(busy), reads, writes, reads * words, writes * words, transfers, int(one.accesses_display))
