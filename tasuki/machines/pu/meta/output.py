"""What the meta-assembler writes, and reading it back: binary, hex for ``$readmemh``, and the listing.

Binary: the words one after another, each most significant byte first (32 bytes for 256 bits). Hex: a word a line, 64
digits, with comments ``// label`` that ``$readmemh`` skips. Both hold program memory alone; data stays in the source.
"""

from __future__ import annotations

from collections.abc import Iterator

from tasuki.diagnostics import Diagnostic, SourceError, Span
from tasuki.machines.pu.isa import DEFAULT, InstructionSet, Program, Word
from tasuki.machines.pu.meta.assembler import Assembly


def to_binary(program: Program, isa: InstructionSet = DEFAULT) -> bytes:
    """The words as bytes; a word whose width is no multiple of 8 is filled up with zeros at its upper end."""
    size = (isa.bits + 7) // 8
    return b"".join(word.to_bytes(size) for word in program.words)


def from_binary(data: bytes, name: str = "<binary>", isa: InstructionSet = DEFAULT) -> tuple[Word, ...]:
    """The words of `to_binary`. Raises SourceError where the length is no whole number of words or too great."""
    size = (isa.bits + 7) // 8
    if len(data) % size:
        raise _wrong(f"{name}: this is no microcode", f"a multiple of {size} bytes", f"{len(data)} bytes")
    if len(data) // size > isa.program_words:
        raise _wrong(f"{name}: the program is too long", f"at most {isa.program_words} words")
    words = tuple(int.from_bytes(data[at : at + size]) for at in range(0, len(data), size))
    for address, word in enumerate(words):
        if word >> isa.bits:
            raise _wrong(f"{name}: word {address} is wider than {isa.bits} bits")
    return words


def _wrong(message: str, expected: str | None = None, found: str | None = None) -> SourceError:
    return SourceError([Diagnostic(message, None, expected, found)])


def to_hex(program: Program, isa: InstructionSet = DEFAULT) -> str:
    """Lines for Verilog's ``$readmemh``."""
    digits = (isa.bits + 3) // 4
    names: dict[int, list[str]] = {}
    for name, address in program.labels.items():
        names.setdefault(address, []).append(name)
    lines = []
    for address, word in enumerate(program.words):
        label = "  // " + ", ".join(names[address]) if address in names else ""
        lines.append(f"{word:0{digits}x}{label}\n")
    return "".join(lines)


def from_hex(text: str, name: str = "<hex>", isa: InstructionSet = DEFAULT) -> tuple[Word, ...]:
    """The words of a hex file: white space between words, ``//`` comments, ``_`` between digits.

    Addresses (``@``) and unknown digits (x, z) are not accepted. Raises SourceError with all faulty words.
    """
    words, faults = [], []
    for number, line in enumerate(text.splitlines(), 1):
        for column, piece in _pieces(line.split("//")[0]):
            span = Span(name, number, column, number, column + len(piece))
            digits = piece.replace("_", "")
            if not digits or len(digits) > 1000 or not set(digits) <= set("0123456789abcdefABCDEF"):
                faults.append(Diagnostic("this is no word", span, "hexadecimal digits", source=text))
            elif int(digits, 16) >> isa.bits:
                faults.append(Diagnostic(f"the word is wider than {isa.bits} bits", span, source=text))
            else:
                words.append(int(digits, 16))
    if len(words) > isa.program_words:
        faults.append(Diagnostic(f"{name}: the program is too long", None, f"at most {isa.program_words} words"))
    if faults:
        raise SourceError(faults[:100])
    return tuple(words)


def _pieces(line: str) -> Iterator[tuple[int, str]]:
    at = 0
    for piece in line.split():
        at = line.index(piece, at)
        yield at, piece
        at += len(piece)


def listing(assembly: Assembly) -> str:
    """Address, bits and source side by side, every line of every file; data and sizes are in the source column."""
    isa, words = assembly.isa, assembly.program.words
    digits = (isa.bits + 3) // 4
    groups = digits + (digits - 1) // 8
    lines = [f"{'addr':>5}  {'bits':{groups}}  source\n"]
    current = None
    for listed in assembly.listed:
        if listed.source is not current:
            current = listed.source
            lines.append(f"{'':5}  {'':{groups}}  ; file {current.name}\n")
        text = current.lines[listed.line - 1]
        left = " " * (7 + groups)
        if listed.address is not None:
            left = f"{listed.address:05d}  {_grouped(words[listed.address], digits)}"
        lines.append(f"{left}  {text}".rstrip() + "\n")
    return "".join(lines)


def _grouped(word: Word, digits: int) -> str:
    """Hex digits in groups of eight, counted from the right."""
    text = f"{word:0{digits}x}"
    first = digits % 8
    head = [text[:first]] if first else []
    return " ".join(head + [text[at : at + 8] for at in range(first, digits, 8)])
