"""The import rule of the architecture, held: who may import whom."""

import ast
from pathlib import Path

import pytest

import tasuki

PACKAGE = Path(tasuki.__file__).parent

# layer -> layers that its files may import (besides themselves). The longest matching prefix of a path decides.
MAY_IMPORT = {
    "diagnostics": set(),
    "ir": {"diagnostics"},
    "language": {"ir", "diagnostics"},
    "native": {"diagnostics"},
    "machines": {"ir", "native", "diagnostics"},
    "modules": {"language"},
    "scene": {"language", "diagnostics"},
    "programs": {"diagnostics", "ir", "language", "machines", "native"},
    "mapping": {"diagnostics", "ir", "language", "machines", "native", "programs"},
    "measure": {"diagnostics", "ir", "language", "machines", "native", "programs"},
    "renderers": {"diagnostics", "ir", "language", "machines", "modules", "native", "scene", "programs", "mapping"},
    "explain": {"diagnostics", "ir", "language", "machines", "native", "programs", "renderers", "scene"},
    "catalogue": {"diagnostics", "language", "machines", "measure", "modules", "renderers", "scene"},
}
FREE = {"__init__", "cli", "__main__", "version"}


def imported(path: Path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import"
            for alias in node.names:
                yield (f"{node.module}.{alias.name}" if node.module == "tasuki" else node.module), node.lineno


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_layers_import_only_what_stands_below(path: Path):
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    layer = parts[0]
    if layer in FREE:
        return
    for name, line in imported(path):
        if not name.startswith("tasuki."):
            continue
        target = name.split(".")
        if layer == "machines" and target[1] == "machines" and len(parts) > 2 and len(target) > 2:
            assert target[2] == parts[1], f"{path}:{line}: machines never import each other"
        allowed = {layer, "version"} | MAY_IMPORT[layer]
        assert target[1] in allowed, f"{path}:{line}: {layer} may not import {name}"
