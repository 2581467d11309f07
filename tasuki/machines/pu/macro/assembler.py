"""The macro assembler: readable source to meta-assembler source, and through the meta-assembler to words."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from tasuki.diagnostics import Diagnostic, Note, SourceError, Span
from tasuki.machines.pu.isa import Program
from tasuki.machines.pu.macro.expand import Expansion, Line
from tasuki.machines.pu.macro.reader import Reader
from tasuki.machines.pu.meta import Assembly
from tasuki.machines.pu.meta import assemble as assemble_meta
from tasuki.machines.pu.meta.source import Errors, Source, TooManyErrors, read_source

LIBRARY = Path(__file__).parent / "library"
"""The basic operation macros and the ordinary instructions, as files. Every program sees them."""


@dataclass(frozen=True)
class MacroAssembly:
    """A program written in the macro assembler.

    `source` is the text with its includes put in, `meta` the meta-assembler source that it became, `assembly` what that
    assembles to; its spans are lines of the macro source.
    """

    source: str
    meta: str
    assembly: Assembly

    @property
    def program(self) -> Program:
        """The program, for a simulator."""
        return self.assembly.program


def assemble_file(path: Path | str) -> MacroAssembly:
    """Assembles a `.macro` file and what it includes. Raises SourceError with every error that was found."""
    path = Path(path)
    return _assemble(read_source(path), path)


def assemble(text: str, name: str = "<text>") -> MacroAssembly:
    """Assembles a text; `name` is what messages call it, and where its includes start from. Raises SourceError."""
    return _assemble(Source(name, text), None)


@cache
def library() -> Reader:
    """The library, read once. Raises SourceError where it is wrong."""
    errors = Errors()
    reader = Reader(errors)
    reader.read_library(sorted(LIBRARY.glob("*.macro")))
    errors.check()
    return reader


def _assemble(source: Source, path: Path | None) -> MacroAssembly:
    errors = Errors()
    reader = Reader(errors)
    expansion = Expansion(reader)
    try:
        reader.use_library(library())
        reader.read(source, path)
        expansion.run()
    except TooManyErrors:
        pass
    errors.check()
    lines = [*_head(reader, source.name), *expansion.lines]
    meta = "".join(f"{line.text}\n" for line in lines)
    name = f"{source.name} (translated)"
    try:
        assembly = assemble_meta(meta, name)
    except SourceError as error:
        raise SourceError([_traced(one, name, lines) for one in error.diagnostics]) from None
    spans = tuple(_origin(span, lines) for span in assembly.program.spans)
    program = replace(assembly.program, spans=spans)
    return MacroAssembly("".join(f"{line}\n" for line in reader.text), meta, replace(assembly, program=program))


def _head(reader: Reader, name: str) -> list[Line]:
    """What stands before the instructions: sizes of memories, tables as comments, and data."""
    lines = [Line(f"; translated from {Path(name).name}")]
    needed = max((table.base + table.rows for table in reader.tables), default=0)
    needed = max(needed, max(reader.memory, default=-1) // 4 + 1)
    sizes = dict(reader.sizes)
    if needed > sizes.get(".memory", Program.memory_rows):
        sizes[".memory"] = needed
    lines += [Line(f"{directive} {rows}") for directive, rows in sizes.items()]
    for table in reader.tables:
        last = table.base + table.rows - 1
        lines.append(Line(f"; {table.name}: rows {table.base} to {last}, BR{table.unit} IR{table.unit} AR{table.unit}"))
    rows: dict[int, list[int]] = {}
    for place, (word, _) in reader.memory.items():
        rows.setdefault(place // 4, [0, 0, 0, 0])[place % 4] = word
    lines += [Line(f".data {row}: {', '.join(f'{word:#010x}' for word in rows[row])}") for row in sorted(rows)]
    return lines


def _origin(span: Span | None, lines: list[Line]) -> Span | None:
    """The macro assembler's line for a line of the translation."""
    return lines[span.line - 1].span if span else None


def _traced(one: Diagnostic, name: str, lines: list[Line]) -> Diagnostic:
    """A message of the meta-assembler, told at the line of the program that the faulty line comes from."""
    if one.span is None or one.span.file != name:
        return one
    line = lines[one.span.line - 1]
    if line.origin is None:
        return one
    notes = (Note(f"which became `{line.text.strip()}`"),)
    return replace(one, span=line.span, source=line.origin.source.text, notes=notes)
