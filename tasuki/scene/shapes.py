"""Shapes and what they are made of: single values for people, arrays for large scenes.

`Shapes` is the sequence of a scene's shapes. It stands in three batches of arrays, one for each sort of shape, and an
array that gives the sort of every shape in scene order; a `Sphere`, `Cone` or `Polygon` is made only when somebody
asks for it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias, overload

import numpy as np

from tasuki.diagnostics import Diagnostic, SceneError, Span

Vector: TypeAlias = tuple[float, float, float]
Colour: TypeAlias = tuple[float, float, float]

SPHERE, CONE, POLYGON = range(3)
"""Sorts of shapes, as they stand in `Shapes.sorts`."""


@dataclass(frozen=True)
class Material:
    """What a surface is made of.

    `ambient` is the share of `colour` that shows without any light; None: `diffuse` times `default_intensity`.
    `exponent` is Phong's. `reflection` weighs the mirrored ray; `transmission` of the light enters the surface, split
    by Fresnel's equations, and `transmittance` of it passes each unit of the way inside. `two_sided` None: both sides
    show where `transmission` > 0 (so says NFF), and on patches with normals, which approximate curved sheets; elsewhere
    the outside (of a polygon: the front) alone.
    """

    name: str = "default"
    colour: Colour = (1.0, 1.0, 1.0)
    ambient: float | None = None
    diffuse: float = 1.0
    specular: float = 0.0
    exponent: float = 1.0
    reflection: float = 0.0
    transmission: float = 0.0
    index: float = 1.0
    transmittance: Colour = (1.0, 1.0, 1.0)
    two_sided: bool | None = None

    def shows_both_sides(self, *, smooth: bool = False) -> bool:
        """Whether a shape of this material shows from both sides; `smooth`: it is a patch with normals."""
        if self.two_sided is not None:
            return self.two_sided
        return self.transmission > 0.0 or smooth


@dataclass(frozen=True)
class Sphere:
    """A sphere; a negative radius: only its inside is visible."""

    centre: Vector
    radius: float
    material: Material = Material()
    place: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True)
class Cone:
    """An open cone or, with equal radii, cylinder, without caps; both radii negative: only its inside is visible."""

    base: Vector
    base_radius: float
    apex: Vector
    apex_radius: float
    material: Material = Material()
    place: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True)
class Polygon:
    """A flat polygon, convex or concave, its points counterclockwise as seen from the front.

    `normals`, one for each point and of any length, make it a patch: shading interpolates them. SceneError where there
    are fewer than three points, or not as many normals as points.
    """

    points: tuple[Vector, ...]
    normals: tuple[Vector, ...] | None = None
    material: Material = Material()
    place: Span | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        found, normals = len(self.points), len(self.normals or self.points)
        if found < 3:
            problem = Diagnostic("a polygon needs at least 3 points", self.place, "3 or more points", str(found))
            raise SceneError(str(problem))
        if normals != found:
            problem = Diagnostic("a patch needs a normal for every point", self.place, f"{found} normals", str(normals))
            raise SceneError(str(problem))


Shape: TypeAlias = Sphere | Cone | Polygon


@dataclass(frozen=True, eq=False)
class Batch:
    """Shapes of one sort: of each, the index of its material and the line of its file (0: it is in no file)."""

    material: np.ndarray
    line: np.ndarray

    def __len__(self) -> int:
        return len(self.material)


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

    def keep(self, kept: np.ndarray) -> Polygons:
        """The polygons where the mask `kept` is true."""
        points = np.repeat(kept, self.sizes)
        starts = np.concatenate(([0], np.cumsum(self.sizes[kept])))
        return Polygons(
            self.material[kept], self.line[kept], self.points[points], self.normals[points], starts, self.smooth[kept]
        )


class Shapes(Sequence[Shape]):
    """The shapes of a scene in order, as arrays: `sorts` (n,) says to which batch each of them belongs.

    Within a batch shapes stand in scene order too, so that the i-th shape of sort s is the i-th of its batch.
    """

    def __init__(
        self,
        materials: Sequence[Material],
        sorts: np.ndarray,
        spheres: Spheres,
        cones: Cones,
        polygons: Polygons,
        file: str | None = None,
    ) -> None:
        self.materials = tuple(materials)
        self.sorts = sorts
        self.spheres = spheres
        self.cones = cones
        self.polygons = polygons
        self.file = file

    @classmethod
    def of(cls, shapes: Iterable[Shape], materials: Sequence[Material] = ()) -> Shapes:
        """The same shapes as arrays. `materials` may give materials, used or not, that come first in their order."""
        shapes = list(shapes)
        numbers = {material: number for number, material in enumerate(dict.fromkeys(materials))}
        rows = {Sphere: SPHERE, Cone: CONE, Polygon: POLYGON}
        members: tuple[list, list, list] = ([], [], [])
        for shape in shapes:
            members[rows[type(shape)]].append((shape, numbers.setdefault(shape.material, len(numbers))))
        file = next((shape.place.file for shape in shapes if shape.place), None)
        sorts = np.array([rows[type(shape)] for shape in shapes], np.uint8)
        return cls(list(numbers), sorts, _spheres(members[0]), _cones(members[1]), _polygons(members[2]), file)

    @cached_property
    def positions(self) -> np.ndarray:
        """Where in its batch each shape stands, (n,)."""
        positions = np.empty(len(self.sorts), np.intp)
        for sort in (SPHERE, CONE, POLYGON):
            members = self.sorts == sort
            positions[members] = np.arange(np.count_nonzero(members))
        return positions

    def __len__(self) -> int:
        return len(self.sorts)

    @overload
    def __getitem__(self, index: int) -> Shape: ...
    @overload
    def __getitem__(self, index: slice) -> list[Shape]: ...
    def __getitem__(self, index: int | slice) -> Shape | list[Shape]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        make = (self._sphere, self._cone, self._polygon)[self.sorts[index]]
        return make(int(self.positions[index]))

    def __iter__(self) -> Iterator[Shape]:
        return (self[i] for i in range(len(self)))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Shapes):
            return NotImplemented
        return self.materials == other.materials and len(self) == len(other) and list(self) == list(other)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<{len(self.spheres)} spheres, {len(self.cones)} cones, {len(self.polygons)} polygons>"

    def batch(self, sort: int) -> Batch:
        """The batch of sort `SPHERE`, `CONE` or `POLYGON`."""
        return (self.spheres, self.cones, self.polygons)[sort]

    def place(self, sort: int, position: int) -> Span | None:
        """Where the shape at `position` of a batch stands in its file."""
        line = int(self.batch(sort).line[position])
        return Span(self.file, line) if self.file and line else None

    def of_materials(self, materials: Sequence[Material]) -> Shapes:
        """The same shapes, made of other materials with the same indices."""
        return Shapes(materials, self.sorts, self.spheres, self.cones, self.polygons, self.file)

    def keep_polygons(self, kept: np.ndarray) -> Shapes:
        """These shapes without the polygons where the mask `kept` is false."""
        remaining = np.ones(len(self.sorts), bool)
        remaining[self.sorts == POLYGON] = kept
        polygons = self.polygons.keep(kept)
        return Shapes(self.materials, self.sorts[remaining], self.spheres, self.cones, polygons, self.file)

    def _sphere(self, i: int) -> Sphere:
        batch = self.spheres
        return Sphere(_vector(batch.centre[i]), float(batch.radius[i]), *self._common(SPHERE, i))

    def _cone(self, i: int) -> Cone:
        batch = self.cones
        base, apex = _vector(batch.base[i]), _vector(batch.apex[i])
        return Cone(base, float(batch.base_radius[i]), apex, float(batch.apex_radius[i]), *self._common(CONE, i))

    def _polygon(self, i: int) -> Polygon:
        batch = self.polygons
        here = slice(batch.starts[i], batch.starts[i + 1])
        normals = tuple(map(_vector, batch.normals[here])) if batch.smooth[i] else None
        return Polygon(tuple(map(_vector, batch.points[here])), normals, *self._common(POLYGON, i))

    def _common(self, sort: int, i: int) -> tuple[Material, Span | None]:
        return self.materials[self.batch(sort).material[i]], self.place(sort, i)


def _vector(row: np.ndarray) -> Vector:
    x, y, z = row.tolist()
    return x, y, z


def _vectors(rows: list) -> np.ndarray:
    return np.array(rows, np.float64).reshape(-1, 3)


def _materials_and_lines(members: list) -> tuple[np.ndarray, np.ndarray]:
    lines = [shape.place.line if shape.place else 0 for shape, _ in members]
    return np.array([material for _, material in members], np.int32), np.array(lines, np.int64)


def _spheres(members: list[tuple[Sphere, int]]) -> Spheres:
    centre = _vectors([sphere.centre for sphere, _ in members])
    radius = np.array([sphere.radius for sphere, _ in members], np.float64)
    return Spheres(*_materials_and_lines(members), centre, radius)


def _cones(members: list[tuple[Cone, int]]) -> Cones:
    return Cones(
        *_materials_and_lines(members),
        _vectors([cone.base for cone, _ in members]),
        np.array([cone.base_radius for cone, _ in members], np.float64),
        _vectors([cone.apex for cone, _ in members]),
        np.array([cone.apex_radius for cone, _ in members], np.float64),
    )


def _polygons(members: list[tuple[Polygon, int]]) -> Polygons:
    sizes = [len(polygon.points) for polygon, _ in members]
    normals = [polygon.normals or ((0.0, 0.0, 0.0),) * len(polygon.points) for polygon, _ in members]
    return Polygons(
        *_materials_and_lines(members),
        _vectors([point for polygon, _ in members for point in polygon.points]),
        _vectors([normal for given in normals for normal in given]),
        np.concatenate(([0], np.cumsum(sizes))).astype(np.intp),
        np.array([polygon.normals is not None for polygon, _ in members], bool),
    )
