"""The microinstruction's fields: names, widths, places and values, as data. `InstructionSet` holds them.

Fields stand in the word in the order of `InstructionSet.fields`, the first at the most significant end, without gaps.
A field's name is its unit and a word: `x.op`, `mem.on`, `seq.to`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

from tasuki.machines.pu.isa import values
from tasuki.machines.pu.isa.values import Value

Kind = Literal["choice", "register", "mask", "address", "literal"]


@dataclass(frozen=True)
class Widths:
    """Widths in bits: the parameters of the machine. The default makes a word of exactly 256 bits.

    A register file has 2**width registers; program memory holds 2**program words.
    """

    fpp_op: int = 5
    vector_source: int = 3
    s_source: int = 4
    fpp_register: int = 6
    fpp_write: int = 2
    table_function: int = 3
    table_input: int = 3
    alu_op: int = 5
    alu_source: int = 4
    alu_register: int = 5
    alu_write: int = 1
    memory_op: int = 2
    memory_data: int = 2
    address_register: int = 5
    address_mode: int = 3
    address_update: int = 2
    address_load: int = 3
    display_op: int = 2
    sequencer_op: int = 4
    condition: int = 5
    program: int = 14


@dataclass(frozen=True)
class Field:
    """One field. `place` is the bit number of its least significant bit.

    `values` are the meanings of a choice; `file` is the register file that a register field names
    ("x", "y", "z", "s", "alu", "br", "ir" or "ar").
    """

    name: str
    width: int
    kind: Kind
    meaning: str
    values: tuple[Value, ...] = ()
    file: str = ""
    place: int = 0

    @property
    def unit(self) -> str:
        """The unit that the field steers: the part of the name before the dot."""
        return self.name.split(".")[0]

    @property
    def mask(self) -> int:
        """The greatest number that fits: 2**width - 1."""
        return (1 << self.width) - 1

    @cached_property
    def codes(self) -> Mapping[str, int]:
        """Mnemonic -> code."""
        return {value.name: value.code for value in self.values}

    @cached_property
    def by_code(self) -> Mapping[int, Value]:
        """Code -> value."""
        return {value.code: value for value in self.values}


def _fpp(unit: str, w: Widths) -> Iterator[Field]:
    """One floating-point unit with its register bank."""
    source = w.s_source if unit == "s" else w.vector_source
    writes = values.S_WRITES if unit == "s" else values.VECTOR_WRITES
    sources = values.SOURCES[unit]
    name = f"FPP{unit.upper()}"
    yield Field(f"{unit}.op", w.fpp_op, "choice", f"Operation of {name}.", values.FPP_OPERATIONS)
    yield Field(f"{unit}.a", source, "choice", "Source of operand a.", sources)
    yield Field(f"{unit}.b", source, "choice", "Source of operand b.", sources)
    for port, meaning in (("ra", "Register at read port a."), ("rb", "Register at read port b.")):
        yield Field(f"{unit}.{port}", w.fpp_register, "register", meaning, file=unit)
    yield Field(f"{unit}.rd", w.fpp_register, "register", "Register that is written.", file=unit)
    yield Field(f"{unit}.w", w.fpp_write, "choice", "What is written to it.", writes)


def _alu(w: Widths) -> Iterator[Field]:
    yield Field("alu.op", w.alu_op, "choice", "Operation of the integer ALU.", values.ALU_OPERATIONS)
    yield Field("alu.a", w.alu_source, "choice", "Source of operand a.", values.ALU_SOURCES)
    yield Field("alu.b", w.alu_source, "choice", "Source of operand b.", values.ALU_SOURCES)
    yield Field("alu.ra", w.alu_register, "register", "ALU register at read port a.", file="alu")
    yield Field("alu.rb", w.alu_register, "register", "ALU register at read port b.", file="alu")
    yield Field("alu.rd", w.alu_register, "register", "ALU register that is written.", file="alu")
    yield Field("alu.w", w.alu_write, "choice", "What is written to it.", values.ALU_WRITES)


def _tables(w: Widths) -> Iterator[Field]:
    yield Field("tab.op", w.table_function, "choice", "Which table is read.", values.TABLE_FUNCTIONS)
    yield Field("tab.in", w.table_input, "choice", "Which word it is read for.", values.TABLE_INPUTS)


def _memory(w: Widths) -> Iterator[Field]:
    yield Field("mem.op", w.memory_op, "choice", "Access to one row of the data memory.", values.MEMORY_OPERATIONS)
    yield Field("mem.on", 4, "mask", "Enabled banks: 8 = X, 4 = Y, 2 = Z, 1 = S; also as letters, `xyz`.")
    for bank in "xyzs":
        meaning = f"What bank {bank.upper()}'s data bus carries (memory write and display)."
        yield Field(f"mem.{bank}", w.memory_data, "choice", meaning, values.MEMORY_DATA)


def _address_generator(w: Widths) -> Iterator[Field]:
    yield Field("ag.mode", w.address_mode, "choice", "How the row is computed.", values.ADDRESS_MODES)
    for file, name in (("br", "Base"), ("ir", "Index"), ("ar", "Attribute")):
        yield Field(f"ag.{file}", w.address_register, "register", f"{name} register.", file=file)
    yield Field("ag.update", w.address_update, "choice", "How the index register goes on.", values.ADDRESS_UPDATES)
    yield Field("ag.load", w.address_load, "choice", "Which register is loaded, and with what.", values.ADDRESS_LOADS)


def _sequencer(w: Widths) -> Iterator[Field]:
    yield Field("seq.op", w.sequencer_op, "choice", "Where control goes.", values.SEQUENCER_OPERATIONS)
    yield Field("seq.cond", w.condition, "choice", "The condition.", values.CONDITIONS)
    yield Field("seq.not", 1, "choice", "Its polarity.", values.POLARITY)
    yield Field("seq.to", w.program, "address", "Address in program memory.")


def _place(fields: list[Field]) -> tuple[Field, ...]:
    """The same fields, packed from the least significant end backwards."""
    placed, place = [], 0
    for one in reversed(fields):
        placed.append(Field(one.name, one.width, one.kind, one.meaning, one.values, one.file, place))
        place += one.width
    return tuple(reversed(placed))


@dataclass(frozen=True)
class InstructionSet:
    """All fields of a machine with these widths. `DEFAULT` is the paper's machine: 256 bits.

    Raises ValueError where a width is too small for the values that its field must hold.
    """

    widths: Widths = field(default_factory=Widths)

    def __post_init__(self) -> None:
        for one in self.fields:
            if one.width < 1 or any(value.code > one.mask for value in one.values):
                raise ValueError(f"field {one.name}: {one.width} bits cannot hold {len(one.values)} values")

    @cached_property
    def fields(self) -> tuple[Field, ...]:
        """Every field, the most significant first."""
        w = self.widths
        fields = [one for unit in "xyzs" for one in _fpp(unit, w)]
        fields += [*_tables(w), *_alu(w), *_memory(w), *_address_generator(w)]
        fields += [Field("disp.op", w.display_op, "choice", "The display port.", values.DISPLAY_OPERATIONS)]
        fields += [*_sequencer(w), Field("lit", 32, "literal", "The literal: any word, read by whoever selects it.")]
        return _place(fields)

    @cached_property
    def by_name(self) -> Mapping[str, Field]:
        """Name -> field."""
        return {one.name: one for one in self.fields}

    @cached_property
    def bits(self) -> int:
        """The width of the microinstruction."""
        return sum(one.width for one in self.fields)

    @cached_property
    def register_counts(self) -> Mapping[str, int]:
        """Register file -> number of registers: "x", "y", "z", "s", "alu", "br", "ir", "ar"."""
        return {one.file: one.mask + 1 for one in self.fields if one.kind == "register"}

    @property
    def program_words(self) -> int:
        """How many microinstructions program memory holds."""
        return 1 << self.widths.program


DEFAULT = InstructionSet()
