"""The first pass: files, includes, labels and directives. It leaves one `Line` for every microinstruction.

Every instruction line is one word, whatever its mnemonics stand for, so that addresses are known after this pass.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from tasuki.diagnostics import Note, SourceError, Span
from tasuki.machines.pu.isa import InstructionSet
from tasuki.machines.pu.meta.definitions import Definition, Definitions
from tasuki.machines.pu.meta.source import Errors, Source, Token, TooManyErrors, read_source, tokenize
from tasuki.machines.pu.meta.symbols import Symbols, close_match

MAX_INCLUDES = 64
"""Files that include each other, one in the next."""


@dataclass(frozen=True)
class Line:
    """One microinstruction as written. `span` is where messages at run time point. `raw` marks `.word`."""

    tokens: list[Token]
    span: Span
    raw: bool = False


@dataclass(frozen=True)
class Listed:
    """A source line for the listing, with the address of its microinstruction if it has one."""

    source: Source
    line: int
    address: int | None


@dataclass
class Reader:
    """What the first pass finds. `read` takes the main file; included files follow."""

    isa: InstructionSet
    errors: Errors = field(default_factory=Errors)
    lines: list[Line] = field(default_factory=list)
    listed: list[Listed] = field(default_factory=list)
    data: list[tuple[list[Token], list[list[Token]]]] = field(default_factory=list)
    sizes: dict[str, list[Token]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.symbols = Symbols(self.isa, self.errors)
        self.definitions = Definitions(self.errors)
        self._active: list[Path] = []
        self._done: set[Path] = set()
        self._origin: str | None = None
        self._origin_line = 0
        self._place = 0
        self._directives: dict[str, Callable[[Token, list[Token]], None]] = {
            ".const": self._const,
            ".reg": self._const,
            ".define": self._define,
            ".value": self._value,
            ".include": self._include,
            ".memory": self._size,
            ".display": self._size,
            ".data": self._data,
            ".line": self._line,
            ".word": self._word,
        }

    def read(self, source: Source, path: Path | None = None) -> None:
        """Reads one text and what it includes. `path` is where its includes start from (None: no file)."""
        self._active.append(path.resolve() if path else Path(source.name))
        line = 1
        while line <= len(source.lines):
            first = line
            tokens = tokenize(source, line, self.errors)
            while tokens and tokens[-1].text == "\\":
                tokens.pop()
                line += 1
                if line <= len(source.lines):
                    tokens += tokenize(source, line, self.errors)
            self._place = len(self.listed)
            self.listed += [Listed(source, number, None) for number in range(first, min(line, len(source.lines)) + 1)]
            self._statement(tokens)
            line += 1
        self._done.add(self._active.pop())

    def _statement(self, tokens: list[Token]) -> None:
        while len(tokens) >= 2 and tokens[0].kind == "name" and tokens[1].text == ":":
            self.symbols.define_label(tokens[0], len(self.lines))
            tokens = tokens[2:]
        if not tokens:
            return
        head = tokens[0]
        if head.kind != "directive":
            self._instruction(tokens, raw=False)
        elif head.text in self._directives:
            self._directives[head.text](head, tokens[1:])
        else:
            near = close_match(head.text, self._directives) or ", ".join(self._directives)
            self.errors.add(f"'{head.text}' is not a directive", head, expected=near)

    def _instruction(self, tokens: list[Token], raw: bool) -> None:
        span = tokens[0].span
        if self._origin is not None:
            span = Span(self._origin, self._origin_line)
        if len(self.lines) == self.isa.program_words:
            self.errors.add("the program is too long", tokens, expected=f"at most {self.isa.program_words} words")
            raise TooManyErrors
        listed = self.listed[self._place]
        self.listed[self._place] = Listed(listed.source, listed.line, len(self.lines))
        self.lines.append(Line(tokens, span, raw))

    def _const(self, head: Token, rest: list[Token]) -> None:
        if len(rest) < 3 or rest[0].kind != "name" or rest[1].text != "=":
            return self._malformed(head, rest, f"{head.text} NAME = VALUE")
        return self.symbols.define_constant(rest[0], rest[2:])

    def _define(self, head: Token, rest: list[Token]) -> None:
        equals = next((i for i, token in enumerate(rest) if token.text == "="), 0)
        front, body = rest[:equals], rest[equals + 1 :]
        parameters = _parameters(front)
        if parameters is None:
            return self._malformed(head, rest, ".define NAME = FIELDS, or .define NAME(PARAMETER, ...) = FIELDS")
        if front[0].text in self.isa.by_name:
            return self.errors.add(f"'{front[0].text}' is the name of a field", front[0], hint="choose another name")
        return self.definitions.add(Definition(front[0], tuple(parameters), tuple(body)))

    def _value(self, head: Token, rest: list[Token]) -> None:
        if len(rest) < 4 or rest[0].kind != "name" or rest[1].kind != "name" or rest[2].text != "=":
            return self._malformed(head, rest, ".value FIELD NAME = NUMBER")
        one = self.isa.by_name.get(rest[0].text)
        if one is None:
            near = close_match(rest[0].text, self.isa.by_name)
            self.errors.add(f"there is no field '{rest[0].text}'", rest[0], expected=near)
            return None
        return self.symbols.define_mnemonic(one, rest[1], rest[3:])

    def _include(self, head: Token, rest: list[Token]) -> None:
        if len(rest) != 1 or rest[0].kind != "string":
            return self._malformed(head, rest, '.include "FILE"')
        base = self._active[-1].parent
        path = base / rest[0].text[1:-1]
        try:
            real = path.resolve()
            if real in self._active:
                chain = " -> ".join(one.name for one in [*self._active[self._active.index(real) :], real])
                self.errors.add("the file includes itself", rest[0], found=chain)
            elif len(self._active) > MAX_INCLUDES:
                self.errors.add("includes are nested too deeply", rest[0], expected=f"at most {MAX_INCLUDES} levels")
            elif real not in self._done:
                source = read_source(path)
                origin, self._origin = self._origin, None
                self.read(source, path)
                self._origin = origin
        except SourceError as error:
            diagnostic = error.diagnostics[0]
            self.errors.add(diagnostic.message, rest[0], expected=diagnostic.expected, found=diagnostic.found)
        except (OSError, ValueError, RuntimeError):
            self.errors.add("this is no name of a file", rest[0])
        return None

    def _size(self, head: Token, rest: list[Token]) -> None:
        if not rest:
            return self._malformed(head, rest, f"{head.text} ROWS")
        if head.text in self.sizes:
            notes = [Note("first given here", self.sizes[head.text][0].span)]
            self.errors.add(f"{head.text} is given twice", head, notes=notes)
        self.sizes.setdefault(head.text, rest)
        return None

    def _data(self, head: Token, rest: list[Token]) -> None:
        colon = next((i for i, token in enumerate(rest) if token.text == ":"), 0)
        if not colon or colon + 1 == len(rest):
            return self._malformed(head, rest, ".data ROW: WORD, ...")
        words: list[list[Token]] = [[]]
        for token in rest[colon + 1 :]:
            if token.text == ",":
                words.append([])
            else:
                words[-1].append(token)
        if not all(words):
            return self._malformed(head, rest, ".data ROW: WORD, ...")
        self.data.append((rest[:colon], words))
        return None

    def _line(self, head: Token, rest: list[Token]) -> None:
        if not rest:
            self._origin = None
            return None
        if len(rest) != 2 or rest[0].kind != "number" or rest[1].kind != "string" or not rest[0].text.isdecimal():
            return self._malformed(head, rest, '.line, or .line NUMBER "FILE"')
        self._origin, self._origin_line = rest[1].text[1:-1], int(rest[0].text[:9])
        return None

    def _word(self, head: Token, rest: list[Token]) -> None:
        if not rest:
            return self._malformed(head, rest, ".word NUMBER")
        return self._instruction(rest, raw=True)

    def _malformed(self, head: Token, rest: list[Token], form: str) -> None:
        self.errors.add(f"{head.text} is malformed", [head, *rest], expected=form)


def _parameters(front: list[Token]) -> list[Token] | None:
    """The parameters of ``NAME`` or ``NAME(PARAMETER, ...)``; None where it is neither."""
    if not front or front[0].kind != "name":
        return None
    if len(front) == 1:
        return []
    if len(front) < 3 or front[1].text != "(" or front[-1].text != ")":
        return None
    inside = front[2:-1]
    names, commas = inside[::2], inside[1::2]
    if any(token.kind != "name" for token in names) or any(token.text != "," for token in commas):
        return None
    return None if inside and len(names) == len(commas) else names
