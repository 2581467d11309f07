"""The meta-assembler: source in which a line is a microinstruction, to words.

Two passes: `reader` finds the lines, labels and definitions; here every line's mnemonics are expanded, its fields
computed and checked, and the words made. All errors of a source come together, each with its caret.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tasuki.diagnostics import Note
from tasuki.machines.pu.isa import DEFAULT, InstructionSet, Program, Row, Word, conflicts, decode
from tasuki.machines.pu.meta.definitions import Definition, Setting
from tasuki.machines.pu.meta.expressions import ValueFault
from tasuki.machines.pu.meta.reader import Line, Listed, Reader
from tasuki.machines.pu.meta.source import Source, Token, TooManyErrors, read_source
from tasuki.machines.pu.meta.symbols import close_match

MAX_ROWS = 1 << 24
"""The largest data or display memory, in rows."""


@dataclass(frozen=True)
class Assembly:
    """A program and the source lines that it came from, for the listing."""

    program: Program
    listed: tuple[Listed, ...]
    isa: InstructionSet


def assemble_file(path: Path | str, isa: InstructionSet = DEFAULT) -> Assembly:
    """Assembles a file and what it includes. Raises SourceError with every error that was found."""
    path = Path(path)
    return _assemble(read_source(path), path, isa)


def assemble(text: str, name: str = "<text>", isa: InstructionSet = DEFAULT) -> Assembly:
    """Assembles a text; `name` is what messages call it, and where its includes start from. Raises SourceError."""
    return _assemble(Source(name, text), None, isa)


def _assemble(source: Source, path: Path | None, isa: InstructionSet) -> Assembly:
    reader = Reader(isa)
    reader.definitions.add(Definition(Token("name", "nop", Source("<predefined>", "nop"), 1, 0), (), ()))
    program = Program(())
    try:
        reader.read(source, path)
        program = _Assembler(reader).program()
    except TooManyErrors:
        pass
    reader.errors.check()
    return Assembly(program, tuple(reader.listed), isa)


class _Assembler:
    """The second pass over what the reader found."""

    def __init__(self, reader: Reader) -> None:
        self.reader, self.isa, self.errors, self.symbols = reader, reader.isa, reader.errors, reader.symbols

    def program(self) -> Program:
        """The program; where there are errors, something of no use."""
        self._constants()
        words = tuple(self._raw(line) if line.raw else self._word(line) for line in self.reader.lines)
        memory_rows = self._size(".memory", Program.memory_rows)
        display_rows = self._size(".display", Program.display_rows)
        return Program(
            words,
            tuple(line.span for line in self.reader.lines),
            {name: address for name, (_, address) in self.symbols.labels.items()},
            self._memory(memory_rows),
            memory_rows,
            display_rows,
        )

    def _constants(self) -> None:
        """Computes every constant and mnemonic, so that wrong ones are reported even if nothing uses them."""
        for constant in self.symbols.constants.values():
            try:
                self.symbols.resolve(constant.name)
            except ValueFault as fault:
                self._report(fault, constant.name)
        for name, own in self.symbols.mnemonics.items():
            for constant in own.values():
                try:
                    self.symbols.field_bits(self.isa.by_name[name], constant.tokens)
                except ValueFault as fault:
                    self._report(fault, constant.name)

    def _word(self, line: Line) -> Word:
        """One microinstruction from its settings."""
        word, given = 0, dict[str, Setting]()
        for setting in self.reader.definitions.expand(line.tokens):
            name = setting.field.text
            one = self.isa.by_name.get(name)
            if one is None:
                near = close_match(name, self.isa.by_name)
                self.errors.add(f"there is no field '{name}'", setting.field, expected=near, notes=setting.notes())
            elif name in given:
                notes = [Note("first given here", given[name].field.span), *setting.notes()]
                self.errors.add(f"the field {name} is given twice", setting.field, notes=notes)
            elif setting.value:
                given[name] = setting
                try:
                    word |= self.symbols.field_bits(one, setting.value) << one.place
                except ValueFault as fault:
                    self._report(fault, setting.field, setting.notes())
        self._conflicts(word, given)
        return word

    def _conflicts(self, word: Word, given: dict[str, Setting]) -> None:
        for problem in conflicts(decode(word, self.isa), self.isa):
            settings = [given[name] for name in problem.fields if name in given]
            where = [settings[-1].field, *settings[-1].value]
            notes = [Note("and this", setting.field.span) for setting in settings[:-1]]
            self.errors.add(problem.message, where, notes=[*notes, *settings[-1].notes()])

    def _raw(self, line: Line) -> Word:
        try:
            return self.symbols.count(line.tokens, 0, (1 << self.isa.bits) - 1)
        except ValueFault as fault:
            self._report(fault, line.tokens[0])
            return 0

    def _size(self, directive: str, default: int) -> int:
        tokens = self.reader.sizes.get(directive)
        if tokens is None:
            return default
        try:
            return self.symbols.count(tokens, 1, MAX_ROWS)
        except ValueFault as fault:
            self._report(fault, tokens[0])
            return default

    def _memory(self, rows: int) -> dict[int, Row]:
        """The rows that `.data` fills; words beyond a row's four go on in the next row."""
        memory: dict[int, Row] = {}
        origin: dict[int, Token] = {}
        for place, values in self.reader.data:
            try:
                first = self.symbols.count(place, 0, rows - 1)
                words = [self.symbols.word(value) for value in values]
                words += [0] * (-len(words) % 4)
                self.symbols.count(place, 0, rows - len(words) // 4)
            except ValueFault as fault:
                self._report(fault, place[0])
                continue
            for i in range(0, len(words), 4):
                row = first + i // 4
                if row in memory:
                    notes = [Note("first given here", origin[row].span)]
                    self.errors.add(f"row {row} is given twice", place, notes=notes)
                memory[row] = (words[i], words[i + 1], words[i + 2], words[i + 3])
                origin[row] = place[0]
        return memory

    def _report(self, fault: ValueFault, fallback: Token, notes: list[Note] | None = None) -> None:
        where = list(fault.tokens) or fallback
        self.errors.add(fault.message, where, expected=fault.expected, notes=notes or ())
