"""The scene tree becomes flat: shapes in batches, and objects as formulas of literals, all in the scene's coordinates.

`tasuki.scene.walk` finds what stands where. Here the batches are moved; `tasuki.scene.flat_objects` makes the objects.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tasuki.diagnostics import Diagnostic, Span
from tasuki.scene.collector import collector_paused
from tasuki.scene.csg import FlatObjects, Sphered
from tasuki.scene.flat_objects import flat_objects
from tasuki.scene.material import Material
from tasuki.scene.model import Scene
from tasuki.scene.problem import Path
from tasuki.scene.shapes import (
    CONE,
    NO_FRAME,
    NODE,
    POLYGON,
    SPHERE,
    Batch,
    Cones,
    Polygons,
    Shapes,
    Spheres,
    batch_of,
    file_of,
    positions_of,
    surface_sort,
)
from tasuki.scene.source import scene_error
from tasuki.scene.transforms import IDENTITY
from tasuki.scene.tree import Extent, Node
from tasuki.scene.walk import Join, Placed, Run, Use, Walk

OBJECT = NODE
"""The sort of an object: no other nodes are left in a flat scene."""


@dataclass(frozen=True, eq=False, slots=True)
class FlatGroup:
    """The things of the scene with the numbers `first` to `end` belong together; `place` and `path` lead to the group's
    node.
    """

    first: int
    end: int
    extent: Sphered
    place: Span | None
    path: Path


@dataclass(frozen=True, eq=False)
class Flat:
    """A scene without its tree, in float64.

    Things are numbered in scene order: the i-th is of sort `sorts[i]`, SPHERE, CONE, POLYGON or OBJECT, and stands at
    `positions[i]` of its batch in `shapes`, or of `objects`. `frames` (k, 4, 4) place local coordinates in the scene's;
    `frame` of a batch, or of literals, is an index into them. Every `material` is an index into `materials`.
    """

    materials: tuple[Material, ...]
    shapes: Shapes
    objects: FlatObjects
    sorts: np.ndarray
    positions: np.ndarray
    groups: list[FlatGroup]
    frames: np.ndarray

    def __len__(self) -> int:
        return len(self.sorts)

    def place(self, number: int) -> Span | None:
        """Where a thing stands in its file."""
        sort, position = int(self.sorts[number]), int(self.positions[number])
        return self.objects.places[position] if sort == OBJECT else self.shapes.place(sort, position)


def flatten(scene: Scene, walk: Walk | None = None) -> Flat:
    """`scene` without its tree. Polygons without area are left out.

    The scene must have none of the `problems` that `tasuki.scene.check` finds; `walk` is the one on which it sought
    them. Without it SceneError where transforms, taken together, are singular, or stretch what cannot be stretched.
    """
    if not scene.shapes.nodes and not scene.shapes.polygons.degenerate.any():
        return _already_flat(scene.shapes)
    with collector_paused():
        return _flat(walk or _walk(scene.shapes), scene.shapes.file)


def _walk(shapes: Shapes) -> Walk:
    walk = Walk(shapes)
    found = list(walk.problems())
    if found:
        diagnostics = (Diagnostic(f"{one.dotted}: {one.message}", None, one.expected, one.found) for one in found)
        raise scene_error(diagnostics)
    return walk


def _already_flat(shapes: Shapes) -> Flat:
    nothing = flat_objects([], [], 0)
    return Flat(shapes.materials, shapes, nothing, shapes.sorts, shapes.positions, [], np.zeros((0, 4, 4)))


def _flat(walk: Walk, file: str | None) -> Flat:
    spheres, sphere_numbers = _batch(walk, SPHERE)
    cones, cone_numbers = _batch(walk, CONE)
    polygons, polygon_numbers = _batch(walk, POLYGON)
    polygons = _moved_polygons(polygons, walk.frames)
    kept = ~polygons.degenerate
    objects = sorted((*walk.objects, *_stretched_spheres(walk)), key=lambda placed: placed.number)
    sorts = np.full(walk.count, OBJECT, np.uint8)
    for sort, numbers in ((SPHERE, sphere_numbers), (CONE, cone_numbers), (POLYGON, polygon_numbers)):
        sorts[numbers] = sort
    remain = np.ones(walk.count, bool)
    remain[polygon_numbers[~kept]] = False
    sorts = sorts[remain]
    shapes = Shapes(
        walk.materials,
        sorts[sorts != OBJECT],
        _moved_spheres(spheres, walk),
        _moved_cones(cones, walk),
        polygons.take(np.flatnonzero(kept)),
        file or file_of(placed.node for placed in walk.surfaces),
    )
    found, frames = _objects(objects, walk)
    return Flat(walk.materials, shapes, found, sorts, positions_of(sorts), _groups(walk, remain), frames)


# Batches


def _batch(walk: Walk, sort: int) -> tuple[Any, np.ndarray]:
    """All shapes of one sort in scene order, in local coordinates, and their numbers; no spheres that are stretched."""
    singles = [
        placed
        for placed in walk.surfaces
        if surface_sort(placed.node) == sort and not (sort == SPHERE and walk.is_stretched(placed.frame))
    ]
    single = batch_of(sort, [placed.node for placed in singles], [placed.material for placed in singles])
    frames = np.array([placed.frame for placed in singles], np.int32)
    batches: list[Batch] = [replace(single, frame=frames)]
    numbers = [np.array([placed.number for placed in singles], np.intp)]
    for run in walk.runs:
        if sort == SPHERE and walk.is_stretched(run.frame):
            continue
        members = _members(run, sort)
        batch = run.shapes.batch(sort).take(run.shapes.positions[members])
        frame = np.full(len(batch), run.frame, np.int32)
        batches.append(replace(batch, material=run.materials[batch.material], frame=frame))
        numbers.append(run.number + members - run.first)
    together = np.concatenate(numbers)
    order = np.argsort(together, kind="stable")
    return type(single).joined(batches).take(order), together[order]


def _members(run: Run, sort: int) -> np.ndarray:
    """Where in its `Shapes` the entries of one sort of a run stand."""
    return run.first + np.flatnonzero(run.shapes.sorts[run.first : run.end] == sort)


def _stretched_spheres(walk: Walk) -> Iterator[Placed]:
    """Spheres that are none in the scene, each as an object."""
    for placed in walk.surfaces:
        if surface_sort(placed.node) == SPHERE and walk.is_stretched(placed.frame):
            yield placed._replace(tokens=[Use(placed.node, placed.frame, placed.material, False)])
    for run in walk.runs:
        if walk.is_stretched(run.frame):
            for position in _members(run, SPHERE).tolist():
                node = run.shapes[position]
                material = int(run.materials[run.shapes.spheres.material[run.shapes.positions[position]]])
                tokens: list[Use | Join] = [Use(node, run.frame, material, False)]
                number, path = run.number + position - run.first, (*run.path, position)
                yield Placed(node, run.frame, material, number, path, tokens)


def _moved_spheres(spheres: Spheres, walk: Walk) -> Spheres:
    centre = _moved(spheres.centre, spheres.frame, walk.frames)
    return replace(spheres, centre=centre, radius=spheres.radius * _scales(spheres.frame, walk.frames))


def _moved_cones(cones: Cones, walk: Walk) -> Cones:
    base, apex = (_moved(points, cones.frame, walk.frames) for points in (cones.base, cones.apex))
    scales = _scales(cones.frame, walk.frames)
    radii = {"base_radius": cones.base_radius * scales, "apex_radius": cones.apex_radius * scales}
    return replace(cones, base=base, apex=apex, **radii)


def _moved_polygons(polygons: Polygons, frames: np.ndarray) -> Polygons:
    """Polygons in the scene; where a frame mirrors, their points run the other way round, so that the front stays."""
    frame = np.repeat(polygons.frame, polygons.sizes)
    points = _moved(polygons.points, frame, frames)
    # Normals follow the inverse transposed; its multiple by the determinant does as well, and takes no division.
    linear = frames[:, :3, :3]
    a, b, c = (linear[:, :, axis] for axis in range(3))
    # What leaves float64 here is found when primitives are verified.
    with np.errstate(over="ignore", invalid="ignore"):
        cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=2)
        mirrors = np.einsum("ki,ki->k", a, cofactors[:, :, 0]) < 0.0
    cofactors[mirrors] *= -1.0
    normals = _times(cofactors, polygons.normals, frame)
    turned = replace(polygons, points=points, normals=normals)
    mirrored = (polygons.frame != NO_FRAME) & np.append(mirrors, False)[polygons.frame]
    if not mirrored.any():
        return turned
    last, first = polygons.starts[1:] - 1, polygons.starts[:-1]
    within = np.arange(len(points))
    order = np.where(np.repeat(mirrored, polygons.sizes), np.repeat(first + last, polygons.sizes) - within, within)
    return replace(turned, points=points[order], normals=normals[order])


def _moved(points: np.ndarray, frame: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """`points` (n, 3), each placed by its frame in the scene."""
    moved = _times(frames[:, :3, :3], points, frame)
    inside = frame != NO_FRAME
    moved[inside] += frames[frame[inside], :3, 3]
    return moved


def _times(matrices: np.ndarray, vectors: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Each of `vectors` (n, 3) times the matrix (k, 3, 3) of its frame."""
    product = vectors.copy()
    inside = frame != NO_FRAME
    product[inside] = np.einsum("nij,nj->ni", matrices[frame[inside]], vectors[inside])
    return product


def _scales(frame: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """By how much a similarity stretches, (n,): the cube root of the volume of a unit cube."""
    with np.errstate(over="ignore"):
        factors = np.cbrt(np.abs(np.linalg.det(frames[:, :3, :3])))
    return np.append(factors, 1.0)[frame]


# Objects and groups


def _objects(objects: Sequence[Placed], walk: Walk) -> tuple[FlatObjects, np.ndarray]:
    """The objects, and the frames with that of the scene's own coordinates, if any of their solids needs it."""
    extents = _extents([(placed.node, placed.frame) for placed in objects], walk.frames)
    found = flat_objects(objects, extents, len(walk.frames))
    if len(found) and found.literals.frame.max() == len(walk.frames):
        return found, np.concatenate([walk.frames, IDENTITY.matrix[None]])
    return found, walk.frames


def _groups(walk: Walk, remain: np.ndarray) -> list[FlatGroup]:
    """The groups, their ranges without the things that do not `remain`."""
    before = np.concatenate(([0], np.cumsum(remain))).tolist()
    extents = _extents([(gathered.group, gathered.frame) for gathered in walk.groups], walk.frames)
    return [
        FlatGroup(before[gathered.first], before[gathered.end], extent, gathered.group.place, gathered.path)
        for gathered, extent in zip(walk.groups, extents, strict=True)
    ]


def _extents(nodes: Sequence[tuple[Node, int]], frames: np.ndarray) -> list[Sphered]:
    """The extents of nodes with their frames. A sphere becomes one that holds what it is stretched to."""
    extents: list[Any] = [getattr(node, "extent", None) for node, _ in nodes]
    given = [number for number, extent in enumerate(extents) if isinstance(extent, Extent)]
    frame = np.array([nodes[number][1] for number in given], np.intp)
    centres = np.array([extents[number].centre for number in given], np.float64).reshape(-1, 3)
    moved = _moved(centres, frame, frames)
    stretch = np.append(np.linalg.norm(frames[:, :3, :3], ord=2, axis=(1, 2)), 1.0)[frame].tolist()
    for number, centre, factor in zip(given, moved.tolist(), stretch, strict=True):
        extents[number] = (tuple(centre), extents[number].radius * factor)
    return extents
