"""What every layer says when something is wrong: spans, diagnostics, caret drawing, and the exception tree.

Imported by everyone; imports nothing of the package. An error that reaches a user is a `TasukiError`; its text names
the file, the place, what was expected and what was found. Columns are counted in characters, never in bytes.
"""

from __future__ import annotations

import linecache
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

WIDEST = 160
"""Characters that are drawn of a source line; of a longer one only the part around what is wrong."""


@dataclass(frozen=True)
class Span:
    """A stretch of source text: 1-based lines, 0-based columns in characters, the end exclusive."""

    file: str
    line: int
    column: int = 0
    end_line: int = 0
    end_column: int = 0

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column + 1}"


@dataclass(frozen=True)
class Note:
    """A second place that explains a diagnostic (where a type was fixed, why a value varies)."""

    message: str
    span: Span | None = None


@dataclass(frozen=True)
class Diagnostic:
    """One thing that is wrong, at one place.

    `expected` and `found` are printed on lines of their own; `hint` says what to do about it.
    `source` gives the text of the file where it is not on disk (a notebook cell, standard input).
    """

    message: str
    span: Span | None = None
    expected: str | None = None
    found: str | None = None
    hint: str | None = None
    notes: tuple[Note, ...] = ()
    source: str | None = None

    def __str__(self) -> str:
        head = f"{self.span}: error: {self.message}" if self.span else f"error: {self.message}"
        parts = [head]
        if self.span:
            parts += _draw(self.span, self.source)
        parts += [f"  {label}: {text}" for label, text in self._labelled() if text]
        for note in self.notes:
            parts.append(f"{note.span}: note: {note.message}" if note.span else f"  note: {note.message}")
            if note.span:
                parts += _draw(note.span, self.source if note.span.file == (self.span and self.span.file) else None)
        return "\n".join(parts)

    def _labelled(self) -> list[tuple[str, str | None]]:
        return [("expected", self.expected), ("found", self.found), ("hint", self.hint)]


class TasukiError(Exception):
    """The root of every error that Tasuki raises on purpose; its text is fit for a user."""


class SourceError(TasukiError):
    """A module's source is wrong. `diagnostics` holds every error that was found, in source order."""

    def __init__(self, diagnostics: Iterable[Diagnostic]) -> None:
        self.diagnostics = tuple(diagnostics)
        count = len(self.diagnostics)
        tail = f"\n\n{count} errors" if count > 1 else ""
        super().__init__("\n\n".join(map(str, self.diagnostics)) + tail)


class LinkError(TasukiError):
    """A program cannot be put together: an unfilled socket, a signature that does not fit, an unknown module."""


class SceneError(TasukiError):
    """A scene is missing, malformed, or asks for something that cannot be drawn."""


class OutputError(TasukiError):
    """A picture or a report cannot be written where it was asked for."""


class MachineError(TasukiError):
    """A program stopped on a machine: an access outside a table, lanes that disagree, a broken promise."""


class VerifyError(TasukiError):
    """A program in the intermediate representation breaks one of its invariants: a fault of the compiler."""


def _draw(span: Span, source: str | None) -> list[str]:
    """The source line of `span` with carets under it, or nothing where the text is not to be had."""
    lines = _lines(source) if source is not None else linecache.getlines(span.file)
    line = lines[span.line - 1 : span.line]
    # A line of odd spaces alone, such as a no-break space, is not blank: it can be what is wrong.
    if not line or not line[0].strip(" \t\r\n"):
        return []
    text = line[0].rstrip("\n").replace("\t", " ")
    end = span.end_column if span.end_line in (0, span.line) else len(text)
    end = min(max(end, span.column + 1), max(len(text), span.column + 1))
    text, column, end = _window(text, span.column, end)
    gutter = f"{span.line:5} | "
    pad = " " * _width(text[:column])
    return [gutter + text, " " * (len(gutter) - 2) + "| " + pad + "^" * max(1, _width(text[column:end]))]


def _window(text: str, column: int, end: int) -> tuple[str, int, int]:
    """The part of a very long line around `column` to `end`, and where these stand in it."""
    if len(text) <= WIDEST:
        return text, column, end
    first = max(0, column - WIDEST // 3)
    last = first + WIDEST
    head, tail = "..." if first else "", "..." if last < len(text) else ""
    shift = len(head) - first
    return head + text[first:last] + tail, column + shift, min(end, last) + shift


@lru_cache(maxsize=4)
def _lines(source: str) -> list[str]:
    """The lines of a text; many diagnostics are about one."""
    return source.splitlines()


def _width(text: str) -> int:
    """Terminal cells that `text` takes: East Asian wide characters take two."""
    return sum(2 if unicodedata.east_asian_width(c) in "WF" else 0 if unicodedata.combining(c) else 1 for c in text)
