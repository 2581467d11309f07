"""A scene in NFF as one for POV-Ray 3.7 that shows the same picture: `python -m bench.nff_to_pov SCENE.nff OUT.pov`.

It reads NFF by itself, not through `tasuki.scene`, so that a mistake of our importer shows as a difference between the
two pictures. Files are taken to be right: these are the Standard Procedural Databases, not a user's.

What POV-Ray cannot be told: NFF's surfaces are one-sided, POV-Ray's show, and cast shadows, from both sides. Closed
objects look the same; the open height field of `mount` shadows its own border in POV-Ray alone.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

MAX_TRACE_LEVEL = 5
"""Generations of rays, the eye ray counted: as `RenderOptions.depth`."""

SIMPLE = {"b": 3, "f": 8, "c": 8, "s": 4, "from": 3, "at": 3, "up": 3, "angle": 1, "hither": 1, "resolution": 2, "v": 0}
"""Numbers that follow an entity, where that is the same for all of its kind."""


@dataclass(frozen=True)
class Entity:
    """A word of the format and the numbers that follow it."""

    word: str
    values: np.ndarray


@dataclass
class Objects:
    """POV-Ray's text of the objects of one material. Triangles go into one mesh: with that POV-Ray is fastest."""

    single: list[str] = field(default_factory=list)
    mesh: list[str] = field(default_factory=list)

    def text(self, material: str) -> str:
        parts = [f"{body} material {{ {material} }} }}" for body in self.single]
        if self.mesh:
            parts.append("mesh {\n" + "\n".join(self.mesh) + f"\nmaterial {{ {material} }}\n}}")
        return "\n".join(parts)


def entities(text: str) -> Iterator[Entity]:
    """The entities of a file in NFF, in order."""
    tokens = " ".join(line.partition("#")[0] for line in text.splitlines()).split()
    starts = [i for i, token in enumerate(tokens) if token[0].isalpha()]
    for start, end in zip(starts, [*starts[1:], len(tokens)], strict=True):
        entity = Entity(tokens[start], np.array(tokens[start + 1 : end], np.float64))
        if len(entity.values) != SIMPLE.get(entity.word, len(entity.values)):
            raise SystemExit(f"`{entity.word}` is followed by {len(entity.values)} numbers")
        yield entity


def translate(text: str, width: int, height: int, *, refraction: bool = True) -> str:
    """The scene of an NFF file in POV-Ray's language, for a picture of `width` x `height` pixels.

    Without `refraction` transparent materials are opaque.
    """
    found = list(entities(text))
    one = {entity.word: entity.values for entity in found if entity.word in SIMPLE}
    lights = [entity.values for entity in found if entity.word == "l"]
    intensity = math.sqrt(len(lights)) / (2 * len(lights)) if lights else 0.0
    parts = [
        "#version 3.7;",
        # POV-Ray leaves out rays that weigh less than adc_bailout; NFF's ray trees are cut by their depth alone.
        f"global_settings {{ assumed_gamma 1 ambient_light 1 max_trace_level {MAX_TRACE_LEVEL} adc_bailout 0 }}",
        f"background {{ rgb {vector(one.get('b', np.zeros(3)))} }}",
        camera(one, width, height),
        *(light(values, intensity) for values in lights),
        *materials_and_objects(found, intensity, refraction=refraction),
    ]
    return "\n".join(parts) + "\n"


def vector(values: Sequence[float] | np.ndarray) -> str:
    return "<" + ", ".join(f"{value:.17g}" for value in values) + ">"


def camera(one: dict[str, np.ndarray], width: int, height: int) -> str:
    """NFF measures its angle between the centres of the outer rows: n rows have n - 1 distances between centres.

    A `right` that completes `direction` and `up` to a right-handed system keeps NFF's handedness.
    """
    forward = unit(one["at"] - one["from"])
    right = unit(np.cross(forward, one["up"]))
    up = np.cross(right, forward)
    rows = 2.0 * math.tan(math.radians(one["angle"][0]) / 2.0) * height / max(height - 1, 1)
    return (
        f"camera {{ perspective location {vector(one['from'])} direction {vector(forward)} "
        f"right {vector(right * rows * width / height)} up {vector(up * rows)} }}"
    )


def light(values: np.ndarray, intensity: float) -> str:
    colour = values[3:] if len(values) == 6 else np.full(3, intensity)
    return f"light_source {{ {vector(values[:3])} rgb {vector(colour)} }}"


def materials_and_objects(found: Sequence[Entity], intensity: float, *, refraction: bool) -> Iterator[str]:
    """A declaration for every `f`, followed by the objects made of it."""
    objects, number = Objects(), 0
    yield material(np.array([1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0]), number, intensity, refraction=refraction)
    for entity in found:
        if entity.word == "f":
            yield objects.text(f"F{number}")
            objects, number = Objects(), number + 1
            yield material(entity.values, number, intensity, refraction=refraction)
        elif entity.word == "s":
            objects.single.append(f"sphere {{ {vector(entity.values[:3])}, {abs(entity.values[3]):.17g}")
        elif entity.word == "c":
            objects.single.append(cone(entity.values))
        elif entity.word in ("p", "pp"):
            add_polygon(objects, entity)
    yield objects.text(f"F{number}")


def material(values: np.ndarray, number: int, intensity: float, *, refraction: bool) -> str:
    """NFF's ambient share is Kd times the lights' intensity; Ks weighs the highlight and the mirrored ray both."""
    colour, (kd, ks, shine, transmission, index) = values[:3], values[3:]
    transparent = refraction and transmission > 0.0
    # POV-Ray takes light that passes through off diffuse and ambient light; NFF's Kd is what remains.
    opacity = max(1.0 - transmission, 1e-6) if transparent else 1.0
    finish = [f"ambient {kd * intensity / opacity:.17g}", f"diffuse {kd / opacity:.17g}"]
    if ks > 0.0:
        finish += [f"phong {ks:.17g} phong_size {shine:.17g}", f"reflection {ks:.17g}"]
    pigment = f"rgb {vector(colour)}" + (f" transmit {transmission:.17g}" if transparent else "")
    interior = f"interior {{ ior {index:.17g} }}" if transparent else ""
    texture = f"texture {{ pigment {{ {pigment} }} finish {{ {' '.join(finish)} }} }}"
    return f"#declare F{number} = material {{ {texture} {interior} }}"


def cone(values: np.ndarray) -> str:
    base, base_radius, apex, apex_radius = values[:3], abs(values[3]), values[4:7], abs(values[7])
    if base_radius == apex_radius:
        return f"cylinder {{ {vector(base)}, {vector(apex)}, {base_radius:.17g} open"
    return f"cone {{ {vector(base)}, {base_radius:.17g}, {vector(apex)}, {apex_radius:.17g} open"


def add_polygon(objects: Objects, entity: Entity) -> None:
    """As a fan of triangles where that keeps within the polygon, else as POV-Ray's own polygon."""
    smooth = entity.word == "pp"
    corners = entity.values[1:].reshape(int(entity.values[0]), -1)
    points = corners[:, :3]
    if not smooth and not is_fan(points):
        outline = ", ".join(vector(point) for point in [*points, points[0]])
        objects.single.append(f"polygon {{ {len(points) + 1}, {outline}")
        return
    for i in range(1, len(corners) - 1):
        fan = corners[[0, i, i + 1]]
        kind = "smooth_triangle" if smooth else "triangle"
        # Rows of a patch are a point and its normal: in POV-Ray's order already.
        objects.mesh.append(f"{kind} {{ {', '.join(vector(part) for part in fan.reshape(-1, 3))} }}")


def is_fan(points: np.ndarray) -> bool:
    """Whether all triangles of the fan from the first corner turn the same way."""
    sides = points[1:] - points[0]
    turns = np.cross(sides[:-1], sides[1:])
    return bool((turns @ turns[0] > 0.0).all())


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v)


def main() -> None:
    parser = argparse.ArgumentParser(description="Translate a scene in NFF for POV-Ray 3.7.")
    parser.add_argument("scene", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--size", type=int, default=512, help="pixels along each side of the picture")
    parser.add_argument("--opaque", action="store_true", help="make transparent materials opaque")
    options = parser.parse_args()
    text = translate(options.scene.read_text(), options.size, options.size, refraction=not options.opaque)
    options.output.write_text(text)


if __name__ == "__main__":
    main()
