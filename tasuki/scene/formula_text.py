"""Formulas of set operations as text: infix, and the Polish form in which the paper gives them (section 6.2).

Both forms have one vocabulary. In infix a complement binds more tightly than an intersection, that more tightly than
unions and differences, and operators of equal rank are taken from the left. The parsers keep stacks of their own, so
that a formula of thousands of parts overflows nothing.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import TypeAlias

from tasuki.diagnostics import Diagnostic, SceneError, Span
from tasuki.scene.source import quote, suggestion

Expression: TypeAlias = str | tuple
"""The name of a part, ("complement", a), or ("union", a, b), ("intersection", a, b), ("difference", a, b)."""

PART_NAME = r"[^\W\d]\w*"
"""What may name a part: a letter or underscore, then letters, digits and underscores, of any script."""

BINARY = {"+": "union", "∪": "union", "&": "intersection", "*": "intersection", "∩": "intersection"}
BINARY |= {"-": "difference", "\\": "difference"}
UNARY = dict.fromkeys("~!", "complement")
RANK = {"union": 1, "difference": 1, "intersection": 2, "complement": 3}

_TOKEN = re.compile(rf"\s*(?:({PART_NAME})|(\S))")
_OPERAND = "the name of a part, `~` or `(`"


class FormulaError(SceneError):
    """A formula is wrong between its characters `column` and `end`, counted from 0; the text draws it with a caret."""

    def __init__(
        self, text: str, column: int, end: int, message: str, expected: str, found: str, hint: str | None = None
    ) -> None:
        self.column, self.end = column, end
        self.message, self.expected, self.found, self.hint = message, expected, found, hint
        span = Span("formula", 1, column, 1, end)
        super().__init__(str(Diagnostic(message, span, expected, found, hint, source=text.replace("\n", " "))))


def parse_infix(text: str, parts: Collection[str]) -> Expression:
    """What `text` means, such as "plate - (hole1 + hole2)". FormulaError where it is wrong or names another part."""
    return _Infix(text, parts).parse()


def parse_polish(text: str, parts: Collection[str]) -> Expression:
    """What `text` means, such as "- plate + hole1 hole2". FormulaError where it is wrong or names another part."""
    pending: list[_Pending] = []
    done: Expression | None = None
    for token in _tokens(text, parts):
        if done is not None:
            raise token.error("the formula is complete before this", "the end of the formula")
        if token.sign in ("(", ")"):
            raise token.error("the Polish form has no parentheses", "an operator or the name of a part")
        if token.sign:
            pending.append(_Pending(token))
            continue
        done = token.text
        while pending and done is not None:
            pending[-1].operands.append(done)
            done = pending.pop().expression if pending[-1].is_complete else None
    if pending:
        last = pending[-1]
        expected = f"{last.arity} after it, each a part or an operator with its own"
        raise last.token.error("an operand of this operator is missing", expected, str(len(last.operands)))
    if done is None:
        raise _empty(text)
    return done


@dataclass(frozen=True, slots=True)
class _Token:
    """A part's name, or a sign: an operator or a parenthesis."""

    text: str
    sign: str
    column: int
    source: str

    def error(self, message: str, expected: str, found: str | None = None, hint: str | None = None) -> FormulaError:
        end = self.column + len(self.text)
        return FormulaError(self.source, self.column, end, message, expected, found or quote(self.text), hint)


def _tokens(text: str, parts: Collection[str]) -> Iterator[_Token]:
    end = len(text.rstrip())
    for match in _TOKEN.finditer(text, 0, end):
        name, sign = match[1] or "", match[2] or ""
        token = _Token(name or sign, sign, match.start(1) if name else match.start(2), text)
        if sign and sign not in BINARY and sign not in UNARY and sign not in "()":
            raise token.error("no such operator", "one of + - & ~, a parenthesis, or the name of a part")
        if name and name not in parts:
            hint = suggestion(name, list(parts))
            raise token.error("no such part", f"one of {', '.join(parts)}" if parts else "a part", hint=hint)
        yield token


class _Pending:
    """An operator of the Polish form that waits for operands."""

    def __init__(self, token: _Token) -> None:
        self.token = token
        self.operation = UNARY.get(token.sign) or BINARY[token.sign]
        self.arity = 1 if token.sign in UNARY else 2
        self.operands: list[Expression] = []

    @property
    def is_complete(self) -> bool:
        return len(self.operands) == self.arity

    @property
    def expression(self) -> Expression:
        return (self.operation, *self.operands)


class _Infix:
    """Dijkstra's shunting-yard algorithm: operands wait on one stack, operators and open parentheses on another."""

    def __init__(self, text: str, parts: Collection[str]) -> None:
        self.text = text
        self.parts = parts
        self.operands: list[Expression] = []
        self.operators: list[_Token] = []

    def parse(self) -> Expression:
        expects_operand = True
        for token in _tokens(self.text, self.parts):
            expects_operand = self._operand(token) if expects_operand else self._operator(token)
        if expects_operand:
            raise self._missing()
        self._reduce(0)
        if self.operators:
            raise self.operators[-1].error("this parenthesis is not closed", "a `)` for it", "the end of the formula")
        return self.operands[0]

    def _operand(self, token: _Token) -> bool:
        """Take a token where an operand must begin; whether the next must begin one too."""
        if token.sign == "(" or token.sign in UNARY:
            self.operators.append(token)
            return True
        if token.sign:
            raise token.error("an operand is missing", _OPERAND)
        self.operands.append(token.text)
        return False

    def _operator(self, token: _Token) -> bool:
        """Take a token after an operand; whether an operand must follow."""
        if token.sign in BINARY:
            self._reduce(RANK[BINARY[token.sign]])
            self.operators.append(token)
            return True
        if token.sign != ")":
            raise token.error("an operator is missing", "an operator such as + or -, or the end of the formula")
        self._reduce(0)
        if not self.operators:
            raise token.error("this parenthesis closes nothing", "a `(` before it")
        self.operators.pop()
        return False

    def _reduce(self, rank: int) -> None:
        """Apply the operators of `rank` or more that wait since the last open parenthesis."""
        while self.operators and self.operators[-1].sign != "(":
            sign = self.operators[-1].sign
            operation = UNARY.get(sign) or BINARY[sign]
            if RANK[operation] < rank:
                return
            self.operators.pop()
            count = 1 if sign in UNARY else 2
            self.operands[-count:] = [(operation, *self.operands[-count:])]

    def _missing(self) -> FormulaError:
        if not self.operators:
            return _empty(self.text)
        end = len(self.text.rstrip())
        return FormulaError(self.text, end, end + 1, "an operand is missing", _OPERAND, "the end of the formula")


def _empty(text: str) -> FormulaError:
    return FormulaError(text, 0, 1, "this formula is empty", "the name of a part, or an operation on parts", "nothing")
