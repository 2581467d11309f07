"""What a scene is: plain values, whatever file or program they come from.

Lengths have the scene's own unit, colours are linear RGB (1 is full), angles are degrees. Coordinates are right-handed.
`Scene.shapes` behaves as the sequence of the nodes that the scene consists of, in order, but as far as it can it stands
in arrays (`tasuki.scene.shapes`), so that a hundred thousand polygons cost no Python object each.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np

from tasuki.scene.material import Colour, Material, Vector
from tasuki.scene.shapes import Shape, Shapes


@dataclass(frozen=True)
class Camera:
    """A perspective view without distortion.

    `eye` looks at `at`, and `up` (not parallel to that) points to the upper edge. `angle` is the field of view over the
    picture's *height*, measured between its edges, or, as NFF does, between the centres of its outer pixels. Pixels are
    square. `hither` is the distance of the front clipping plane, by which ray tracing does not clip; `resolution` is
    (width, height) in pixels.
    """

    eye: Vector
    at: Vector
    up: Vector
    angle: float
    resolution: tuple[int, int] = (512, 512)
    hither: float = 0.0
    angle_between: Literal["edges", "centres"] = "edges"

    def edge_angle(self, pixels: int) -> float:
        """Degrees between the edges of a picture of `pixels` rows.

        n rows have n - 1 distances between their centres, hence 2 atan(tan(angle / 2) n / (n - 1)). One row alone
        has none: its angle is taken between its edges.
        """
        if self.angle_between == "edges" or pixels < 2:
            return self.angle
        return 2.0 * math.degrees(math.atan(math.tan(math.radians(self.angle) / 2.0) * pixels / (pixels - 1)))

    def frame(self, width: int, height: int) -> ViewFrame:
        """The view of a picture of `width` x `height` pixels, which need not be `resolution`."""
        eye, at, up = (np.array(vector, np.float64) for vector in (self.eye, self.at, self.up))
        forward = _unit(at - eye)
        right = _unit(np.cross(forward, _unit(up)))
        upward = np.cross(right, forward)
        half_height = math.tan(math.radians(self.edge_angle(height)) / 2.0)
        pixel = 2.0 * half_height / height
        corner = forward - right * (pixel * width / 2.0) + upward * half_height
        return ViewFrame(eye, corner, right * pixel, -upward * pixel)


@dataclass(frozen=True)
class ViewFrame:
    """From `eye`, the point (x, y) of the picture, in pixels from its upper left corner, lies in the direction
    `corner + x right + y down`; the centre of pixel (i, j) is (i + 0.5, j + 0.5). Arrays of shape (3,), float64."""

    eye: np.ndarray
    corner: np.ndarray
    right: np.ndarray
    down: np.ndarray


@dataclass(frozen=True)
class PointLight:
    """A light at a point. Its intensity does not fall with distance; without a colour see `default_intensity`."""

    position: Vector
    colour: Colour | None = None


@dataclass(frozen=True)
class DirectionalLight:
    """Light that travels in one `direction`, of any length, as the sun's does; without a colour as a `PointLight`."""

    direction: Vector
    colour: Colour | None = None


Light: TypeAlias = PointLight | DirectionalLight


@dataclass(init=False)
class Scene:
    """Everything that is drawn. `warnings` tells what an importer left out or assumed; it takes no part in equality.

    `shapes` may be given as any iterable of nodes; it is kept as `tasuki.scene.shapes.Shapes`.
    """

    camera: Camera
    background: Colour
    lights: tuple[Light, ...]
    shapes: Shapes
    warnings: list[str] = field(compare=False, repr=False)

    def __init__(
        self,
        camera: Camera,
        shapes: Iterable[Shape] | Shapes,
        lights: Sequence[Light] = (),
        background: Colour = (0.0, 0.0, 0.0),
        warnings: Iterable[str] = (),
    ) -> None:
        self.camera = camera
        self.shapes = shapes if isinstance(shapes, Shapes) else Shapes.of(shapes)
        self.lights = tuple(lights)
        self.background = background
        self.warnings = list(warnings)

    @property
    def materials(self) -> tuple[Material, ...]:
        """All materials of the shapes; `material` of a batch is an index into them."""
        return self.shapes.materials


def default_intensity(lights: int) -> float:
    """Intensity of each of `lights` lights without a colour, and of the ambient light: sqrt(n) / (2 n).

    The rule of the Standard Procedural Databases. With no light there is no ambient light either.
    """
    return math.sqrt(lights) / (2 * lights) if lights else 0.0


def _unit(vector: np.ndarray) -> np.ndarray:
    # Scaled first, so that the squares of very large or very small numbers neither overflow nor vanish.
    scaled = vector / np.abs(vector).max()
    return scaled / np.linalg.norm(scaled)
