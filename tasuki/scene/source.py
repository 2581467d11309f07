"""The text of a scene file: read once, with the place of every character, and every way in which reading can fail."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from tasuki.diagnostics import Diagnostic, SceneError, Span

MOST_ERRORS = 20
"""How many errors of one file are shown; the rest is counted."""

OUTSIDE = ("this file lies outside the scene's folder, which has to be allowed", "a file in that folder, or deeper")
"""What is wrong where a scene may not name a file, and what was expected."""

# Characters that would steer a terminal or break a quoted line; they are shown as a blank.
_CONTROLS = dict.fromkeys((*range(9), 11, 12, *range(14, 32), 127, 133, 8232, 8233), " ")


@dataclass(frozen=True)
class SourceText:
    """A scene file in UTF-8: `data` holds its bytes, with every line ended by a line feed.

    `allow_outside`: the files that it names may lie outside its folder.
    """

    file: str
    data: bytes
    allow_outside: bool = False

    @classmethod
    def read(cls, path: str | Path, *, allow_outside: bool = False) -> SourceText:
        """The file at `path`; SceneError where it is missing, a directory, unreadable, binary, or not UTF-8."""
        path = Path(path)
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            raise SceneError(str(Diagnostic(f"there is no file {str(path)!r}", hint=_similar_file(path)))) from None
        except IsADirectoryError:
            message = f"{str(path)!r} is a directory"
            raise SceneError(str(Diagnostic(message, expected="a scene file", found="a directory"))) from None
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise SceneError(str(Diagnostic(f"cannot read {str(path)!r}: {reason}"))) from None
        return cls.from_bytes(str(path), data, allow_outside=allow_outside)

    @classmethod
    def from_bytes(cls, file: str, data: bytes, *, allow_outside: bool = False) -> SourceText:
        """Text in `data`, named `file` in messages; SceneError where it is binary or not UTF-8."""
        if b"\0" in data:
            problem = Diagnostic(f"{file!r} is not a text file", expected="text in UTF-8", found="binary data")
            raise SceneError(str(problem))
        if b"\r" in data:
            data = data.replace(b"\r\n", b" \n").replace(b"\r", b"\n")
        source = cls(file, data, allow_outside)
        try:
            data.decode("utf-8")
        except UnicodeDecodeError as error:
            found = f"byte 0x{data[error.start]:02x}"
            problem = source.diagnostic("this is not UTF-8", source.span(error.start), "text in UTF-8", found)
            raise SceneError(str(problem)) from None
        return source

    @property
    def folder(self) -> Path:
        """The folder from which the files that it names are looked for."""
        return Path(self.file).parent.absolute()

    def beside(self, file: str) -> Path | None:
        """Where a `file` that it names lies; None where that is outside its folder, links followed, and not allowed."""
        path = self.folder / file
        # There is no file with a zero in its name: whoever opens it says so.
        if self.allow_outside or "\0" in file:
            return path
        is_inside = Path(os.path.realpath(path)).is_relative_to(os.path.realpath(self.folder))
        return path if is_inside else None

    @cached_property
    def line_starts(self) -> np.ndarray:
        """Offset in bytes of the first character of every line."""
        ends = np.flatnonzero(np.frombuffer(self.data, np.uint8) == ord("\n"))
        return np.concatenate(([0], ends + 1))

    @cached_property
    def shown(self) -> str:
        """The text as messages quote it: control characters are blanks."""
        return self.data.decode("utf-8", errors="replace").translate(_CONTROLS)

    def lines(self, offsets: np.ndarray) -> np.ndarray:
        """1-based line of every byte offset."""
        return np.searchsorted(self.line_starts, offsets, side="right")

    def span(self, start: int, end: int | None = None) -> Span:
        """The place of bytes `start` to `end` (one character where `end` is not given), in characters."""
        line = int(self.lines(np.asarray(start)))
        line_start = int(self.line_starts[line - 1])
        column = len(self.data[line_start:start].decode("utf-8", errors="replace"))
        width = 1 if end is None else len(self.data[start:end].decode("utf-8", errors="replace"))
        return Span(self.file, line, column, line, column + width)

    def diagnostic(
        self, message: str, span: Span, expected: str | None = None, found: str | None = None, **more: str
    ) -> Diagnostic:
        """A diagnostic that can quote this text, though it may have changed on disk."""
        return Diagnostic(message, span, expected, found, source=self.shown, **more)  # type: ignore[arg-type]


def scene_error(diagnostics: Iterable[Diagnostic]) -> SceneError:
    """One error that shows the first `MOST_ERRORS` diagnostics in source order, and says how many there are.

    Who collects diagnostics may stop at one more than that, so beyond it there is no count.
    """
    found = sorted(diagnostics, key=lambda d: (d.span.line, d.span.column) if d.span else (0, 0))
    parts = [str(diagnostic) for diagnostic in found[:MOST_ERRORS]]
    if len(found) > MOST_ERRORS:
        parts.append(f"more than {MOST_ERRORS} errors; the first {MOST_ERRORS} are shown")
    elif len(found) > 1:
        parts.append(f"{len(found)} errors")
    return SceneError("\n\n".join(parts))


def quote(text: str) -> str:
    """`text` as a message shows what was found: quoted, printable, and not too long."""
    return repr(text if len(text) <= 40 else text[:37] + "...")


BROUGHT = "what is of your own is brought by --with FILE.py"
"""The hint where nothing known is like a word that a user's file may make known."""


def suggestion(word: str, known: Sequence[str]) -> str | None:
    """A hint that names the known word most like `word`, where one is."""
    import difflib  # needed only to say what is wrong

    close = difflib.get_close_matches(word, known, n=1)
    return f"did you mean {close[0]!r}?" if close else None


def _similar_file(path: Path) -> str | None:
    try:
        names = sorted(entry.name for entry in path.parent.iterdir())
    except (OSError, ValueError):
        return None
    return suggestion(path.name, names)
