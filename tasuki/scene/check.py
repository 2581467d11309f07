"""What must hold of a scene whatever it came from, and what is put right with a warning.

Importers translate the path of a `Problem` into a place of their file; without a file it is shown as it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from tasuki.scene.model import Camera, Material, Scene
from tasuki.scene.shapes import CONE, POLYGON, SPHERE, Shapes

LEAST_AREA = 1e-10
"""Area of a polygon, in units of its outline's length squared, below which it is a line: what rounding alone leaves."""

MOST_WARNINGS = 5
"""How many degenerate polygons are named one by one."""


@dataclass(frozen=True)
class Problem:
    """One fault. `path` leads to it from the scene: ("shapes", 3, "radius"), ("camera", "up")."""

    path: tuple[str | int, ...]
    message: str
    expected: str
    found: str

    @property
    def dotted(self) -> str:
        """The path as people write it: shapes[3].radius."""
        return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in self.path).lstrip(".")


def problems(scene: Scene) -> list[Problem]:
    """Everything that keeps `scene` from being drawn, camera first, then materials, lights and shapes in order."""
    found = [*_camera(scene.camera), *_colour(("background",), scene.background)]
    for number, material in enumerate(scene.materials):
        found += _material(("materials", number), material)
    for number, light in enumerate(scene.lights):
        found += _finite(("lights", number, "position"), light.position)
        if light.colour is not None:
            found += _colour(("lights", number, "colour"), light.colour)
    return found + sorted(_shapes(scene.shapes), key=lambda problem: problem.path[1])


def without_degenerate(scene: Scene) -> Scene:
    """The scene without its polygons of no area, each of which leaves a warning."""
    polygons = scene.shapes.polygons
    areas = np.linalg.norm(polygons.area_vectors, axis=1) / 2.0
    kept = areas > LEAST_AREA * polygons.perimeters**2
    if kept.all():
        return scene
    dropped = np.flatnonzero(~kept)
    warnings = [
        f"{scene.shapes.place(POLYGON, position) or f'polygon {position}'}: warning: "
        f"this polygon has no area; it is left out"
        for position in dropped[:MOST_WARNINGS]
    ]
    if len(dropped) > MOST_WARNINGS:
        warnings.append(f"warning: {len(dropped) - MOST_WARNINGS} more polygons have no area; they are left out")
    shapes = scene.shapes.keep_polygons(kept)
    return Scene(scene.camera, shapes, scene.lights, scene.background, scene.warnings + warnings)


def with_advice(scene: Scene) -> Scene:
    """The scene, with a warning for each thing that is legal but leaves the picture dark or empty."""
    advice = []
    if not scene.lights:
        advice.append("warning: the scene has no light: only the background will show")
    if not len(scene.shapes):
        advice.append("warning: the scene has no shapes: only the background will show")
    return Scene(scene.camera, scene.shapes, scene.lights, scene.background, scene.warnings + advice)


def with_sides(scene: Scene, two_sided: bool | None) -> Scene:
    """The scene with every material one-sided or two-sided, where `two_sided` says so."""
    if two_sided is None:
        return scene
    shapes = scene.shapes.of_materials([replace(material, two_sided=two_sided) for material in scene.materials])
    return Scene(scene.camera, shapes, scene.lights, scene.background, scene.warnings)


def _camera(camera: Camera) -> Iterator[Problem]:
    fields = {"eye": camera.eye, "at": camera.at, "up": camera.up, "angle": (camera.angle,), "hither": (camera.hither,)}
    not_finite = [problem for name, value in fields.items() for problem in _finite(("camera", name), value)]
    yield from not_finite
    if not not_finite:
        yield from _directions(camera)
    if not 0.0 < camera.angle < 180.0:
        yield Problem(("camera", "angle"), "no such field of view", "0 < angle < 180 degrees", _number(camera.angle))
    if camera.hither < 0.0:
        yield Problem(("camera", "hither"), "the front plane is behind the eye", "0 or more", _number(camera.hither))
    if min(camera.resolution) < 1:
        found = " ".join(map(str, camera.resolution))
        yield Problem(("camera", "resolution"), "the picture has no pixels", "at least 1 pixel each way", found)


def _directions(camera: Camera) -> Iterator[Problem]:
    eye, at, up = (np.array(vector, np.float64) for vector in (camera.eye, camera.at, camera.up))
    forward = at - eye
    if not forward.any():
        expected = "a point other than where the eye is"
        yield Problem(("camera", "at"), "the eye looks at itself", expected, _point(camera.at))
    if not up.any():
        yield Problem(("camera", "up"), "the up vector has no direction", "a vector other than zero", _point(camera.up))
    if forward.any() and up.any():
        forward, up = forward / np.abs(forward).max(), up / np.abs(up).max()
        sine = np.linalg.norm(np.cross(forward, up)) / (np.linalg.norm(forward) * np.linalg.norm(up))
        # Below this the direction to the right is rounding error in float32.
        if sine < 1e-6:
            expected = "a vector at an angle to the view"
            yield Problem(("camera", "up"), "the eye looks along the up vector", expected, _point(camera.up))


def _material(path: tuple[str | int, ...], material: Material) -> Iterator[Problem]:
    yield from _colour((*path, "colour"), material.colour)
    yield from _colour((*path, "transmittance"), material.transmittance)
    for name in ("ambient", "diffuse", "specular", "exponent", "reflection", "transmission"):
        value = getattr(material, name)
        if value is not None and not 0.0 <= value < math.inf:
            yield Problem((*path, name), f"no such value for {name!r}", "a number, 0 or more", _number(value))
    if not 0.0 < material.index < math.inf:
        message = "no such refractive index"
        yield Problem((*path, "index"), message, "a number greater than 0", _number(material.index))


def _colour(path: tuple[str | int, ...], colour: Iterable[float]) -> Iterator[Problem]:
    for step, value in enumerate(colour):
        if not 0.0 <= value < math.inf:
            yield Problem((*path, step), "no such brightness", "a number, 0 or more", _number(value))


def _finite(path: tuple[str | int, ...], values: Iterable[float]) -> Iterator[Problem]:
    for step, value in enumerate(values):
        if not math.isfinite(value):
            yield Problem((*path, step), "this is not a finite number", "a finite number", _number(value))


def _shapes(shapes: Shapes) -> Iterator[Problem]:
    orders = [np.flatnonzero(shapes.sorts == sort) for sort in (SPHERE, CONE, POLYGON)]

    def where(sort: int, bad: np.ndarray) -> Iterator[tuple[int, int]]:
        return ((int(position), int(orders[sort][position])) for position in np.flatnonzero(bad))

    spheres, cones, polygons = shapes.spheres, shapes.cones, shapes.polygons
    finite_polygon = np.ones(len(polygons), bool)
    owner = np.repeat(np.arange(len(polygons)), polygons.sizes)
    finite_polygon[owner[_not_finite(polygons.points, polygons.normals)]] = False
    sorted_by_batch = [
        (SPHERE, _not_finite(spheres.centre, spheres.radius)),
        (CONE, _not_finite(cones.base, cones.base_radius, cones.apex, cones.apex_radius)),
        (POLYGON, ~finite_polygon),
    ]
    for sort, bad in sorted_by_batch:
        for _, order in where(sort, bad):
            yield Problem(("shapes", order), "not all of its numbers are finite", "finite numbers", "NaN or infinity")
    for _, order in where(SPHERE, spheres.radius == 0.0):
        path = ("shapes", order, "radius")
        yield Problem(path, "this sphere has no size", "a radius other than 0", "0")
    first, second = cones.base_radius, cones.apex_radius
    for position, order in where(CONE, (first == 0.0) & (second == 0.0) | (first * second < 0.0)):
        found = f"{_number(first[position])} and {_number(second[position])}"
        expected = "two radii of one sign, not both 0"
        yield Problem(("shapes", order, "base_radius"), "this cone has no such surface", expected, found)
    for position, order in where(CONE, (cones.base == cones.apex).all(axis=1)):
        found = _point(cones.apex[position])
        expected = "a point other than the base"
        yield Problem(("shapes", order, "apex"), "the base and the apex of this cone coincide", expected, found)


def _not_finite(*arrays: np.ndarray) -> np.ndarray:
    """Which rows hold a number that is not finite."""
    bad = [~np.isfinite(array) for array in arrays]
    return np.logical_or.reduce([rows.any(axis=1) if rows.ndim > 1 else rows for rows in bad])


def _number(value: float) -> str:
    return f"{value:.9g}"


def _point(values: Iterable[float]) -> str:
    return " ".join(map(_number, values))
