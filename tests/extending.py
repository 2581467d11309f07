"""What files of users register, for as long as a test needs it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import pytest

from tasuki.language.load import load_file
from tasuki.renderers import accelerators
from tasuki.renderers.extensions import load_extensions
from tasuki.scene import kinds, textures

EXAMPLES = Path(__file__).parents[1] / "examples"
PLACES = {
    "as it is": lambda node: node,
    "turned": lambda node: node.rotate((1.0, 2.0, 0.5), 65.0).translate(0.2, 0.1, -0.1),
    "stretched": lambda node: node.scale(1.3, 0.7, 1.6).rotate("x", 40.0),
    "sheared": lambda node: node.transformed([[1.0, 0.4, 0.0], [0.0, 1.0, 0.2], [0.0, 0.0, 1.0]]),
    "mirrored": lambda node: node.scale(-1.0, 1.0, 1.0).rotate("y", 30.0),
}
"""What may be done to a node."""


@contextmanager
def registries() -> Iterator[None]:
    """What is registered meanwhile is forgotten afterwards, and files that are run meanwhile can be run again."""
    before = set(sys.modules)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kinds, "_KINDS", kinds._KINDS.copy())
        patch.setattr(textures, "_KINDS", textures._KINDS.copy())
        patch.setattr(accelerators, "_ACCELERATORS", accelerators._ACCELERATORS.copy())
        yield
    for name in set(sys.modules) - before:
        if hasattr(sys.modules[name], "__tasuki_digest__"):
            del sys.modules[name]


@contextmanager
def brought(*names: str) -> Iterator[list[ModuleType]]:
    """The examples of these names, registered."""
    with registries():
        files = [EXAMPLES / f"{name}.py" for name in names]
        load_extensions(files)
        yield [load_file(file) for file in files]
