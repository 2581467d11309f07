"""Spherical extents of things, objects and groups (paper, section 6), and the tree of them as modules walk through it.

An extent is a row (x, y, z, radius) in the scene's coordinates, float64; of infinite radius where there are no bounds,
of radius -inf around nothing. One that a user gives is believed; any other is computed, from the literals up: a union's
encloses its operands', an intersection has the tightest of its operands', a complement has none (unless it is that of a
surface inside out).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from tasuki.diagnostics import Diagnostic
from tasuki.scene.bounds import FLAT, is_empty
from tasuki.scene.csg import QUADRIC, Sphered, negated
from tasuki.scene.flatten import OBJECT
from tasuki.scene.formula import Part, in_one_frame, local_boxes, parents_last
from tasuki.scene.kinds import OBJECT as OBJECT_KIND
from tasuki.scene.kinds import PrimitiveKind, record_dtype
from tasuki.scene.objects import SLACK, Batch, Formulas
from tasuki.scene.placing import PlacedLiterals
from tasuki.scene.placing import local_box as box_of_primitive
from tasuki.scene.problem import dotted
from tasuki.scene.shapes import POLYGON
from tasuki.scene.surfaces import completed

if TYPE_CHECKING:
    from tasuki.scene.pack import Packed

NONE = np.array([0.0, 0.0, 0.0, inf])
AROUND_NOTHING = np.array([0.0, 0.0, 0.0, -inf])
GROUP = -1
"""The code of a node that is a group."""
DIAGONALS = np.array([[1.0, 1.0, 1.0, 1.0], [1.0, 1.0, -1.0, -1.0], [1.0, -1.0, 1.0, -1.0]])
"""From the middle of a box to one end of each diagonal, in units of half its sides."""


# --- spheres ----------------------------------------------------------------------------------------------------------


def around(extents: np.ndarray, owners: np.ndarray, count: int) -> np.ndarray:
    """Of each of `count` owners the sphere (count, 4) around those of the spheres (n, 4) that it owns; `owners` (n,).

    Its centre is the middle of the box around them.
    """
    centres, radii = extents[:, :3], extents[:, 3]
    low, high = np.full((count, 3), inf), np.full((count, 3), -inf)
    largest, reach = np.full((2, count), -inf)
    np.minimum.at(low, owners, centres - radii[:, None])
    np.maximum.at(high, owners, centres + radii[:, None])
    np.maximum.at(largest, owners, radii)
    bounded = np.isfinite(largest)
    middle = np.zeros((count, 3))
    middle[bounded] = (low[bounded] + high[bounded]) / 2.0
    np.maximum.at(reach, owners, np.linalg.norm(centres - middle[owners], axis=1) + radii)
    return np.column_stack([middle, np.where(bounded, reach, largest)])


def around_boxes(boxes: np.ndarray, matrices: np.ndarray | None = None) -> np.ndarray:
    """The spheres (n, 4) around boxes (n, 6), half their diagonals; or around what affine `matrices` (n, 4, 4) make of
    them.
    """
    extents = np.where(is_empty(boxes)[:, None], AROUND_NOTHING, np.tile(NONE, (len(boxes), 1)))
    finite = np.isfinite(boxes).all(axis=1)
    low, high = boxes[finite, :3], boxes[finite, 3:]
    middle, half = (low + high) / 2.0, (high - low) / 2.0
    if matrices is None:
        extents[finite] = np.column_stack([middle, np.sqrt(np.einsum("ni,ni->n", half, half))])
        return extents
    linear = matrices[finite, :3, :3]
    centre = np.einsum("nij,nj->ni", linear, middle) + matrices[finite, :3, 3]
    ends = (linear * half[:, None]) @ DIAGONALS
    extents[finite] = np.column_stack([centre, np.linalg.norm(ends, axis=1).max(axis=1, initial=0.0)])
    return extents


def around_points(points: np.ndarray) -> np.ndarray:
    """Spheres (n, 4) around points (n, k, 3), about the middles of the boxes around them."""
    middle = (points.min(axis=1) + points.max(axis=1)) / 2.0
    radius = np.linalg.norm(points - middle[:, None], axis=2).max(axis=1)
    return np.column_stack([middle, radius])


def around_quadrics(values: np.ndarray, matrices: np.ndarray) -> np.ndarray:
    """The extents (n, 4) of the insides of quadrics (n, 4, 4) under `matrices` (n, 4, 4): of ellipsoids their largest
    axis, wherever matrices bring it.

    An ellipsoid is where Q is positive definite; its radius is the root of constant over least eigenvalue.
    """
    extents = np.tile(NONE, (len(values), 1))
    linear = matrices[:, :3, :3]
    middle, opening, constant = completed(values, values[:, 3, :3])
    inverse = np.linalg.inv(linear)
    here = np.einsum("nji,njk,nkl->nil", inverse, values[:, :3, :3], inverse)
    own, stretched = np.linalg.eigvalsh(values[:, :3, :3]), np.linalg.eigvalsh(here)
    closed = (own[:, 0] > FLAT * own[:, 2]) & (stretched[:, 0] > 0.0) & (opening == 0.0).all(axis=1)
    centre = np.einsum("nij,nj->ni", linear, middle) + matrices[:, :3, 3]
    radius = np.sqrt(np.maximum(constant, 0.0) / np.where(closed, stretched[:, 0], 1.0))
    extents[closed] = np.column_stack([centre, np.where(constant > 0.0, radius, -inf)])[closed]
    return extents


# --- primitives -------------------------------------------------------------------------------------------------------


def _of_spheres(records: np.ndarray) -> np.ndarray:
    """Quadrics that stand alone are spheres."""
    return np.column_stack([records["centre"], np.sqrt(records["constant"].astype(np.float64))])


def _of_cones(records: np.ndarray) -> np.ndarray:
    """About the point of the axis that is as far from the one rim as from the other; if it is not between them, about
    the middle of the larger end.
    """
    length, radius = records["length"].astype(np.float64), records["radius"].astype(np.float64)
    end = np.maximum(radius + records["slope"] * length, 0.0)
    along = np.clip((length**2 + end**2 - radius**2) / (2.0 * length), 0.0, length)
    centre = records["base"] + along[:, None] * records["axis"]
    return np.column_stack([centre, np.maximum(np.hypot(along, radius), np.hypot(length - along, end))])


def _of_corners(records: np.ndarray) -> np.ndarray:
    names = [name for name in "abcd" if name in (records.dtype.names or ())]
    return around_points(np.stack([records[name].astype(np.float64) for name in names], axis=1))


_OF_PRIMITIVES: Mapping[str, Callable[[np.ndarray], np.ndarray]] = {
    "quadric": _of_spheres,
    "cone": _of_cones,
    "triangle": _of_corners,
    "quad": _of_corners,
}
"""Those of other kinds are around the boxes that their own modules give."""


def of_primitives(kind: PrimitiveKind, records: np.ndarray) -> np.ndarray:
    """The extents (n, 4) of primitives that stand alone."""
    if kind.name in _OF_PRIMITIVES:
        return _OF_PRIMITIVES[kind.name](records)
    return around_boxes(np.array([box_of_primitive(kind, record) for record in records]).reshape(-1, 6))


# --- objects ----------------------------------------------------------------------------------------------------------


def of_formulas(formulas: Formulas) -> np.ndarray:
    """The extents (n, 4) of the objects of a scene, in scene order; of those that are left out as well."""
    literals, placing = formulas.objects.literals, formulas.placing
    quadrics = np.zeros((2, 0, 4))
    if QUADRIC in placing.rows:
        rows = placing.rows[QUADRIC]
        values, matrices = literals.values_of(QUADRIC, rows), placing.frames[literals.frame[rows]]
        quadrics = np.stack([around_quadrics(values, matrices), around_quadrics(negated(values, QUADRIC), matrices)])
    extents = np.empty((len(formulas.objects), 4))
    for batch in formulas.batches():
        extents[formulas.order[batch.members]] = _of_batch(batch, quadrics)
    return extents


def _of_batch(batch: Batch, quadrics: np.ndarray) -> np.ndarray:
    """The extents (n, 4) of formulas of one form; `quadrics` (2, k, 4) are those of all that there are and of their
    complements.
    """
    parts = parents_last(batch.root)
    leaves = [part for part in parts if part.leaf]
    found = dict(zip(map(id, leaves), _of_literals(leaves, batch.placed, quadrics), strict=True))
    for part in parts:
        if not part.leaf:
            operands = [found.pop(id(one)) for one in part.parts]
            found[id(part)] = _tightest(np.stack(list(_candidates(part, operands, batch.placed))))
    return found[id(batch.root)]


def _of_literals(leaves: Sequence[Part], placed: PlacedLiterals, quadrics: np.ndarray) -> np.ndarray:
    """The extents (k, n, 4) of all literals of formulas."""
    shape = (len(leaves), -1, 4)
    whole = around_boxes(np.concatenate([part.boxes for part in leaves])).reshape(shape)
    literals = [part.leaf for part in leaves if part.leaf]
    boxes, matrices = [placed.boxes(one)[2] for one in literals], [placed.matrices(one) for one in literals]
    own = around_boxes(np.concatenate(boxes), np.concatenate(matrices)).reshape(shape)
    for number, literal in enumerate(literals):
        if literal.kind == QUADRIC:
            own[number] = quadrics[int(literal.inverted), placed.positions(literal)]
    return _tightest(np.stack([whole, own]))


def _tightest(candidates: np.ndarray) -> np.ndarray:
    """Of k extents (k, ..., 4) the first that is the smallest."""
    smallest = candidates[..., 3].argmin(axis=0)[None, ..., None]
    return np.take_along_axis(candidates, smallest, axis=0)[0]


def _candidates(part: Part, operands: Sequence[np.ndarray], placed: PlacedLiterals) -> Iterator[np.ndarray]:
    """Spheres (n, 4) around operators of formulas, given those of their operands."""
    yield around_boxes(part.boxes)
    if part.is_union:
        count = len(part.boxes)
        yield around(np.concatenate(operands), np.tile(np.arange(count), len(operands)), count)
    else:
        yield from operands
        for literals in in_one_frame(part):
            yield around_boxes(*local_boxes(literals, placed))


# --- the tree ---------------------------------------------------------------------------------------------------------


def of_things(packed: Packed) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of everything that a ray may hit, in scene order: its number in the flat scene, its code, and its extent."""
    flat, formulas = packed.flat, packed.formulas
    computed = of_formulas(formulas)[formulas.numbers]
    given = [flat.objects.extents[number] for number in formulas.numbers.tolist()]
    numbers = [np.flatnonzero(flat.sorts == OBJECT)[formulas.numbers]]
    codes = [np.arange(len(computed)) * 32 + OBJECT_KIND]
    extents = [_tighter(computed, given)]
    for one in packed.primitives:
        numbers.append(one.shapes)
        codes.append(np.arange(len(one.records)) * 32 + one.kind.number)
        extents.append(of_primitives(one.kind, one.records) + np.append(packed.origin, 0.0))
    order = np.argsort(np.concatenate(numbers), kind="stable")
    return np.concatenate(numbers)[order], np.concatenate(codes)[order], np.concatenate(extents)[order]


def _tighter(computed: np.ndarray, given: Sequence[Sphered]) -> np.ndarray:
    """The extents, those that users gave where they are the smaller."""
    extents = computed.copy()
    for row, one in zip(extents, given, strict=True):
        if isinstance(one, tuple) and one[1] < row[3]:
            row[:3], row[3] = one
    return extents


def of_groups(packed: Packed, numbers: np.ndarray, extents: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of every group, in preorder, the range (n, 2) of its things among `numbers`, and its extent (n, 4).

    A group's encloses those of the things and groups that are directly in it.
    """
    groups = packed.flat.groups
    ends = np.array([(group.first, group.end) for group in groups], np.intp).reshape(-1, 2)
    ranges = np.searchsorted(numbers, ends)
    owner_of_thing, owner, level = _owners(ranges, len(numbers))
    grouped = np.flatnonzero(owner_of_thing >= 0)
    found = np.tile(AROUND_NOTHING, (len(groups), 1))
    given = [group.extent for group in groups]
    for depth in range(level.max(initial=-1), -1, -1):
        here = np.flatnonzero(level == depth)
        inner = np.flatnonzero(level == depth + 1)
        things = grouped[level[owner_of_thing[grouped]] == depth]
        members = np.concatenate([extents[things], found[inner]])
        owners = np.searchsorted(here, np.concatenate([owner_of_thing[things], owner[inner]]))
        found[here] = _tighter(around(members, owners, len(here)), [given[group] for group in here.tolist()])
    return ranges, found


def _owners(ranges: np.ndarray, things: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The innermost group around each thing and around each group (-1: none), and how many are around a group.

    An empty group is around nothing, and at level 0.
    """
    owner_of_thing = np.full(things, -1)
    owner, level = np.full(len(ranges), -1), np.zeros(len(ranges), np.intp)
    for group, (first, end) in enumerate(ranges.tolist()):
        if first < end:
            owner[group] = owner_of_thing[first]
            level[group] = level[owner[group]] + 1 if owner[group] >= 0 else 0
            owner_of_thing[first:end] = group
    return owner_of_thing, owner, level


def of_polygons(packed: Packed, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As `of_groups`, of all polygons: one that became several triangles is a group of these."""
    flat, polygons = packed.flat, packed.flat.shapes.polygons
    own = np.flatnonzero(flat.sorts == POLYGON)
    ranges = np.column_stack([np.searchsorted(numbers, own, side) for side in ("left", "right")])
    points = np.column_stack([polygons.points, np.zeros(len(polygons.points))])
    return ranges, around(points, np.repeat(np.arange(len(own)), polygons.sizes), len(own))


def _useful_groups(packed: Packed, numbers: np.ndarray, extents: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """In preorder the ranges and extents of all groups, and of polygons of several triangles, that are worth a step."""
    flat_ranges, around_flat = of_polygons(packed, numbers)
    # What is around a polygon is tighter than what is around all that is around its triangles.
    whole = extents.copy()
    whole[packed.flat.sorts[numbers] == POLYGON] = np.repeat(around_flat, np.diff(flat_ranges)[:, 0], axis=0)
    ranges, around_groups = of_groups(packed, numbers, whole)
    several = flat_ranges[:, 1] - flat_ranges[:, 0] > 1
    ranges = np.concatenate([ranges, flat_ranges[several]])
    around_groups = np.concatenate([around_groups, around_flat[several]])
    useful = np.flatnonzero(np.isfinite(around_groups[:, 3]) & (ranges[:, 0] < ranges[:, 1]))
    order = useful[np.lexsort((-ranges[useful, 1], ranges[useful, 0]))]
    return ranges[order], around_groups[order]


def nodes(packed: Packed) -> np.ndarray:
    """The table "extent_nodes": things in scene order, each group that has an extent before what it holds."""
    numbers, codes, extents = of_things(packed)
    ranges, around_groups = _useful_groups(packed, numbers, extents)
    first, end = ranges.T
    # Before a thing stand the groups that begin at it or earlier; a group's place is after all that begin before it.
    at_thing = np.arange(len(codes)) + np.searchsorted(first, np.arange(len(codes)), side="right")
    at_group = first + np.arange(len(first))
    records = np.zeros(len(codes) + len(first), record_dtype("ExtentNode"))
    records["code"][at_thing], records["code"][at_group] = codes, GROUP
    records["skip"][at_thing], records["skip"][at_group] = at_thing + 1, end + np.searchsorted(first, end)
    every = np.empty((len(records), 4))
    every[at_thing], every[at_group] = extents, around_groups
    every[:, :3] -= packed.origin
    records["centre"], records["radius"] = _widened(every, packed.scene.camera.eye - packed.origin)
    return records


def _widened(extents: np.ndarray, eye: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centres and radii, in the coordinates of the memory, for float32; a negative radius: there is no extent.

    Rounded numbers, and surfaces that were merged, may be away from where they were by `SLACK` of the scene's size,
    which is at most twice the largest coordinate.
    """
    bounded = np.isfinite(extents[:, 3])
    reach = np.abs(extents[bounded, :3]) + extents[bounded, 3:]
    slack = 2.0 * SLACK * max(reach.max(initial=0.0), np.abs(eye).max())
    centre = np.where(bounded[:, None], extents[:, :3], 0.0)
    return centre, np.where(bounded, extents[:, 3] * (1.0 + SLACK) + slack, -1.0)


def unbounded(packed: Packed) -> Iterator[Diagnostic]:
    """What is wrong where users want the extent of something to be computed that has no bounds."""
    flat, objects = packed.flat, packed.flat.objects
    if "auto" not in objects.extents and not any(group.extent == "auto" for group in flat.groups):
        return
    numbers, _codes, extents = of_things(packed)
    things = dict(zip(numbers.tolist(), extents[:, 3].tolist(), strict=True))
    of_objects = [things.get(place, -inf) for place in np.flatnonzero(flat.sorts == OBJECT).tolist()]
    around_groups = of_groups(packed, numbers, extents)[1][:, 3].tolist()
    bounded = [
        *zip(["object"] * len(objects), objects.extents, objects.places, objects.paths, of_objects, strict=True),
        *(
            ("group", one.extent, one.place, one.path, radius)
            for one, radius in zip(flat.groups, around_groups, strict=True)
        ),
    ]
    for noun, extent, place, path, radius in bounded:
        if extent == "auto" and radius == inf:
            message = f"{dotted((*path, 'extent'))}: this {noun} has no bounds, so it can have no extent"
            yield Diagnostic(message, place, "something that has bounds", f"an unbounded {noun}")
