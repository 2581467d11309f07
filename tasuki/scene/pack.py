"""The scene in the four-bank memory: a table for each kind of primitive in use, the materials, and the lights.

Tables are verified as they are packed: every number is finite, every attribute exists. What is added later (the view,
the BVH, the picture) goes into `Packed.builder`; `Packed.build` then allocates the memory once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.scene import extents
from tasuki.scene.check import checked
from tasuki.scene.collector import collector_paused
from tasuki.scene.flatten import Flat, flatten
from tasuki.scene.kinds import MOST_KINDS, PrimitiveKind, lookup, record_dtype
from tasuki.scene.lower import TWO_SIDED, Primitives, lower
from tasuki.scene.material import Material, Vector
from tasuki.scene.meetings import media, with_shared_spheres
from tasuki.scene.memory import Memory, MemoryBuilder
from tasuki.scene.model import DirectionalLight, Light, Scene, default_intensity
from tasuki.scene.objects import Formulas, Objects, matrix_records
from tasuki.scene.problem import dotted
from tasuki.scene.sheets import with_sheets
from tasuki.scene.source import scene_error
from tasuki.scene.textures import TextureKind, lower_textures
from tasuki.scene.transforms import unit

DIRECTIONAL = 1
"""The kind of a directional light, as `tasuki.modules.records` gives it."""
LEAST_SIZE, MOST_SIZE = 1e-12, 1e12
FAR_AWAY = 16.0
"""How many times its size a scene may be away from the origin before its coordinates count from its middle."""
MOST_PRIMITIVES = 2**31 // MOST_KINDS
"""An index times 32, plus a kind, must fit an i32."""
VAIN = "this object is empty, or fills all space: it has no surface to show"
THIN = (
    "a solid of this object is thinner than a millionth of its size: "
    "from afar float32 cannot tell its faces apart, and it may not show"
)
"""Warnings."""


@dataclass(frozen=True)
class Packed:
    """A packed scene, ready to have more tables added to `builder`.

    `primitives` are those in memory, by kind: `primitives[k].shapes[i]` is the number in the flat scene of the shape
    from which primitive i of that kind came. `formulas` are those of the objects, in the scene's coordinates, float64.
    Coordinates in memory count from `origin`, (3,) float64.
    """

    scene: Scene
    flat: Flat
    origin: np.ndarray
    primitives: tuple[Primitives, ...]
    formulas: Formulas
    objects: Objects
    textures: Sequence[TextureKind]
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
        return sum(self.counts.values()) + self.objects.count

    def build(self) -> Memory:
        """The memory with all tables that `builder` has by now."""
        return self.builder.build()


def pack(scene: Scene) -> Packed:
    """The tables of `scene`: one for each kind in use, "attributes" and "lights".

    SceneError with everything that cannot be drawn, and where the scene does not fit the memory.
    """
    with collector_paused():
        return _pack(scene)


def _pack(scene: Scene) -> Packed:
    found, walk = checked(scene)
    if found:
        described = (f"the scene's {problem.dotted}: {problem.message}" for problem in found)
        diagnostics = zip(described, found, strict=True)
        raise scene_error(Diagnostic(text, None, problem.expected, problem.found) for text, problem in diagnostics)
    flat = flatten(scene, walk)
    formulas = Formulas(flat.objects, flat.materials, flat.frames)
    middle, size = _middle_and_size(flat, formulas.boxes, scene.camera.eye)
    shared = with_shared_spheres(with_sheets(flat, formulas, size), size)
    if shared is not flat:
        flat, formulas = shared, Formulas(shared.objects, flat.materials, shared.frames)
    origin = local_origin(middle, size)
    _verify_size(flat, size)
    primitives = tuple(lower(flat, origin))
    objects = formulas.lower(origin, size, {one.kind.name: len(one.records) for one in primitives})
    builder = MemoryBuilder()
    textures = lower_textures(flat.materials)
    for name, records in [*_records(flat, primitives, objects).items(), *textures.tables.items()]:
        builder.add(name, records)
    builder.add("matrices", _verified("matrix", matrix_records(flat.frames, origin)))
    builder.add("media", media(flat, objects, lookup("quadric").number, origin, size))
    attributes = _attributes(flat.materials, textures.codes, len(scene.lights))
    builder.add("attributes", _verified("material", attributes))
    builder.add("lights", _verified("light", _lights(scene.lights, origin)))
    warnings = [*scene.warnings, *_warnings(flat, formulas, objects)]
    scene = Scene(scene.camera, scene.shapes, scene.lights, scene.background, warnings)
    packed = Packed(scene, flat, origin, primitives, formulas, objects, textures.kinds, builder)
    unbounded = list(extents.unbounded(packed))
    if unbounded:
        raise scene_error(unbounded)
    return packed


def _warnings(flat: Flat, formulas: Formulas, objects: Objects) -> Iterator[str]:
    """A warning for each object without a surface, or of which little can be seen."""
    for numbers, text in ((formulas.left_out, VAIN), (objects.thin.tolist(), THIN)):
        for number in numbers:
            where = flat.objects.places[number] or dotted(flat.objects.paths[number])
            yield f"{where}: warning: {text}"


def _records(flat: Flat, primitives: Sequence[Primitives], objects: Objects) -> dict[str, np.ndarray]:
    """The tables of primitives and objects: of one kind those that stand alone first, then literals' surfaces."""
    tables = dict(objects.tables)
    for one in primitives:
        verify(one, flat)
        name = one.kind.table_name
        tables[name] = np.concatenate([one.records, tables[name]]) if name in tables else one.records
    for name in objects.tables:
        _verified(f"{name}: record", tables[name])
    return tables


def _attributes(materials: Sequence[Material], textures: Sequence[int], lights: int) -> np.ndarray:
    """One record for each material and the code of its texture; what they have in common has the same name in both."""
    records = np.zeros(len(materials), record_dtype("Attribute"))
    intensity = default_intensity(lights)
    with np.errstate(over="ignore"):
        for name in set(records.dtype.names or ()) - {"flags", "ambient", "texture"}:
            values = np.array([getattr(material, name) for material in materials], np.float64)
            records[name] = values.reshape(records[name].shape)
        records["ambient"] = [
            material.diffuse * intensity if material.ambient is None else material.ambient for material in materials
        ]
    records["texture"] = textures
    records["flags"] = [TWO_SIDED if material.shows_both_sides() else 0 for material in materials]
    return records


def local_origin(middle: np.ndarray, size: float) -> np.ndarray:
    """From where the coordinates in memory count: zero, or the middle of a scene that lies far away for its size.

    float32 has 24 bits for a coordinate. Where those would tell the way to the scene rather than places in it, float64
    takes the way off first.
    """
    return middle if np.abs(middle).max() > FAR_AWAY * size else np.zeros(3)


def _middle_and_size(flat: Flat, boxes: np.ndarray, eye: Vector) -> tuple[np.ndarray, float]:
    """Of the box around all things, as far as they are bounded, and the camera's place; zero for no things."""
    if not len(flat):
        return np.zeros(3), 0.0
    spheres, cones, polygons = flat.shapes.spheres, flat.shapes.cones, flat.shapes.polygons
    corners = np.split(boxes, 2, axis=1)
    points = np.concatenate([[eye], spheres.centre, cones.base, cones.apex, polygons.points, *corners])
    points = np.where(np.isfinite(points), points, np.array(eye))
    low, high = points.min(axis=0), points.max(axis=0)
    size = max(float((high - low).max()), 2.0 * float(np.abs(spheres.radius).max(initial=0.0)))
    return (low + high) / 2.0, size or 1.0


def _verify_size(flat: Flat, size: float) -> None:
    """SceneError where the scene is so large or small that products of three lengths leave float32."""
    if len(flat) and not LEAST_SIZE <= size <= MOST_SIZE:
        expected = f"a size of {LEAST_SIZE:g} to {MOST_SIZE:g}"
        raise SceneError(str(Diagnostic("the scene's size is out of range", None, expected, f"{size:g}")))


def _lights(lights: Sequence[Light], origin: np.ndarray) -> np.ndarray:
    records = np.zeros(len(lights), record_dtype("Light"))
    grey = (default_intensity(len(lights)),) * 3
    with np.errstate(over="ignore"):
        for record, light in zip(records, lights, strict=True):
            record["colour"] = grey if light.colour is None else light.colour
            if isinstance(light, DirectionalLight):
                way = -np.array(light.direction, np.float64)
                record["kind"], record["position"] = DIRECTIONAL, unit(way)
            else:
                record["position"] = np.array(light.position) - origin
    return records


def verify(primitives: Primitives, flat: Flat) -> None:
    """SceneError that names the shape of a primitive which float32 cannot hold, or which has no attribute."""
    records = primitives.records
    if len(records) > MOST_PRIMITIVES:
        message = f"the scene has too many primitives of kind {primitives.kind.name!r}"
        raise SceneError(str(Diagnostic(message, None, f"at most {MOST_PRIMITIVES}", str(len(records)))))
    attributes = records["attribute"]
    unknown = (attributes < 0) | (attributes >= len(flat.materials))
    wrong = np.flatnonzero(unknown | _not_finite(records))
    if len(wrong):
        number = int(primitives.shapes[wrong[0]])
        place = flat.place(number)
        if unknown[wrong[0]]:
            expected, found = f"a material, 0 to {len(flat.materials) - 1}", str(attributes[wrong[0]])
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
            bad |= ~np.isfinite(values).all(axis=tuple(range(1, values.ndim)))
    return bad
