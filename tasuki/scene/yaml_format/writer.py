"""Writing: a scene as text, which gives an equal scene when it is read."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from tasuki.scene.material import Material, Texture
from tasuki.scene.model import Camera, DirectionalLight, Scene
from tasuki.scene.shapes import Shapes
from tasuki.scene.solids import Polygon, Solid
from tasuki.scene.transforms import IDENTITY, Transform
from tasuki.scene.tree import Bounded, Complement, Extent, Formula, Group, Instance, Node, SetOperation
from tasuki.scene.yaml_format.nodes import resolve_scalar
from tasuki.scene.yaml_format.tree import CLASSES

KEYS = {made: key for key, made in CLASSES.items()}
"""The key of each class of nodes; a polygon without normals has another, and a user's kind its own name."""

_APART = {field.name for field in fields(Bounded)} | {"children", "child", "parts", "shapes"}
OWN_FIELDS = {
    made: [(field.name, field.default) for field in fields(made) if field.name not in _APART]
    for made in CLASSES.values()
}
"""Names and defaults of what nodes of a class have, besides what all nodes have and the nodes in them."""


def dump_yaml(scene: Scene) -> str:
    """`scene` in the own format; reading it gives an equal scene."""
    return "\n".join(_Writer(scene).lines()) + "\n"


class _Writer:
    """Writes one scene. Materials and definitions have names of their own in the file."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.materials = dict(zip(scene.materials, _unique(one.name for one in scene.materials), strict=True))
        self.defined = _defined(scene.shapes)
        names = _unique(node.name or node.noun for node in self.defined)
        self.definitions = dict(zip(map(id, self.defined), names, strict=True))

    def lines(self) -> Iterator[str]:
        scene = self.scene
        camera = {field.name: getattr(scene.camera, field.name) for field in fields(Camera)}
        yield from ("version: 1", "camera:", *(f"  {name}: {_value(value)}" for name, value in camera.items()))
        yield f"background: {_value(scene.background)}"
        yield "lights:" if scene.lights else "lights: []"
        for light in scene.lights:
            place = "direction" if isinstance(light, DirectionalLight) else "position"
            yield f"  - {_flow({place: getattr(light, place), 'colour': light.colour})}"
        yield "materials:" if self.materials else "materials: {}"
        for material, name in self.materials.items():
            changed = [field.name for field in fields(Material)[1:] if getattr(material, field.name) != field.default]
            yield f"  {_text(name)}: {_flow({field: getattr(material, field) for field in changed})}"
        if self.defined:
            yield "definitions:"
        for node in self.defined:
            yield f"  {_text(self.definitions[id(node)])}:"
            yield from self._tree(node, "", 4)
        yield "shapes:" if len(scene.shapes) else "shapes: []"
        for node in scene.shapes:
            yield from self._tree(node, "- ", 2)

    def _tree(self, root: Node, lead: str, column: int) -> Iterator[str]:
        """The lines of a node whose key stands at `column` after the `lead`. By a loop: a tree may be deep."""
        stack: list[str | tuple[Node, str, int]] = [(root, lead, column)]
        while stack:
            top = stack.pop()
            if isinstance(top, str):
                yield top
                continue
            node, lead, column = top
            pad, body = " " * column, column + len(lead) + 2
            inner = list(self._inner(node, body))
            if not inner:
                yield f"{pad}{lead}{self._key(node)}: {_flow(self._values(node))}"
                continue
            yield f"{pad}{lead}{self._key(node)}:"
            yield from (f"{' ' * body}{name}: {text}" for name, text in _given(self._values(node)))
            stack += reversed(inner)

    def _inner(self, node: Node, column: int) -> Iterator[str | tuple[Node, str, int]]:
        """The lines of a node's body, from `column` on, that hold other nodes."""
        pad = " " * column
        if isinstance(node, Formula):
            yield f"{pad}parts:"
            for name, part in node.parts.items():
                yield f"{pad}  {_text(name)}:"
                yield part, "", column + 4
        elif isinstance(node, Complement):
            yield f"{pad}child:"
            yield node.child, "", column + 2
        elif members := _members(node):
            yield f"{pad}children:"
            yield from ((child, "- ", column + 2) for child in members)

    def _key(self, node: Node) -> str:
        if isinstance(node, Solid):
            return node.kind
        return "polygon" if isinstance(node, Polygon) and node.normals is None else KEYS[type(node)]

    def _values(self, node: Node) -> Mapping[str, Any]:
        """What is to be written of a node besides the nodes in it; None where there is nothing to say."""
        if isinstance(node, Solid):
            own = dict(node.fields)
        elif isinstance(node, Instance):
            own = {"of": self.definitions[id(node.of)]}
        else:
            given = ((name, default, getattr(node, name)) for name, default in OWN_FIELDS[type(node)])
            own = {name: value for name, default, value in given if value != default}
        if isinstance(node, Group) and not _members(node):
            own["children"] = ()
        return own | {
            "material": None if node.material is None else self.materials[node.material],
            "transform": _steps(node.transform),
            "name": node.name,
            "extent": node.extent if isinstance(node, Bounded) else None,
        }


def _members(node: Node) -> list[Node]:
    """The children of a group or a set operation, those of a batch one by one."""
    children = node.children if isinstance(node, Group | SetOperation) else ()
    return [one for child in children for one in (child if isinstance(child, Shapes) else [child])]


def _defined(shapes: Shapes) -> list[Node]:
    """Everything of which there are instances, once, in order of first use."""
    found: dict[int, Node] = {}
    stack, seen = list[Any](shapes.nodes)[::-1], set[int]()
    while stack:
        node = stack.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        if isinstance(node, Instance):
            found[id(node.of)] = node.of
        stack += (node.nodes if isinstance(node, Shapes) else node.inner)[::-1]
    return list(found.values())


def _steps(transform: Transform) -> list[dict[str, Any]] | None:
    """The steps of a transformation: one where it only moves or only stretches, else its matrix."""
    if transform == IDENTITY:
        return None
    linear, move = transform.matrix[:3, :3], transform.matrix[:3, 3]
    if np.array_equal(linear, np.eye(3)):
        return [{"translate": move.tolist()}]
    if not move.any() and np.array_equal(linear, np.diag(np.diag(linear))):
        return [{"scale": np.diag(linear).tolist()}]
    return [{"matrix": transform.matrix[:3].tolist()}]


def _given(values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """The names and texts of those `values` that are not None."""
    return ((name, _value(value)) for name, value in values.items() if value is not None)


def _flow(values: Mapping[str, Any]) -> str:
    return "{" + ", ".join(f"{name}: {text}" for name, text in _given(values)) + "}"


def _value(value: Any) -> str:
    if isinstance(value, tuple | list):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, Mapping):
        return _flow({_text(key): one for key, one in value.items()})
    if isinstance(value, Extent):
        return _flow({"centre": value.centre, "radius": value.radius})
    if isinstance(value, Texture):
        return _flow({_text(value.kind): value.values})
    if isinstance(value, bool):
        return "true" if value else "false"
    return _text(value) if isinstance(value, str) else _number(value)


def _number(value: float) -> str:
    """The shortest text that is read back as the same number, in the notation of every version of YAML."""
    text = repr(float(value)) if not isinstance(value, int) else str(value)
    if "e" in text and "." not in text:
        return text.replace("e", ".0e")
    return text[:-2] if text.endswith(".0") and text != "-0.0" else text


def _text(text: str) -> str:
    """A word or several, quoted unless they are plainly text."""
    if re.fullmatch(r"[A-Za-z]([A-Za-z0-9_ -]*[A-Za-z0-9_])?", text) and resolve_scalar(text) == text:
        return text
    return '"' + "".join(_escaped(sign) for sign in text) + '"'


def _escaped(sign: str) -> str:
    """A character as it stands in double quotes."""
    if sign in '"\\':
        return "\\" + sign
    return sign if sign.isprintable() and ord(sign) < 0x10000 else f"\\U{ord(sign):08x}"


def _unique(names: Iterable[str]) -> list[str]:
    """The names, a number after each that was there before."""
    taken: set[str] = set()
    found = []
    for name in names:
        unique, copy = name, 1
        while unique in taken:
            copy += 1
            unique = f"{name} {copy}"
        taken.add(unique)
        found.append(unique)
    return found
