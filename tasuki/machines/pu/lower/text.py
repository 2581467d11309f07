"""The text of a compiled program: macro assembler source that a person can read.

At the head the memory (records, tables, where registers live that found no place) and the macros that the program
brings along; then the prologue, the loop over items with the entry in it, and the subroutines. A comment line above the
macro calls of each line of source says which it is.
"""

from __future__ import annotations

import linecache
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache

from tasuki.machines.pu.lower.code import Label, Origin, Word
from tasuki.machines.pu.lower.macros import NUMBERS, definition
from tasuki.machines.pu.lower.places import Final, FinalItem, Fixed
from tasuki.machines.pu.lower.program import Lowered
from tasuki.machines.pu.macro.assembler import library

INDENT = "        "
Key = tuple[str, tuple[str, ...]]


@dataclass
class Text:
    """Source lines; `modules[i]` is the module for which line i counts ("" where it makes no microinstruction)."""

    lines: list[str] = field(default_factory=list)
    modules: list[str] = field(default_factory=list)

    def add(self, line: str, module: str = "") -> None:
        self.lines.append(line)
        self.modules.append(module)


def write(lowered: Lowered) -> Text:
    """The whole text."""
    pieces = [(lowered.entry, "jump item"), *((routine, "return") for routine in lowered.routines)]
    text = Text()
    for line in (*_memory(lowered), "", *_definitions([piece.items for piece, _ in pieces])):
        text.add(line)
    for piece, end in pieces:
        text.add("")
        text.add(f"{piece.label}:")
        module, written = lowered.written.get(piece.label, ("", None))
        if written:
            for line in written.lines:
                text.add(line, module)
            continue
        _write_items(text, piece.items)
        if end == "return":
            last = next((item.origin.module for item in reversed(piece.items) if isinstance(item, Final)), "")
            text.add(f"{INDENT}return", last)
    for number, site in enumerate(lowered.sites):
        text.add(f"{site.label}:")
        text.add(f"{INDENT}fault {number}", site.origin.module)
    return text


def _memory(lowered: Lowered) -> Iterator[str]:
    """Records and tables, from row 0 on: descriptors, then what is the program's own."""
    first = len(lowered.tables)
    yield f"; rows 0 to {first - 1}: for each table its first row and its number of records" if first else "; no tables"
    yield f".const frame = {first}"
    first += lowered.frame_rows
    for text in dict.fromkeys(slot.text for slot in lowered.slots):
        yield from text.source
    for slot in lowered.slots:
        count = slot.length or 1
        yield f".table {slot.name}, {slot.text.name}, {count}, {first}"
        first += count * len(slot.text.rows)


def own_rows(lowered: Lowered) -> int:
    """Rows of memory before those of the tables that the program is given."""
    slots = sum((slot.length or 1) * len(slot.text.rows) for slot in lowered.slots)
    return len(lowered.tables) + lowered.frame_rows + slots


def _definitions(pieces: Sequence[Sequence[FinalItem]]) -> Iterator[str]:
    """The macros that the program brings along, each for the kinds of operands that it is used with."""
    used: dict[Key, None] = {}
    for items in pieces:
        for item in items:
            if isinstance(item, Final):
                used.setdefault((item.name, tuple(_kind(operand) for operand in item.operands)))
    for name, kinds in sorted(used.keys() - _library()):
        steps = definition(name, kinds)
        if steps is not None:
            letters = _letters(name, kinds)
            parameters = ", ".join(f"{letter}:{kind}" for letter, kind in zip(letters, kinds, strict=True))
            yield f".macro {name} {parameters}"
            yield from (f"    {step}" for step in steps)
            yield ".end"


@cache
def _library() -> frozenset[Key]:
    """The macros that every program sees, with the kinds of their operands."""
    macros = (one for same in library().library.values() for one in same)
    return frozenset((one.name.text, tuple(kind for _, kind in one.parameters)) for one in macros)


def _letters(name: str, kinds: Sequence[str]) -> Sequence[str]:
    """Names of a macro's parameters: d is written, or the place in memory; a comparison has a and b."""
    return "ab" if name == "compare" else "dabc"[: len(kinds)]


def _write_items(text: Text, items: Sequence[FinalItem]) -> None:
    shown: Origin | None = None
    for item in items:
        if isinstance(item, Label):
            text.add(f"{item.name}:")
            continue
        if shown is None or _line(item.origin) != _line(shown):
            shown = item.origin
            comment = _comment(shown)
            if comment:
                text.add(f"{INDENT}; {comment}")
        operands = ", ".join(map(_written, item.operands))
        text.add(f"{INDENT}{item.name} {operands}".rstrip(), item.origin.module)


def _line(origin: Origin) -> tuple[str, int] | None:
    return (origin.span.file, origin.span.line) if origin.span else None


def _comment(origin: Origin) -> str:
    """The line of source that an origin is."""
    if origin.span is None:
        return ""
    line = linecache.getline(origin.span.file, origin.span.line).strip()
    name = origin.span.file.replace("\\", "/").rsplit("/", 1)[-1]
    return f"{name}:{origin.span.line}: {line}".rstrip()


def _kind(operand: Fixed | float | int | Word) -> str:
    if isinstance(operand, Word):
        return operand.kind
    if isinstance(operand, Fixed):
        return operand.banks if len(operand.banks) == 1 else "v"
    return NUMBERS[isinstance(operand, int)]


def _written(operand: Fixed | float | int | Word) -> str:
    if isinstance(operand, Word):
        return operand.text
    if isinstance(operand, Fixed):
        return f"{operand.banks if len(operand.banks) == 1 else 'v'}{operand.number}"
    return repr(operand)
