"""The registry of textures: how the colour of a material may vary over a surface. Files of users fill it.

A kind of texture is a table of records, the textures' parameters, and a module that works on one of them: made like a
kind of primitives (`tasuki.scene.kinds`), and named in scenes by the texture of a material.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.language import Table
from tasuki.language.declare import Module
from tasuki.scene.material import Material, Texture
from tasuki.scene.problem import Problem
from tasuki.scene.registry import Origin, Registry
from tasuki.scene.source import suggestion

MOST_KINDS = 32
"""A texture's code is its row * 32 + the number of its kind."""
FILE = "file"
"""The type of a parameter that names a file; in a scene file, from the folder in which that stands."""
NUMBERS = {"f32": "a number", "i32": "a whole number", "bool": "true or false"}
VECTORS = {"vec3": 3, "vec4": 4}
TYPES = (*NUMBERS, *VECTORS, FILE)
"""What parameters of textures may be."""

Loaded: TypeAlias = tuple[Mapping[str, Any], Mapping[str, np.ndarray]]
"""The fields of a texture's record, and rows of further tables, by name."""


@dataclass(frozen=True)
class TextureKind:
    """One kind of texture.

    `module` takes a record of `table`, the colour of the material, a point in local coordinates and the normal for
    shading; it gives the colour there. What a texture of this kind is told in a scene are the fields of the record,
    those that `defaults` has being optional; `parameters` {name: type} are others, of which `load` makes the record: it
    takes their values, and gives the fields, and tables of its own as structured arrays. A field with the name of such
    a table receives the row at which this texture's part of it begins. Types are "f32", "i32", "bool", "vec3", "vec4"
    or "file". `register` gives the `number`.
    """

    name: str
    table: Table
    module: Module
    parameters: Mapping[str, str] | None = None
    defaults: Mapping[str, Any] = field(default_factory=dict)
    load: Callable[[Mapping[str, Any]], Loaded] | None = None
    number: int = -1

    @property
    def table_name(self) -> str:
        """The name of the kind's table in memory."""
        return self.table.named(f"{self.name}_textures")

    @property
    def takes(self) -> Mapping[str, str]:
        """The parameters that a scene may give, and their types."""
        if self.parameters is not None:
            return self.parameters
        return {name: str(type_) for name, type_ in self.table.record.ir.fields}


_KINDS: Registry[TextureKind] = Registry("texture", MOST_KINDS)


def register(kind: TextureKind) -> TextureKind:
    """Make `kind` known; the result has its number. What the same file registered under its name is replaced.

    SceneError where another file has taken the name, or there is no room.
    """
    origin = Origin.of_caller()
    number = _KINDS.number(kind.name, origin)
    for name, type_ in kind.takes.items():
        if type_ not in TYPES:
            message = f"the texture {kind.name!r} cannot have a parameter {name!r} of this type"
            raise SceneError(str(Diagnostic(message, None, ", ".join(TYPES), repr(type_))))
    return _KINDS.enter(kind.name, replace(kind, number=number), origin)


def textures() -> tuple[TextureKind, ...]:
    """All kinds of textures, in the order of their numbers."""
    return tuple(_KINDS.values())


def files(texture: Texture) -> dict[str, str]:
    """The files that a texture names, by parameter."""
    kind = _KINDS.get(texture.kind)
    types = kind.takes if kind else {}
    return {name: value for name, value in texture.values.items() if types.get(name) == FILE and isinstance(value, str)}


def placed(texture: Texture, folder: Path) -> Texture:
    """The texture with its files named from `folder`. What is wrong with it stays for `problems` to say."""
    moved = {name: str(folder / file) for name, file in files(texture).items()}
    return replace(texture, values={**texture.values, **moved})


# --- what is wrong ----------------------------------------------------------------------------------------------------


def problems(texture: Texture) -> Iterator[Problem]:
    """What is wrong with a texture: its kind (path "kind"), or its values (paths "values", NAME)."""
    kind = _KINDS.get(texture.kind)
    if kind is None:
        known = ", ".join(_KINDS) or "none: files that are given along (--with) bring textures"
        yield Problem(("kind",), f"there is no texture {texture.kind!r}", known, repr(texture.kind))
        return
    takes = kind.takes
    for name, value in texture.values.items():
        if name not in takes:
            hint = suggestion(name, list(takes))
            message = f"a texture {kind.name!r} has no {name!r}" + (f"; {hint}" if hint else "")
            yield Problem(("values", name), message, ", ".join(takes), repr(name))
        else:
            yield from _value_problems(name, takes[name], value)
    for name in takes:
        if name not in texture.values and name not in kind.defaults:
            yield Problem(("values", name), f"a texture {kind.name!r} needs this", f"a value for {name!r}", "none")


def _value_problems(name: str, type_: str, value: Any) -> Iterator[Problem]:
    expected = _expected(type_, value)
    if expected:
        found = list(value) if isinstance(value, tuple) else value
        yield Problem(("values", name), "no such value for a texture", expected, repr(found))
    elif type_ == FILE and not Path(value).is_file():
        found = "a folder" if Path(value).is_dir() else "no such file"
        yield Problem(("values", name), f"the texture's file {value!r} is missing", "a file", found)


def _expected(type_: str, value: Any) -> str | None:
    """What a parameter of this type should have been; None where `value` is it."""
    if type_ == FILE:
        return None if isinstance(value, str) else "the name of a file"
    if type_ in VECTORS:
        size = VECTORS[type_]
        fits = isinstance(value, tuple) and len(value) == size and all(map(_is_number, value))
        return None if fits else f"{size} numbers"
    is_whole = isinstance(value, int) and not isinstance(value, bool)
    fits = {"f32": _is_number(value), "i32": is_whole, "bool": isinstance(value, bool)}[type_]
    return None if fits else NUMBERS[type_]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


# --- textures in memory -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Textures:
    """`codes[i]` is what the attribute of material i has as `texture`; `tables` by name; `kinds` are those in use."""

    codes: Sequence[int]
    tables: Mapping[str, np.ndarray]
    kinds: Sequence[TextureKind]


def lower_textures(materials: Sequence[Material]) -> Textures:
    """The records of all textures, one for each that differs, and their tables.

    SceneError where a texture cannot be loaded.
    """
    rows: dict[str, dict[Texture, int]] = {}
    codes = []
    for material in materials:
        code = -1
        if material.texture is not None:
            mine = rows.setdefault(material.texture.kind, {})
            code = mine.setdefault(material.texture, len(mine)) * 32 + _KINDS[material.texture.kind].number
        codes.append(code)
    kinds = sorted((_KINDS[name] for name in rows), key=lambda kind: kind.number)
    tables: dict[str, np.ndarray] = {}
    for kind in kinds:
        _add(tables, kind.table_name, _records(kind, list(rows[kind.name]), tables))
    return Textures(codes, tables, kinds)


def _records(kind: TextureKind, textures: Sequence[Texture], tables: dict[str, np.ndarray]) -> np.ndarray:
    records = np.zeros(len(textures), kind.table.record.numpy_dtype())
    for record, texture in zip(records, textures, strict=True):
        values = {**kind.defaults, **texture.values}
        fields, more = kind.load(values) if kind.load else (values, {})
        firsts = {name: _add(tables, name, rows) for name, rows in more.items()}
        for name, value in {**fields, **firsts}.items():
            record[name] = value
    return records


def _add(tables: dict[str, np.ndarray], name: str, rows: np.ndarray) -> int:
    """Append `rows` to a table; the first of them. SceneError where another kind has a table of this name."""
    before = tables.get(name, rows[:0])
    if before.dtype != rows.dtype:
        raise SceneError(str(Diagnostic(f"two kinds of textures have a table {name!r}, with different records")))
    # Not `np.concatenate`, which would take the gaps out of records.
    tables[name] = np.empty(len(before) + len(rows), rows.dtype)
    tables[name][: len(before)], tables[name][len(before) :] = before, rows
    return len(before)
