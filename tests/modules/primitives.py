"""Primitives of every kind, and rays at them, at random."""

from __future__ import annotations

import numpy as np

from tasuki.modules.records import SPHERE, TWO_SIDED, Cone, Plane, Quad, Quadric, Triangle
from tests.modules.running import dot, random_directions, records, unit

COUNT = 4001


def rays(seed: int, count: int = COUNT, reach: float = 5.0) -> tuple[np.ndarray, np.ndarray]:
    """Origins around 0 and unit directions, float32; two thirds of the rays go by the middle."""
    draw = np.random.default_rng(seed)
    origin = draw.uniform(-reach, reach, (count, 3)).astype(np.float32)
    aimed = unit(draw.uniform(-2, 2, (count, 3)) - origin)
    return origin, np.where(np.arange(count)[:, None] % 3 == 0, random_directions(draw, count), aimed)


def point_at(origin: np.ndarray, direction: np.ndarray, t: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        return origin.astype(np.float64) + t[:, None] * direction.astype(np.float64)


def planes(seed: int, count: int = COUNT, flags: int = TWO_SIDED) -> np.ndarray:
    draw = np.random.default_rng(seed)
    return records(Plane, count, normal=random_directions(draw, count), d=draw.normal(size=count) * 3, flags=flags)


def quadric_of(matrix: np.ndarray, centre: np.ndarray, linear: np.ndarray, constant: np.ndarray, flags: int = 0):
    result = records(Quadric, len(matrix), centre=centre, constant=constant, flags=flags)
    for axis in range(3):
        result[f"q{axis + 1}"] = matrix[:, :, axis]
        result[f"l{axis + 1}"] = linear[:, axis]
    return result


SHAPES = {
    "ellipsoid": ([1, 2, 0.5], [0, 0, 0], 1),
    "ellipsoid inside out": ([-1, -2, -0.5], [0, 0, 0], -1),
    "cylinder": ([1, 0.5, 0], [0, 0, 0], 1),
    "double cone": ([1, 1, -0.5], [0, 0, 0], 0),
    "hyperboloid of one sheet": ([1, 1, -0.5], [0, 0, 0], 1),
    "hyperboloid of two sheets": ([1, 1, -0.5], [0, 0, 0], -1),
    "paraboloid": ([1, 0.5, 0], [0, 0, -1], 0),
    "saddle": ([1, -0.5, 0], [0, 0, -1], 0),
    "plane pair": ([1, 0, 0], [0, 0, 0], 1),
    "displaced": ([1, 2, 0.5], [0.5, -1, 1], 1),
}


def random_quadrics(name: str, seed: int, count: int = COUNT) -> np.ndarray:
    """Quadrics of one shape, turned and moved at random; every fifth stands exactly as given."""
    draw = np.random.default_rng(seed)
    diagonal, linear, constant = SHAPES[name]
    turn = np.linalg.qr(draw.normal(size=(count, 3, 3)))[0]
    turn[::5] = np.eye(3)
    matrix = turn @ (np.diag(diagonal) * draw.uniform(0.5, 2, (count, 1, 1))) @ turn.transpose(0, 2, 1)
    # Symmetric to the last bit, as records are.
    matrix = np.float32(matrix + matrix.transpose(0, 2, 1)) / 2
    centre = draw.uniform(-2, 2, (count, 3))
    centre[::5] = 0
    return quadric_of(matrix, centre, np.einsum("nij,j->ni", turn, linear), np.full(count, constant))


def value_at(given: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """In float64 the left side less the right, half its gradient's length, and the size of what was added up."""
    v = point - given["centre"]
    matrix = np.stack([given["q1"], given["q2"], given["q3"]], axis=-1).astype(np.float64)
    linear = np.stack([given["l1"], given["l2"], given["l3"]], axis=-1).astype(np.float64)
    gradient = np.einsum("nij,nj->ni", matrix, v) + 0.5 * linear
    value = np.einsum("ni,nij,nj->n", v, matrix, v) + dot(linear, v) - given["constant"]
    size = np.einsum("ni,nij,nj->n", np.abs(v), np.abs(matrix), np.abs(v)) + dot(np.abs(linear), np.abs(v))
    return value, np.linalg.norm(gradient, axis=-1), size + np.abs(given["constant"])


def gradient_of(given: np.ndarray, point: np.ndarray) -> np.ndarray:
    v = point - given["centre"]
    matrix = np.stack([given["q1"], given["q2"], given["q3"]], axis=-1).astype(np.float64)
    linear = np.stack([given["l1"], given["l2"], given["l3"]], axis=-1)
    return np.einsum("nij,nj->ni", matrix, v) + 0.5 * linear


def spheres(seed: int, count: int = COUNT, flags: int = 0) -> np.ndarray:
    draw = np.random.default_rng(seed)
    matrix = np.tile(np.eye(3), (count, 1, 1))
    radius = 10 ** draw.uniform(-3, 1, count)
    centre = draw.uniform(-3, 3, (count, 3))
    return quadric_of(matrix, centre, np.zeros((count, 3)), radius**2, SPHERE | flags)


def cones(seed: int, count: int = COUNT, flags: int = TWO_SIDED) -> np.ndarray:
    """A third cylinders, a third cones with an apex, a third cut; both ways round."""
    draw = np.random.default_rng(seed)
    radius, length = draw.uniform(0.3, 2, count), draw.uniform(0.5, 3, count)
    end = np.choose(np.arange(count) % 3, [radius, 0 * radius, draw.uniform(0, 2, count)])
    axis = random_directions(draw, count)
    base = draw.uniform(-2, 2, (count, 3))
    slope = (end - radius) / length
    return records(Cone, count, base=base, axis=axis, radius=radius, length=length, slope=slope, flags=flags)


def triangles(seed: int, count: int = COUNT, flags: int = TWO_SIDED) -> np.ndarray:
    draw = np.random.default_rng(seed)
    corners = draw.uniform(-2, 2, (3, count, 3))
    normals = np.stack([random_directions(draw, count) for _ in range(3)])
    return records(
        Triangle,
        count,
        **dict(zip(("a", "b", "c"), corners, strict=True)),
        **dict(zip(("normal_a", "normal_b", "normal_c"), normals, strict=True)),
        flags=flags,
    )


def quads(seed: int, count: int = COUNT, flags: int = TWO_SIDED) -> np.ndarray:
    """Flat convex quadrilaterals: the corners of affinely mapped squares, pulled towards one another."""
    draw = np.random.default_rng(seed)
    right, up, middle = draw.normal(size=(3, count, 3))
    pulls = draw.uniform(0.6, 1.0, (4, count, 1))
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    corners = [middle + pull * (x * right + y * up) for (x, y), pull in zip(signs, pulls, strict=True)]
    normal = np.cross(right, up)
    fields = dict(zip("abcd", corners, strict=True)) | {f"normal_{name}": normal for name in "abcd"}
    return records(Quad, count, **fields, flags=flags)
