"""Tasuki's own scene format, in YAML: reading with places in every message, and writing.

`docs/scene-format.md` describes it, `tasuki.scene.schema` defines it.
"""

from __future__ import annotations

import gc
import json
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from typing import Any

from pydantic import ValidationError

from tasuki.diagnostics import Diagnostic, SceneError, Span
from tasuki.scene.check import problems
from tasuki.scene.material import PLAIN, Material
from tasuki.scene.model import Camera, PointLight, Scene, Vector
from tasuki.scene.problem import Problem
from tasuki.scene.schema import SHAPE_MODELS, CameraModel, LightModel, MaterialModel, SceneModel
from tasuki.scene.shapes import Shape, Shapes
from tasuki.scene.solids import Cone, Cylinder, Polygon, Sphere
from tasuki.scene.source import SourceText, quote, scene_error, suggestion
from tasuki.scene.yaml_nodes import Node, compose, resolve_scalar

Path = Sequence[str | int]

# What each kind of pydantic error expects; {name} is filled from the error's context.
EXPECTED = {
    "missing": "a value for it",
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "finite_number": "a finite number",
    "string_type": "a word",
    "bool_type": "true or false",
    "list_type": "a list",
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "greater_than": "more than {gt}",
    "greater_than_equal": "{ge} or more",
    "less_than": "less than {lt}",
    "literal_error": "{expected}",
    "normals_count": "{expected}",
    "union_tag_invalid": "one of " + ", ".join(SHAPE_MODELS),
    "union_tag_not_found": "one key, one of " + ", ".join(SHAPE_MODELS),
}


def read(source: SourceText) -> Scene:
    """The scene in `source`; SceneError with everything that is wrong with it."""
    with _collector_paused():
        return _read(source)


def _read(source: SourceText) -> Scene:
    root = compose(source)
    if root is None:
        raise SceneError(str(Diagnostic(f"{source.file!r} is empty", None, "a scene in YAML", "no document")))
    places = Places(source, root)
    try:
        model = SceneModel.model_validate(root.plain())
    except ValidationError as error:
        raise scene_error(places.explain(one) for one in error.errors(include_url=False)) from None
    unknown = [places.unknown_material(model, number) for number in range(len(model.shapes))]
    scene = _scene(model, places)
    found = [one for one in unknown if one] + [places.locate(model, problem) for problem in problems(scene)]
    if found:
        raise scene_error(found)
    return scene


class Places:
    """Translates paths of the data into places of the file."""

    def __init__(self, source: SourceText, root: Node) -> None:
        self.source = source
        self.root = root

    def node(self, path: Path) -> Node:
        """The node at `path`, or the deepest on the way there that exists."""
        node = self.root
        for step in path:
            if isinstance(node.value, dict) and step in node.value:
                node = node.value[step][1]
            elif isinstance(node.value, list) and isinstance(step, int) and step < len(node.value):
                node = node.value[step]
            else:
                break
        return node

    def span(self, path: Path) -> Span:
        return self.node(path).span(self.source.file)

    def diagnostic(
        self, path: Path, message: str, expected: str, found: str, hint: str | None = None, span: Span | None = None
    ) -> Diagnostic:
        text = f"{dotted(path)}: {message}" if path else message
        return Diagnostic(text, span or self.span(path), expected, found, hint, source=self.source.shown)

    def explain(self, error: Any) -> Diagnostic:
        """A pydantic error as a diagnostic."""
        kind, path = error["type"], _without_tags(error["loc"])
        context = {
            name: f"{value:g}" if isinstance(value, float) else value for name, value in error.get("ctx", {}).items()
        }
        node = self.node(path)
        message = re.sub(r"^Input should be", "this should be", error["msg"])
        if kind == "extra_forbidden":
            return self._unknown_key(path)
        if kind == "missing":
            parent = self.node(path[:-1])
            return self.diagnostic(path, "this is missing", f"a key {path[-1]!r}", parent.describe())
        if kind in ("too_short", "too_long"):
            expected, found = self._length(kind, context, node)
            return self.diagnostic(path, "this list has the wrong length", expected, found)
        if kind in ("union_tag_invalid", "union_tag_not_found"):
            return self._unknown_shape(path, node)
        expected = EXPECTED.get(kind, message).format(**context)
        found = context.get("found") or node.describe()
        if kind.endswith("_type"):
            message = "this is of the wrong type"
        return self.diagnostic(path, message, expected, found)

    def unknown_material(self, model: SceneModel, number: int) -> Diagnostic | None:
        """What is wrong with the material of shape `number`, if anything."""
        key, body = _body(model.shapes[number])
        if body.material is None or body.material in model.materials:
            return None
        known = list(model.materials)
        path = ("shapes", number, key, "material")
        expected = "one of " + ", ".join(known) if known else "no material: the scene has none"
        return self.diagnostic(
            path, "no such material", expected, quote(body.material), suggestion(body.material, known)
        )

    def locate(self, model: SceneModel, problem: Problem) -> Diagnostic:
        """A problem of the scene as a diagnostic."""
        path = list(problem.path)
        if path[0] == "materials":
            path[1] = list(model.materials)[int(path[1])]
        elif path[0] == "shapes":
            key, _ = _body(model.shapes[int(path[1])])
            path.insert(2, key)
            if key == "cylinder" and path[-1] == "base_radius":
                path[-1] = "radius"
        return self.diagnostic(path, problem.message, problem.expected, problem.found)

    def _unknown_key(self, path: Path) -> Diagnostic:
        parent = self.node(path[:-1])
        key, _ = parent.value[path[-1]]
        known = _known_keys(path[:-1])
        hint = suggestion(str(path[-1]), known)
        span = key.span(self.source.file)
        return self.diagnostic(path, "there is no such key", f"one of {', '.join(known)}", quote(key.text), hint, span)

    def _unknown_shape(self, path: Path, node: Node) -> Diagnostic:
        known = list(SHAPE_MODELS)
        if not isinstance(node.value, dict) or len(node.value) != 1:
            return self.diagnostic(path, "a shape has one key", EXPECTED["union_tag_not_found"], node.describe())
        ((name, (key, _)),) = node.value.items()
        span, hint = key.span(self.source.file), suggestion(name, known)
        return self.diagnostic(path, "no such shape", EXPECTED["union_tag_invalid"], quote(name), hint, span)

    def _length(self, kind: str, context: dict[str, Any], node: Node) -> tuple[str, str]:
        least, most = context.get("min_length"), context.get("max_length")
        # Lists whose length may vary have only a least one; the others are vectors and resolutions.
        is_open = kind == "too_short" and node.value and isinstance(node.value[0].value, list)
        expected = f"{least or most} or more" if is_open else f"{least or most} numbers"
        return expected, str(context["actual_length"])


def dump_yaml(scene: Scene) -> str:
    """`scene` in the own format; reading it gives an equal scene."""
    camera = {field.name: getattr(scene.camera, field.name) for field in fields(Camera)}
    lines = ["version: 1", "camera:", *(f"  {name}: {_value(value)}" for name, value in camera.items())]
    lines += [f"background: {_value(scene.background)}", "lights:" if scene.lights else "lights: []"]
    lines += [f"  - {_flow(light, ('position', 'colour'))}" for light in scene.lights]
    names = _unique_names(scene.materials)
    lines.append("materials:" if names else "materials: {}")
    for material, name in names.items():
        changed = [field.name for field in fields(Material)[1:] if getattr(material, field.name) != field.default]
        lines.append(f"  {_text(name)}: {_flow(material, changed)}")
    lines.append("shapes:" if len(scene.shapes) else "shapes: []")
    lines += [f"  - {_shape_text(shape, names[shape.material or PLAIN])}" for shape in scene.shapes]
    return "\n".join(lines) + "\n"


def dotted(path: Path) -> str:
    """A path as people write it: shapes[3].sphere.radius."""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path).lstrip(".")


# From the validated model to the scene


@contextmanager
def _collector_paused() -> Iterator[None]:
    """Without the garbage collector: every node lives until the end, and looking at them again doubles the time."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def _scene(model: SceneModel, places: Places) -> Scene:
    materials = {name: _material(name, material) for name, material in model.materials.items()}
    shapes = []
    for number, shape in enumerate(model.shapes):
        key, body = _body(shape)
        material = materials.get(body.material, Material()) if body.material is not None else Material()
        place = Span(places.source.file, places.node(("shapes", number)).start.line + 1)
        shapes.append(_shape(key, body, material, place))
    return Scene(
        camera=_camera(model.camera),
        shapes=Shapes.of(shapes, list(materials.values())),
        lights=[PointLight(_vector(one.position), _colour(one.colour)) for one in model.lights],
        background=_vector(model.background),
    )


def _body(shape: Any) -> tuple[str, Any]:
    """The key of a shape, and the model under it."""
    ((key, body),) = shape
    return key, body


def _camera(model: CameraModel) -> Camera:
    width, height = model.resolution
    return Camera(
        eye=_vector(model.eye),
        at=_vector(model.at),
        up=_vector(model.up),
        angle=model.angle,
        resolution=(width, height),
        hither=model.hither,
        angle_between=model.angle_between,
    )


def _material(name: str, model: MaterialModel) -> Material:
    values = dict(model)
    values |= {"colour": _vector(model.colour), "transmittance": _vector(model.transmittance)}
    return Material(name, **values)


def _shape(key: str, body: Any, material: Material, place: Span) -> Shape:
    if key == "sphere":
        return Sphere(_vector(body.centre), body.radius, material=material, place=place)
    if key == "cylinder":
        base, apex = _vector(body.base), _vector(body.apex)
        return Cylinder(base, apex, body.radius, open=True, material=material, place=place)
    if key == "cone":
        base, apex = _vector(body.base), _vector(body.apex)
        return Cone(base, body.base_radius, apex, body.apex_radius, open=True, material=material, place=place)
    points = tuple(map(_vector, body.points))
    normals = tuple(map(_vector, body.normals)) if key == "patch" else None
    return Polygon(points, normals, material=material, place=place)


def _vector(values: Iterable[float]) -> Vector:
    x, y, z = map(float, values)
    return x, y, z


def _colour(values: Iterable[float] | None) -> Vector | None:
    return None if values is None else _vector(values)


# Messages


def _without_tags(location: Path) -> Path:
    """An error's location without the union's tag, which repeats the key of a shape."""
    if len(location) > 2 and location[0] == "shapes":
        return (*location[:2], *location[3:])
    return location


def _known_keys(path: Path) -> list[str]:
    """The keys that the mapping at `path` may have."""
    models: dict[str, type] = {"camera": CameraModel, "lights": LightModel, "materials": MaterialModel}
    model: Any = SceneModel
    if path:
        model = SHAPE_MODELS[str(path[2])] if path[0] == "shapes" else models[str(path[0])]
    return list(model.model_fields)


# Text


def _shape_text(shape: Shape, material: str) -> str:
    if isinstance(shape, Sphere):
        key, names = "sphere", ["centre", "radius"]
    elif isinstance(shape, Polygon):
        key, names = ("patch", ["points", "normals"]) if shape.normals else ("polygon", ["points"])
    elif isinstance(shape, Cylinder):
        key, names = "cylinder", ["base", "apex", "radius"]
    else:
        key, names = "cone", ["base", "base_radius", "apex", "apex_radius"]
    parts = ", ".join(f"{name}: {_value(getattr(shape, name))}" for name in names)
    return f"{key}: {{{parts}, material: {_text(material)}}}"


def _flow(thing: Any, names: Iterable[str]) -> str:
    """The fields `names` of a dataclass as a flow mapping; None is left out."""
    given = ((name, getattr(thing, name)) for name in names)
    return "{" + ", ".join(f"{name}: {_value(value)}" for name, value in given if value is not None) + "}"


def _value(value: Any) -> str:
    if isinstance(value, tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
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
    """A name, quoted unless it is plainly a word."""
    is_plain = re.fullmatch(r"[A-Za-z][A-Za-z0-9_ -]*[A-Za-z0-9]|[A-Za-z]", text) and resolve_scalar(text) == text
    return text if is_plain else json.dumps(text)


def _unique_names(materials: Iterable[Material]) -> dict[Material, str]:
    """A name for every material, its own unless another has it."""
    names: dict[Material, str] = {}
    taken: set[str] = set()
    for material in materials:
        name, copy = material.name, 1
        while name in taken:
            copy += 1
            name = f"{material.name} {copy}"
        names[material] = name
        taken.add(name)
    return names
