"""A scene of any bounded things as triangles alone: for the scanline method, and for files of meshes.

Curved surfaces become patches with exact normals at their corners. Chords lie within a tolerance of them, by default
`TOLERANCE` of the scene's size.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.scene.csg import PLANE
from tasuki.scene.flatten import Flat, flatten
from tasuki.scene.formula import normalised
from tasuki.scene.model import Scene
from tasuki.scene.objects import Formulas
from tasuki.scene.shapes import POLYGON, Cones, Polygons, Shapes, Spheres
from tasuki.scene.solid_mesh import SolidMesh, Tessellator, segments_of
from tasuki.scene.surfaces import Merged

TOLERANCE = 1.0 / 4096.0


def tessellated(scene: Scene, tolerance: float = TOLERANCE) -> Scene:
    """The scene with triangles and quadrilaterals in the place of all that is no polygon.

    `tolerance` is a share of the scene's size. SceneError where an object has no bounds, or is of a kind that has no
    triangles, and where the package manifold3d is needed and absent.
    """
    if not scene.shapes.nodes and not len(scene.shapes.spheres) and not len(scene.shapes.cones):
        return scene
    flat = flatten(scene)
    formulas = Formulas(flat.objects, flat.materials, flat.frames)
    shapes = flat.shapes
    size = _size(flat, formulas.boxes)
    chord = tolerance * size
    made = [_spheres(shapes.spheres, chord), _cones(shapes.cones, chord), *_objects(flat, formulas, chord, size)]
    # Patches show both sides unless they are told; what was a solid shows the sides that it had.
    sided = [replace(material, two_sided=material.shows_both_sides()) for material in flat.materials]
    made = [replace(part, material=part.material + len(sided)) for part in made]
    polygons = Polygons.joined([shapes.polygons, *made])
    # Set operations leave slivers that are lines.
    polygons = polygons.take(np.flatnonzero(~polygons.degenerate))
    sorts, nothing = np.full(len(polygons), POLYGON, np.uint8), Shapes.of([])
    flat_shapes = Shapes((*flat.materials, *sided), sorts, nothing.spheres, nothing.cones, polygons, shapes.file)
    return Scene(scene.camera, flat_shapes, scene.lights, scene.background, scene.warnings)


def _size(flat: Flat, boxes: np.ndarray) -> float:
    """The longest side of the box around all that is bounded."""
    spheres, cones, polygons = flat.shapes.spheres, flat.shapes.cones, flat.shapes.polygons
    reach = np.abs(spheres.radius)[:, None]
    points = [spheres.centre - reach, spheres.centre + reach, cones.base, cones.apex, polygons.points]
    every = np.concatenate([*points, *np.split(boxes, 2, axis=1)])
    every = every[np.isfinite(every).all(axis=1)]
    return float(np.ptp(every, axis=0).max()) if len(every) else 1.0


# --- spheres and open cones -------------------------------------------------------------------------------------------


def _spheres(spheres: Spheres, chord: float) -> Polygons:
    """Quadrilaterals between circles of latitude; of a sphere seen from inside, turned inwards."""
    parts = []
    segments = np.array([segments_of(abs(radius), chord) for radius in spheres.radius], np.int64)
    for count in np.unique(segments):
        mine = spheres.take(np.flatnonzero(segments == count))
        corners = _unit_sphere(int(count))
        normals = corners[None] * np.sign(mine.radius)[:, None, None, None]
        points = mine.centre[:, None, None] + np.abs(mine.radius)[:, None, None, None] * corners[None]
        parts.append(_patches(_facing(points, normals), mine.material, mine.line, mine.frame))
    return Polygons.joined(parts) if parts else _no_polygons()


def _unit_sphere(segments: int) -> np.ndarray:
    """Corners (n, 4, 3) of the unit sphere's faces; at the poles two of them coincide."""
    longitude = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    latitude = np.linspace(-np.pi / 2.0, np.pi / 2.0, segments // 2 + 1)
    across, along = np.meshgrid(longitude, latitude)
    points = np.stack([np.cos(along) * np.cos(across), np.cos(along) * np.sin(across), np.sin(along)], axis=2)
    points[:, -1], points[0], points[-1] = points[:, 0], (0.0, 0.0, -1.0), (0.0, 0.0, 1.0)
    quads = [points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]]
    return np.stack(quads, axis=2).reshape(-1, 4, 3)


def _cones(cones: Cones, chord: float) -> Polygons:
    """Quadrilaterals along open cones and cylinders."""
    parts = []
    widest = np.maximum(np.abs(cones.base_radius), np.abs(cones.apex_radius))
    segments = np.array([segments_of(radius, chord) for radius in widest], np.int64)
    for count in np.unique(segments):
        mine = cones.take(np.flatnonzero(segments == count))
        points, normals = _cone_faces(mine, int(count))
        parts.append(_patches(_facing(points, normals), mine.material, mine.line, mine.frame))
    return Polygons.joined(parts) if parts else _no_polygons()


def _cone_faces(cones: Cones, segments: int) -> tuple[np.ndarray, np.ndarray]:
    """Corners and normals, both (n, segments, 4, 3)."""
    along = cones.apex - cones.base
    length = np.linalg.norm(along, axis=1, keepdims=True)
    axis = along / length
    least = np.eye(3)[np.abs(axis).argmin(axis=1)]
    first = np.cross(axis, least)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(axis, first)
    angle = np.append(np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False), 0.0)[None, :, None]
    out = np.cos(angle) * first[:, None] + np.sin(angle) * second[:, None]
    base_radius, apex_radius = np.abs(cones.base_radius), np.abs(cones.apex_radius)
    low = cones.base[:, None] + base_radius[:, None, None] * out
    high = cones.apex[:, None] + apex_radius[:, None, None] * out
    slope = ((base_radius - apex_radius)[:, None] / length)[:, None]
    inward = (cones.base_radius < 0.0) | (cones.apex_radius < 0.0)
    normal = np.where(inward, -1.0, 1.0)[:, None, None] * (out + slope * axis[:, None])
    points = np.stack([low[:, :-1], low[:, 1:], high[:, 1:], high[:, :-1]], axis=2)
    normals = np.stack([normal[:, :-1], normal[:, 1:], normal[:, 1:], normal[:, :-1]], axis=2)
    return points, normals


def _facing(points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quadrilaterals (n, k, 4, 3) that turn counterclockwise about their normals."""
    turns = np.cross(points[:, :, 2] - points[:, :, 0], points[:, :, 3] - points[:, :, 1])
    wrong = np.einsum("nki,nki->nk", turns, normals.sum(axis=2)) < 0.0
    points[wrong], normals[wrong] = points[wrong][:, ::-1], normals[wrong][:, ::-1]
    return points, normals


def _patches(
    faces: tuple[np.ndarray, np.ndarray], material: np.ndarray, line: np.ndarray, frame: np.ndarray
) -> Polygons:
    """Faces (n, k, corners, 3) of n shapes as patches; those that two equal corners make triangles, as such."""
    points, normals = faces
    count, corners = points.shape[1:3]
    points, normals = points.reshape(-1, corners, 3), normals.reshape(-1, corners, 3)
    kept = (points != np.roll(points, -1, axis=1)).any(axis=2)
    sizes = kept.sum(axis=1)
    return Polygons(
        np.repeat(material, count),
        np.repeat(line, count),
        points[kept],
        normals[kept],
        np.concatenate(([0], np.cumsum(sizes))).astype(np.intp),
        np.ones(len(points), bool),
        frame=np.repeat(frame, count),
    )


def _no_polygons() -> Polygons:
    return Shapes.of([]).polygons


# --- objects ----------------------------------------------------------------------------------------------------------


def _objects(flat: Flat, formulas: Formulas, chord: float, size: float) -> list[Polygons]:
    if not len(formulas.numbers):
        return []
    try:
        import manifold3d  # noqa: F401
    except ImportError:
        hint = "pip install 'tasuki[meshes]'"
        message = "set operations become triangles by the package manifold3d, which is absent"
        raise SceneError(str(Diagnostic(message, hint=hint))) from None
    merged = formulas.merged(size)
    objects, found = formulas.objects, []
    for box, row in zip(formulas.around, formulas.rows.tolist(), strict=True):
        tessellator = _tessellator(formulas, merged, int(objects.starts[row]), chord)
        place = objects.places[row]
        meshes = tessellator.meshes(normalised(objects.forms[objects.form[row]]), box, place)
        materials, line = objects.literals.material[objects.starts[row] :], place.line if place else 0
        found += [_of_literal(mesh, int(materials[mesh.literal.number]), line) for mesh in meshes]
    return found


def _tessellator(formulas: Formulas, merged: Mapping[str, Merged], first: int, chord: float) -> Tessellator:
    """For the object whose literals begin with the one in row `first`."""
    return Tessellator(
        chord,
        lambda literal: formulas.placing.canonical(merged, first + literal.number),
        lambda literal: formulas.objects.literals.place(first + literal.number),
    )


def _of_literal(mesh: SolidMesh, material: int, line: int) -> Polygons:
    count = len(mesh.corners)
    curved = mesh.literal.kind != PLANE
    return Polygons(
        np.full(count, material, np.int32),
        np.full(count, line, np.int64),
        mesh.corners.reshape(-1, 3),
        mesh.normals.reshape(-1, 3),
        np.arange(0, 3 * count + 1, 3, dtype=np.intp),
        np.full(count, curved, bool),
    )
