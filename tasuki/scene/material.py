"""What surfaces are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

Vector: TypeAlias = tuple[float, float, float]
Colour: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True)
class Texture:
    """What varies a material over a surface: a registered `kind` of texture, and the values that this one has."""

    kind: str
    values: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        plain = {name: tuple(value) if isinstance(value, list) else value for name, value in self.values.items()}
        object.__setattr__(self, "values", plain)

    def __hash__(self) -> int:
        return hash((self.kind, frozenset(self.values.items())))


@dataclass(frozen=True)
class Material:
    """What a surface is made of.

    `ambient` is the share of `colour` that shows without any light; None: `diffuse` times `default_intensity`.
    `exponent` is Phong's. `reflection` weighs the mirrored ray; `transmission` of the light enters the surface, split
    by Fresnel's equations, and `transmittance` of it passes each unit of the way inside. `two_sided` None: both sides
    show where `transmission` > 0 (so says NFF), and on patches with normals, which approximate curved sheets; elsewhere
    the outside (of a polygon: the front) alone. `texture` varies it over the surface.
    """

    name: str = "default"
    colour: Colour = (1.0, 1.0, 1.0)
    ambient: float | None = None
    diffuse: float = 1.0
    specular: float = 0.0
    exponent: float = 1.0
    reflection: float = 0.0
    transmission: float = 0.0
    index: float = 1.0
    transmittance: Colour = (1.0, 1.0, 1.0)
    two_sided: bool | None = None
    texture: Texture | None = None

    def shows_both_sides(self, *, smooth: bool = False) -> bool:
        """Whether a shape of this material shows from both sides; `smooth`: it is a patch with normals."""
        if self.two_sided is not None:
            return self.two_sided
        return self.transmission > 0.0 or smooth


PLAIN = Material()
"""Plain white: what a shape is made of where nothing says otherwise."""
