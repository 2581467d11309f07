"""The composite operations, each as a fixed order of primitive ones. That order is their meaning on every machine.

Each function takes the leaves of its arguments as `Term`s and returns a list of `Term`s, the leaves of the result. A
`Term` wraps whatever a machine computes with (a NumPy array, a register, a name in LLVM) together with `apply`, which
performs one primitive of the table. Imported by `ops` alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Union


@dataclass(frozen=True)
class Term:
    """A scalar in an expansion; operators apply primitives. `scalar` is its type's name ("f32", "i32", "bool")."""

    value: Any
    scalar: str
    apply: Callable[..., Any]
    """apply(primitive name, values, scalar names of the arguments) -> value"""
    literal: Callable[[float | int, str], Any]
    """literal(number, scalar name) -> value"""

    def op(self, name: str, *others: Operand, gives: str | None = None) -> Term:
        terms = [self, *(self._lift(other) for other in others)]
        value = self.apply(name, [t.value for t in terms], [t.scalar for t in terms])
        return Term(value, gives or self.scalar, self.apply, self.literal)

    def _lift(self, other: Operand) -> Term:
        if isinstance(other, Term):
            return other
        return Term(self.literal(other, self.scalar), self.scalar, self.apply, self.literal)

    def __add__(self, other: Operand) -> Term:
        return self.op("add", other)

    def __sub__(self, other: Operand) -> Term:
        return self.op("subtract", other)

    def __mul__(self, other: Operand) -> Term:
        return self.op("multiply", other)

    def __and__(self, other: Operand) -> Term:
        return self.op("bit_and", other)

    def __neg__(self) -> Term:
        return self.op("negate")

    def __rtruediv__(self, numerator: float) -> Term:
        return self._lift(numerator).op("divide", self)

    def equals(self, other: Operand) -> Term:
        return self.op("equal", other, gives="bool")


Operand = Union["Term", float, int]
Vec = list[Term]


def reciprocal(a: Vec) -> Vec:
    return [1.0 / a[0]]


def dot(a: Vec, b: Vec) -> Vec:
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return [total]


def cross(a: Vec, b: Vec) -> Vec:
    (ax, ay, az), (bx, by, bz) = a, b
    return [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]


def norm(a: Vec) -> Vec:
    return [dot(a, a)[0].op("sqrt")]


def normalize(a: Vec) -> Vec:
    scale = 1.0 / norm(a)[0]
    return [x * scale for x in a]


def transform(v: Vec, m: Vec) -> Vec:
    return [dot(v, column)[0] for column in _columns(m)]


def compose(a: Vec, b: Vec) -> Vec:
    rows = [transform(row, b) for row in _columns(transpose(a))]
    return transpose([x for row in rows for x in row])


def transpose(m: Vec) -> Vec:
    return [m[4 * i + j] for j in range(4) for i in range(4)]


def sin(a: Vec) -> Vec:
    return [_circular(a[0], 0)]


def cos(a: Vec) -> Vec:
    return [_circular(a[0], 1)]


def _columns(m: Vec) -> list[Vec]:
    return [m[4 * i : 4 * i + 4] for i in range(4)]


def _circular(x: Term, quarter: int) -> Term:
    """sin(x + quarter * pi/2): x less the nearest multiple of pi/2 in three exact-product terms, then Cephes'
    polynomials.
    """
    n = (x * 0.63661977236758134 + 0.5).op("floor")
    # The leading terms have so few bits that n times each is exact for |n| < 2**13 (Cody and Waite 1980).
    r = ((x - n * 1.5703125) - n * 4.837512969970703125e-4) - n * 7.54978995489188216e-8
    z = r * r
    sine = ((z * -1.9515295891e-4 + 8.3321608736e-3) * z + -1.6666654611e-1) * z * r + r
    cosine = ((z * 2.443315711809948e-5 + -1.388731625493765e-3) * z + 4.166664568298827e-2) * z * z + (
        z * -0.5 + 1.0
    )
    quadrant = n.op("to_i32", gives="i32").op("add", quarter) & 3
    odd = (quadrant & 1).equals(1)
    value = odd.op("select", cosine, sine, gives="f32")
    return (quadrant & 2).equals(2).op("select", -value, value, gives="f32")
