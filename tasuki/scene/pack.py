"""The scene in the four-bank memory: a table for each kind of primitive in use, the materials, and the lights.

Tables are verified as they are packed: every number is finite, every attribute exists. What is added later (the view,
the BVH, the picture) goes into `Packed.builder`; `Packed.build` then allocates the memory once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.scene.check import problems, without_degenerate
from tasuki.scene.kinds import MOST_KINDS, PrimitiveKind, resolve
from tasuki.scene.lower import TWO_SIDED, Primitives, lower
from tasuki.scene.memory import Memory, MemoryBuilder
from tasuki.scene.model import Scene, default_intensity
from tasuki.scene.source import scene_error

RECORDS = "tasuki.modules.records"
LEAST_SIZE, MOST_SIZE = 1e-12, 1e12
FAR_AWAY = 16.0
"""How many times its size a scene may be away from the origin before its coordinates count from its middle."""
MOST_PRIMITIVES = 2**31 // MOST_KINDS
"""An index times 32, plus a kind, must fit an i32."""


@dataclass(frozen=True)
class Packed:
    """A packed scene, ready to have more tables added to `builder`.

    `primitives` are those in memory, by kind: `primitives[k].shapes[i]` is the number in `scene.shapes` of the shape
    from which primitive i of that kind came. Coordinates in memory count from `origin`, (3,) float64.
    """

    scene: Scene
    origin: np.ndarray
    primitives: tuple[Primitives, ...]
    operands: tuple[PrimitiveKind, ...]
    object_costs: np.ndarray
    builder: MemoryBuilder

    @property
    def kinds(self) -> tuple[PrimitiveKind, ...]:
        """The kinds in use, in the order of their numbers."""
        return tuple(one.kind for one in self.primitives)

    @property
    def counts(self) -> Mapping[str, int]:
        """Number of primitives by the name of their kind."""
        return {one.kind.name: len(one.records) for one in self.primitives}

    @property
    def things(self) -> int:
        """What a ray may hit: primitives and objects."""
        return sum(self.counts.values()) + len(self.object_costs)

    def build(self) -> Memory:
        """The memory with all tables that `builder` has by now."""
        return self.builder.build()


def pack(scene: Scene) -> Packed:
    """The tables of `scene`: one for each kind in use, "attributes" and "lights".

    SceneError with everything that cannot be drawn, and where the scene does not fit the memory.
    """
    found = problems(scene)
    if found:
        described = (f"the scene's {problem.dotted}: {problem.message}" for problem in found)
        diagnostics = zip(described, found, strict=True)
        raise scene_error(Diagnostic(text, None, problem.expected, problem.found) for text, problem in diagnostics)
    scene = without_degenerate(scene)
    origin = local_origin(scene)
    primitives = tuple(lower(scene, origin))
    builder = MemoryBuilder()
    for one in primitives:
        verify(one, scene)
        builder.add(one.kind.table_name, one.records)
    _verify_size(scene)
    builder.add("attributes", _verified("material", _attributes(scene)))
    builder.add("lights", _verified("light", _lights(scene, origin)))
    builder.add("matrices", np.zeros(0, _dtype("Matrix")))
    builder.add("media", np.zeros(0, _dtype("Medium")))
    return Packed(scene, origin, primitives, (), np.zeros(0, np.float32), builder)


def _attributes(scene: Scene) -> np.ndarray:
    """One record for each material; what they have in common has the same name in both."""
    materials = scene.materials
    records = np.zeros(len(materials), _dtype("Attribute"))
    intensity = default_intensity(len(scene.lights))
    with np.errstate(over="ignore"):
        for name in set(records.dtype.names or ()) - {"flags", "ambient", "texture"}:
            values = np.array([getattr(material, name) for material in materials], np.float64)
            records[name] = values.reshape(records[name].shape)
        records["ambient"] = [
            material.diffuse * intensity if material.ambient is None else material.ambient for material in materials
        ]
    records["texture"] = -1
    records["flags"] = [TWO_SIDED if material.shows_both_sides() else 0 for material in materials]
    return records


def local_origin(scene: Scene) -> np.ndarray:
    """From where the coordinates in memory count: zero, or the middle of a scene that lies far away for its size.

    float32 has 24 bits for a coordinate. Where those would tell the way to the scene rather than places in it, float64
    takes the way off first.
    """
    middle, size = _middle_and_size(scene)
    return middle if np.abs(middle).max() > FAR_AWAY * size else np.zeros(3)


def _middle_and_size(scene: Scene) -> tuple[np.ndarray, float]:
    """Of the box around the shapes and the camera's place; zero for no shapes."""
    if not len(scene.shapes):
        return np.zeros(3), 0.0
    spheres, cones, polygons = scene.shapes.spheres, scene.shapes.cones, scene.shapes.polygons
    points = np.concatenate([[scene.camera.eye], spheres.centre, cones.base, cones.apex, polygons.points])
    low, high = points.min(axis=0), points.max(axis=0)
    size = max(float((high - low).max()), 2.0 * float(np.abs(spheres.radius).max(initial=0.0)))
    return (low + high) / 2.0, size


def _verify_size(scene: Scene) -> None:
    """SceneError where the scene is so large or small that products of three lengths leave float32."""
    _, size = _middle_and_size(scene)
    if len(scene.shapes) and not LEAST_SIZE <= size <= MOST_SIZE:
        expected = f"a size of {LEAST_SIZE:g} to {MOST_SIZE:g}"
        raise SceneError(str(Diagnostic("the scene's size is out of range", None, expected, f"{size:g}")))


def _lights(scene: Scene, origin: np.ndarray) -> np.ndarray:
    records = np.zeros(len(scene.lights), _dtype("Light"))
    grey = (default_intensity(len(scene.lights)),) * 3
    with np.errstate(over="ignore"):
        records["position"] = np.array([light.position for light in scene.lights]).reshape(-1, 3) - origin
        colours = [grey if light.colour is None else light.colour for light in scene.lights]
        records["colour"] = np.array(colours).reshape(-1, 3)
    return records


def verify(primitives: Primitives, scene: Scene) -> None:
    """SceneError that names the shape of a primitive which float32 cannot hold, or which has no attribute."""
    records = primitives.records
    if len(records) > MOST_PRIMITIVES:
        message = f"the scene has too many primitives of kind {primitives.kind.name!r}"
        raise SceneError(str(Diagnostic(message, None, f"at most {MOST_PRIMITIVES}", str(len(records)))))
    attributes = records["attribute"]
    unknown = (attributes < 0) | (attributes >= len(scene.materials))
    wrong = np.flatnonzero(unknown | _not_finite(records))
    if len(wrong):
        number = int(primitives.shapes[wrong[0]])
        place = scene.shapes[number].place
        if unknown[wrong[0]]:
            expected, found = f"a material, 0 to {len(scene.materials) - 1}", str(attributes[wrong[0]])
        else:
            expected, found = "numbers within the range of float32, squares included", "infinity"
        message = f"shape {number} cannot be packed as a {primitives.kind.name}"
        raise SceneError(str(Diagnostic(message, place, expected, found)))


def _verified(name: str, records: np.ndarray) -> np.ndarray:
    for number in np.flatnonzero(_not_finite(records))[:1]:
        raise SceneError(
            str(
                Diagnostic(f"{name} {number} cannot be packed", None, "numbers within the range of float32", "infinity")
            )
        )
    return records


def _not_finite(records: np.ndarray) -> np.ndarray:
    """Which records hold a number that is not finite."""
    bad = np.zeros(len(records), bool)
    for name in records.dtype.names or ():
        values = records[name]
        if values.dtype.kind == "f":
            finite = np.isfinite(values)
            bad |= ~(finite.all(axis=1) if finite.ndim > 1 else finite)
    return bad


def _dtype(record: str) -> Any:
    return resolve(f"{RECORDS}:{record}").numpy_dtype()
