"""What a name or an argument can stand for in macro assembler source, and the kinds that macros ask for.

| kind | written | meaning |
|---|---|---|
| s, x, y, z | s0 to s63, x0 ... | a register of one bank: a scalar |
| v | v0 to v63 | the registers of that number in the banks X, Y, Z, S: a vector |
| m | m0 to m60 | four neighbouring vectors: a matrix, its columns one after another |
| i | i0 to i31 | a register of the ALU: an integer |
| float, integer | 0.5, 3, 2*N | a number; a whole number will do for a float |
| label | any label | an address of program memory |
| table | name of a `.table` or `.picture` | rows of data memory |
| field | table.field | words of the record that a table's index names |
| condition | s.lt, alu.eq, special, ... | what the sequencer can test |
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple

from tasuki.machines.pu.isa import DEFAULT
from tasuki.machines.pu.meta.expressions import Register

FILES = {
    "s": ("s",),
    "x": ("x",),
    "y": ("y",),
    "z": ("z",),
    "v": ("x", "y", "z", "s"),
    "m": ("x", "y", "z", "s"),
    "i": ("alu",),
    "R": ("x", "y", "z", "s"),
    "I": ("alu",),
    "BR": ("br",),
    "IR": ("ir",),
    "AR": ("ar",),
}
"""Kind of register -> the register files that it names. The kinds in capitals are the meta-assembler's."""
KINDS = ("s", "x", "y", "z", "v", "m", "i", "float", "integer", "label", "table", "field", "condition")
MATRIX_ROWS = 4
_REGISTER = re.compile(r"([sxyzvmi]|R|I|BR|IR|AR)(\d{1,4})")
_LATCHES = {0b1000: "memx", 0b0100: "memy", 0b0010: "memz", 0b0001: "mems"}


class Word(NamedTuple):
    """A mnemonic of a choice field, such as a condition."""

    text: str


class Label(NamedTuple):
    """A label, under the name that it has in the meta-assembler source."""

    name: str


@dataclass(frozen=True)
class Record:
    """A record: its length in rows, and for each field its row and its banks (8 = X, 4 = Y, 2 = Z, 1 = S)."""

    rows: int
    fields: dict[str, tuple[int, int]]


@dataclass(frozen=True)
class Table:
    """Records, one after another from row `base` on, reached through BR, IR and AR number `unit`.

    A picture is a table of pixels: `count` is then its number of lines, and `width` and `pitch` are in pixels.
    """

    name: str
    record: Record
    base: int
    count: int
    unit: int
    width: int = 0

    @property
    def rows(self) -> int:
        """Rows of data memory that it takes."""
        return self.count * (self.width or self.record.rows)


@dataclass(frozen=True)
class Field:
    """A field of the record at which a table stands."""

    table: Table
    name: str
    row: int
    banks: int


Operand = Register | int | float | Word | Label | Table | Field

ATTRIBUTES = {
    "table": ("base", "stride", "count", "width", "br", "ir", "ar", "ir2", "ar2"),
    "field": ("row", "banks", "latch", "alu_latch", "br", "ir", "ar"),
    "register": ("x", "y", "z", "s", "v"),
}
"""What may stand behind the dot: of a table, of a field, of a vector or matrix register."""


def register(text: str) -> Register | None:
    """The register that a name is, whatever its number; None where it is none."""
    found = _REGISTER.fullmatch(text)
    return Register(found[1], int(found[2])) if found else None


def register_fault(one: Register) -> str | None:
    """Why there is no such register, or None."""
    count = DEFAULT.register_counts[FILES[one.kind][0]]
    last = count - MATRIX_ROWS if one.kind == "m" else count - 1
    return None if 0 <= one.number <= last else f"expected {one.kind}0 to {one.kind}{last}"


def kind_of(operand: Operand) -> str:
    """The kind of an operand, as macros name kinds; a whole number is an "integer"."""
    if isinstance(operand, Register):
        return operand.kind
    names = {int: "integer", float: "float", Word: "condition", Label: "label", Table: "table", Field: "field"}
    return names[type(operand)]


def fits(operand: Operand, kind: str) -> bool:
    """Whether a parameter of this kind takes the operand."""
    found = kind_of(operand)
    return found == kind or (kind == "float" and found == "integer")


def attribute(operand: Operand, name: str) -> Operand | None:
    """What `operand.name` is, or None where there is no such thing."""
    if isinstance(operand, Table):
        return _of_table(operand, name)
    if isinstance(operand, Field):
        return _of_field(operand, name)
    if isinstance(operand, Register) and operand.kind in ("v", "m") and name in ATTRIBUTES["register"]:
        return Register(name, operand.number)
    return None


def attribute_fault(operand: Operand, name: str) -> str:
    """Why `operand.name` is nothing."""
    if isinstance(operand, Field) and name in ("latch", "alu_latch"):
        return f"{shown(operand)} is more than one word"
    return f"{shown(operand)} has no '{name}'"


def _of_table(table: Table, name: str) -> Operand | None:
    if name in table.record.fields:
        row, banks = table.record.fields[name]
        return Field(table, name, row, banks)
    numbers = {"base": table.base, "stride": table.width or table.record.rows, "count": table.count}
    if name in numbers:
        return numbers[name]
    if name == "width":
        return table.width
    return _address_register(table, name)


def _of_field(field: Field, name: str) -> Operand | None:
    if name in ("row", "banks"):
        return field.row if name == "row" else field.banks
    if name in ("latch", "alu_latch"):
        latch = _LATCHES.get(field.banks)
        if latch is None:
            return None
        # FPPS calls the latch of its own bank `mem`; the ALU has none of its own.
        return Word("mem" if name == "latch" and latch == "mems" else latch)
    return _address_register(field.table, name)


def _address_register(table: Table, name: str) -> Operand | None:
    """BR, IR and AR of a table; `ir2` and `ar2` are the partners."""
    file = name.removesuffix("2")
    if file not in ("br", "ir", "ar") or name == "br2":
        return None
    return Register(file.upper(), table.unit ^ 1 if name.endswith("2") else table.unit)


def span_of_registers(operand: Operand) -> set[tuple[str, int]]:
    """(bank, number) of all registers that an operand takes."""
    if not isinstance(operand, Register):
        return set()
    rows = MATRIX_ROWS if operand.kind == "m" else 1
    return {(file, operand.number + i) for file in FILES[operand.kind] for i in range(rows)}


def shown(operand: Operand) -> str:
    """An operand as one would write it."""
    if isinstance(operand, Word | Label):
        return operand[0]
    if isinstance(operand, Table):
        return operand.name
    return f"{operand.table.name}.{operand.name}" if isinstance(operand, Field) else str(operand)
