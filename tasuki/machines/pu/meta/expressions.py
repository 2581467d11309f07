"""Values in meta-assembler source: numbers, registers, names, and arithmetic on them.

A value is a whole number, a float or a register. Whole numbers take ``+ - * // % << >> & | ^ ~``, floats
``+ - * /``, and ``/`` makes a float of any two; a register plus or minus a number is another register of its kind.
Precedence is C's, except that ``& ^ |`` bind as in Python (all comparisons being absent, nothing else differs).

Values are evaluated straight from their tokens: no tree is built, and a chain of a million additions needs no depth.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from typing import NamedTuple

from tasuki.machines.pu.meta.source import Token

MAX_DEPTH = 60
"""Nested parentheses and signs in one value, and constants that stand on constants."""
LIMIT_BITS = 512
"""Whole numbers have fewer bits than this: room for a microinstruction of any width, none for runaway arithmetic."""


class Register(NamedTuple):
    """A register by kind ("R", "I", "BR", "IR", "AR") and number."""

    kind: str
    number: int

    def __str__(self) -> str:
        return f"{self.kind}{self.number}"


Number = int | float
Value = int | float | Register


class ValueFault(Exception):
    """A value that cannot be computed: the message and the tokens at fault. The assembler makes it a diagnostic."""

    def __init__(self, message: str, tokens: Sequence[Token], expected: str | None = None) -> None:
        super().__init__(message)
        self.message, self.tokens, self.expected = message, tokens, expected


def _left(a: int, b: int) -> int:
    if not 0 <= b < LIMIT_BITS:
        raise ValueError(f"a shift count must be 0 to {LIMIT_BITS - 1}")
    return a << b


def _right(a: int, b: int) -> int:
    if not 0 <= b < LIMIT_BITS:
        raise ValueError(f"a shift count must be 0 to {LIMIT_BITS - 1}")
    return a >> b


_PRECEDENCE = {"|": 1, "^": 2, "&": 3, "<<": 4, ">>": 4, "+": 5, "-": 5, "*": 6, "/": 6, "//": 6, "%": 6}
_ON_NUMBERS: dict[str, Callable[[Number, Number], Number]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}
_ON_INTEGERS: dict[str, Callable[[int, int], int]] = {
    "//": operator.floordiv,
    "%": operator.mod,
    "<<": _left,
    ">>": _right,
    "&": operator.and_,
    "|": operator.or_,
    "^": operator.xor,
}


def extent(tokens: Sequence[Token], start: int) -> int:
    """Where the value that begins at `start` ends (exclusive): the longest alternation of operands and operators.

    A name before "=" is the next field, never an operand.
    """
    at, depth, operand = start, 0, True
    while at < len(tokens):
        token = tokens[at]
        if operand:
            if token.text == "(":
                depth += 1
            elif token.kind == "name" and at + 1 < len(tokens) and tokens[at + 1].text == "=":
                break
            elif token.kind in ("number", "name"):
                operand = False
            elif token.text not in ("-", "+", "~"):
                break
        elif token.text == ")" and depth:
            depth -= 1
        elif token.text in _PRECEDENCE:
            operand = True
        else:
            break
        at += 1
    return at


def parse_number(token: Token) -> Number:
    """The number that a token writes. Raises ValueFault where it is of LIMIT_BITS bits or more, or beyond any float."""
    text = token.text.replace("_", "")
    try:
        if text[:2].lower() in ("0x", "0b"):
            return _checked(int(text, 0))
        if "." in text or "e" in text or "E" in text:
            return _finite(float(text))
        return _checked(int(text))
    except (ValueError, OverflowError):
        raise ValueFault("this number cannot be represented", [token]) from None


def _checked(value: int) -> int:
    if abs(value) >> LIMIT_BITS:
        raise OverflowError("the number is too large")
    return value


def _finite(value: float) -> float:
    if math.isinf(value):
        raise OverflowError("the number is too large")
    return value


class _Evaluator:
    """Precedence climbing over one token sequence."""

    def __init__(self, tokens: Sequence[Token], resolve: Callable[[Token], Value]) -> None:
        self.tokens, self.resolve, self.at = tokens, resolve, 0

    def whole(self) -> Value:
        if not self.tokens:
            raise ValueFault("a value is missing", [])
        value = self.binary(1, 0)
        if self.at < len(self.tokens):
            raise ValueFault("unexpected text after the value", self.tokens[self.at :])
        return value

    def binary(self, least: int, depth: int) -> Value:
        first = self.at
        left = self.unary(depth)
        while self.at < len(self.tokens):
            mark = self.tokens[self.at]
            precedence = _PRECEDENCE.get(mark.text, 0)
            if precedence < least:
                break
            self.at += 1
            right = self.binary(precedence + 1, depth)
            left = self.apply(mark, left, right, first)
        return left

    def unary(self, depth: int) -> Value:
        if self.at >= len(self.tokens):
            raise ValueFault("a value is missing after this", [self.tokens[-1]])
        token = self.tokens[self.at]
        if depth > MAX_DEPTH:
            raise ValueFault("the value is nested too deeply", [token], f"at most {MAX_DEPTH} levels")
        self.at += 1
        if token.kind == "number":
            return parse_number(token)
        if token.kind == "name":
            return self.resolve(token)
        if token.text == "(":
            value = self.binary(1, depth + 1)
            if self.at >= len(self.tokens) or self.tokens[self.at].text != ")":
                raise ValueFault("this parenthesis is not closed", [token])
            self.at += 1
            return value
        if token.text in ("-", "+", "~"):
            return self.signed(token, self.unary(depth + 1))
        raise ValueFault(f"unexpected '{token.text}' in a value", [token], "a number, a name or '('")

    def signed(self, mark: Token, value: Value) -> Value:
        if isinstance(value, Register) or (mark.text == "~" and isinstance(value, float)):
            raise ValueFault(f"'{mark.text}' does not apply to {_sort(value)}", [mark])
        if mark.text == "~":
            assert isinstance(value, int)
            return ~value
        return -value if mark.text == "-" else value

    def apply(self, mark: Token, left: Value, right: Value, first: int) -> Value:
        """One operator on its operands; the token `first` is where a message about them begins."""
        name = mark.text
        try:
            if isinstance(left, Register) and isinstance(right, int) and name in ("+", "-"):
                return Register(left.kind, left.number + (right if name == "+" else -right))
            if not isinstance(left, Register) and not isinstance(right, Register) and name in _ON_NUMBERS:
                result = _ON_NUMBERS[name](left, right)
                if isinstance(result, int):
                    return _checked(result)
                return result if math.inf in (abs(left), abs(right)) else _finite(result)
            if isinstance(left, int) and isinstance(right, int):
                return _checked(_ON_INTEGERS[name](left, right))
        except (ArithmeticError, ValueError) as error:
            raise ValueFault(f"this cannot be computed: {error}", self.tokens[first : self.at]) from None
        message = f"'{name}' does not apply to {_sort(left)} and {_sort(right)}"
        raise ValueFault(message, self.tokens[first : self.at])


def _sort(value: Value) -> str:
    if isinstance(value, Register):
        return f"a register ({value})"
    return f"the float {value}" if isinstance(value, float) else f"the number {value}"


def evaluate(tokens: Sequence[Token], resolve: Callable[[Token], Value]) -> Value:
    """The value of `tokens`; `resolve` gives the value of a name. Raises ValueFault."""
    return _Evaluator(tokens, resolve).whole()
