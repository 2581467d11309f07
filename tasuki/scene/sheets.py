"""Polygons that lie in faces of objects: they become objects themselves, so that both are crossed at one t.

A polygon stands as a solid of which one literal shows, its plane; the others are planes through its edges. Where the
plane is a face of another object too it is one surface with it, and the opaque one of the two shows.
"""

from __future__ import annotations

import numpy as np

from tasuki.scene.csg import PLANE, FlatObjects, Form, Join, Literal, Literals, Sheet
from tasuki.scene.flatten import Flat
from tasuki.scene.material import Vector
from tasuki.scene.meetings import TOUCHING, with_objects
from tasuki.scene.objects import SLACK, Faces, Formulas
from tasuki.scene.placing import measures
from tasuki.scene.problem import Path
from tasuki.scene.shapes import POLYGON, Polygons
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
    if not len(polygons) or not len(flat.objects):
        return flat
    sides = np.array([[one.shows_both_sides(smooth=smooth) for one in flat.materials] for smooth in (False, True)])
    two_sided = sides[polygons.smooth.astype(int), polygons.material]
    found = _on_faces(_faces_of(polygons, two_sided), formulas.faces(), size)
    found[found] = _are_flat(polygons.take(np.flatnonzero(found)))
    if not found.any():
        return flat
    return with_objects(flat, POLYGON, found, _as_objects(flat, np.flatnonzero(found), two_sided[found], SLACK * size))


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


def _as_objects(flat: Flat, positions: np.ndarray, two_sided: np.ndarray, slack: float) -> FlatObjects:
    """The polygons at `positions` of their batch as objects in the local coordinates that they had, so that their
    textures stay.
    """
    polygons = flat.shapes.polygons
    formulas = [_formula(polygons.take(np.array([position]))) for position in positions.tolist()]
    forms = {form: number for number, form in enumerate(dict.fromkeys(form for form, _ in formulas))}
    sizes = np.array([len(planes) for _, planes in formulas], np.intp)
    owner, starts = np.repeat(np.arange(len(sizes)), sizes), np.concatenate([[0], np.cumsum(sizes)])
    frame, material = polygons.frame[positions], polygons.material[positions]
    to_scene = np.concatenate([flat.frames, IDENTITY.matrix[None]])[frame]
    planes = np.einsum("ni,nij->nj", np.concatenate([planes for _, planes in formulas]), to_scene[owner])
    places = [flat.shapes.place(POLYGON, position) for position in positions.tolist()]
    literals = Literals(
        (PLANE,),
        (planes,),
        places,
        np.zeros(len(planes), np.uint8),
        np.arange(len(planes)),
        frame[owner],
        material[owner],
        owner,
    )
    form = np.array([forms[form] for form, _ in formulas], np.int32)
    paths: list[Path] = [("shapes", number) for number in np.flatnonzero(flat.sorts == POLYGON)[positions].tolist()]
    boxes = _boxes(polygons.take(positions), slack)
    extents = [_around(box) for box in boxes]
    sheets = [Sheet(tuple(box), side) for box, side in zip(boxes.tolist(), two_sided.tolist(), strict=True)]
    return FlatObjects(list(forms), literals, form, starts, material, extents, places, paths, sheets)


def _boxes(polygons: Polygons, slack: float) -> np.ndarray:
    first = polygons.starts[:-1]
    low, high = (end.reduceat(polygons.points, first) for end in (np.minimum, np.maximum))
    return np.column_stack([low - slack, high + slack])


def _around(box: np.ndarray) -> tuple[Vector, float]:
    x, y, z = ((box[:3] + box[3:]) / 2.0).tolist()
    return (x, y, z), float(np.linalg.norm(box[3:] - box[:3])) / 2.0


def _formula(polygon: Polygons) -> tuple[Form, np.ndarray]:
    """The form of one polygon, and the planes (k, 4) of its literals in the scene's coordinates."""
    points, normal = polygon.points, unit(polygon.area_vectors[0])
    beyond = max(((points - point) @ across).max() for across, point in _edges(points, normal))
    convex = beyond <= STRAIGHT * np.ptp(points)
    parts = [points] if convex else [points[corners] for corners in triangulate(polygon)[0]]
    form: list[Join | Literal] = [Join("intersection", 2), Literal(0, PLANE, 0), Join("union", len(parts))]
    planes = [(normal, points[0])]
    for corners in parts:
        edges = _edges(corners, normal)
        form.append(Join("intersection", len(edges)))
        form += [Literal(len(planes) + number, PLANE, 0) for number in range(len(edges))]
        planes += edges
    return tuple(form), np.array([np.append(across, -(across @ point)) for across, point in planes])


def _edges(points: np.ndarray, normal: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Of the outline `points` (n, 3) each edge's unit normal in the plane, outward, and a point on the edge."""
    along = np.roll(points, -1, axis=0) - points
    length = np.linalg.norm(along, axis=1)
    kept = length > STRAIGHT * np.ptp(points)
    return list(zip(unit(np.cross(along[kept], normal)), points[kept], strict=True))
