"""Shapes become primitives: structured arrays of records, one array for each kind, by array operations throughout.

A sphere is a quadric, a cone or cylinder a cone, a polygon triangles. Everything is computed in float64 and rounded
once, when it is put into a record.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tasuki.scene.flatten import Flat
from tasuki.scene.kinds import UNIT_MATRIX, PrimitiveKind, lookup
from tasuki.scene.quads import flat_convex_quads
from tasuki.scene.shapes import CONE, POLYGON, SPHERE, Batch, Polygons
from tasuki.scene.triangulate import triangulate

TWO_SIDED = 1
INSIDE_ONLY = 2
"""Flags of a primitive, as `tasuki.modules.records` gives them."""


@dataclass(frozen=True)
class Primitives:
    """All primitives of one kind: their `records`, and of each the number of its shape in the flat scene."""

    kind: PrimitiveKind
    records: np.ndarray
    shapes: np.ndarray


def lower(flat: Flat, origin: np.ndarray) -> list[Primitives]:
    """The primitives of the batches of a scene, by kind in the order of kinds; kinds without any are left out.

    Their coordinates count from `origin`, (3,) float64 in the scene's own.
    """
    lowered = [_spheres(flat, origin), _cones(flat, origin), *_polygons(flat, origin)]
    return sorted((one for one in lowered if len(one.records)), key=lambda one: one.kind.number)


def _spheres(flat: Flat, origin: np.ndarray) -> Primitives:
    """(P - centre)^T I (P - centre) = radius^2."""
    spheres = flat.shapes.spheres
    kind, records = _records("quadric", flat, spheres, inside_only=spheres.radius < 0.0)
    records["centre"] = _float32(spheres.centre - origin)
    records["constant"] = _float32(spheres.radius**2)
    records["q1"] = (1.0, 0.0, 0.0)
    records["q2"] = (0.0, 1.0, 0.0)
    records["q3"] = (0.0, 0.0, 1.0)
    records["flags"] |= UNIT_MATRIX
    return Primitives(kind, records, _shape_numbers(flat, SPHERE))


def _cones(flat: Flat, origin: np.ndarray) -> Primitives:
    cones = flat.shapes.cones
    inside_only = (cones.base_radius < 0.0) | (cones.apex_radius < 0.0)
    kind, records = _records("cone", flat, cones, inside_only=inside_only)
    along = cones.apex - cones.base
    length = np.linalg.norm(along, axis=1)
    base_radius, apex_radius = np.abs(cones.base_radius), np.abs(cones.apex_radius)
    records["base"] = _float32(cones.base - origin)
    records["radius"] = _float32(base_radius)
    records["axis"] = along / length[:, None]
    records["length"] = _float32(length)
    records["slope"] = _float32((apex_radius - base_radius) / length)
    return Primitives(kind, records, _shape_numbers(flat, CONE))


def _polygons(flat: Flat, origin: np.ndarray) -> list[Primitives]:
    """What of the polygons can be taken as flat convex quadrilaterals as quads, the rest as triangles."""
    polygons = flat.shapes.polygons
    corners, owner = triangulate(polygons)
    quads, first = flat_convex_quads(polygons, corners, owner, _float32(polygons.points - origin))
    alone = np.ones(len(owner), bool)
    alone[first] = alone[first + 1] = False
    return [
        _flat_primitives("triangle", flat, origin, corners[alone], owner[alone]),
        _flat_primitives("quad", flat, origin, quads, owner[first]),
    ]


def _flat_primitives(
    kind_name: str, flat: Flat, origin: np.ndarray, corners: np.ndarray, owner: np.ndarray
) -> Primitives:
    """Primitives with `corners` (n, 3 or 4), indices into the polygons' points; `owner` is the polygon of each."""
    polygons = flat.shapes.polygons
    kind, records = _records(kind_name, flat, polygons, smooth=polygons.smooth, owner=owner)
    normals = _corner_normals(polygons)
    for corner, name in enumerate("abcd"[: corners.shape[1]]):
        records[name] = _float32(polygons.points[corners[:, corner]] - origin)
        records[f"normal_{name}"] = _float32(normals[corners[:, corner]])
    return Primitives(kind, records, _shape_numbers(flat, POLYGON)[owner])


def _corner_normals(polygons: Polygons) -> np.ndarray:
    """The normal at every point, (m, 3): the face's, of unit length, unless a patch gives one other than zero."""
    area_vectors = polygons.area_vectors
    face = area_vectors / np.linalg.norm(area_vectors, axis=1)[:, None]
    given = (polygons.normals != 0.0).any(axis=1, keepdims=True)
    return np.where(given, polygons.normals, np.repeat(face, polygons.sizes, axis=0))


def _records(
    kind_name: str,
    flat: Flat,
    batch: Batch,
    *,
    inside_only: np.ndarray | bool = False,
    smooth: np.ndarray | bool = False,
    owner: np.ndarray | slice = slice(None),
) -> tuple[PrimitiveKind, np.ndarray]:
    """Records with their first row filled: kind, attribute, matrix, flags. `owner[i]` is the shape of record i.

    The frames are the first of the matrices in memory, so that textures find local coordinates; -1: none of its own.
    """
    kind = lookup(kind_name)
    two_sided = np.array([material.shows_both_sides() for material in flat.materials], bool)
    two_sided_patch = np.array([material.shows_both_sides(smooth=True) for material in flat.materials], bool)
    both = np.where(smooth, two_sided_patch[batch.material], two_sided[batch.material])
    shape_flags = np.where(inside_only, INSIDE_ONLY, np.where(both, TWO_SIDED, 0))
    flags = shape_flags[owner]
    records = np.zeros(len(flags), kind.record.numpy_dtype())
    records["kind"] = kind.number
    records["attribute"] = batch.material[owner]
    records["matrix"] = batch.frame[owner]
    records["flags"] = flags
    return kind, records


def _shape_numbers(flat: Flat, sort: int) -> np.ndarray:
    return np.flatnonzero(flat.sorts == sort)


def _float32(values: np.ndarray) -> np.ndarray:
    """Rounded to float32; what is too large becomes infinite, which `pack` reports."""
    with np.errstate(over="ignore"):
        return values.astype(np.float32)
