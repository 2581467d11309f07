"""Which solids meet: spheres that share a surface with a literal of an object, and media that touch other things."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tasuki.scene.csg import QUADRIC, FlatObjects, Form, Literal, Literals
from tasuki.scene.flatten import OBJECT, Flat
from tasuki.scene.kinds import OBJECT as OBJECT_KIND
from tasuki.scene.kinds import lookup, record_dtype
from tasuki.scene.objects import SLACK, Objects
from tasuki.scene.placing import FAR
from tasuki.scene.problem import Path
from tasuki.scene.shapes import CONE, NO_FRAME, POLYGON, SPHERE, Shapes, positions_of
from tasuki.scene.surfaces import TOLERANCE
from tasuki.scene.transforms import IDENTITY

TOUCHING = 1e-6
"""Boxes no farther apart, as a share of the scene's size, are taken to touch."""


def with_shared_spheres(flat: Flat, size: float) -> Flat:
    """The scene with such spheres as objects that coincide with a spherical literal of one, or of which one is
    transparent and the other stands in the same place: then both are crossed at one t. `size` is that of the scene.
    """
    spheres = flat.shapes.spheres
    if not len(spheres):
        return flat
    balls = _balls(flat.objects.literals, flat.frames)
    features = np.column_stack([spheres.centre, spheres.radius])
    shared = _in_one_place(flat, features)
    order = np.argsort(features[:, 0])
    near = [np.searchsorted(features[order, 0], balls[:, 0] + side * TOLERANCE * size) for side in (-1.0, 1.0)]
    for ball in np.flatnonzero(near[0] < near[1]):
        mine = order[near[0][ball] : near[1][ball]]
        shared[mine] |= (np.abs(features[mine] - balls[ball]) <= TOLERANCE * size).all(axis=1)
    # Of a negative radius only the inside shows: a surface, no solid.
    shared &= spheres.radius > 0.0
    return with_objects(flat, SPHERE, shared, _as_objects(flat, shared)) if shared.any() else flat


def _in_one_place(flat: Flat, features: np.ndarray) -> np.ndarray:
    """Which spheres, of centre and radius `features` (n, 4), are the same as others, any of them transparent."""
    clear = np.array([material.transmission > 0.0 for material in flat.materials], bool)[flat.shapes.spheres.material]
    if not clear.any():
        return np.zeros(len(features), bool)
    _, place, count = np.unique(features, axis=0, return_inverse=True, return_counts=True)
    place = place.reshape(-1)
    with_clear = np.bincount(place, weights=clear) > 0.0
    return (count > 1)[place] & with_clear[place]


def _balls(literals: Literals, frames: np.ndarray) -> np.ndarray:
    """Centre and radius, (n, 4), of all literals that are spheres in the scene."""
    if QUADRIC not in literals.kinds:
        return np.zeros((0, 4))
    rows = literals.of_kind(QUADRIC)
    values, matrices = literals.values_of(QUADRIC, rows), frames[literals.frame[rows]]
    inverses = np.linalg.inv(matrices[:, :3, :3])
    # What overflows here is told, with its place, when it is placed.
    with np.errstate(all="ignore"):
        q = inverses.swapaxes(1, 2) @ values[:, :3, :3] @ inverses
        uneven = np.abs(q / np.abs(q).max(axis=(1, 2), keepdims=True) - np.eye(3)).max(axis=(1, 2))
        round_ = uneven <= 1e-9
        q, values, matrices, inverses = q[round_, 0, 0], values[round_], matrices[round_], inverses[round_]
        shift = np.einsum("nji,nj->ni", inverses, values[:, :3, 3]) / (2.0 * q[:, None])
        centre = np.einsum("nij,nj->ni", matrices[:, :3, :3], values[:, 3, :3]) + matrices[:, :3, 3] - shift
        squares = values[:, 3, 3] / q + np.einsum("ni,ni->n", shift, shift)
    return np.column_stack([centre, np.sqrt(np.maximum(squares, 0.0))])


def with_objects(flat: Flat, sort: int, taken: np.ndarray, made: FlatObjects) -> Flat:
    """The scene with the shapes of a sort, SPHERE or POLYGON, where the mask `taken` is true, as the objects `made`.

    Literals of these may be in NO_FRAME: in the scene's own coordinates.
    """
    shapes = flat.shapes
    numbers = np.flatnonzero(flat.sorts == sort)[taken]
    order = np.argsort(np.concatenate([np.flatnonzero(flat.sorts == OBJECT), numbers]))
    literals, frames = _in_frames(made.literals, flat.frames)
    objects = FlatObjects.joined(flat.objects, replace(made, literals=literals)).take(order)
    sorts = flat.sorts.copy()
    sorts[numbers] = OBJECT
    kept = np.flatnonzero(~taken)
    spheres = shapes.spheres.take(kept) if sort == SPHERE else shapes.spheres
    polygons = shapes.polygons.take(kept) if sort == POLYGON else shapes.polygons
    left = Shapes(shapes.materials, sorts[sorts != OBJECT], spheres, shapes.cones, polygons, shapes.file)
    positions = positions_of(sorts)
    return replace(flat, shapes=left, objects=objects, sorts=sorts, positions=positions, frames=frames)


def _in_frames(literals: Literals, frames: np.ndarray) -> tuple[Literals, np.ndarray]:
    """Literals of which none is in NO_FRAME, and the frames (k, 4, 4), with that of the scene's own coordinates."""
    outside = literals.frame == NO_FRAME
    if not outside.any():
        return literals, frames
    if not len(frames) or not np.array_equal(frames[-1], IDENTITY.matrix):
        frames = np.concatenate([frames, IDENTITY.matrix[None]])
    return replace(literals, frame=np.where(outside, len(frames) - 1, literals.frame)), frames


def _as_objects(flat: Flat, shared: np.ndarray) -> FlatObjects:
    """The spheres where the mask `shared` is true as objects, in the local coordinates that they had, so that their
    textures stay.
    """
    positions = np.flatnonzero(shared)
    spheres, count = flat.shapes.spheres.take(positions), len(positions)
    to_scene = np.concatenate([flat.frames, IDENTITY.matrix[None]])[spheres.frame]
    linear, moved = to_scene[:, :3, :3], spheres.centre - to_scene[:, :3, 3]
    values = np.zeros((count, 4, 4))
    values[:, :3, :3] = linear.swapaxes(1, 2) @ linear
    values[:, 3, :3] = np.linalg.solve(linear, moved[:, :, None])[:, :, 0]
    values[:, 3, 3] = spheres.radius**2
    places = [flat.shapes.place(SPHERE, position) for position in positions.tolist()]
    paths: list[Path] = [("shapes", number) for number in np.flatnonzero(flat.sorts == SPHERE)[shared].tolist()]
    each, first, nothing = np.arange(count + 1), np.zeros(count, np.uint8), [None] * count
    literals = Literals((QUADRIC,), (values,), places, first, each[:-1], spheres.frame, spheres.material, each[:-1])
    forms, form = [(Literal(0, QUADRIC, 0),)], first.astype(np.int32)
    return FlatObjects(forms, literals, form, each, spheres.material, nothing, places, paths, nothing)


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
    mixed, is_surface = _mixed(flat.objects), [_is_surface(form) for form in flat.objects.forms]
    records = []
    for place in np.argsort(numbers, kind="stable").tolist():
        number = int(numbers[place])
        sort, position = int(flat.sorts[number]), int(flat.positions[number])
        if sort not in (SPHERE, OBJECT):
            continue
        material = (flat.shapes.spheres if sort == SPHERE else flat.objects).material[position]
        if not clear[material] or (sort == SPHERE and flat.shapes.spheres.radius[position] < 0.0):
            continue
        if sort == OBJECT and (flat.objects.sheets[position] is not None or is_surface[flat.objects.form[position]]):
            continue
        if (sort == OBJECT and mixed[position]) or neighbours.meets(place):
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


def _is_surface(form: Form) -> bool:
    """Whether a formula is a surface of a user's kind, which has no inside."""
    return len(form) == 1 and isinstance(form[0], Literal) and lookup(form[0].kind).sort == "surface"


def _mixed(objects: FlatObjects) -> np.ndarray:
    """Which objects have literals of more than one material, (n,)."""
    if not len(objects):
        return np.zeros(0, bool)
    low, high = (end.reduceat(objects.literals.material, objects.starts[:-1]) for end in (np.minimum, np.maximum))
    return low != high


def _media_records(found: Sequence[tuple[np.ndarray, int, int]]) -> np.ndarray:
    records = np.zeros(len(found), record_dtype("Medium"))
    for record, (box, code, material) in zip(records, found, strict=True):
        size = np.abs(box[np.isfinite(box)]).max(initial=1.0)
        record["low"] = np.maximum(box[:3] - SLACK * size, -FAR)
        record["high"] = np.minimum(box[3:] + SLACK * size, FAR)
        record["code"], record["attribute"] = code, material
    return records
