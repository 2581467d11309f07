"""The registry of primitive kinds: what a machine intersects, whatever shape it came from.

A kind names a table of the memory, hence the record of its primitives, and the modules that work on it. Each may be
given as the object itself or as "package.module:attribute", imported when it is first needed: so this layer knows the
modules by name only. To add a kind, call `register`; nothing here needs to change.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass, replace
from typing import Any, Literal

from tasuki.diagnostics import SceneError
from tasuki.scene.registry import Origin, Registry
from tasuki.scene.source import suggestion

UNIT_MATRIX = 4
"""Flag of a quadric whose matrix is the unit matrix, without linear term: a sphere (`SPHERE` in the modules' records).
"""
OBJECT = 31
"""The kind of objects in a thing's code."""
MOST_KINDS = 31
"""A thing's code is its index * 32 + its kind; the last kind is that of objects."""
SURFACE = ("hit", "surface")
SOLID = ("span", "normal", "inside")
"""Modules that a kind of each sort must have."""


@dataclass(frozen=True)
class Narrow:
    """A module, by name, that may stand for the kind's own in `role` where every primitive has `flag`; and its cost."""

    role: str
    flag: int
    module: str
    cost: float


@dataclass(frozen=True)
class PrimitiveKind:
    """One kind of primitive.

    `table` is the table that holds its records. A *surface* has no inside. The modules that fill the sockets of the
    search for it are `hit` (the first visible crossing of a ray), `surface` (normals, attribute and matrix at a point)
    and `box` (bounds). A *solid* may be an operand of set operations; for that it has `span` (whether a ray is IN
    before and after some t, and its next crossing), `normal`, `inside` (IN/OUT at a point) and `box`. With `hit` and
    `surface` beside them it is searched faster where it stands alone; without them it is an object of one operand.
    Either may have `part` (the box around what lies between two planes: `primitive_part` of `tasuki.modules.parts`), by
    which the hierarchy's builder may cut what is long and slanting.
    `cost` is that of `hit` in units of a triangle's. Kinds that are not built in are nodes of scene files, under their
    names; their modules work in the node's own coordinates, where a ray's direction may have any length. `number` is
    what the field `kind` of a record holds; `register` gives it.
    """

    name: str
    sort: Literal["solid", "surface"]
    table: Any
    box: Any
    hit: Any = None
    surface: Any = None
    span: Any = None
    normal: Any = None
    inside: Any = None
    part: Any = None
    cost: float = 1.0
    narrow: tuple[Narrow, ...] = ()
    is_built_in: bool = False
    number: int = -1

    def resolve(self, role: str) -> Any:
        """The object in field `role` ("table", "hit", ...), imported where it is given by name."""
        value = getattr(self, role)
        return resolve(value) if isinstance(value, str) else value

    def narrowed(self, records: Any) -> PrimitiveKind:
        """The kind as it may stand for `records`, a structured array: with the narrower modules that do for all."""
        for one in self.narrow:
            if (records["flags"] & one.flag).all():
                changes: dict[str, Any] = {one.role: one.module, "cost": one.cost}
                return replace(self, **changes)
        return self

    @property
    def record(self) -> Any:
        """The record type of the kind's table."""
        return self.resolve("table").record

    @property
    def table_name(self) -> str:
        """The name of the kind's table in memory."""
        return self.resolve("table").named(f"{self.name}s")


_KINDS: Registry[PrimitiveKind] = Registry("primitive kind", MOST_KINDS)


def register(kind: PrimitiveKind) -> PrimitiveKind:
    """Make `kind` known; the result has its number. What the same file registered under its name is replaced.

    SceneError where another file has taken the name, or the kind is inconsistent.
    """
    origin = Origin.of_caller()
    number = _KINDS.number(kind.name, origin)
    _check_roles(kind)
    return _KINDS.enter(kind.name, replace(kind, number=number), origin)


def _check_roles(kind: PrimitiveKind) -> None:
    """SceneError where a kind lacks modules of its sort, or has such of the other."""
    wanted, foreign = (SOLID, ()) if kind.sort == "solid" else (SURFACE, SOLID)
    missing = [role for role in wanted if getattr(kind, role) is None]
    excess = [role for role in foreign if getattr(kind, role) is not None]
    if missing or excess:
        expected = f"a {kind.sort} has the modules {', '.join((*wanted, 'box'))}"
        found = ", ".join([f"no {role}" for role in missing] + excess)
        message = f"the primitive kind {kind.name!r} is inconsistent"
        raise SceneError(f"error: {message}\n  expected: {expected}\n  found: {found}")


def lookup(name: str) -> PrimitiveKind:
    """The kind named `name`; SceneError, naming those that exist, where there is none."""
    if name not in _KINDS:
        close = suggestion(name, list(_KINDS))
        hint = f"\n  hint: {close}" if close else ""
        raise SceneError(f"error: no primitive kind {name!r}\n  expected: one of {', '.join(_KINDS)}{hint}")
    return _KINDS[name]


def kinds() -> tuple[PrimitiveKind, ...]:
    """All kinds, in the order of their numbers."""
    return tuple(_KINDS.values())


def record_dtype(name: str) -> Any:
    """The layout of a record of `tasuki.modules.records`."""
    return resolve(f"tasuki.modules.records:{name}").numpy_dtype()


def resolve(name: str) -> Any:
    """The object that "package.module:attribute" names; SceneError where there is none."""
    module, _, attribute = name.partition(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise SceneError(f"error: cannot find {name!r}: {error}") from error


def _builtin(name: str, sort: Literal["solid", "surface"], cost: float = 1.0) -> PrimitiveKind:
    modules = f"tasuki.modules.{name}"
    kind = PrimitiveKind(
        name=name,
        sort=sort,
        table=f"tasuki.modules.records:{name}s",
        box=f"{modules}:{name}_bounds",
        cost=cost,
        is_built_in=True,
    )
    roles: dict[str, Any] = {role: f"{modules}:{name}_{role}" for role in (*SURFACE, *(SOLID * (sort == "solid")))}
    if name != "plane":
        roles["part"] = f"{modules}:{name}_part"
    return replace(kind, **roles)


_SPHERES = Narrow("hit", UNIT_MATRIX, "tasuki.modules.quadric:sphere_hit", cost=0.5)
"""A general quadric's code beside a sphere's costs registers, even where no primitive ever reaches it."""

for _kind in (
    _builtin("plane", "solid"),
    replace(_builtin("quadric", "solid", cost=2.0), narrow=(_SPHERES,)),
    _builtin("cone", "surface", cost=2.0),
    _builtin("triangle", "surface"),
    _builtin("quad", "surface"),
):
    register(_kind)
