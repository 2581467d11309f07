"""From YAML nodes to the tree of a scene.

By loops instead of recursion, so that the depth of a tree is limited by the scene's own rule, not by Python's stack: a
`Survey` checks every node by itself, and puts definitions in an order in which each follows what it uses; `build`
makes nodes from the leaves up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from types import MappingProxyType
from typing import Any, Literal

from pydantic import ValidationError

from tasuki.diagnostics import Diagnostic, Span
from tasuki.scene import solids, tree
from tasuki.scene.formula_text import FormulaError, parse_infix, parse_polish
from tasuki.scene.importers.meshes import MeshError
from tasuki.scene.material import Material
from tasuki.scene.mesh import Mesh
from tasuki.scene.problem import Path
from tasuki.scene.schema_fields import ExtentModel
from tasuki.scene.schema_nodes import (
    LISTS,
    BoundedModel,
    ComplementModel,
    InstanceModel,
    MeshModel,
    NodeModel,
    ObjectModel,
)
from tasuki.scene.source import MOST_ERRORS
from tasuki.scene.transforms import IDENTITY, Transform, TransformError, matrix, rotate, scale, translate
from tasuki.scene.yaml_format.mesh_files import MeshFiles
from tasuki.scene.yaml_format.nodes import Node
from tasuki.scene.yaml_format.places import Places

CLASSES: Mapping[str, type[tree.Node]] = MappingProxyType(
    {
        "sphere": solids.Sphere,
        "ellipsoid": solids.Ellipsoid,
        "box": solids.Box,
        "cylinder": solids.Cylinder,
        "cone": solids.Cone,
        "hyperboloid": solids.Hyperboloid,
        "paraboloid": solids.Paraboloid,
        "half_space": solids.HalfSpace,
        "slab": solids.Slab,
        "wedge": solids.Wedge,
        "quadric": solids.Quadric,
        "rounded_box": solids.RoundedBox,
        "tube": solids.Tube,
        "polygon": solids.Polygon,
        "patch": solids.Polygon,
        "union": tree.Union,
        "intersection": tree.Intersection,
        "difference": tree.Difference,
        "complement": tree.Complement,
        "object": tree.Formula,
        "mesh": Mesh,
        "group": tree.Group,
        "instance": tree.Instance,
    }
)
"""The class of the node under each key."""

_COMMON = frozenset(BoundedModel.model_fields)
_STEPS: Mapping[str, Callable[[Any], Transform]] = MappingProxyType(
    {
        "translate": lambda by: translate(*by),
        "rotate": lambda turn: rotate(turn.axis, turn.angle),
        "scale": lambda factors: scale(*factors) if isinstance(factors, list) else scale(factors),
        "matrix": matrix,
    }
)


@dataclass(slots=True)
class Item:
    """One node of the file, checked by itself: `inner` are the numbers of the items directly inside it."""

    path: Path
    key: str
    body: NodeModel
    transform: Transform
    place: Span
    inner: list[int] = field(default_factory=list)


class Survey:
    """Checks the definitions and the shapes of a file. `wrong` holds what is wrong with them.

    `materials` are the names of the scene's materials. Where nothing is wrong, `items` are all nodes, each before those
    within it; `roots` gives the items of each definition and each shape; `order` names the definitions, each after
    those that it uses; and `meshes` has read the files of meshes.
    """

    def __init__(self, places: Places, materials: Sequence[str]) -> None:
        self.places = places
        self.materials = materials
        self.wrong: list[Diagnostic] = []
        self.items: list[Item] = []
        self.roots: dict[Path, range] = {}
        self.order: list[str] = []
        self.meshes = MeshFiles(places.source)
        self._uses: dict[str, dict[str, Path]] = {name: {} for name in places.plain("definitions", dict)}
        for name in self._uses:
            self._walk(("definitions", name), places.follow(("definitions", name))[0])
        shapes, _ = places.follow(("shapes",))
        for number in range(len(places.plain("shapes", list))):
            self._walk(("shapes", number), shapes.value[number])
        if not self.wrong:
            self._sort_definitions()

    def _walk(self, root: Path, node: Node) -> None:
        """Check the `node` at `root` and all within it."""
        first = len(self.items)
        stack: list[tuple[Path, Node, Item | None]] = [(root, node, None)]
        while stack and len(self.wrong) <= MOST_ERRORS:
            path, node, parent = stack.pop()
            if not self.places.is_item(node):
                self.wrong.append(self.places.unknown_node(path, node))
                continue
            ((key, (_, body)),) = node.value.items()
            item = self._item((*path, key), key, body, Span(self.places.source.file, node.line + 1))
            if item is not None:
                if parent is not None:
                    parent.inner.append(len(self.items))
                self.items.append(item)
            stack += [(*one, item) for one in reversed(list(_inner((*path, key), key, body)))]
        self.roots[root] = range(first, len(self.items))

    def _item(self, path: Path, key: str, node: Node, place: Span) -> Item | None:
        """The node of kind `key` whose body is `node`, at `path`; None where it is wrong."""
        model = self.places.models[key]
        plain = {"children": node.plain} if key in LISTS and isinstance(node.value, list) else node.plain
        try:
            body = model.model_validate(plain)
        except ValidationError as error:
            found = error.errors(include_url=False, include_input=False)
            self.wrong += [self.places.explain(one, path, model) for one in found]
            return None
        before = len(self.wrong)
        self._check_names(path, body)
        transform = self._transform(path, body.transform) if body.transform else IDENTITY
        if isinstance(body, ObjectModel):
            self._check_formula(path, body)
        elif isinstance(body, MeshModel):
            self._check_mesh(path, body)
        return Item(path, key, body, transform, place) if len(self.wrong) == before else None

    def _check_names(self, path: Path, body: NodeModel) -> None:
        """That the material and the definition which a body names exist."""
        if body.material is not None and body.material not in self.materials:
            self.wrong.append(self.places.unknown(path, "material", body.material, self.materials))
        if isinstance(body, InstanceModel):
            if body.of not in self._uses:
                self.wrong.append(self.places.unknown(path, "of", body.of, list(self._uses), noun="definition"))
            if path[0] == "definitions":
                self._uses[str(path[1])].setdefault(body.of, (*path, "of"))

    def _check_formula(self, path: Path, body: ObjectModel) -> None:
        key, text, parse = ("polish", body.polish, parse_polish)
        if body.formula is not None:
            key, text, parse = "formula", body.formula, parse_infix
        try:
            parse(text or "", body.parts)
        except FormulaError as error:
            self.wrong.append(self.places.formula((*path, key), error))

    def _check_mesh(self, path: Path, body: MeshModel) -> None:
        try:
            self.meshes.shapes(body.file)
        except MeshError as error:
            self.wrong.append(
                self.places.diagnostic((*path, "file"), error.message, error.expected, error.found, error.hint)
            )

    def _transform(self, path: Path, steps: Sequence[Any]) -> Transform:
        """The steps of the transformation at `path`, one after the other."""
        transform = IDENTITY
        for number, step in enumerate(steps):
            ((key, value),) = step
            try:
                transform = transform.then(_STEPS[key](value))
            except TransformError as error:
                place = (*path, "transform", number, key)
                self.wrong.append(self.places.diagnostic(place, error.message, error.expected, error.found))
        return transform

    def _sort_definitions(self) -> None:
        try:
            self.order = list(TopologicalSorter(self._uses).static_order())
        except CycleError as error:
            self.wrong.append(self._cycle(error.args[1][1:]))

    def _cycle(self, used_first: Sequence[str]) -> Diagnostic:
        """The message about definitions of which each is used by the next one, and the last by the first."""
        names = list(reversed(used_first))
        first = min(range(len(names)), key=lambda number: list(self._uses).index(names[number]))
        way = [*names[first:], *names[: first + 1]]
        message, expected = "this definition holds itself", "a definition that does not lead back to itself"
        return self.places.diagnostic(self._uses[way[0]][way[1]], message, expected, " -> ".join(way))


def build(survey: Survey, materials: Mapping[str, Material]) -> list[tree.Node]:
    """The shapes that a `survey` found nothing wrong with, from the leaves up."""
    definitions: dict[str, tree.Node] = {}
    for name in survey.order:
        definitions[name] = _build(survey, survey.roots["definitions", name], materials, definitions)
    shapes = [items for path, items in survey.roots.items() if path[0] == "shapes"]
    return [_build(survey, items, materials, definitions) for items in shapes]


def _build(
    survey: Survey, numbers: range, materials: Mapping[str, Material], definitions: Mapping[str, tree.Node]
) -> tree.Node:
    """The node of the first of the items with `numbers`; the others are those within it."""
    built: dict[int, tree.Node] = {}
    for number in reversed(numbers):
        item = survey.items[number]
        body = item.body
        own: dict[str, Any] = {name: _value(value) for name, value in body if name not in _COMMON}
        material = None if body.material is None else materials[body.material]
        common: dict[str, Any] = {"material": material, "transform": item.transform, "name": body.name}
        if isinstance(body, BoundedModel) and body.extent is not None:
            common["extent"] = _extent(body.extent)
        if isinstance(body, InstanceModel):
            own["of"] = definitions[body.of]
        elif isinstance(body, ObjectModel):
            own["parts"] = {name: built.pop(one) for name, one in zip(body.parts, item.inner, strict=True)}
        elif isinstance(body, ComplementModel):
            own["child"] = built.pop(item.inner[0])
        elif isinstance(body, MeshModel):
            own = {"file": str(survey.meshes.path(body.file)), "shapes": survey.meshes.shapes(body.file)}
        elif item.key in LISTS:
            own["children"] = tuple(built.pop(one) for one in item.inner)
        elif item.key not in CLASSES:
            own = {"kind": item.key, "fields": own}
        built[number] = CLASSES.get(item.key, solids.Solid)(**own, **common, place=item.place)
    return built[numbers.start]


def _inner(path: Path, key: str, body: Node) -> Iterator[tuple[Path, Node]]:
    """The nodes directly inside the body of a node, with their paths."""
    if key in LISTS and isinstance(body.value, list):
        yield from (((*path, number), node) for number, node in enumerate(body.value))
    held = body.value if isinstance(body.value, dict) else {}
    if key in LISTS and "children" in held and isinstance(held["children"][1].value, list):
        yield from (((*path, "children", number), node) for number, node in enumerate(held["children"][1].value))
    if key == "object" and "parts" in held and isinstance(held["parts"][1].value, dict):
        yield from (((*path, "parts", name), node) for name, (_, node) in held["parts"][1].value.items())
    if key == "complement" and "child" in held:
        yield (*path, "child"), held["child"][1]


def _value(value: Any) -> Any:
    """A checked value as nodes hold it: lists are tuples."""
    if type(value) is not list:
        return value
    return tuple(map(_value, value)) if value and type(value[0]) is list else tuple(value)


def _extent(extent: ExtentModel | Literal["auto"]) -> tree.Extent | Literal["auto"]:
    return extent if extent == "auto" else tree.Extent(_value(extent.centre), extent.radius)
