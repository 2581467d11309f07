"""What must hold of a scene whatever it came from, and what is put right with a warning.

Importers translate the path of a `Problem` into a place of their file; without a file it is shown as it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from tasuki.scene import textures
from tasuki.scene.collector import collector_paused
from tasuki.scene.material import Material
from tasuki.scene.mesh import Mesh
from tasuki.scene.model import Camera, DirectionalLight, Light, Scene
from tasuki.scene.problem import Path, Problem, dotted, number, point
from tasuki.scene.shape_check import Census, shape_problems
from tasuki.scene.shapes import POLYGON, Shapes, batch_of
from tasuki.scene.solids import Polygon
from tasuki.scene.traverse import is_empty
from tasuki.scene.walk import Walk

NO_AREA = "warning: this polygon has no area; it is left out"

MOST_WARNINGS = 5
"""How many degenerate polygons are named one by one."""


def problems(scene: Scene) -> list[Problem]:
    """Everything that keeps `scene` from being drawn, camera first, then materials, lights and shapes in order."""
    return checked(scene)[0]


def checked(scene: Scene) -> tuple[list[Problem], Walk | None]:
    """The `problems` of a scene; and the walk through its shapes on which some were sought, None where it took none."""
    found = [*_camera(scene.camera), *_colour(("background",), scene.background)]
    for place, material in enumerate(scene.materials):
        found += _material(("materials", place), material)
    for place, light in enumerate(scene.lights):
        found += _light(("lights", place), light)
    of_shapes, walk = _shapes(scene.shapes)
    return found + sorted(of_shapes, key=lambda problem: problem.path[1]), walk


def _shapes(shapes: Shapes) -> tuple[list[Problem], Walk | None]:
    with collector_paused():
        found = shape_problems(shapes)
        if found or not shapes.nodes:
            return found, None
        walk = Walk(shapes)
        return list(walk.problems()), walk


def without_degenerate(scene: Scene) -> Scene:
    """The scene without its polygons of no area, each of which leaves a warning.

    Those inside other nodes leave theirs, but stay: a flat scene is without them.
    """
    shapes = scene.shapes
    degenerate = shapes.polygons.degenerate
    warnings = [
        f"{shapes.place(POLYGON, position) or f'polygon {position}'}: {NO_AREA}"
        for position in np.flatnonzero(degenerate).tolist()
    ]
    warnings += _degenerate_inside(shapes)
    if not warnings:
        return scene
    if len(warnings) > MOST_WARNINGS:
        more = f"warning: {len(warnings) - MOST_WARNINGS} more polygons have no area; they are left out"
        warnings[MOST_WARNINGS:] = [more]
    if degenerate.any():
        shapes = shapes.keep_polygons(~degenerate)
    return Scene(scene.camera, shapes, scene.lights, scene.background, scene.warnings + warnings)


def _degenerate_inside(shapes: Shapes) -> list[str]:
    """A warning for each polygon without area inside the nodes of `shapes`, and one for all those of a mesh."""
    if not shapes.nodes:
        return []
    census = Census(shapes)
    places = np.array(census.by_class.get(Polygon, []), np.intp)
    polygons = [census.nodes[place] for place in places]
    degenerate = batch_of(POLYGON, polygons, [0] * len(polygons)).degenerate
    found = [census.nodes[place].place or dotted(census.path(place)) for place in places[degenerate]]
    return [f"{where}: {NO_AREA}" for where in found] + _degenerate_in_meshes(census)


def _degenerate_in_meshes(census: Census) -> list[str]:
    warnings = {}
    for place in census.by_class.get(Mesh, []):
        mesh = census.nodes[place]
        if count := int(np.count_nonzero(mesh.shapes.polygons.degenerate)):
            warnings[mesh.file] = f"{mesh.file}: warning: polygons without area are left out: {count:,}"
    return list(warnings.values())


def with_advice(scene: Scene) -> Scene:
    """The scene, with a warning for each thing that is legal but leaves the picture dark or empty."""
    advice = []
    if not scene.lights:
        advice.append("warning: the scene has no light: only the background will show")
    if is_empty([scene.shapes]):
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
        yield Problem(("camera", "angle"), "no such field of view", "0 < angle < 180 degrees", number(camera.angle))
    if camera.hither < 0.0:
        yield Problem(("camera", "hither"), "the front plane is behind the eye", "0 or more", number(camera.hither))
    if min(camera.resolution) < 1:
        found = " ".join(map(str, camera.resolution))
        yield Problem(("camera", "resolution"), "the picture has no pixels", "at least 1 pixel each way", found)


def _directions(camera: Camera) -> Iterator[Problem]:
    eye, at, up = (np.array(vector, np.float64) for vector in (camera.eye, camera.at, camera.up))
    forward = at - eye
    if not forward.any():
        expected = "a point other than where the eye is"
        yield Problem(("camera", "at"), "the eye looks at itself", expected, point(camera.at))
    if not up.any():
        yield Problem(("camera", "up"), "the up vector has no direction", "a vector other than zero", point(camera.up))
    if forward.any() and up.any():
        forward, up = forward / np.abs(forward).max(), up / np.abs(up).max()
        sine = np.linalg.norm(np.cross(forward, up)) / (np.linalg.norm(forward) * np.linalg.norm(up))
        # Below this the direction to the right is rounding error in float32.
        if sine < 1e-6:
            expected = "a vector at an angle to the view"
            yield Problem(("camera", "up"), "the eye looks along the up vector", expected, point(camera.up))


def _material(path: Path, material: Material) -> Iterator[Problem]:
    yield from _colour((*path, "colour"), material.colour)
    yield from _colour((*path, "transmittance"), material.transmittance)
    for name in ("ambient", "diffuse", "specular", "exponent", "reflection", "transmission"):
        value = getattr(material, name)
        if value is not None and not 0.0 <= value < math.inf:
            yield Problem((*path, name), f"no such value for {name!r}", "a number, 0 or more", number(value))
    if not 0.0 < material.index < math.inf:
        message = "no such refractive index"
        yield Problem((*path, "index"), message, "a number greater than 0", number(material.index))
    if material.texture is not None:
        for problem in textures.problems(material.texture):
            yield replace(problem, path=(*path, "texture", *problem.path))


def _light(path: Path, light: Light) -> Iterator[Problem]:
    if isinstance(light, DirectionalLight):
        yield from _finite((*path, "direction"), light.direction)
        if not any(light.direction):
            message = "this light has no direction"
            yield Problem((*path, "direction"), message, "a vector other than zero", point(light.direction))
    else:
        yield from _finite((*path, "position"), light.position)
    if light.colour is not None:
        yield from _colour((*path, "colour"), light.colour)


def _colour(path: Path, colour: Iterable[float]) -> Iterator[Problem]:
    for step, value in enumerate(colour):
        if not 0.0 <= value < math.inf:
            yield Problem((*path, step), "no such brightness", "a number, 0 or more", number(value))


def _finite(path: Path, values: Iterable[float]) -> Iterator[Problem]:
    for step, value in enumerate(values):
        if not math.isfinite(value):
            yield Problem((*path, step), "this is not a finite number", "a finite number", number(value))
