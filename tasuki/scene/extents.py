"""Spherical extents of things, objects and groups (paper, section 6), and the tree of them as modules walk through it.

An extent is a row (x, y, z, radius) in the scene's coordinates, float64; of infinite radius where there are no bounds,
of radius -inf around nothing. One that a user gives is believed; any other is computed, from the literals up: a union's
encloses its operands', an intersection has the tightest of its operands', a complement has none (unless it is that of a
surface inside out).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import inf, sqrt
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from tasuki.diagnostics import Diagnostic
from tasuki.scene.bounds import EMPTY, FLAT, Box, is_bounded
from tasuki.scene.csg import QUADRIC, Leaf, negated
from tasuki.scene.flatten import OBJECT, FlatGroup, FlatObject, Sphered
from tasuki.scene.formula import LeafBoxes, Part, in_one_frame, local_box, parents_last
from tasuki.scene.kinds import OBJECT as OBJECT_KIND
from tasuki.scene.kinds import PrimitiveKind, record_dtype
from tasuki.scene.objects import SLACK
from tasuki.scene.objects import local_box as box_of_primitive
from tasuki.scene.problem import dotted
from tasuki.scene.shapes import POLYGON
from tasuki.scene.surfaces import completed

if TYPE_CHECKING:
    from tasuki.scene.pack import Packed

Extent: TypeAlias = tuple[float, float, float, float]

NONE: Extent = (0.0, 0.0, 0.0, inf)
AROUND_NOTHING: Extent = (0.0, 0.0, 0.0, -inf)
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


def around_box(box: Box, matrix: np.ndarray | None = None) -> Extent:
    """The sphere around a box, half its diagonal; or around what an affine `matrix` (4, 4) makes of it."""
    if box == EMPTY or not is_bounded(box):
        return AROUND_NOTHING if box == EMPTY else NONE
    low, high = np.array(box[:3]), np.array(box[3:])
    middle, half = (low + high) / 2.0, (high - low) / 2.0
    if matrix is None:
        x, y, z = middle.tolist()
        return x, y, z, sqrt(float(half @ half))
    x, y, z = (matrix[:3, :3] @ middle + matrix[:3, 3]).tolist()
    return x, y, z, float(np.linalg.norm((matrix[:3, :3] * half) @ DIAGONALS, axis=0).max())


def around_points(points: np.ndarray) -> np.ndarray:
    """Spheres (n, 4) around points (n, k, 3), about the middles of the boxes around them."""
    middle = (points.min(axis=1) + points.max(axis=1)) / 2.0
    radius = np.linalg.norm(points - middle[:, None], axis=2).max(axis=1)
    return np.column_stack([middle, radius])


def around_quadrics(leaves: Sequence[Leaf]) -> np.ndarray:
    """The extents (n, 4) of quadric literals: of ellipsoids their largest axis, wherever matrices bring it.

    An ellipsoid is where Q is positive definite; its radius is the root of constant over least eigenvalue.
    """
    extents = np.tile(np.array(NONE), (len(leaves), 1))
    if not leaves:
        return extents
    values = np.array([leaf.values for leaf in leaves], np.float64)
    inverted = [leaf.inverted for leaf in leaves]
    values[inverted] = negated(values[inverted])
    matrices = np.array([leaf.matrix for leaf in leaves])
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
    return np.array([around_box(box_of_primitive(kind, record)) for record in records]).reshape(-1, 4)


# --- objects ----------------------------------------------------------------------------------------------------------


def of_formulas(roots: Sequence[Part], leaf_boxes: LeafBoxes) -> np.ndarray:
    """The extents (n, 4) of formulas with boxes (`formula.with_boxes`)."""
    parts = [parents_last(root) for root in roots]
    quadrics = [part.leaf for row in parts for part in row if part.leaf and part.leaf.kind == QUADRIC]
    ellipsoids = dict(zip(map(id, quadrics), map(tuple, around_quadrics(quadrics).tolist()), strict=True))
    extents = []
    for row in parts:
        found: dict[int, Extent] = {}
        for part in row:
            operands = [found.pop(id(one)) for one in part.parts]
            candidates = _candidates(part, operands, ellipsoids, leaf_boxes)
            found[id(part)] = min(candidates, key=lambda extent: extent[3])
        extents.append(found[id(row[-1])])
    return np.array(extents, np.float64).reshape(-1, 4)


def _candidates(
    part: Part, operands: Sequence[Extent], ellipsoids: Mapping[int, Extent], leaf_boxes: LeafBoxes
) -> Iterator[Extent]:
    """Spheres around a part of a formula, given those of its operands."""
    yield around_box(part.box)
    if part.leaf:
        yield ellipsoids.get(id(part.leaf)) or around_box(leaf_boxes(part.leaf)[2], part.leaf.matrix)
    elif part.is_union:
        x, y, z, radius = around(np.array(operands), np.zeros(len(operands), np.intp), 1)[0].tolist()
        yield x, y, z, radius
    else:
        yield from operands
        for leaves in in_one_frame(part):
            yield around_box(*local_box(leaves, leaf_boxes))


# --- the tree ---------------------------------------------------------------------------------------------------------


def of_things(packed: Packed) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of everything that a ray may hit, in scene order: its number in the flat scene, its code, and its extent."""
    flat, formulas = packed.flat, packed.formulas
    computed = of_formulas(formulas.roots, formulas.placing.boxes)
    given = [flat.objects[number].extent for number in formulas.numbers.tolist()]
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
    found = np.tile(np.array(AROUND_NOTHING), (len(groups), 1))
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
    flat = packed.flat
    bounded: list[FlatObject | FlatGroup] = [*flat.objects, *flat.groups]
    if not any(one.extent == "auto" for one in bounded):
        return
    numbers, _codes, extents = of_things(packed)
    things = dict(zip(numbers.tolist(), extents[:, 3].tolist(), strict=True))
    places = np.flatnonzero(flat.sorts == OBJECT).tolist()
    radii = [things.get(place, -inf) for place in places] + of_groups(packed, numbers, extents)[1][:, 3].tolist()
    for one, radius in zip(bounded, radii, strict=True):
        if one.extent == "auto" and radius == inf:
            noun = "object" if isinstance(one, FlatObject) else "group"
            message = f"{dotted((*one.path, 'extent'))}: this {noun} has no bounds, so it can have no extent"
            yield Diagnostic(message, one.place, "something that has bounds", f"an unbounded {noun}")
