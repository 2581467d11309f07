"""Scene files: one importer for each format, chosen by the file's suffix.

An importer is a function from `SourceText` to `Scene`, in a file of its own; it raises SceneError with everything that
is wrong. It is named here, and imported when the first file of its format is read. Meshes are read from their paths.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.scene.check import with_advice, with_sides, without_degenerate
from tasuki.scene.model import Scene
from tasuki.scene.source import SourceText, suggestion

Importer = Callable[[SourceText], Scene]

MeshImporter = Callable[[Path], Scene]
"""Reads the file itself: it may be binary, and have others beside it."""

_MESHES = dict.fromkeys((".obj", ".ply", ".stl", ".gltf", ".glb"), "tasuki.scene.importers.meshes:read")
_IMPORTERS: dict[str, str | Importer] = {
    ".nff": "tasuki.scene.importers.nff:read",
    ".yaml": "tasuki.scene.yaml_format:read",
    ".yml": "tasuki.scene.yaml_format:read",
}


def register_importer(suffix: str, importer: str | Importer) -> None:
    """Read files ending in `suffix` (".x3d") with `importer`, a function or its name "package.module:function".

    SceneError where the suffix has an importer already.
    """
    taken = _IMPORTERS.get(suffix.lower()) or _MESHES.get(suffix.lower())
    if taken:
        raise SceneError(f"error: files ending in {suffix!r} have an importer already: {taken}")
    _IMPORTERS[suffix.lower()] = importer


def load_scene(path: str | Path, *, two_sided: bool | None = None, allow_outside: bool = False) -> Scene:
    """The scene in the file at `path`, whose suffix, in upper or lower case, tells the format.

    `two_sided` overrides what the file says, or its format assumes, about which sides of surfaces show. Degenerate
    polygons are left out; `Scene.warnings` tells what was. The files that a scene names lie in its folder, or deeper,
    unless `allow_outside`. SceneError with everything that is wrong with the file.
    """
    scene = _read(Path(path), allow_outside)
    return with_sides(with_advice(without_degenerate(scene)), two_sided)


def _read(path: Path, allow_outside: bool) -> Scene:
    mesh = _MESHES.get(path.suffix.lower())
    if mesh:
        read_mesh: MeshImporter = _named(mesh)
        return read_mesh(path)
    return _importer(path)(SourceText.read(path, allow_outside=allow_outside))


def _importer(path: Path) -> Importer:
    suffix = path.suffix.lower()
    found = _IMPORTERS.get(suffix)
    if found is None and path.is_dir():
        raise SceneError(str(Diagnostic(f"{str(path)!r} is a directory", None, "a scene file", "a directory")))
    if found is None:
        known = sorted([*_IMPORTERS, *_MESHES])
        problem = Diagnostic(
            f"cannot tell the format of {str(path)!r} by its suffix",
            expected=f"a file ending in {', '.join(known)}",
            found=repr(path.suffix) if suffix else "no suffix",
            hint=suggestion(suffix, known),
        )
        raise SceneError(str(problem))
    return _named(found) if isinstance(found, str) else found


def _named(name: str) -> Any:
    """The function "package.module:function"."""
    module, _, function = name.partition(":")
    return getattr(importlib.import_module(module), function)
