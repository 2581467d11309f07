"""One way through the scene tree, every instance apart: what stands where, in scene order.

Things are numbered as they are met. Each is noted with its frame: the number of the product of all transforms on the
way to it; `Walk.frames` works those products out, a level of the tree at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from tasuki.scene.csg import Join
from tasuki.scene.formula_text import Expression
from tasuki.scene.material import PLAIN, Material
from tasuki.scene.mesh import Mesh
from tasuki.scene.problem import Path, Problem
from tasuki.scene.shapes import NO_FRAME, NODE, POLYGON, Shapes, material_numbers, surface_sort
from tasuki.scene.solids import Cone, Cylinder, Polygon, Sphere
from tasuki.scene.transforms import IDENTITY, singular
from tasuki.scene.tree import (
    Complement,
    Difference,
    Formula,
    Group,
    Instance,
    Intersection,
    Node,
    SetOperation,
    Union,
)

UNNAMED = -1
"""The material of what no node around it names one for, so far."""

SIMILAR = 1e-9
"""How far the columns of a similarity may be from equal lengths and right angles, in units of their length."""


class Use(NamedTuple):
    """A solid as an operand: where it stands, its material by number, and whether its outside is meant."""

    solid: Node
    frame: int
    material: int
    inverted: bool


class Placed(NamedTuple):
    """A thing of the scene. Of a surface `tokens` is empty; of an object it is the formula, operators first."""

    node: Node
    frame: int
    material: int
    number: int
    path: Path
    tokens: list[Use | Join]


class Run(NamedTuple):
    """The entries `first` to `end` of a `Shapes`, all in its batches; `materials[i]` is the number of its i-th."""

    shapes: Shapes
    first: int
    end: int
    frame: int
    number: int
    path: Path
    materials: np.ndarray


@dataclass(slots=True)
class Gathered:
    """A group, or a mesh: it has the things with the numbers `first` to `end`."""

    group: Group | Mesh
    frame: int
    path: Path
    first: int
    end: int = 0


class _Visit(NamedTuple):
    """What is still to be met: a node, with what holds around it. Inside an object `tokens` is its formula so far."""

    what: Any
    frame: int
    material: int
    path: Path
    tokens: list[Use | Join] | None = None
    inverted: bool = False


class _Stretch(NamedTuple):
    """Entries of a `Shapes` between two of its nodes, and the numbers of its materials."""

    shapes: Shapes
    first: int
    end: int
    materials: np.ndarray


class _Operand(NamedTuple):
    """A part of the expression of a formula."""

    formula: Formula
    expression: Expression


class Walk:
    """What a walk through `shapes` found.

    `count` things, numbered in scene order: single `surfaces`, `runs` of batches, and `objects`. `groups` are in the
    order in which they begin. `materials` are those of `shapes`, and plain white where something needs it.
    """

    def __init__(self, shapes: Shapes) -> None:
        self.surfaces: list[Placed] = []
        self.objects: list[Placed] = []
        self.runs: list[Run] = []
        self.groups: list[Gathered] = []
        self.count = 0
        self._numbers = material_numbers(shapes.materials)
        self._numbers_by_id: dict[int, int] = {}
        self._transforms: list[np.ndarray] = []
        self._parents: list[int] = []
        self._depths: list[int] = []
        self._frame_paths: list[Path] = []
        self._visits: list[_Visit] = [_Visit(shapes, NO_FRAME, UNNAMED, ("shapes",))]
        while self._visits:
            visit = self._visits.pop()
            self._MEET.get(type(visit.what), Walk._solid)(self, visit)

    @property
    def materials(self) -> tuple[Material, ...]:
        return tuple(self._numbers)

    @cached_property
    def frames(self) -> np.ndarray:
        """From the local coordinates of every frame to the scene's, (k, 4, 4) float64."""
        made = np.array(self._transforms).reshape(-1, 4, 4)
        parents, depths = np.array(self._parents, np.intp), np.array(self._depths, np.intp)
        order = np.argsort(depths, kind="stable")
        with np.errstate(over="ignore", invalid="ignore"):
            for level in np.split(order, np.flatnonzero(np.diff(depths[order])) + 1)[1:]:
                made[level] = made[parents[level]] @ made[level]
        return made

    @cached_property
    def similar(self) -> np.ndarray:
        """Which frames keep angles, so that a sphere stays one, (k,)."""
        linear = self.frames[:, :3, :3]
        products = np.swapaxes(linear, 1, 2) @ linear
        squares = np.einsum("kii->k", products) / 3.0
        return np.abs(products - squares[:, None, None] * np.eye(3)).max(axis=(1, 2), initial=0.0) <= SIMILAR * squares

    def problems(self) -> Iterator[Problem]:
        """What is wrong with where things stand: frames without inverse, and surfaces that cannot be stretched."""
        bad = np.flatnonzero(singular(self.frames))
        for frame in bad:
            message = "the transforms of this node and of those around it, taken together, are singular"
            path = (*self._frame_paths[frame], "transform")
            yield Problem(path, message, "a product that can be inverted", "one that float64 cannot invert")
        if len(bad):
            return
        for node, path in self._stretched():
            message = f"{node.described} can be moved, turned and scaled evenly, but not stretched or sheared"
            yield Problem(path, message, "transforms that keep angles", "one that does not")

    def _stretched(self) -> Iterator[tuple[Node, Path]]:
        """The surfaces, other than polygons, that do not stay what they are, with their paths."""
        for placed in self.surfaces:
            if surface_sort(placed.node) != POLYGON and not placed.node.is_solid and self.is_stretched(placed.frame):
                yield placed.node, placed.path
        for run in self.runs:
            if self.is_stretched(run.frame):
                for position in range(run.first, run.end):
                    node = run.shapes[position]
                    if not (isinstance(node, Polygon) or node.is_solid):
                        yield node, (*run.path, position)

    def is_stretched(self, frame: int) -> bool:
        """Whether a sphere in `frame` is none in the scene."""
        return frame != NO_FRAME and not self.similar[frame]

    # One method for each sort of thing that can be met

    def _shapes(self, visit: _Visit) -> None:
        shapes: Shapes = visit.what
        materials = np.array([self._number(material) for material in shapes.materials], np.int32)
        ahead: list[_Visit] = []
        first = 0
        for node, position in zip(shapes.nodes, np.flatnonzero(shapes.sorts == NODE).tolist(), strict=True):
            if first < position:
                ahead.append(visit._replace(what=_Stretch(shapes, first, position, materials)))
            ahead.append(visit._replace(what=node, path=(*visit.path, position)))
            first = position + 1
        if first < len(shapes):
            ahead.append(visit._replace(what=_Stretch(shapes, first, len(shapes), materials)))
        self._visits += ahead[::-1]

    def _stretch(self, visit: _Visit) -> None:
        shapes, first, end, materials = visit.what
        self.runs.append(Run(shapes, first, end, visit.frame, self.count, visit.path, materials))
        self.count += end - first

    def _group(self, visit: _Visit) -> None:
        frame, material = self._around(visit)
        gathered = Gathered(visit.what, frame, visit.path, self.count)
        self.groups.append(gathered)
        self._visits.append(visit._replace(what=gathered))
        group, inner = visit.what, visit.what.inner
        self._visits += [
            _Visit(inner[number], frame, material, (*visit.path, *group.step(number)))
            for number in range(len(inner) - 1, -1, -1)
        ]

    def _end_of_group(self, visit: _Visit) -> None:
        visit.what.end = self.count

    def _instance(self, visit: _Visit) -> None:
        frame, material = self._around(visit)
        path = (*visit.path, "of")
        self._visits.append(visit._replace(what=visit.what.of, frame=frame, material=material, path=path))

    def _surface(self, visit: _Visit) -> None:
        """A sphere, open cone or polygon, if no solid of an object."""
        node: Node = visit.what
        if visit.tokens is not None or surface_sort(node) == NODE or getattr(node, "extent", None) is not None:
            self._solid(visit)
            return
        frame, material = self._around(visit)
        self.surfaces.append(Placed(node, frame, self._named(material), self.count, visit.path, []))
        self.count += 1

    def _solid(self, visit: _Visit) -> None:
        frame, material = self._around(visit)
        tokens = self._tokens(visit, frame)
        tokens.append(Use(visit.what, frame, self._named(material), visit.inverted))

    def _operation(self, visit: _Visit) -> None:
        frame, material = self._around(visit)
        operation: SetOperation = visit.what
        tokens = self._tokens(visit, frame)
        sort: Literal["union", "intersection"] = "union" if isinstance(operation, Union) else "intersection"
        tokens.append(Join(sort, len(operation.children), visit.inverted))
        subtracts = isinstance(operation, Difference)
        for number in range(len(operation.children) - 1, -1, -1):
            path = (*visit.path, "children", number)
            # A difference is an intersection with what is outside all children but the first.
            inverted = subtracts and number > 0
            self._visits.append(_Visit(operation.children[number], frame, material, path, tokens, inverted))

    def _complement(self, visit: _Visit) -> None:
        frame, material = self._around(visit)
        tokens = self._tokens(visit, frame)
        self._visits.append(
            _Visit(visit.what.child, frame, material, (*visit.path, "child"), tokens, not visit.inverted)
        )

    def _formula(self, visit: _Visit) -> None:
        frame, material = self._around(visit)
        tokens = self._tokens(visit, frame)
        operand = _Operand(visit.what, visit.what.expression())
        self._visits.append(_Visit(operand, frame, material, visit.path, tokens, visit.inverted))

    def _operand(self, visit: _Visit) -> None:
        formula, expression = visit.what
        if isinstance(expression, str):
            path = (*visit.path, "parts", expression)
            self._visits.append(visit._replace(what=formula.parts[expression], path=path))
            return
        operation, *operands = expression
        if operation == "complement":
            operand = _Operand(formula, operands[0])
            self._visits.append(visit._replace(what=operand, inverted=not visit.inverted))
            return
        assert visit.tokens is not None
        visit.tokens.append(Join("union" if operation == "union" else "intersection", 2, visit.inverted))
        for number in (1, 0):
            inverted = operation == "difference" and number == 1
            self._visits.append(visit._replace(what=_Operand(formula, operands[number]), inverted=inverted))

    # What they share

    def _around(self, visit: _Visit) -> tuple[int, int]:
        """The frame and the material inside the node that is met."""
        node: Node = visit.what
        frame, material = visit.frame, visit.material
        if node.transform is not IDENTITY:
            self._transforms.append(node.transform.matrix)
            self._parents.append(frame)
            self._depths.append(0 if frame == NO_FRAME else self._depths[frame] + 1)
            self._frame_paths.append(visit.path)
            frame = len(self._transforms) - 1
        if node.material is not None:
            material = self._number(node.material)
        return frame, material

    def _tokens(self, visit: _Visit, frame: int) -> list[Use | Join]:
        """Where the formula that is met goes on: that around it, or, of what stands alone, that of a new object."""
        if visit.tokens is not None:
            return visit.tokens
        own = visit.what.material
        material = UNNAMED if own is None else self._number(own)
        self.objects.append(Placed(visit.what, frame, material, self.count, visit.path, []))
        self.count += 1
        return self.objects[-1].tokens

    def _named(self, material: int) -> int:
        return self._number(PLAIN) if material == UNNAMED else material

    def _number(self, material: Material) -> int:
        # By identity first: to compare the values of materials takes longer than all else here.
        number = self._numbers_by_id.get(id(material))
        if number is None:
            number = self._numbers.setdefault(material, len(self._numbers))
            self._numbers_by_id[id(material)] = number
        return number

    _MEET: ClassVar[dict[type, Callable[[Walk, _Visit], None]]] = {
        Shapes: _shapes,
        _Stretch: _stretch,
        Group: _group,
        Mesh: _group,
        Gathered: _end_of_group,
        Instance: _instance,
        Sphere: _surface,
        Cone: _surface,
        Cylinder: _surface,
        Polygon: _surface,
        Union: _operation,
        Intersection: _operation,
        Difference: _operation,
        Complement: _complement,
        Formula: _formula,
        _Operand: _operand,
    }
