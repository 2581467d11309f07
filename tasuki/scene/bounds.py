"""Boxes around primitives, computed on the host from their records: for `tasuki info`, and to hold the modules to.

Every function takes the structured array of a kind's records, and returns the low and high corners, float64, of shape
(n, 3). They hold every point that float32 arithmetic on the record can find: curved surfaces get a little more room.
"""

from __future__ import annotations

import numpy as np

ROOM = 2.0**-22
"""Relative room around curved surfaces: four roundings of float32."""


def plane_bounds(records: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A plane is without bounds."""
    unbounded = np.full((len(records), 3), np.inf)
    return -unbounded, unbounded


def quadric_bounds(records: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """An ellipsoid's box; other quadrics are without bounds.

    Completing the square moves the centre to p - Q^-1 l / 2 and r to r + l^T Q^-1 l / 4; along axis i an ellipsoid
    reaches sqrt(r (Q^-1)_ii). Negated, it is the same surface.
    """
    low, high = plane_bounds(records)
    matrix = np.stack([records[name] for name in ("q1", "q2", "q3")], axis=2).astype(np.float64)
    linear = np.stack([records[name] for name in ("l1", "l2", "l3")], axis=1).astype(np.float64)
    values = np.linalg.eigvalsh(matrix)
    # Of one sign, and far enough from zero to be inverted.
    definite = (np.abs(values).min(axis=1) > 1e-12 * np.abs(values).max(axis=1)) & (values[:, 0] * values[:, 2] > 0.0)
    inverse = np.linalg.inv(matrix[definite])
    shift = np.einsum("nij,nj->ni", inverse, linear[definite]) / 2.0
    constant = records["constant"][definite] + np.einsum("ni,ni->n", linear[definite], shift) / 2.0
    squares = constant[:, None] * np.einsum("nii->ni", inverse)
    centre = records["centre"][definite].astype(np.float64) - shift
    # Without any real point the surface is empty: a box of no size at its centre.
    reach = np.sqrt(np.maximum(squares, 0.0))
    low[definite], high[definite] = _with_room(centre - reach, centre + reach)
    return low, high


def cone_bounds(records: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The boxes of both rims: a circle of radius r about axis a reaches r sqrt(1 - a_i^2) along axis i."""
    axis = records["axis"].astype(np.float64)
    length = records["length"].astype(np.float64)
    base = records["base"].astype(np.float64)
    apex = base + axis * length[:, None]
    base_radius = records["radius"].astype(np.float64)
    apex_radius = base_radius + records["slope"] * length
    across = np.sqrt(np.maximum(1.0 - axis**2, 0.0))
    base_reach = np.abs(base_radius)[:, None] * across
    apex_reach = np.abs(apex_radius)[:, None] * across
    low = np.minimum(base - base_reach, apex - apex_reach)
    high = np.maximum(base + base_reach, apex + apex_reach)
    return _with_room(low, high)


def triangle_bounds(records: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The box of the corners, exactly."""
    corners = np.stack([records["a"], records["b"], records["c"]]).astype(np.float64)
    return corners.min(axis=0), corners.max(axis=0)


def quad_bounds(records: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The box of the corners, exactly."""
    corners = np.stack([records["a"], records["b"], records["c"], records["d"]]).astype(np.float64)
    return corners.min(axis=0), corners.max(axis=0)


HOST_BOUNDS = {
    "plane": plane_bounds,
    "quadric": quadric_bounds,
    "cone": cone_bounds,
    "triangle": triangle_bounds,
    "quad": quad_bounds,
}
"""The functions above, by the name of their kind."""


def outward(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Boxes (n, 2, 3) float32 that hold the boxes `low` to `high`."""
    with np.errstate(over="ignore"):
        boxes = np.stack([low, high], axis=1).astype(np.float32)
    below, above = boxes[:, 0], boxes[:, 1]
    np.nextafter(below, np.float32(-np.inf), out=below, where=below > low)
    np.nextafter(above, np.float32(np.inf), out=above, where=above < high)
    return boxes


def _with_room(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    room = ROOM * (np.maximum(np.abs(low), np.abs(high)) + (high - low))
    return low - room, high + room
