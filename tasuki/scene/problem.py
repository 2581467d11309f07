"""A fault of a scene, and the path that leads to it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias

Path: TypeAlias = tuple[str | int, ...]
"""Steps from the scene to a part of it, as Python takes them: ("shapes", 3, "children", 0, "radius")."""


@dataclass(frozen=True)
class Problem:
    """One fault. `path` leads to it from the scene: ("shapes", 3, "radius"), ("camera", "up")."""

    path: Path
    message: str
    expected: str
    found: str

    @property
    def dotted(self) -> str:
        """The path as people write it: shapes[3].radius."""
        return dotted(self.path)


def dotted(path: Path) -> str:
    """A path as people write it: shapes[3].radius."""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path).lstrip(".")


def number(value: float) -> str:
    """A number as messages show it."""
    return f"{value:.9g}"


def point(values: Iterable[float]) -> str:
    """A point or vector as messages show it."""
    return " ".join(map(number, values))
