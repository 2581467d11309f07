"""The words of the text form (see `text`)."""

from __future__ import annotations

import re
from dataclasses import dataclass

from tasuki.diagnostics import Span
from tasuki.ir.text import IDENTIFIER

_STRING = r'"(?:[^"\\]|\\.)*"'
_TOKEN = re.compile(
    rf"""(?P<space>\s+|\#[^\n]*)
    |(?P<number>0x[0-9a-f]+|\d+(?:\.\d*)?(?:e[+-]?\d+)?)
    |(?P<member>\.(?:[\w$]+|{_STRING}))
    |(?P<word>{IDENTIFIER}(?:~\d+)?)
    |(?P<string>{_STRING}(?:~\d+)?)
    |(?P<symbol>//|<<|>>|<=|>=|==|!=|->|[-+*/%<>&|^~()\[\]{{}},:=@])
    |(?P<wrong>.)""",
    re.VERBOSE,
)


@dataclass(frozen=True)
class Token:
    """`kind`: number, member, word, string, symbol, wrong, or end."""

    kind: str
    text: str
    span: Span

    def shown(self) -> str:
        """How an error calls it."""
        return "the end of the text" if self.kind == "end" else f"`{self.text}`"


def tokens(text: str, file: str) -> list[Token]:
    """The tokens of `text`, and one of kind "end" after them."""
    found: list[Token] = []
    line, line_start = 1, 0
    for match in _TOKEN.finditer(text):
        kind, lexeme = match.lastgroup or "wrong", match.group()
        column = match.start() - line_start
        if kind != "space":
            found.append(Token(kind, lexeme, Span(file, line, column, line, column + len(lexeme))))
        if "\n" in lexeme:
            line += lexeme.count("\n")
            line_start = match.start() + lexeme.rindex("\n") + 1
    return [*found, Token("end", "", Span(file, line, len(text) - line_start))]
