"""The shapes of a scene: nodes for people, arrays for large scenes.

`Shapes` is the sequence of a scene's nodes. Plain spheres, open cones and cylinders, and polygons stand in three
batches of arrays; any other node is kept as it is; and an array gives the sort of every entry in scene order. So a
hundred thousand polygons cost no Python object each: one is made only when somebody asks for it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, TypeAlias, TypeVar, overload

import numpy as np

from tasuki.diagnostics import Span
from tasuki.scene.material import PLAIN, Material, Vector
from tasuki.scene.solids import Cone, Cylinder, Polygon, Sphere
from tasuki.scene.transforms import IDENTITY
from tasuki.scene.traverse import materials_of, with_materials
from tasuki.scene.tree import Bounded, Many, Node

SPHERE, CONE, POLYGON, NODE = range(4)
"""Sorts of entries, as they stand in `Shapes.sorts`; a NODE is one of the tree that no batch holds."""

Shape: TypeAlias = Node

NO_FRAME = -1
"""The frame of what stands in the scene's own coordinates."""

LEAST_AREA = 1e-10
"""Area of a polygon, in units of its outline's length squared, below which it is a line: what rounding alone leaves."""

_Batch = TypeVar("_Batch", bound="Batch")


@dataclass(frozen=True, eq=False)
class Batch:
    """Shapes of one sort: of each, the index of its material and the line of its file (0: it is in no file).

    `frame` is the index of a flat scene's frame in which the shape was given, or NO_FRAME, which is the default of all.
    """

    material: np.ndarray
    line: np.ndarray
    frame: np.ndarray = field(default=None, kw_only=True)  # type: ignore[arg-type]

    def __post_init__(self) -> None:
        if self.frame is None:
            object.__setattr__(self, "frame", np.full(len(self), NO_FRAME, np.int32))

    def __len__(self) -> int:
        return len(self.material)

    def take(self: _Batch, order: np.ndarray) -> _Batch:
        """The shapes with the numbers `order`, (k,), in that order."""
        return replace(self, **{one.name: getattr(self, one.name)[order] for one in fields(self)})

    @classmethod
    def joined(cls: type[_Batch], batches: Sequence[_Batch]) -> _Batch:
        """The shapes of at least one batch, one after the other."""
        return cls(**{one.name: np.concatenate([getattr(batch, one.name) for batch in batches]) for one in fields(cls)})


@dataclass(frozen=True, eq=False)
class Spheres(Batch):
    """`centre` (n, 3) and `radius` (n,), float64."""

    centre: np.ndarray
    radius: np.ndarray


@dataclass(frozen=True, eq=False)
class Cones(Batch):
    """`base` and `apex` (n, 3), `base_radius` and `apex_radius` (n,), float64."""

    base: np.ndarray
    base_radius: np.ndarray
    apex: np.ndarray
    apex_radius: np.ndarray


@dataclass(frozen=True, eq=False)
class Polygons(Batch):
    """Polygon i has the points `starts[i]` to `starts[i + 1]`, and normals there where `smooth[i]`.

    `points` and `normals` (m, 3), float64 (a normal that is not given is zero); `starts` (n + 1,); `smooth` (n,) bool.
    """

    points: np.ndarray
    normals: np.ndarray
    starts: np.ndarray
    smooth: np.ndarray

    @property
    def sizes(self) -> np.ndarray:
        """Number of points of each polygon, (n,)."""
        return np.diff(self.starts)

    @cached_property
    def area_vectors(self) -> np.ndarray:
        """Newell's vector of each polygon, (n, 3): along its front normal, its length twice the area."""
        first = np.repeat(self.starts[:-1], self.sizes)
        here = self.points - self.points[first]
        following = here[self._following]
        return self._sum_over_points(np.cross(here, following))

    @cached_property
    def perimeters(self) -> np.ndarray:
        """Length of each polygon's outline, (n,)."""
        edges = self.points[self._following] - self.points
        return self._sum_over_points(np.linalg.norm(edges, axis=1))

    @cached_property
    def _following(self) -> np.ndarray:
        """Index of the point that comes after each point on its outline, (m,)."""
        following = np.arange(1, len(self.points) + 1)
        following[self.starts[1:] - 1] = self.starts[:-1]
        return following

    def _sum_over_points(self, values: np.ndarray) -> np.ndarray:
        return np.add.reduceat(values, self.starts[:-1], axis=0) if len(self) else np.zeros((0, *values.shape[1:]))

    @property
    def degenerate(self) -> np.ndarray:
        """Which polygons have no area, (n,)."""
        return np.linalg.norm(self.area_vectors, axis=1) / 2.0 <= LEAST_AREA * self.perimeters**2

    def take(self, order: np.ndarray) -> Polygons:
        sizes = self.sizes[order]
        starts = np.concatenate(([0], np.cumsum(sizes)))
        points = np.arange(starts[-1]) + np.repeat(self.starts[order] - starts[:-1], sizes)
        material, line, smooth = self.material[order], self.line[order], self.smooth[order]
        return Polygons(
            material, line, self.points[points], self.normals[points], starts, smooth, frame=self.frame[order]
        )

    @classmethod
    def joined(cls, batches: Sequence[Polygons]) -> Polygons:
        sizes = np.concatenate([batch.sizes for batch in batches])
        starts = np.concatenate(([0], np.cumsum(sizes)))
        # Not the starts, which count within their own batch.
        columns = {
            one.name: np.concatenate([getattr(batch, one.name) for batch in batches])
            for one in fields(cls)
            if one.name != "starts"
        }
        return cls(starts=starts, **columns)


class Shapes(Many, Sequence[Shape]):
    """The nodes of a scene in order: `sorts` (n,) says for each of them in which batch it stands, or in `nodes`.

    Within a batch, and in `nodes`, they stand in scene order too, so that the i-th of sort s is the i-th there.
    `materials` are all that the shapes are made of, and maybe more. An open cone of equal radii is a cylinder.
    """

    noun = described = "a batch of shapes"
    is_solid = False

    def __init__(
        self,
        materials: Sequence[Material],
        sorts: np.ndarray,
        spheres: Spheres,
        cones: Cones,
        polygons: Polygons,
        file: str | None = None,
        nodes: Sequence[Node] = (),
    ) -> None:
        self.materials: tuple[Material, ...] = tuple(materials)
        self.sorts = sorts
        self.spheres = spheres
        self.cones = cones
        self.polygons = polygons
        self.file = file
        self.nodes = tuple(nodes)

    @classmethod
    def of(cls, shapes: Iterable[Shape], materials: Sequence[Material] = ()) -> Shapes:
        """The same nodes, in arrays where they can be.

        `materials` may give materials, used or not, that come first in their order. A plain shape without material is
        plain white.
        """
        shapes = list(shapes)
        sorts = [sort_of(shape) for shape in shapes]
        members: tuple[list, list, list, list] = ([], [], [], [])
        for shape, sort in zip(shapes, sorts, strict=True):
            members[sort].append(shape)
        numbers = material_numbers((*materials, *materials_of(shapes)))
        spheres, cones, polygons = (
            batch_of(sort, members[sort], [numbers[node.material or PLAIN] for node in members[sort]])
            for sort in (SPHERE, CONE, POLYGON)
        )
        sort_array = np.array(sorts, np.uint8)
        return cls(list(numbers), sort_array, spheres, cones, polygons, file_of(shapes), members[NODE])

    @cached_property
    def positions(self) -> np.ndarray:
        """Where in its batch, or in `nodes`, each entry stands, (n,)."""
        return positions_of(self.sorts)

    def __len__(self) -> int:
        return len(self.sorts)

    @overload
    def __getitem__(self, index: int) -> Shape: ...
    @overload
    def __getitem__(self, index: slice) -> list[Shape]: ...
    def __getitem__(self, index: int | slice) -> Shape | list[Shape]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        return self.node(int(self.sorts[index]), int(self.positions[index]))

    def __iter__(self) -> Iterator[Shape]:
        return (self[i] for i in range(len(self)))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Shapes):
            return NotImplemented
        return self.materials == other.materials and len(self) == len(other) and list(self) == list(other)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        batches = f"{len(self.spheres)} spheres, {len(self.cones)} open cones, {len(self.polygons)} polygons"
        return f"<{batches}, {len(self.nodes)} other nodes>"

    def node(self, sort: int, position: int) -> Node:
        """The entry at `position` of a batch, or of `nodes`."""
        return (self._sphere, self._cone, self._polygon, self.nodes.__getitem__)[sort](position)

    def batch(self, sort: int) -> Batch:
        """The batch of sort `SPHERE`, `CONE` or `POLYGON`."""
        return (self.spheres, self.cones, self.polygons)[sort]

    def place(self, sort: int, position: int) -> Span | None:
        """Where the entry at `position` of a batch, or of `nodes`, stands in its file."""
        if sort == NODE:
            return self.nodes[position].place
        line = int(self.batch(sort).line[position])
        return Span(self.file, line) if self.file and line else None

    def of_materials(self, materials: Sequence[Material]) -> Shapes:
        """The same shapes, made of other materials with the same indices."""
        changed = dict(zip(self.materials, materials, strict=True))
        nodes = with_materials(self.nodes, changed)
        return Shapes(materials, self.sorts, self.spheres, self.cones, self.polygons, self.file, nodes)

    def keep_polygons(self, kept: np.ndarray) -> Shapes:
        """These shapes without the polygons where the mask `kept` is false."""
        remaining = np.ones(len(self.sorts), bool)
        remaining[self.sorts == POLYGON] = kept
        polygons = self.polygons.take(np.flatnonzero(kept))
        sorts = self.sorts[remaining]
        return Shapes(self.materials, sorts, self.spheres, self.cones, polygons, self.file, self.nodes)

    def _sphere(self, i: int) -> Sphere:
        batch = self.spheres
        return Sphere(_vector(batch.centre[i]), float(batch.radius[i]), **self._common(SPHERE, i))

    def _cone(self, i: int) -> Cone | Cylinder:
        batch = self.cones
        base, apex = _vector(batch.base[i]), _vector(batch.apex[i])
        base_radius, apex_radius = float(batch.base_radius[i]), float(batch.apex_radius[i])
        if base_radius == apex_radius:
            return Cylinder(base, apex, base_radius, open=True, **self._common(CONE, i))
        return Cone(base, base_radius, apex, apex_radius, open=True, **self._common(CONE, i))

    def _polygon(self, i: int) -> Polygon:
        batch = self.polygons
        here = slice(batch.starts[i], batch.starts[i + 1])
        normals = tuple(map(_vector, batch.normals[here])) if batch.smooth[i] else None
        return Polygon(tuple(map(_vector, batch.points[here])), normals, **self._common(POLYGON, i))

    def _common(self, sort: int, i: int) -> dict[str, Any]:
        return {"material": self.materials[self.batch(sort).material[i]], "place": self.place(sort, i)}


def sort_of(node: Node) -> int:
    """SPHERE, CONE or POLYGON where a batch can hold `node` as it is, else NODE."""
    if node.name is not None or (node.transform is not IDENTITY and node.transform != IDENTITY):
        return NODE
    if isinstance(node, Bounded) and node.extent is not None:
        return NODE
    return surface_sort(node)


def surface_sort(node: Node) -> int:
    """SPHERE, CONE or POLYGON where `node` is such a shape, wherever it stands, else NODE."""
    kind = type(node)
    if kind is Sphere:
        return SPHERE
    if kind is Polygon:
        return POLYGON
    return CONE if (kind is Cone or kind is Cylinder) and node.open else NODE  # type: ignore[attr-defined]


def positions_of(sorts: np.ndarray) -> np.ndarray:
    """How many entries of the same sort stand before each entry of `sorts`, (n,)."""
    positions = np.empty(len(sorts), np.intp)
    for sort in range(int(sorts.max(initial=0)) + 1):
        members = sorts == sort
        positions[members] = np.arange(np.count_nonzero(members))
    return positions


def material_numbers(materials: Iterable[Material]) -> dict[Material, int]:
    """The number of each distinct material, in order."""
    return {material: number for number, material in enumerate(dict.fromkeys(materials))}


def _vector(row: np.ndarray) -> Vector:
    x, y, z = row.tolist()
    return x, y, z


def _vectors(rows: list) -> np.ndarray:
    return np.array(rows, np.float64).reshape(-1, 3)


def file_of(nodes: Iterable[Node]) -> str | None:
    """The file that `nodes` come from, if any."""
    return next((node.place.file for node in nodes if node.place), None)


def batch_of(sort: int, nodes: Sequence[Any], materials: Sequence[int]) -> Any:
    """`nodes` of one sort, SPHERE, CONE or POLYGON, with the numbers of their materials, as a batch."""
    lines = [node.place.line if node.place else 0 for node in nodes]
    make = (_spheres, _cones, _polygons)[sort]
    return make(nodes, np.array(materials, np.int32), np.array(lines, np.int64))


def _spheres(spheres: Sequence[Sphere], material: np.ndarray, line: np.ndarray) -> Spheres:
    centre = _vectors([sphere.centre for sphere in spheres])
    return Spheres(material, line, centre, np.array([sphere.radius for sphere in spheres], np.float64))


def _cones(cones: Sequence[Cone | Cylinder], material: np.ndarray, line: np.ndarray) -> Cones:
    radii = [
        (cone.radius, cone.radius) if isinstance(cone, Cylinder) else (cone.base_radius, cone.apex_radius)
        for cone in cones
    ]
    base_radius, apex_radius = np.array(radii, np.float64).reshape(-1, 2).T
    base, apex = _vectors([cone.base for cone in cones]), _vectors([cone.apex for cone in cones])
    return Cones(material, line, base, base_radius, apex, apex_radius)


def _polygons(polygons: Sequence[Polygon], material: np.ndarray, line: np.ndarray) -> Polygons:
    sizes = [len(polygon.points) for polygon in polygons]
    normals = [polygon.normals or ((0.0, 0.0, 0.0),) * len(polygon.points) for polygon in polygons]
    return Polygons(
        material,
        line,
        _vectors([point for polygon in polygons for point in polygon.points]),
        _vectors([normal for given in normals for normal in given]),
        np.concatenate(([0], np.cumsum(sizes))).astype(np.intp),
        np.array([polygon.normals is not None for polygon in polygons], bool),
    )
