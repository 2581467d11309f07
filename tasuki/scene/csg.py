"""Solids as set operations on surfaces: what a constructor, a formula and a flat scene's objects are made of.

A literal is one side of a surface, in coordinates of its own. A form says how literals are joined; formulas of one form
differ in numbers only. So a million boxes are one form and columns of numbers, and nothing is done for each of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias
from typing import Literal as OneOf

import numpy as np

from tasuki.diagnostics import Span
from tasuki.scene.material import Vector
from tasuki.scene.problem import Path

PLANE, QUADRIC = "plane", "quadric"
"""The kinds of surfaces whose literals any matrix moves into the scene's coordinates; those of others keep theirs."""

Sphered = tuple[Vector, float] | OneOf["auto"] | None
"""An extent in the scene's coordinates, centre and radius; "auto": to be computed; None: there is none."""


class Join(NamedTuple):
    """The union or intersection of the `arity` operands that follow, at least one; or, `inverted`, all but that."""

    operation: OneOf["union", "intersection"]
    arity: int
    inverted: bool = False


class Literal(NamedTuple):
    """The inside of a surface of some kind, or, `inverted`, all but that: literal `number` in the text of its formula.

    Literals of one `frame`, a number of no other meaning, have their local coordinates in common.
    """

    number: int
    kind: str
    frame: int
    inverted: bool = False


Form: TypeAlias = tuple[Join | Literal, ...]
"""A formula without its numbers: operators before their operands, literals in the order of their numbers."""


@dataclass(frozen=True, eq=False)
class Literals:
    """Literals as columns: literal i is of the kind `kinds[kind[i]]`, its surface row `index[i]` of `values[kind[i]]`.

    Values of planes are (n, d), (k, 4), IN where n . P + d < 0; of quadrics the rows (Q, l), (p, r), (k, 4, 4), Q
    symmetric, IN where (P - p)^T Q (P - p) + l . (P - p) < r, so that r is not lost beside squares of a p that is far
    away; of any other kind the fields of its record by name. All float64, in local coordinates, which the flat scene's
    `frames[frame[i]]` places in the scene's. `material` is an index into the flat scene's materials, `solid` the number
    of the solid whose face a literal is: those of one solid stand together. `places` says where each solid stands in
    its file.
    """

    kinds: tuple[str, ...]
    values: tuple[np.ndarray | Sequence[Mapping[str, Any]], ...]
    places: Sequence[Span | None]
    kind: np.ndarray
    index: np.ndarray
    frame: np.ndarray
    material: np.ndarray
    solid: np.ndarray

    def __len__(self) -> int:
        return len(self.kind)

    def take(self, rows: np.ndarray) -> Literals:
        """The literals `rows`, (k,), in that order."""
        columns = {name: getattr(self, name)[rows] for name in ("kind", "index", "frame", "material", "solid")}
        return replace(self, **columns)

    @classmethod
    def joined(cls, first: Literals, second: Literals) -> Literals:
        """The literals of both, one after the other."""
        kinds = tuple(dict.fromkeys((*first.kinds, *second.kinds)))
        values: list[Any] = []
        before = np.zeros(len(kinds), np.intp)
        for number, name in enumerate(kinds):
            parts = [of.values[of.kinds.index(name)] for of in (first, second) if name in of.kinds]
            values.append(together(name, parts))
            before[number] = len(parts[0]) if name in first.kinds else 0
        renumbered = np.array([kinds.index(name) for name in second.kinds], first.kind.dtype)[second.kind]
        return cls(
            kinds,
            tuple(values),
            (*first.places, *second.places),
            np.concatenate([first.kind, renumbered]),
            np.concatenate([first.index, second.index + before[renumbered]]),
            np.concatenate([first.frame, second.frame]),
            np.concatenate([first.material, second.material]),
            np.concatenate([first.solid, second.solid + len(first.places)]),
        )

    def of_kind(self, name: str) -> np.ndarray:
        """The rows of the literals of a kind."""
        return np.flatnonzero(self.kind == self.kinds.index(name)) if name in self.kinds else np.zeros(0, np.intp)

    def values_of(self, name: str, rows: np.ndarray) -> np.ndarray:
        """The coefficients (k, ...) of the literals `rows`, all planes or all quadrics."""
        values = self.values[self.kinds.index(name)]
        assert isinstance(values, np.ndarray)
        return values[self.index[rows]]

    def place(self, row: int) -> Span | None:
        """Where the solid of a literal stands in its file."""
        return self.places[self.solid[row]]


def negated(values: np.ndarray, kind: str) -> np.ndarray:
    """The values of planes (..., 4), or of quadrics (..., 4, 4), whose insides are the outsides of these."""
    turned = -values
    if kind == QUADRIC:
        turned[..., 3, :3] = values[..., 3, :3]
    return turned


@dataclass(frozen=True, slots=True)
class Sheet:
    """What makes a formula a polygon: of the solid only its first literal, a plane, shows, within `box` (low and high
    corner, in the scene's coordinates); from both sides if `two_sided`.
    """

    box: tuple[float, float, float, float, float, float]
    two_sided: bool


def together(kind: str, parts: Sequence[Any]) -> Any:
    """The `values` of surfaces of a kind, one after the other."""
    return np.concatenate(parts) if kind in (PLANE, QUADRIC) else [one for part in parts for one in part]


@dataclass(frozen=True, eq=False)
class FlatObjects:
    """Solids as formulas, in columns: of object i the form is `forms[form[i]]`, its literals are those from `starts[i]`
    to `starts[i + 1]`.

    `material` is the medium inside it, an index into the flat scene's materials. `places` and `paths` lead to its node.
    One of the `sheets` is a polygon, and holds nothing.
    """

    forms: Sequence[Form]
    literals: Literals
    form: np.ndarray
    starts: np.ndarray
    material: np.ndarray
    extents: Sequence[Sphered]
    places: Sequence[Span | None]
    paths: Sequence[Path]
    sheets: Sequence[Sheet | None]

    def __len__(self) -> int:
        return len(self.form)

    @property
    def sizes(self) -> np.ndarray:
        """How many literals each object has, (n,)."""
        return np.diff(self.starts)

    def take(self, order: np.ndarray) -> FlatObjects:
        """The objects with the numbers `order`, (k,), in that order."""
        sizes = self.sizes[order]
        starts = np.concatenate(([0], np.cumsum(sizes)))
        rows = np.arange(starts[-1]) + np.repeat(self.starts[order] - starts[:-1], sizes)
        lists = ([of_all[i] for i in order] for of_all in (self.extents, self.places, self.paths, self.sheets))
        literals, form, material = self.literals.take(rows), self.form[order], self.material[order]
        return FlatObjects(self.forms, literals, form, starts, material, *lists)

    @classmethod
    def joined(cls, first: FlatObjects, second: FlatObjects) -> FlatObjects:
        """The objects of both, one after the other."""
        return cls(
            (*first.forms, *second.forms),
            Literals.joined(first.literals, second.literals),
            np.concatenate([first.form, second.form + len(first.forms)]),
            np.concatenate([first.starts, second.starts[1:] + first.starts[-1]]),
            np.concatenate([first.material, second.material]),
            (*first.extents, *second.extents),
            (*first.places, *second.places),
            (*first.paths, *second.paths),
            (*first.sheets, *second.sheets),
        )

    def by_form(self) -> list[np.ndarray]:
        """The numbers of the objects of each form, those of a form that none has left out."""
        order = np.argsort(self.form, kind="stable")
        return np.split(order, np.flatnonzero(np.diff(self.form[order])) + 1) if len(order) else []
