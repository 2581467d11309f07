"""Of which planes and quadrics a solid is made: every constructor's formula, in the solid's local coordinates.

A constructor is a fixed form over numbered literals, and a function that gives each literal's coefficients for many
solids at once: columns of numbers (n,) and of vectors (n, 3) go in, (n, 4) for a plane and (n, 4, 4) for a quadric come
out, as `tasuki.scene.csg.Literals` has them. All float64.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from tasuki.scene.csg import PLANE, QUADRIC, Join
from tasuki.scene.solids import (
    Box,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hyperboloid,
    Paraboloid,
    Primitive,
    Quadric,
    RoundedBox,
    Slab,
    Sphere,
    Tube,
    Wedge,
)
from tasuki.scene.transforms import unit


@dataclass(frozen=True, eq=False)
class Surfaces:
    """One literal of n solids: the coefficients of its surfaces, and whether the literal is their outsides."""

    kind: str
    values: np.ndarray
    inverted: bool = False


@dataclass(frozen=True)
class Constructor:
    """`form` joins literals, operators first, literals by number and in their order; `literals` makes them, given by
    name the columns of the fields named in `fields`.
    """

    form: tuple[Join | int, ...]
    fields: tuple[str, ...]
    literals: Callable[..., list[Surfaces]]

    def columns(self, solids: Sequence[Primitive]) -> dict[str, np.ndarray]:
        """What `literals` takes: each field of all `solids` as an array."""
        return {name: np.array([getattr(solid, name) for solid in solids], np.float64) for name in self.fields}


def _plane(normal: np.ndarray, point: np.ndarray) -> Surfaces:
    """Inside is where (P - point) . normal < 0."""
    normal = np.broadcast_to(unit(np.asarray(normal, np.float64)), point.shape)
    return Surfaces(PLANE, np.concatenate([normal, -_dot(normal, point)[:, None]], axis=1))


def _quadric(
    matrix: np.ndarray, centre: np.ndarray, constant: np.ndarray, linear: np.ndarray | float = 0.0
) -> Surfaces:
    """Inside is where (P - centre)^T matrix (P - centre) + linear . (P - centre) < constant."""
    linear = np.broadcast_to(linear, centre.shape)
    values = np.empty((len(centre), 4, 4))
    values[:, :3, :3], values[:, :3, 3] = matrix, linear
    values[:, 3, :3], values[:, 3, 3] = centre, constant
    return Surfaces(QUADRIC, values)


def _sphere(centre: np.ndarray, radius: np.ndarray) -> list[Surfaces]:
    return [_quadric(np.broadcast_to(np.eye(3), (len(centre), 3, 3)), centre, radius**2)]


def _ellipsoid(centre: np.ndarray, radii: np.ndarray) -> list[Surfaces]:
    return [_quadric(_diagonal(radii**-2.0), centre, np.ones(len(centre)))]


def _hyperboloid(centre: np.ndarray, radii: np.ndarray, sheets: np.ndarray) -> list[Surfaces]:
    return [_quadric(_diagonal(radii**-2.0 * (1.0, 1.0, -1.0)), centre, np.where(sheets == 1, 1.0, -1.0))]


def _paraboloid(vertex: np.ndarray, radii: np.ndarray) -> list[Surfaces]:
    squares = np.concatenate([radii**-2.0, np.zeros((len(radii), 1))], axis=1)
    up = np.broadcast_to((0.0, 0.0, -1.0), vertex.shape)
    return [_quadric(_diagonal(squares), vertex, np.zeros(len(vertex)), up)]


def _general(matrix: np.ndarray, centre: np.ndarray, linear: np.ndarray, constant: np.ndarray) -> list[Surfaces]:
    return [_quadric(matrix, centre, constant, linear)]


def _half_space(normal: np.ndarray, point: np.ndarray) -> list[Surfaces]:
    return [_plane(normal, point)]


def _slab(normal: np.ndarray, point: np.ndarray, thickness: np.ndarray) -> list[Surfaces]:
    half = unit(normal) * (thickness / 2.0)[:, None]
    return [_plane(-normal, point - half), _plane(normal, point + half)]


def _box(low: np.ndarray, high: np.ndarray) -> list[Surfaces]:
    axes = np.eye(3)
    return [plane for axis in axes for plane in (_plane(-axis, low), _plane(axis, high))]


def _wedge(low: np.ndarray, high: np.ndarray) -> list[Surfaces]:
    x, y, z = np.eye(3)
    size = high - low
    slope = np.stack([size[:, 2], np.zeros(len(size)), size[:, 0]], axis=1)
    edge = np.stack([high[:, 0], low[:, 1], low[:, 2]], axis=1)
    return [_plane(-x, low), _plane(-y, low), _plane(y, high), _plane(-z, low), _plane(slope, edge)]


def _cone(base: np.ndarray, base_radius: np.ndarray, apex: np.ndarray, apex_radius: np.ndarray) -> list[Surfaces]:
    """At height h = (P - base) . axis inside is where |P - base|^2 - h^2 < (base_radius + slope h)^2, between the caps.

    The other half of the double cone lies beyond the caps.
    """
    length = np.linalg.norm(apex - base, axis=1)
    slope = (apex_radius - base_radius) / length
    axis = unit(apex - base)
    across = np.eye(3) - (1.0 + slope**2)[:, None, None] * axis[:, :, None] * axis[:, None, :]
    side = _quadric(across, base, base_radius**2, (-2.0 * base_radius * slope)[:, None] * axis)
    return [side, _plane(-axis, base), _plane(axis, apex)]


def _cylinder(base: np.ndarray, apex: np.ndarray, radius: np.ndarray) -> list[Surfaces]:
    return _cone(base, radius, apex, radius)


def _tube(base: np.ndarray, apex: np.ndarray, radius: np.ndarray, hole: np.ndarray) -> list[Surfaces]:
    drilled = _cone(base, hole, apex, hole)[0]
    return [*_cylinder(base, apex, radius), Surfaces(QUADRIC, drilled.values, inverted=True)]


def _rounded_box(low: np.ndarray, high: np.ndarray, radius: np.ndarray) -> list[Surfaces]:
    """Boxes through the flat faces, cylinders along the edges, spheres at the corners."""
    inner = np.stack([low, high]) + np.array([1.0, -1.0])[:, None, None] * radius[:, None]
    found = []
    for axis in np.eye(3):
        found += _box(np.where(axis, low, inner[0]), np.where(axis, high, inner[1]))
    for along in range(3):
        for sides in product((0, 1), repeat=2):
            ends = [np.insert(np.array(sides), along, end) for end in (0, 1)]
            found += _cylinder(_corner(inner, ends[0]), _corner(inner, ends[1]), radius)
    for sides in product((0, 1), repeat=3):
        found += _sphere(_corner(inner, sides), radius)
    return found


def _corner(box: np.ndarray, sides: Iterable[int]) -> np.ndarray:
    """The corners (n, 3) of boxes (2, n, 3), at the low (0) or high (1) side along each axis."""
    return np.stack([box[side, :, axis] for axis, side in enumerate(sides)], axis=1)


def _diagonal(values: np.ndarray) -> np.ndarray:
    return values[:, :, None] * np.eye(3)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("ni,ni->n", a, b)


def _all_of(first: int, count: int) -> tuple[Join | int, ...]:
    return (Join("intersection", count), *range(first, first + count))


_ROUNDED = (
    Join("union", 23),
    *(token for first in range(0, 18, 6) for token in _all_of(first, 6)),
    *(token for first in range(18, 54, 3) for token in _all_of(first, 3)),
    *range(54, 62),
)

CONSTRUCTORS: dict[type[Any], Constructor] = {
    Sphere: Constructor((0,), ("centre", "radius"), _sphere),
    Ellipsoid: Constructor((0,), ("centre", "radii"), _ellipsoid),
    Box: Constructor(_all_of(0, 6), ("low", "high"), _box),
    Cylinder: Constructor(_all_of(0, 3), ("base", "apex", "radius"), _cylinder),
    Cone: Constructor(_all_of(0, 3), ("base", "base_radius", "apex", "apex_radius"), _cone),
    Hyperboloid: Constructor((0,), ("centre", "radii", "sheets"), _hyperboloid),
    Paraboloid: Constructor((0,), ("vertex", "radii"), _paraboloid),
    HalfSpace: Constructor((0,), ("normal", "point"), _half_space),
    Slab: Constructor(_all_of(0, 2), ("normal", "point", "thickness"), _slab),
    Wedge: Constructor(_all_of(0, 5), ("low", "high"), _wedge),
    Quadric: Constructor((0,), ("matrix", "centre", "linear", "constant"), _general),
    RoundedBox: Constructor(_ROUNDED, ("low", "high", "radius"), _rounded_box),
    Tube: Constructor(_all_of(0, 4), ("base", "apex", "radius", "hole"), _tube),
}
"""The constructor of every solid except those of registered kinds, which are literals themselves."""
