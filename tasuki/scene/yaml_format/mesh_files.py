"""The files of meshes that a scene names."""

from __future__ import annotations

from pathlib import Path

from tasuki.scene.importers.meshes import MeshError, read_mesh
from tasuki.scene.shapes import Shapes
from tasuki.scene.source import OUTSIDE, SourceText


class MeshFiles:
    """Reads the meshes that the scene in `source` names, each once. `warnings` tells what was left out of them."""

    def __init__(self, source: SourceText) -> None:
        self.warnings: list[str] = []
        self._source = source
        self._read: dict[Path, Shapes | MeshError] = {}

    def path(self, file: str) -> Path:
        """Where the `file` lies. MeshError where that is outside the scene's folder, and may not be."""
        path = self._source.beside(file)
        if path is None:
            raise MeshError(*OUTSIDE, repr(file))
        return path

    def shapes(self, file: str) -> Shapes:
        """The mesh in the `file`. MeshError where there is none that can be read."""
        path = self.path(file)
        if path not in self._read:
            try:
                self._read[path], warnings = read_mesh(path)
                self.warnings += warnings
            except MeshError as error:
                self._read[path] = error
        found = self._read[path]
        if isinstance(found, MeshError):
            raise found
        return found
