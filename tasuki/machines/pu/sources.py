"""Microcode from files, by their suffix: `.macro` and `.meta` are source, `.hex` and `.bin` what was assembled."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tasuki.diagnostics import Diagnostic, SourceError
from tasuki.machines.pu import macro, meta
from tasuki.machines.pu.isa import Program, Word
from tasuki.machines.pu.meta.source import read_bytes, read_source

FORMS = ("macro", "meta", "listing", "hex", "binary")
"""What an assembled file can be written as."""


@dataclass(frozen=True)
class Assembled:
    """An assembled file: its text as meta-assembler source, and as macro assembler source where it was written so."""

    assembly: meta.Assembly
    meta: str
    macro: str | None

    @property
    def program(self) -> Program:
        """The program, for a simulator."""
        return self.assembly.program

    def written(self, form: str) -> bytes:
        """The program in one of `FORMS`. Raises SourceError where there is no such form."""
        if form == "binary":
            return meta.to_binary(self.program)
        if form == "macro" and self.macro is None:
            raise SourceError([Diagnostic("there is no macro source", None, "a .macro file", "a .meta file")])
        texts = {"macro": lambda: self.macro, "meta": lambda: self.meta, "hex": lambda: meta.to_hex(self.program)}
        texts["listing"] = lambda: meta.listing(self.assembly)
        if form not in texts:
            raise SourceError([Diagnostic(f"there is no form {form!r}", None, ", ".join(FORMS))])
        return (texts[form]() or "").encode()


def assemble(path: Path) -> Assembled:
    """Assembles a file; words alone are disassembled first. Raises SourceError with every error that was found."""
    if path.suffix == ".macro":
        made = macro.assemble_file(path)
        return Assembled(made.assembly, made.meta, made.source)
    if path.suffix == ".meta":
        return Assembled(meta.assemble_file(path), read_source(path).text, None)
    if path.suffix in (".hex", ".bin"):
        text = meta.disassemble(Program(_words(path)))
        return Assembled(meta.assemble(text, f"{path} (disassembled)"), text, None)
    found = repr(path.suffix) if path.suffix else "no suffix"
    message = f"cannot tell the language of {str(path)!r} by its suffix"
    raise SourceError([Diagnostic(message, None, "a name ending in .macro or .meta, or in .hex or .bin", found)])


def _words(path: Path) -> tuple[Word, ...]:
    """The words of a `.hex` or `.bin` file."""
    if path.suffix == ".hex":
        return meta.from_hex(read_source(path).text, str(path))
    return meta.from_binary(read_bytes(path), str(path))
