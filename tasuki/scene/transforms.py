"""Transforms: affine maps that place what a node holds in the coordinates around it.

Matrices work on columns: P_around = M P_local. A singular one is refused where it is made, so that every transform can
be inverted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.scene.material import Vector

AXES: dict[str, Vector] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}

SINGULAR = 1e-14
"""A determinant of less than this, in units of the product of its columns' lengths, is zero but for rounding."""


class TransformError(SceneError):
    """There is no such transform; `message`, `expected` and `found` as in a `Diagnostic`."""

    def __init__(self, message: str, expected: str, found: str) -> None:
        self.message, self.expected, self.found = message, expected, found
        super().__init__(str(Diagnostic(message, None, expected, found)))


class Transform:
    """An affine map. `matrix` is (4, 4) float64, its last row 0 0 0 1; it is not to be written to."""

    __slots__ = ("matrix",)

    matrix: np.ndarray

    def __init__(self, matrix: np.ndarray) -> None:
        # Adding zero turns -0 into 0, so that equal maps have equal bytes.
        self.matrix = matrix + 0.0
        self.matrix.setflags(write=False)

    def then(self, following: Transform) -> Transform:
        """This transform, and after it `following`."""
        if self is IDENTITY:
            return following
        return Transform(following.matrix @ self.matrix)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Transform):
            return NotImplemented
        return self is other or np.array_equal(self.matrix, other.matrix)

    def __hash__(self) -> int:
        return hash(self.matrix.tobytes())

    def __repr__(self) -> str:
        return "IDENTITY" if self == IDENTITY else f"matrix({self.matrix[:3].tolist()})"


IDENTITY = Transform(np.eye(4))
"""The transform that leaves everything where it is."""


def translate(x: float, y: float, z: float) -> Transform:
    """The move by (x, y, z). TransformError where it is not finite."""
    made = np.eye(4)
    made[:3, 3] = _finite((x, y, z), "this move is not finite")
    return Transform(made)


def rotate(axis: str | Sequence[float], degrees: float) -> Transform:
    """The right-handed turn by `degrees` about `axis` through the origin: a vector of any length, or "x", "y", "z".

    By Rodrigues' formula; quarter turns about an axis of coordinates are exact. TransformError where the axis is zero
    or anything not finite.
    """
    if isinstance(axis, str):
        if axis not in AXES:
            raise TransformError("no such axis", "x, y, z or a vector", repr(axis))
        axis = AXES[axis]
    vector = _finite(axis, "this axis is not finite")
    if vector.shape != (3,):
        raise TransformError("this axis is no vector", "three numbers", f"{vector.size} numbers")
    _finite((degrees,), "this angle is not finite")
    if not vector.any():
        raise TransformError("this axis has no direction", "a vector other than zero", _numbers(vector))
    x, y, z = unit(vector)
    cosine, sine = _cosine_and_sine(degrees)
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    made = np.eye(4)
    made[:3, :3] = cosine * np.eye(3) + sine * across + (1.0 - cosine) * np.outer((x, y, z), (x, y, z))
    return Transform(made)


def scale(x: float, y: float | None = None, z: float | None = None) -> Transform:
    """The stretch by `x` every way, or by `x`, `y` and `z` along the axes. TransformError where one is zero."""
    if (y is None) != (z is None):
        raise TransformError("this scale is incomplete", "one factor or three", "two factors")
    factors = _finite((x, x if y is None else y, x if z is None else z), "this scale is not finite")
    if not factors.all():
        message = "a scale of zero flattens what it is applied to"
        raise TransformError(message, "factors other than 0", _numbers(factors))
    return Transform(np.diag([*factors, 1.0]))


def matrix(rows: Sequence[Sequence[float]] | np.ndarray) -> Transform:
    """The map with the given rows: 3 x 3, 3 x 4, or 4 x 4 with the last row 0 0 0 1.

    TransformError where it has another form, is not finite, or singular.
    """
    try:
        given = np.array(rows, np.float64)
    except (ValueError, TypeError):
        raise TransformError("this is no matrix", "3 x 3, 3 x 4 or 4 x 4 numbers", "rows of different kinds") from None
    if given.shape not in ((3, 3), (3, 4), (4, 4)):
        found = " x ".join(map(str, given.shape)) or "a number"
        raise TransformError("this is no matrix of a transform", "3 x 3, 3 x 4 or 4 x 4 numbers", found)
    _finite(given.reshape(-1), "this matrix is not finite")
    if len(given) == 4 and given[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
        raise TransformError("the last row of this matrix is not that of a transform", "0 0 0 1", _numbers(given[3]))
    made = np.eye(4)
    made[:3, : given.shape[1]] = given[:3]
    if singular(made):
        found = f"determinant {np.linalg.det(made[:3, :3]):.9g}"
        raise TransformError("this matrix is singular", "a matrix that can be inverted", found)
    return Transform(made)


def singular(matrices: np.ndarray) -> np.ndarray:
    """Which of `matrices` (..., 4, 4) are not finite, or have no inverse for all that float64 can tell."""
    linear = matrices[..., :3, :3]
    finite = np.isfinite(matrices).all(axis=(-2, -1))
    # Columns of unit length first: a tiny figure is not a flat one.
    lengths = np.abs(linear).max(axis=-2, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        columns = linear / lengths
        columns = columns / np.linalg.norm(columns, axis=-2, keepdims=True)
        volume = np.abs(np.linalg.det(columns))
    return ~(finite & (volume > SINGULAR))


def unit(vector: np.ndarray) -> np.ndarray:
    """`vector`, (..., 3) and not zero, at length 1; neither overflows nor vanishes where its squares would."""
    scaled = vector / np.abs(vector).max(axis=-1, keepdims=True)
    return scaled / np.linalg.norm(scaled, axis=-1, keepdims=True)


def _cosine_and_sine(degrees: float) -> tuple[float, float]:
    """Of an angle in degrees, exact at multiples of 90."""
    quarters, rest = divmod(degrees, 90.0)
    cosine, sine = math.cos(math.radians(rest)), math.sin(math.radians(rest))
    for _ in range(int(quarters) % 4):
        cosine, sine = -sine, cosine
    return cosine, sine


def _finite(values: Sequence[float] | np.ndarray, message: str) -> np.ndarray:
    numbers = np.array(values, np.float64)
    if not np.isfinite(numbers).all():
        raise TransformError(message, "finite numbers", "NaN or infinity")
    return numbers


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{value:.9g}" for value in values)
