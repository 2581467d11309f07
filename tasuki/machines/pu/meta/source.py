"""Reading source text: files, tokens, and the list of errors that an assembler gathers on the way.

A token knows its file, line and column, so that every message can draw its caret. Line numbers count as
`str.splitlines` does, as the carets of `diagnostics` do.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from tasuki.diagnostics import Diagnostic, Note, SourceError, Span

MAX_BYTES = 8 * 1024 * 1024
"""The largest source file: many times what fills program memory."""
MAX_LINE = 100_000
"""The longest line, in characters."""
MAX_ERRORS = 100
"""Errors that are collected before the assembler gives up."""


@dataclass(frozen=True, eq=False)
class Source:
    """One text with the name under which messages speak of it."""

    name: str
    text: str

    @cached_property
    def lines(self) -> list[str]:
        """The lines, without their ends."""
        return self.text.splitlines()


class Token(NamedTuple):
    """A piece of a line. `kind` is name, directive, number, string or mark."""

    kind: str
    text: str
    source: Source
    line: int
    column: int

    @property
    def span(self) -> Span:
        """Where the token stands."""
        return Span(self.source.name, self.line, self.column, self.line, self.column + len(self.text))


_TOKEN = re.compile(
    r"""(?P<space>[ \t]+|;.*)
      | (?P<number>0[xX][0-9a-fA-F_]+|0[bB][01_]+|\d[\d_]*(?:\.\d+)?(?:[eE][+-]?\d+)?)
      | (?P<name>[^\W\d]\w*(?:\.\w+)*)
      | (?P<directive>\.[^\W\d]\w*)
      | (?P<string>"[^"]*")
      | (?P<mark><<|>>|//|[-=,():+*/%&|^~\\])""",
    re.VERBOSE,
)


class TooManyErrors(Exception):
    """Raised when MAX_ERRORS are gathered; the caller reports what there is."""


@dataclass
class Errors:
    """The errors found so far, in the order in which they were found."""

    found: list[Diagnostic] = field(default_factory=list)

    def add(
        self,
        message: str,
        where: Token | Sequence[Token] | None,
        *,
        expected: str | None = None,
        found: str | None = None,
        hint: str | None = None,
        notes: Iterable[Note] = (),
    ) -> None:
        """One more error at a token, or at the stretch of line from the first token to the last."""
        tokens = [where] if isinstance(where, Token) else list(where or ())
        span, text = (_stretch(tokens), tokens[0].source.text) if tokens else (None, None)
        self.found.append(Diagnostic(message, span, expected, found, hint, tuple(notes), text))
        if len(self.found) >= MAX_ERRORS:
            raise TooManyErrors

    def check(self) -> None:
        """Raises SourceError where there are errors: each once, file by file, in the order of their lines."""
        if not self.found:
            return
        files = {name: i for i, name in enumerate(dict.fromkeys(one.span.file for one in self.found if one.span))}

        def place(one: Diagnostic) -> tuple[int, int, int]:
            return (files[one.span.file], one.span.line, one.span.column) if one.span else (-1, 0, 0)

        ordered = sorted({(one.message, one.span): one for one in reversed(self.found)}.values(), key=place)
        if len(self.found) >= MAX_ERRORS:
            ordered.append(Diagnostic(f"too many errors: only the first {MAX_ERRORS} are shown"))
        raise SourceError(ordered)


def _stretch(tokens: Sequence[Token]) -> Span:
    first = tokens[0]
    same = [token for token in tokens if token.source is first.source and token.line == first.line]
    begin = min(token.column for token in same)
    end = max(token.column + len(token.text) for token in same)
    return Span(first.source.name, first.line, begin, first.line, end)


def read_source(path: Path) -> Source:
    """The text of a source file. Raises SourceError as `read_bytes` does, and where it is not UTF-8 text."""
    return Source(str(path), decode_text(read_bytes(path), str(path)))


def read_bytes(path: Path) -> bytes:
    """What a file holds. Raises SourceError where it is missing, is no file, or is larger than MAX_BYTES."""
    name = str(path)
    try:
        if not path.is_file():
            raise _unreadable(name, "there is no such file" if not path.exists() else "this is not a file")
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise _unreadable(name, "the source is too large", f"at most {MAX_BYTES} bytes", f"{size} bytes")
        return path.read_bytes()
    except (OSError, ValueError) as error:
        raise _unreadable(name, f"the file cannot be read: {getattr(error, 'strerror', None) or error}") from None


def decode_text(data: bytes, name: str) -> str:
    """UTF-8 text without NUL. Raises SourceError that names the line of the first bad byte."""
    at = data.find(b"\0")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        at = error.start if at < 0 else min(at, error.start)
    if at >= 0:
        line = data.count(b"\n", 0, at) + 1
        raise _unreadable(name, f"line {line}: this is not text", "UTF-8 text", f"byte {data[at]:#04x} at offset {at}")
    return text


def _unreadable(name: str, message: str, expected: str | None = None, found: str | None = None) -> SourceError:
    return SourceError([Diagnostic(f"{name}: {message}", None, expected, found)])


def tokenize(source: Source, line: int, errors: Errors) -> list[Token]:
    """The tokens of one line (numbered from 1); characters that begin no token are reported and skipped."""
    text, at, tokens = source.lines[line - 1], 0, []
    if len(text) > MAX_LINE:
        # Without a place, for the line would be drawn in full.
        errors.add(f"{source.name}: line {line} is too long", None, expected=f"at most {MAX_LINE} characters")
        return []
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            end = at + 1
            bad = Token("mark", text[at:end], source, line, at)
            message = "a string without its closing quote" if text[at] == '"' else f"unexpected character {text[at]!r}"
            errors.add(message, bad)
            if text[at] == '"':
                break
        else:
            end = match.end()
            if match.lastgroup and match.lastgroup != "space":
                tokens.append(Token(match.lastgroup, match.group(), source, line, at))
        at = end
    return tokens
