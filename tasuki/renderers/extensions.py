"""Files that users bring (`--with FILE.py`): what such a file registers is known from then on.

A file of Python registers solids and surfaces (`tasuki.scene.kinds`), textures (`tasuki.scene.textures`) or
accelerators (`tasuki.renderers.accelerators`) while it is run: once, and again when it has changed.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from tasuki.diagnostics import Diagnostic, SceneError, Span
from tasuki.language.load import load_file
from tasuki.renderers.accelerators import accelerators
from tasuki.scene.kinds import kinds
from tasuki.scene.textures import textures


def load_extensions(files: Iterable[str | Path]) -> None:
    """Run those of `files` that have not been run yet, or have changed since: then they replace what they registered.

    SourceError where one is missing, is not Python or fails; SceneError where it registers nothing, or something that
    cannot be registered.
    """
    for file in files:
        before, known = _registered(), list(sys.modules.values())
        try:
            namespace = load_file(file)
        except SceneError as error:
            raise SceneError(_with_place(error, file)) from error
        is_new = not any(namespace is one for one in known)
        if is_new and all(any(one is other for other in before) for one in _registered()):
            expected = "a call of `register`, of a kind of primitives, a texture or an accelerator"
            raise SceneError(str(Diagnostic(f"the file '{file}' registers nothing", None, expected, "none")))


def _registered() -> list[Any]:
    """What is registered by now."""
    return [*kinds(), *textures(), *accelerators()]


def _with_place(error: SceneError, file: str | Path) -> str:
    """What went wrong, and the line of the file that asked for it."""
    path = str(Path(file).resolve())
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == path]
    message, *details = str(error).removeprefix("error: ").split("\n")
    return "\n".join([str(Diagnostic(message, Span(path, (lines[-1] if lines else 1) or 1))), *details])
