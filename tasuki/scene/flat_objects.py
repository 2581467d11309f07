"""Solids that a walk found become objects in columns, all solids of one sort together, whichever objects they are in.

The coefficients of a solid's literals are made once, for all of its uses: instances of one node share them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from tasuki.scene.constructors import CONSTRUCTORS
from tasuki.scene.csg import FlatObjects, Form, Join, Literal, Literals, Sphered, together
from tasuki.scene.shapes import NO_FRAME
from tasuki.scene.solids import Solid
from tasuki.scene.tree import Node
from tasuki.scene.walk import Placed, Use

Sort: TypeAlias = type | str
"""A class of solids that has a constructor, or the name of a registered kind."""

Key: TypeAlias = tuple[Join | tuple[int, Sort, bool], ...]
"""What objects of one form have in common, operators first: of each solid the number of its frame among those of its
object, its sort, and whether its outside is meant.
"""


class _Made(NamedTuple):
    """The literals of all solids of one sort: how each solid joins its own, the kind of each and whether it is the
    outside of its surface; `surfaces[k]` are of all n different solids the coefficients of literal k.
    """

    form: tuple[Join | int, ...]
    sides: Sequence[tuple[str, bool]]
    surfaces: Sequence[np.ndarray | Sequence[Mapping[str, Any]]]


def flat_objects(placed: Sequence[Placed], extents: Sequence[Sphered], world: int) -> FlatObjects:
    """The objects that were `placed`, with their `extents`; `world` is the number of the frame of what has none."""
    uses = [token for one in placed for token in one.tokens if type(token) is Use]
    keys: dict[Key, int] = {}
    form = np.array([keys.setdefault(_key(one.tokens), len(keys)) for one in placed], np.int32)
    literals, made = _literals(uses, world)
    forms = [_form(key, made) for key in keys]
    sizes = np.array([sum(type(token) is Literal for token in one) for one in forms], np.intp)
    starts = np.concatenate([[0], np.cumsum(sizes[form])])
    own = np.array([one.material for one in placed], np.int32)
    # What has no material of its own has that of its first literal.
    material = np.where(own < 0, literals.material[starts[:-1]], own)
    places, paths = [one.node.place for one in placed], [one.path for one in placed]
    return FlatObjects(forms, literals, form, starts, material, extents, places, paths, [None] * len(placed))


def _sort(solid: Node) -> Sort:
    return solid.kind if isinstance(solid, Solid) else type(solid)


def _key(tokens: Sequence[Use | Join]) -> Key:
    frames: dict[int, int] = {}
    return tuple(
        token
        if isinstance(token, Join)
        else (frames.setdefault(token.frame, len(frames)), _sort(token.solid), token.inverted)
        for token in tokens
    )


def _form(key: Key, made: Mapping[Sort, _Made]) -> Form:
    """The form of objects, every solid written out as what it is made of."""
    form: list[Join | Literal] = []
    count = 0
    for token in key:
        if isinstance(token, Join):
            form.append(token)
            continue
        frame, sort, inverted = token
        for place, inner in enumerate(made[sort].form):
            turned = inverted and place == 0
            if isinstance(inner, Join):
                form.append(inner._replace(inverted=inner.inverted != turned))
            else:
                kind, outside = made[sort].sides[inner]
                form.append(Literal(count + inner, kind, frame, outside != turned))
        count += len(made[sort].sides)
    return tuple(form)


def _literals(uses: Sequence[Use], world: int) -> tuple[Literals, dict[Sort, _Made]]:
    """The literals of all solids, use after use; and how they were made."""
    members: dict[Sort, list[int]] = {}
    for number, use in enumerate(uses):
        members.setdefault(_sort(use.solid), []).append(number)
    made: dict[Sort, _Made] = {}
    values: dict[str, list[Any]] = {}
    counts = np.zeros(len(uses), np.intp)
    positions = []
    for sort, mine in members.items():
        solids, places = _different([uses[number].solid for number in mine])
        made[sort] = _made(sort, solids)
        counts[mine] = len(made[sort].sides)
        positions.append(places)
    starts = np.concatenate([[0], np.cumsum(counts)])
    kind, index = np.zeros(starts[-1], np.uint8), np.zeros(starts[-1], np.intp)
    for (sort, mine), places in zip(members.items(), positions, strict=True):
        for number, ((name, _), surfaces) in enumerate(zip(made[sort].sides, made[sort].surfaces, strict=True)):
            before = values.setdefault(name, [])
            rows = starts[mine] + number
            kind[rows], index[rows] = list(values).index(name), sum(map(len, before)) + places
            before.append(surfaces)
    frame, material = np.array([(use.frame, use.material) for use in uses], np.int32).reshape(-1, 2).T
    frame = np.where(frame == NO_FRAME, world, frame)
    literals = Literals(
        tuple(values),
        tuple(together(name, parts) for name, parts in values.items()),
        [use.solid.place for use in uses],
        kind,
        index,
        np.repeat(frame, counts),
        np.repeat(material, counts),
        np.repeat(np.arange(len(uses), dtype=np.int32), counts),
    )
    return literals, made


def _different(solids: Sequence[Any]) -> tuple[list[Any], np.ndarray]:
    """Every distinct node once, and where among them each of `solids` is."""
    numbers: dict[int, int] = {}
    found: list[Any] = []
    positions = np.empty(len(solids), np.intp)
    for place, solid in enumerate(solids):
        number = numbers.setdefault(id(solid), len(found))
        if number == len(found):
            found.append(solid)
        positions[place] = number
    return found, positions


def _made(sort: Sort, solids: Sequence[Any]) -> _Made:
    if isinstance(sort, str):
        return _Made((0,), [(sort, False)], [[solid.fields for solid in solids]])
    constructor = CONSTRUCTORS[sort]
    # What overflows here is told, with its place, when it is packed.
    with np.errstate(all="ignore"):
        surfaces = constructor.literals(**constructor.columns(solids))
    sides = [(one.kind, one.inverted) for one in surfaces]
    return _Made(constructor.form, sides, [one.values for one in surfaces])
