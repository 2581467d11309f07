"""Source text behind a module: read once, parsed once, and turned into spans whose columns count characters."""

from __future__ import annotations

import ast
import hashlib
import linecache
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import CodeType

from tasuki.diagnostics import Diagnostic, SourceError, Span


@dataclass(frozen=True)
class Source:
    """The text of a file or of a notebook cell."""

    file: str
    text: str

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.text, self.file)

    @cached_property
    def lines(self) -> list[str]:
        # Not `splitlines`: it also splits at characters (form feed, U+2028) that do not end a line of Python.
        return self.text.split("\n")

    @cached_property
    def digest(self) -> str:
        return hashlib.sha256(self.text.encode("utf-8", "surrogatepass")).hexdigest()

    def span(self, node: ast.AST) -> Span:
        """Where `node` stands. `ast` counts columns in UTF-8 bytes; a caret needs characters."""
        line, column = getattr(node, "lineno", 1), getattr(node, "col_offset", 0)
        end_line = getattr(node, "end_lineno", None) or line
        end_column = getattr(node, "end_col_offset", None) or column
        return Span(self.file, line, self._characters(line, column), end_line, self._characters(end_line, end_column))

    def _characters(self, line: int, column: int) -> int:
        text = self.lines[line - 1] if 0 < line <= len(self.lines) else ""
        return column if text.isascii() else len(text.encode()[:column].decode(errors="ignore"))

    def function(self, code: CodeType) -> ast.FunctionDef | None:
        """The definition that `code` was compiled from, or None where the text has changed since."""
        functions = (node for node in ast.walk(self.tree) if isinstance(node, ast.FunctionDef))
        named = (node for node in functions if node.name == code.co_name)
        return next((node for node in named if _first_line(node) == code.co_firstlineno), None)

    def class_near(self, name: str, line: int) -> ast.ClassDef | None:
        """The definition of class `name` that begins nearest to `line`."""
        found = [node for node in ast.walk(self.tree) if isinstance(node, ast.ClassDef) and node.name == name]
        return min(found, key=lambda node: abs(_first_line(node) - line), default=None)


def read_source(file: str) -> Source | None:
    """The text that Python knows under the name `file`, which may be a notebook cell; None where there is none."""
    linecache.checkcache(file)
    lines = linecache.getlines(file)
    return _source(file, "".join(lines)) if lines else None


@lru_cache(maxsize=256)
def _source(file: str, text: str) -> Source:
    """One `Source` per text, so that a file of many modules is parsed once."""
    return Source(file, text)


def parse_function(code: CodeType, what: str, source: Source | None = None) -> tuple[Source, ast.FunctionDef]:
    """Source and definition of a function, which `what` names. `SourceError` where they cannot be had.

    `source` is given where the text that was run is known; else it is looked for under the name of the file.
    """
    place = Span(code.co_filename, code.co_firstlineno)
    source = source or read_source(code.co_filename)
    if source is None:
        raise SourceError([Diagnostic(f"the source of {what} cannot be read", place)])
    try:
        definition = source.function(code)
    except SyntaxError:
        definition = None
    if definition is None:
        hint = "the file has changed: load it again"
        raise SourceError([Diagnostic(f"{what} is not where it was", place, hint=hint)])
    return source, definition


def source_order(diagnostic: Diagnostic) -> tuple[str, int, int]:
    """The key by which diagnostics are sorted for the reader."""
    span = diagnostic.span
    return (span.file, span.line, span.column) if span else ("", 0, 0)


def _first_line(node: ast.FunctionDef | ast.ClassDef) -> int:
    """The line on which Python lets a definition begin: that of its first decorator."""
    return min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])
