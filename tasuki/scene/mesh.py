"""A mesh from a file as one node of the tree: `tasuki.scene.importers.meshes.load_mesh` makes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from tasuki.scene.problem import Path
from tasuki.scene.tree import Bounded, Many, Node


@dataclass(frozen=True, slots=True, eq=False)
class Mesh(Bounded):
    """The triangles of a `file`, as a batch in the file's own coordinates.

    With a `material` all of `shapes` are made of it; without one they keep those of the file, whatever is around.
    """

    noun: ClassVar[str] = "mesh"
    holds: ClassVar[bool] = True

    file: str
    shapes: Many

    def __post_init__(self) -> None:
        if self.material is not None:
            shapes = self.shapes.of_materials([self.material] * len(self.shapes.materials))
            object.__setattr__(self, "shapes", shapes)

    @property
    def inner(self) -> Sequence[Any]:
        return (self.shapes,)

    def step(self, number: int) -> Path:
        return ("shapes",)

    def of_inner(self, inner: Sequence[Any]) -> Node:
        return replace(self, shapes=inner[0])
