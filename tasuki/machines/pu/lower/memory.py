"""Tables, local arrays and the fields of their records: loads and stores through the address generator.

Every table and every local array is a `.table` of the macro assembler, with a base, an index and an attribute register
of its own: row = BR + IR * AR + row in the record. A record's fields become rows and words with names. What is loaded
or stored goes row by row: one memory access brings all parts that lie in a row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from tasuki.ir.types import BOOL, I32, Record, Scalar, Type, Vector
from tasuki.machines.pu.lower.code import Operand, Origin, Place, Word
from tasuki.machines.pu.lower.parts import COMPONENTS, part_starts, parts
from tasuki.machines.pu.lower.values import Arithmetic, Value

TAKEN = ("base", "stride", "count", "width", "br", "ir", "ar", "ir2", "ar2")
"""Words that mean something else behind the dot of a table."""


@dataclass(frozen=True)
class RecordText:
    """A record as `.record` declares it: for each row its name and its four words, "-" where there is none."""

    name: str
    rows: tuple[tuple[str, tuple[str, ...]], ...]

    @classmethod
    def of(cls, name: str, record: Record) -> RecordText:
        names = _Names()
        rows: list[tuple[str, list[str]]] = []
        for part, places in _parts_in_rows(record):
            row = places[0][0]
            if row == len(rows):
                rows.append((names.fresh(part if len(places) > 1 else f"{part}_row"), ["-"] * 4))
            for component, (_, bank) in zip(COMPONENTS if len(places) > 1 else ("",), places, strict=False):
                rows[row][1][bank] = names.fresh(f"{part}_{component}" if component else part)
        return cls(name, tuple((row, tuple(words)) for row, words in rows))

    @property
    def source(self) -> list[str]:
        """The lines that declare it."""
        lines = [f"    .row {row}: {' '.join(words)}" for row, words in self.rows]
        return [f".record {self.name}", *lines, ".end"]


class _Names:
    """Names of one record, each once."""

    def __init__(self) -> None:
        self.used = set(TAKEN)

    def fresh(self, name: str) -> str:
        while name in self.used:
            name += "_"
        self.used.add(name)
        return name


def _parts_in_rows(record: Record) -> Iterator[tuple[str, Sequence[tuple[int, int]]]]:
    """For each scalar and vector of a record its name, and the row and bank of each of its words."""
    starts = [*part_starts(record), len(record.leaves)]
    for name, start, end in zip(_part_names(record, ""), starts, starts[1:], strict=False):
        yield name, record.layout[start:end]


def _part_names(type_: Type, prefix: str) -> list[str]:
    if isinstance(type_, Scalar | Vector):
        return [prefix.removesuffix("_")]
    return [part for name, member in type_.members for part in _part_names(member, f"{prefix}{name}_")]


@dataclass(frozen=True)
class Slot:
    """A table, or a local array of `length` records: its name in the program and in the text, its record.

    An index into an array is clamped; a bool in a table may be any word that is not 0.
    """

    key: str
    name: str
    record: Record
    text: RecordText
    length: int | None = None

    @property
    def is_array(self) -> bool:
        return self.length is not None

    def row(self, row: int) -> Word:
        """A row of the record at which the table stands."""
        return Word(f"{self.name}.{self.text.rows[row][0]}", "field")


Fault = Callable[[Slot, Origin], tuple[int, str]]
"""For an access to a table: the row of its descriptor, and a label of the access's own."""


@dataclass
class MemoryAccess:
    """Emits accesses. It remembers at which record a table stands, as long as control cannot come from elsewhere."""

    arithmetic: Arithmetic
    fault: Fault | None
    """Makes the label to which an access outside a table goes, if accesses are checked."""
    standing: dict[str, Operand] = field(default_factory=dict)

    def forget(self) -> None:
        """Control may come from elsewhere, or has been elsewhere."""
        self.standing.clear()

    def written(self, place: Place) -> None:
        """A register has changed: no table stands where it says."""
        register = place.register
        self.standing = {
            name: at for name, at in self.standing.items() if not (isinstance(at, Place) and at.register is register)
        }

    def seek(self, slot: Slot, index: Operand) -> None:
        """The table stands at record `index`; for an array the nearest that it has."""
        if self.standing.get(slot.name) == index:
            return
        code, table = self.arithmetic.code, Word(slot.name, "table")
        if slot.length is None:
            if self.fault:
                row, label = self.fault(slot, code.origin)
                code.effect("check", row, self.arithmetic.placed(index, I32), Word(label, "label"))
            code.effect("seek", table, index)
        elif isinstance(index, int):
            code.effect("seek", table, min(max(index, 0), slot.length - 1))
        else:
            code.effect("seek_within", table, index, slot.length - 1)
        self.standing[slot.name] = index

    def load(self, slot: Slot, index: Operand, leaves: range, type_: Type, into: Place | None) -> Value:
        """The leaves of the record at `index` as a value of `type_`."""
        self.seek(slot, index)
        return self.take(slot, leaves, type_, into)

    def take(self, slot: Slot, leaves: range, type_: Type, into: Place | None = None) -> Value:
        """The same from the record at which the table stands."""
        code = self.arithmetic.code
        value: list[Place] = []
        # Into a part of a vector nothing is taken at once: bringing the rest of it from memory would fetch another row.
        into = None if into and into.is_part else into
        fetched = None
        for part, first in zip(parts(type_), part_starts(type_), strict=True):
            row, bank = slot.record.layout[leaves.start + first]
            if row != fetched:
                code.effect("fetch", slot.row(row))
                fetched = row
            value.append(self._take_part(part, "xyzs"[bank], into))
        if slot.is_array:
            return list(value)
        return [self._truth(one) if part == BOOL else one for part, one in zip(parts(type_), value, strict=True)]

    def _take_part(self, part: Type, bank: str, into: Place | None) -> Place:
        arithmetic = self.arithmetic
        if isinstance(part, Vector):
            return arithmetic.code.emit(f"take{part.size}", into or arithmetic.fresh("xyzs"[: part.size]))
        if str(part) != "f32":
            return arithmetic.code.emit(f"take_{bank}", into or arithmetic.fresh("i"))
        return arithmetic.code.emit(f"take_{bank}", into or arithmetic.fresh("s"))

    def _truth(self, word: Place) -> Place:
        return self.arithmetic.truth(self.arithmetic.holds(word), word)

    def store(self, slot: Slot, index: Operand, leaves: range, type_: Type, value: Value) -> None:
        """The leaves of the record at `index` become `value`."""
        self.seek(slot, index)
        self.put(slot, leaves, type_, value)

    def put(self, slot: Slot, leaves: range, type_: Type, value: Sequence[Operand]) -> None:
        """The same in the record at which the table stands."""
        for part, first, operand in zip(parts(type_), part_starts(type_), value, strict=True):
            row, bank = slot.record.layout[leaves.start + first]
            if isinstance(part, Vector):
                placed = self.arithmetic.placed(operand, part)
                self.arithmetic.code.effect(f"put{part.size}", slot.row(row), placed)
            else:
                self.arithmetic.code.effect(f"put_{'xyzs'[bank]}", slot.row(row), operand)

    def clear(self, slot: Slot) -> None:
        """Every record of an array becomes zero; the table stands nowhere afterwards."""
        assert slot.length is not None
        rows = slot.length * len(slot.text.rows)
        self.arithmetic.code.effect("clear", Word(slot.name, "table"), rows)
