"""Polygons that lie in faces of objects: they become objects themselves, so that both are crossed at one t.

A polygon stands as a solid of which one literal shows, its plane; the others are planes through its edges. Where the
plane is a face of another object too it is one surface with it, and the opaque one of the two shows.
"""

from __future__ import annotations

import numpy as np

from tasuki.scene.csg import PLANE, Branch, Leaf, Sheet
from tasuki.scene.flatten import Flat, FlatObject
from tasuki.scene.meetings import TOUCHING, with_objects
from tasuki.scene.objects import SLACK, Faces, Formulas, measures
from tasuki.scene.shapes import NO_FRAME, POLYGON, Polygons
from tasuki.scene.surfaces import TOLERANCE, merged_planes
from tasuki.scene.transforms import IDENTITY, unit
from tasuki.scene.triangulate import triangulate

STRAIGHT = 1e-9
"""Of a polygon's size: how far a corner may lie beyond an edge of a convex polygon, by rounding."""


def with_sheets(flat: Flat, formulas: Formulas, size: float) -> Flat:
    """The scene with such polygons as objects that lie in a face of one, where both may be seen at one place from one
    side. `size` is that of the scene.

    Patches stay what they are, unless they are shaded like polygons: their normals vary.
    """
    polygons = flat.shapes.polygons
    if not len(polygons) or not flat.objects:
        return flat
    sides = np.array([[one.shows_both_sides(smooth=smooth) for one in flat.materials] for smooth in (False, True)])
    two_sided = sides[polygons.smooth.astype(int), polygons.material]
    found = _on_faces(_faces_of(polygons, two_sided), formulas.faces(), size)
    found[found] = _are_flat(polygons.take(np.flatnonzero(found)))
    if not found.any():
        return flat
    numbers = np.flatnonzero(flat.sorts == POLYGON)[found].tolist()
    made = [_as_object(flat, *one, SLACK * size) for one in zip(numbers, two_sided[found].tolist(), strict=True)]
    return with_objects(flat, POLYGON, found, made)


def _faces_of(polygons: Polygons, two_sided: np.ndarray) -> Faces:
    """The planes of polygons, through their first points."""
    normals = unit(polygons.area_vectors)
    first = polygons.starts[:-1]
    boxes = np.column_stack([np.minimum.reduceat(polygons.points, first), np.maximum.reduceat(polygons.points, first)])
    planes = np.column_stack([normals, -np.einsum("ni,ni->n", normals, polygons.points[first])])
    return Faces(planes, boxes, two_sided)


def _on_faces(polygons: Faces, faces: Faces, size: float) -> np.ndarray:
    """Which of `polygons` lie in one of `faces`, touch what it bounds, and show on a side from which it shows."""
    mine, others = _near(polygons.planes[:, 3], faces.planes[:, 3], TOLERANCE * size)
    both = polygons.take(mine).joined(faces.take(others))
    merged = merged_planes(both.planes, measures(both.boxes, size, np.arange(len(both.planes))))
    found = np.zeros(len(polygons.planes), bool)
    order = np.argsort(merged.number, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(merged.number[order])) + 1):
        here, there = rows[rows < len(mine)], rows[rows >= len(mine)]
        if len(here) and len(there):
            found[mine[here]] = _meet(here, there, both, merged.turned, TOUCHING * size)
    return found


def _near(some: np.ndarray, others: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """The indices of those planes of either set that are as far from the origin as one of the other set."""
    some, others = np.abs(some), np.abs(others)

    def near(values: np.ndarray, to: np.ndarray) -> np.ndarray:
        first, end = np.searchsorted(np.sort(to), [values - tolerance, values + tolerance])
        return np.flatnonzero(first < end)

    return near(some, others), near(others, some)


def _meet(mine: np.ndarray, others: np.ndarray, faces: Faces, turned: np.ndarray, touching: float) -> np.ndarray:
    """Which of the planes `mine`, (k,), touch one of the `others`, which are the same surface, and show on a side on
    which that one shows.
    """
    low, high = faces.boxes[:, :3] - touching, faces.boxes[:, 3:] + touching

    def meets(one: int, many: np.ndarray) -> np.ndarray:
        near = (faces.boxes[many, :3] <= high[one]).all(axis=1) & (faces.boxes[many, 3:] >= low[one]).all(axis=1)
        return near & (faces.two_sided[one] | faces.two_sided[many] | (turned[one] == turned[many]))

    # Python's loop is over the fewer.
    if len(mine) <= len(others):
        return np.array([meets(one, others).any() for one in mine.tolist()], bool)
    return np.logical_or.reduce([meets(one, mine) for one in others.tolist()])


def _are_flat(polygons: Polygons) -> np.ndarray:
    """Which polygons (n,) lie in a plane, and are not shaded as if they did not."""
    owner = np.repeat(np.arange(len(polygons)), polygons.sizes)
    normals = unit(polygons.area_vectors)
    away = polygons.points - polygons.points[polygons.starts[:-1]][owner]
    out = np.abs(np.einsum("ni,ni->n", away, normals[owner])) > TOLERANCE * np.abs(away).max(axis=1)
    length = np.linalg.norm(polygons.normals, axis=1)
    bent = np.einsum("ni,ni->n", polygons.normals, normals[owner]) < (1.0 - TOLERANCE) * length
    return np.bincount(owner[out | bent], minlength=len(polygons)) == 0


def _as_object(flat: Flat, number: int, two_sided: bool, slack: float) -> FlatObject:
    """Thing `number`, a polygon, as an object in the local coordinates that it had, so that its texture stays."""
    position = int(flat.positions[number])
    polygon = flat.shapes.polygons.take(np.array([position]))
    points, normal, frame = polygon.points, unit(polygon.area_vectors[0]), int(polygon.frame[0])
    matrix = IDENTITY.matrix if frame == NO_FRAME else flat.frames[frame]
    material, node = int(polygon.material[0]), flat.shapes.node(POLYGON, position)

    def leaf(normal: np.ndarray, point: np.ndarray) -> Leaf:
        return Leaf(PLANE, np.append(normal, -(normal @ point)) @ matrix, matrix, material, node)

    def within(corners: np.ndarray) -> Branch:
        return Branch("intersection", [leaf(across, point) for across, point in _edges(corners, normal)])

    beyond = max(((points - point) @ across).max() for across, point in _edges(points, normal))
    convex = beyond <= STRAIGHT * np.ptp(points)
    parts = [within(points)] if convex else [within(points[corners]) for corners in triangulate(polygon)[0]]
    root = Branch("intersection", [leaf(normal, points[0]), Branch("union", parts)])
    low, high = points.min(axis=0) - slack, points.max(axis=0) + slack
    extent = tuple(((low + high) / 2.0).tolist()), float(np.linalg.norm(high - low)) / 2.0
    sheet = Sheet((*low.tolist(), *high.tolist()), two_sided)
    return FlatObject(root, material, extent, node.place, ("shapes", number), sheet)


def _edges(points: np.ndarray, normal: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Of the outline `points` (n, 3) each edge's unit normal in the plane, outward, and a point on the edge."""
    along = np.roll(points, -1, axis=0) - points
    length = np.linalg.norm(along, axis=1)
    kept = length > STRAIGHT * np.ptp(points)
    return list(zip(unit(np.cross(along[kept], normal)), points[kept], strict=True))
