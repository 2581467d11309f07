"""The scene tree (paper, section 6.1): what every node has, groups, instances, and set operations.

A node's own numbers count in its local coordinates; `transform` places those in the coordinates of the node around it.
Nodes are values: they never change, so none can hold itself, and one may stand in many places. Python's operators
combine them (`a | b`, `a & b`, `a - b`, `~a`), and methods place them (`node.rotate("z", 30).translate(1, 0, 0)`).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, Literal, TypeVar

import numpy as np

from tasuki.diagnostics import Diagnostic, SceneError, Span
from tasuki.scene.formula_text import PART_NAME, Expression, parse_infix, parse_polish
from tasuki.scene.material import Material, Vector
from tasuki.scene.problem import Path
from tasuki.scene.transforms import IDENTITY, Transform, matrix, rotate, scale, translate

MOST_LEVELS = 1000
"""How deep nodes may be nested."""

_Node = TypeVar("_Node", bound="Node")


class Many:
    """What stands for many nodes as one child of a group; `tasuki.scene.shapes.Shapes` is one."""

    holds: ClassVar[bool] = True

    materials: tuple[Material, ...]
    nodes: tuple[Node, ...]

    def __len__(self) -> int:
        raise NotImplementedError

    def of_materials(self, materials: Sequence[Material]) -> Many:
        """The same, made of other materials with the same indices."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class Extent:
    """A sphere, in a node's local coordinates, which the user promises to contain the node."""

    centre: Vector
    radius: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Node:
    """What all nodes have.

    `material` None: that of the nearest node around it which names one, else plain white. `transform` places the
    node's local coordinates in those around it. `place` is where it stands in its file; it takes no part in equality.
    """

    noun: ClassVar[str] = "node"
    holds: ClassVar[bool] = False
    """Whether there are nodes inside it."""

    material: Material | None = None
    transform: Transform = IDENTITY
    name: str | None = None
    place: Span | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        for name in type(self).__slots__:
            value = getattr(self, name)
            if type(value) is list or type(value) is np.ndarray:
                object.__setattr__(self, name, plain(value))

    @property
    def inner(self) -> Sequence[Any]:
        """The nodes directly inside this one, in order."""
        return ()

    def step(self, number: int) -> Path:
        """How a path goes on from here to `inner[number]`."""
        return ("children", number)

    def of_inner(self, inner: Sequence[Any]) -> Node:
        """The same node with other nodes inside."""
        return self

    @property
    def is_solid(self) -> bool:
        """Whether this node has an inside, so that it may be an operand of set operations."""
        return False

    @property
    def described(self) -> str:
        """The node as messages call it: "a sphere"."""
        return f"{'an' if self.noun[0] in 'aeio' else 'a'} {self.noun}"

    def transformed(self: _Node, by: Transform | Sequence[Sequence[float]] | np.ndarray) -> _Node:
        """The node after the transform it has and then `by`: a transform, or the rows of a matrix.

        TransformError where there is no such transform; so of the three methods below.
        """
        step = by if isinstance(by, Transform) else matrix(by)
        return replace(self, transform=self.transform.then(step))

    def translate(self: _Node, x: float, y: float, z: float) -> _Node:
        """The node moved by (x, y, z)."""
        return self.transformed(translate(x, y, z))

    def rotate(self: _Node, axis: str | Sequence[float], degrees: float) -> _Node:
        """The node turned by `degrees`, right-handed, about `axis` through the origin."""
        return self.transformed(rotate(axis, degrees))

    def scale(self: _Node, x: float, y: float | None = None, z: float | None = None) -> _Node:
        """The node stretched from the origin: by `x` every way, or by `x`, `y` and `z` along the axes."""
        return self.transformed(scale(x, y, z))

    def __or__(self, other: Node) -> Union:
        """What is inside either."""
        return Union((*_operands(Union, self), other))

    def __and__(self, other: Node) -> Intersection:
        """What is inside both."""
        return Intersection((*_operands(Intersection, self), other))

    def __sub__(self, other: Node) -> Difference:
        """What is inside this one, but not inside `other`."""
        return Difference((*_operands(Difference, self), other))

    def __invert__(self) -> Complement:
        """What is outside."""
        return Complement(self)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Node):
            return NotImplemented
        return _same(self, other)

    __hash__ = None  # type: ignore[assignment]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Bounded(Node):
    """A node that may carry an extent; "auto": one is computed, which takes a node that has bounds."""

    extent: Extent | Literal["auto"] | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Group(Bounded):
    """Nodes that belong together: a transform moves them all. A whole `Shapes` may be one of the children."""

    noun: ClassVar[str] = "group"
    holds: ClassVar[bool] = True

    children: Sequence[Any] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "children", tuple(self.children))
        for child in self.children:
            if not isinstance(child, Many):
                _require_node(child, self)

    @property
    def inner(self) -> Sequence[Any]:
        return self.children

    def of_inner(self, inner: Sequence[Any]) -> Node:
        return replace(self, children=inner)

    def __repr__(self) -> str:
        return _short(self)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Instance(Node):
    """The node `of` once more, in another place. Instances share what they are of, in memory too."""

    noun: ClassVar[str] = "instance"
    holds: ClassVar[bool] = True

    of: Node

    def __post_init__(self) -> None:
        _require_node(self.of, self)

    @property
    def inner(self) -> Sequence[Any]:
        return (self.of,)

    def of_inner(self, inner: Sequence[Any]) -> Node:
        return replace(self, of=inner[0])

    def step(self, number: int) -> Path:
        return ("of",)

    @property
    def original(self) -> Node:
        """What it is an instance of, which is no instance."""
        node: Node = self
        while isinstance(node, Instance):
            node = node.of
        return node

    @property
    def is_solid(self) -> bool:
        return self.original.is_solid

    @property
    def described(self) -> str:
        return f"an instance of {self.original.described}"

    def __repr__(self) -> str:
        return _short(self)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SetOperation(Bounded):
    """A set operation on solids. SceneError where it has no operand."""

    noun: ClassVar[str] = "set operation"
    holds: ClassVar[bool] = True

    children: Sequence[Node]

    def __post_init__(self) -> None:
        object.__setattr__(self, "children", tuple(self.children))
        for child in self.children:
            _require_node(child, self)
        if not self.children:
            problem = Diagnostic(f"{self.described} without operands", self.place, "1 or more solids", "none")
            raise SceneError(str(problem))

    @property
    def inner(self) -> Sequence[Any]:
        return self.children

    def of_inner(self, inner: Sequence[Any]) -> Node:
        return replace(self, children=inner)

    @property
    def is_solid(self) -> bool:
        return True

    def __repr__(self) -> str:
        return _short(self)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Union(SetOperation):
    """What is inside any of its children."""

    noun: ClassVar[str] = "union"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Intersection(SetOperation):
    """What is inside all of its children."""

    noun: ClassVar[str] = "intersection"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Difference(SetOperation):
    """What is inside its first child, but inside none of the others."""

    noun: ClassVar[str] = "difference"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Complement(Bounded):
    """What is outside its child."""

    noun: ClassVar[str] = "complement"
    holds: ClassVar[bool] = True

    child: Node

    def __post_init__(self) -> None:
        _require_node(self.child, self)

    @property
    def inner(self) -> Sequence[Any]:
        return (self.child,)

    def of_inner(self, inner: Sequence[Any]) -> Node:
        return replace(self, child=inner[0])

    def step(self, number: int) -> Path:
        return ("child",)

    @property
    def is_solid(self) -> bool:
        return True

    def __repr__(self) -> str:
        return _short(self)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Formula(Bounded):
    """Set operations on named parts, as text: `formula` in infix ("plate - (hole1 + hole2)") or `polish`, not both.

    `tasuki.scene.formula_text` says how they are written. A part may stand in the formula more than once, or not at
    all. FormulaError where the text is wrong.
    """

    noun: ClassVar[str] = "formula"
    holds: ClassVar[bool] = True

    parts: Mapping[str, Node]
    formula: str | None = None
    polish: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "parts", dict(self.parts))
        for part in self.parts.values():
            _require_node(part, self)
        if (self.formula is None) == (self.polish is None):
            found = "neither" if self.formula is None else "both"
            problem = Diagnostic("a formula is given in one form", self.place, "`formula` or `polish`", found)
            raise SceneError(str(problem))
        self.expression()

    def expression(self) -> Expression:
        """What the text means."""
        if self.formula is not None:
            return parse_infix(self.formula, self.parts)
        return parse_polish(self.polish or "", self.parts)

    @property
    def inner(self) -> Sequence[Any]:
        return tuple(self.parts.values())

    @property
    def uses(self) -> list[int]:
        """How often each part stands in the formula."""
        counts = Counter(re.findall(PART_NAME, self.formula or self.polish or ""))
        return [counts[name] for name in self.parts]

    def of_inner(self, inner: Sequence[Any]) -> Node:
        return replace(self, parts=dict(zip(self.parts, inner, strict=True)))

    def step(self, number: int) -> Path:
        return ("parts", list(self.parts)[number])

    @property
    def is_solid(self) -> bool:
        return True

    def __repr__(self) -> str:
        return _short(self)


def _operands(operation: type[SetOperation], node: Node) -> Sequence[Node]:
    """The operands of `node` where it is the bare `operation`, which one more operand can join; else the node."""
    if type(node) is not operation:
        return (node,)
    is_bare = node.material is node.name is node.extent is None and node.transform is IDENTITY
    return node.children if is_bare else (node,)


def _require_node(value: Any, around: Node) -> None:
    if not isinstance(value, Node):
        message = f"{around.described} can hold nodes only"
        raise SceneError(str(Diagnostic(message, around.place, "a node of a scene", type(value).__name__)))


def plain(value: Any) -> Any:
    """Lists and arrays as tuples, so that nodes are plain values."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    return tuple(map(plain, value)) if isinstance(value, list | tuple) else value


def _short(node: Node) -> str:
    """A node without what is inside it, which may be deep."""
    name = f" {node.name!r}" if node.name else ""
    count = len(node.inner)
    return f"<{node.noun}{name} of {count} {'node' if count == 1 else 'nodes'}>"


def _same(first: Node, second: Node) -> bool:
    """Whether two trees are equal. A stack of its own keeps deep trees from overflowing Python's."""
    pairs, seen = [(first, second)], set()
    while pairs:
        a, b = pairs.pop()
        if a is b or (id(a), id(b)) in seen:
            continue
        seen.add((id(a), id(b)))
        if type(a) is not type(b) or len(a.inner) != len(b.inner) or _own(a) != _own(b):
            return False
        for one, other in zip(a.inner, b.inner, strict=True):
            if isinstance(one, Node) and isinstance(other, Node):
                pairs.append((one, other))
            elif one != other:
                return False
    return True


def _own(node: Node) -> list[Any]:
    """What a node says itself, without the nodes inside it."""
    values = [(one.name, getattr(node, one.name)) for one in fields(node) if one.compare]
    return [tuple(value) if name == "parts" else value for name, value in values if name not in _INNER]


_INNER = ("children", "child", "of", "shapes")
