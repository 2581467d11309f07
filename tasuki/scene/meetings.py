"""Which solids meet: spheres that share a surface with a literal of an object, and media that touch other things."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tasuki.scene.csg import QUADRIC, Leaf, Tree
from tasuki.scene.flatten import OBJECT, Flat, FlatObject
from tasuki.scene.kinds import OBJECT as OBJECT_KIND
from tasuki.scene.kinds import lookup, record_dtype
from tasuki.scene.objects import FAR, SLACK, Objects
from tasuki.scene.shapes import CONE, NO_FRAME, POLYGON, SPHERE, Shapes, positions_of
from tasuki.scene.surfaces import TOLERANCE

TOUCHING = 1e-6
"""Boxes no farther apart, as a share of the scene's size, are taken to touch."""


def with_shared_spheres(flat: Flat, size: float) -> Flat:
    """The scene with such spheres as objects that coincide with a spherical literal of one, or of which one is
    transparent and the other stands in the same place: then both are crossed at one t. `size` is that of the scene.
    """
    spheres = flat.shapes.spheres
    if not len(spheres):
        return flat
    literals = [ball for one in flat.objects for ball in _balls(one.root)]
    features = np.column_stack([spheres.centre, spheres.radius])
    shared = _in_one_place(flat, features)
    order = np.argsort(features[:, 0])
    for ball in literals:
        first, end = np.searchsorted(features[order, 0], [ball[0] - TOLERANCE * size, ball[0] + TOLERANCE * size])
        near = order[first:end]
        shared[near] |= (np.abs(features[near] - ball) <= TOLERANCE * size).all(axis=1)
    # Of a negative radius only the inside shows: a surface, no solid.
    shared &= spheres.radius > 0.0
    if not shared.any():
        return flat
    made = [_as_object(flat, position) for position in np.flatnonzero(shared).tolist()]
    return with_objects(flat, SPHERE, shared, made)


def _in_one_place(flat: Flat, features: np.ndarray) -> np.ndarray:
    """Which spheres, of centre and radius `features` (n, 4), are the same as others, any of them transparent."""
    clear = np.array([material.transmission > 0.0 for material in flat.materials], bool)[flat.shapes.spheres.material]
    if not clear.any():
        return np.zeros(len(features), bool)
    _, place, count = np.unique(features, axis=0, return_inverse=True, return_counts=True)
    place = place.reshape(-1)
    with_clear = np.bincount(place, weights=clear) > 0.0
    return (count > 1)[place] & with_clear[place]


def _balls(root: Tree) -> list[np.ndarray]:
    """Centre and radius, (4,), of every spherical literal of a formula."""
    found: list[np.ndarray] = []
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if not isinstance(node, Leaf):
            waiting += node.children
        elif node.kind == QUADRIC and (ball := _ball(node)) is not None:
            found.append(ball)
    return found


def _ball(leaf: Leaf) -> np.ndarray | None:
    """Centre and radius, (4,), of a quadric that is a sphere in the scene; None of any other."""
    values, inverse = np.asarray(leaf.values), np.linalg.inv(leaf.matrix[:3, :3])
    q, linear = inverse.T @ values[:3, :3] @ inverse, inverse.T @ values[:3, 3]
    largest = np.abs(q).max()
    if largest == 0.0 or np.abs(q / largest - np.eye(3)).max() > 1e-9:
        return None
    shift = linear / (2.0 * q[0, 0])
    centre = leaf.matrix[:3, :3] @ values[3, :3] + leaf.matrix[:3, 3] - shift
    return np.append(centre, np.sqrt(max(values[3, 3] / q[0, 0] + shift @ shift, 0.0)))


def with_objects(flat: Flat, sort: int, taken: np.ndarray, made: Sequence[FlatObject]) -> Flat:
    """The scene with the shapes of a sort, SPHERE or POLYGON, where the mask `taken` is true, as the objects `made`."""
    shapes = flat.shapes
    numbers = np.flatnonzero(flat.sorts == sort)[taken]
    order = np.argsort(np.concatenate([np.flatnonzero(flat.sorts == OBJECT), numbers]))
    every = [*flat.objects, *made]
    sorts = flat.sorts.copy()
    sorts[numbers] = OBJECT
    kept = np.flatnonzero(~taken)
    spheres = shapes.spheres.take(kept) if sort == SPHERE else shapes.spheres
    polygons = shapes.polygons.take(kept) if sort == POLYGON else shapes.polygons
    left = Shapes(shapes.materials, sorts[sorts != OBJECT], spheres, shapes.cones, polygons, shapes.file)
    return replace(flat, shapes=left, objects=[every[i] for i in order], sorts=sorts, positions=positions_of(sorts))


def _as_object(flat: Flat, position: int) -> FlatObject:
    """A sphere as an object, in the local coordinates that it had, so that its texture stays."""
    spheres = flat.shapes.spheres
    centre, frame = spheres.centre[position], int(spheres.frame[position])
    matrix = np.eye(4) if frame == NO_FRAME else flat.frames[frame]
    values = np.zeros((4, 4))
    values[:3, :3] = matrix[:3, :3].T @ matrix[:3, :3]
    values[3, :3] = np.linalg.solve(matrix[:3, :3], centre - matrix[:3, 3])
    values[3, 3] = spheres.radius[position] ** 2
    material, node = int(spheres.material[position]), flat.shapes.node(SPHERE, position)
    number = int(np.flatnonzero(flat.sorts == SPHERE)[position])
    root = Leaf(QUADRIC, values, matrix, material, node)
    return FlatObject(root, material, None, node.place, ("shapes", number))


def media(flat: Flat, objects: Objects, quadric: int, origin: np.ndarray, size: float) -> np.ndarray:
    """The table "media": transparent solids that meet other things, in scene order. `quadric`: the kind of spheres;
    `size`: that of the scene.

    Solids of several materials are among them in any case: their own is that of the whole.
    """
    clear = np.array([material.transmission > 0.0 for material in flat.materials], bool)
    if not clear.any():
        return _media_records([])
    numbers, boxes = _boxes(flat, objects, origin)
    rows = np.full(len(flat.objects), -1)
    rows[objects.numbers] = np.arange(len(objects.numbers))
    neighbours = _Neighbours(boxes, TOUCHING * size)
    records = []
    for place in np.argsort(numbers, kind="stable").tolist():
        number = int(numbers[place])
        sort, position = int(flat.sorts[number]), int(flat.positions[number])
        if sort not in (SPHERE, OBJECT):
            continue
        material = flat.shapes.spheres.material[position] if sort == SPHERE else flat.objects[position].material
        if not clear[material] or (sort == SPHERE and flat.shapes.spheres.radius[position] < 0.0):
            continue
        if sort == OBJECT and flat.objects[position].sheet is not None:
            continue
        if sort == OBJECT and _is_surface(flat.objects[position].root):
            continue
        mixed = sort == OBJECT and _is_mixed(flat.objects[position].root)
        if mixed or neighbours.meets(place):
            code = position * 32 + quadric if sort == SPHERE else int(rows[position]) * 32 + OBJECT_KIND
            records.append((boxes[place], code, material))
    return _media_records(records)


def _boxes(flat: Flat, objects: Objects, origin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers in the scene of all things, and boxes (n, 6) around them, in coordinates of memory."""
    spheres, cones, polygons = flat.shapes.spheres, flat.shapes.cones, flat.shapes.polygons
    reach = np.maximum(np.abs(cones.base_radius), np.abs(cones.apex_radius))[:, None]
    low = [spheres.centre - np.abs(spheres.radius)[:, None], np.minimum(cones.base, cones.apex) - reach]
    high = [spheres.centre + np.abs(spheres.radius)[:, None], np.maximum(cones.base, cones.apex) + reach]
    if len(polygons):
        low.append(np.minimum.reduceat(polygons.points, polygons.starts[:-1]))
        high.append(np.maximum.reduceat(polygons.points, polygons.starts[:-1]))
    shapes = np.column_stack([np.concatenate(low) - origin, np.concatenate(high) - origin])
    of_objects = np.flatnonzero(flat.sorts == OBJECT)[objects.numbers]
    numbers = [np.flatnonzero(flat.sorts == sort) for sort in (SPHERE, CONE, POLYGON)]
    return np.concatenate([*numbers, of_objects]), np.concatenate([shapes, objects.boxes])


class _Neighbours:
    """Boxes (n, 6) along the x axis, so that of many only those near one are looked at."""

    def __init__(self, boxes: np.ndarray, touching: float) -> None:
        order = np.argsort(boxes[:, 0], kind="stable")
        self.boxes = boxes
        self.touching = touching
        self.sorted = boxes[order]
        self.reached = np.maximum.accumulate(self.sorted[:, 3])

    def meets(self, place: int) -> bool:
        """Whether the box at `place` touches any other."""
        low, high = self.boxes[place, :3] - self.touching, self.boxes[place, 3:] + self.touching
        first = np.searchsorted(self.reached, low[0])
        near = self.sorted[first : np.searchsorted(self.sorted[:, 0], high[0], side="right")]
        apart = (near[:, :3] > high).any(axis=1) | (near[:, 3:] < low).any(axis=1)
        return bool((~apart).sum() > 1)


def _is_surface(root: Tree) -> bool:
    """Whether a formula is a surface of a user's kind, which has no inside."""
    return isinstance(root, Leaf) and lookup(root.kind).sort == "surface"


def _is_mixed(root: Tree) -> bool:
    """Whether a formula has literals of more than one material."""
    found, waiting = set(), [root]
    while waiting:
        node = waiting.pop()
        if isinstance(node, Leaf):
            found.add(node.material)
        else:
            waiting += node.children
    return len(found) > 1


def _media_records(found: Sequence[tuple[np.ndarray, int, int]]) -> np.ndarray:
    records = np.zeros(len(found), record_dtype("Medium"))
    for record, (box, code, material) in zip(records, found, strict=True):
        size = np.abs(box[np.isfinite(box)]).max(initial=1.0)
        record["low"] = np.maximum(box[:3] - SLACK * size, -FAR)
        record["high"] = np.minimum(box[3:] + SLACK * size, FAR)
        record["code"], record["attribute"] = code, material
    return records
