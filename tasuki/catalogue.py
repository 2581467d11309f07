"""All modules that are installed: the content of `tasuki modules`.

They come with the package (`tasuki.modules`), from other installed packages (entry points of the group
`tasuki.modules`, each of which names a Python module full of modules, or one module), and from files that are named.
"""

from __future__ import annotations

import difflib
import importlib
import importlib.metadata
import pkgutil
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import tasuki.modules
from tasuki.diagnostics import Diagnostic, LinkError, TasukiError
from tasuki.language.declare import Module
from tasuki.language.load import declared, load_modules, resolve_module
from tasuki.renderers.fillers import FILLED
from tasuki.scene.kinds import kinds
from tasuki.scene.textures import textures

if TYPE_CHECKING:
    from tasuki.machines.pu.lower.costs import Cost

GROUP = "tasuki.modules"


def all_modules(files: Iterable[str | Path] = ()) -> list[Module]:
    """Every module: ours, numbered ones first by the paper's order; of installed packages; of `files`.

    Raises LinkError where an installed package cannot be loaded, SourceError where a file cannot.
    """
    shipped = (importlib.import_module(found.name) for found in pkgutil.walk_packages(*_package()))
    ours = [module for namespace in shipped for module in declared(namespace) if isinstance(module, Module)]
    ours.sort(key=lambda module: (module.number is None, module.method or "", module.number or 0))
    named = [module for file in files for module in load_modules(file) if isinstance(module, Module)]
    # A module may be named by several entry points.
    return list(dict.fromkeys([*ours, *_installed(), *named]))


def find_module(name: str, files: Iterable[str | Path] = ()) -> Module:
    """The module named "FILE.py:NAME" or "package.module:NAME", or, by its name alone, among `all_modules(files)`.

    Raises SourceError or LinkError where there is none, or more than one.
    """
    if ":" in name:
        return resolve_module(name)
    modules = all_modules(files)
    found = [module for module in modules if module.name == name]
    if len(found) == 1:
        return found[0]
    if found:
        expected = " or ".join(module.qualified_name for module in found)
        raise LinkError(str(Diagnostic(f"{len(found)} modules are called `{name}`", expected=expected, found=name)))
    close = difflib.get_close_matches(name, [module.name for module in modules], n=1)
    hint = f"did you mean `{close[0]}`?" if close else "`tasuki modules` lists them all"
    raise LinkError(str(Diagnostic(f"there is no module `{name}`", hint=hint)))


def describe(
    modules: Iterable[Module], *, measured: bool = False, progress: Callable[[float], None] | None = None
) -> list[dict[str, Any]]:
    """What `tasuki modules --json` prints of every module, as plain data.

    "pu" holds the steps and the words of microcode, each macro on its own, and "compact" those where macros overlap;
    "cpu" the cycles per item: all if `measured`, which compiles every module (`progress` is told the share that is
    done). None where a number is not known: see `tasuki.measure`. "error": what is wrong with a module that
    should have been measured.
    """
    modules = list(modules)
    sockets = _filled_by_kinds()
    fillers = {module.fills: module for module in reversed(modules) if module.fills}
    rows = []
    for done, module in enumerate(modules):
        if progress:
            progress(done / len(modules))
        row: dict[str, Any] = {
            "number": module.number,
            "method": module.method,
            "name": module.name,
            "qualified_name": module.qualified_name,
            "socket": module.fills or sockets.get(module),
            "file": module.file,
            "line": module.line,
            "summary": module.doc.partition("\n")[0],
            "pu": _steps(None) | {"compact": _steps(None)},
            "cpu": {"cycles": None},
        }
        if measured:
            row |= _measured(module, fillers)
        rows.append(row)
    return rows


def _package() -> tuple[list[str], str]:
    return list(tasuki.modules.__path__), f"{tasuki.modules.__name__}."


def _installed() -> Iterator[Module]:
    for entry in importlib.metadata.entry_points(group=GROUP):
        try:
            found = entry.load()
        except Exception as error:
            # Whatever a stranger's package raises: the message names the package.
            owner = entry.dist.name if entry.dist else entry.name
            problem = Diagnostic(f"the installed package {owner!r} cannot be loaded: {type(error).__name__}: {error}")
            raise LinkError(str(problem)) from error
        if isinstance(found, ModuleType):
            yield from (thing for thing in declared(found) if isinstance(thing, Module))
        elif isinstance(found, Module):
            yield found


def _filled_by_kinds() -> dict[Module, str]:
    """The dispatch socket that a module fills for the kind of primitive or texture that it is registered with."""
    filled = {kind.resolve(role): socket for kind in kinds() for socket, role in FILLED.items()}
    return filled | {kind.module: "texture_colour" for kind in textures()}


def _measured(module: Module, fillers: dict[str, Module]) -> dict[str, Any]:
    from tasuki.measure import cycles_per_item, pu_cost

    try:
        cycles = cycles_per_item(module, fillers)
        macro, compact = (_steps(pu_cost(module, fillers, schedule)) for schedule in ("macro", "compact"))
    except TasukiError as error:
        return {"error": str(error)}
    return {"pu": macro | {"compact": compact}, "cpu": {"cycles": cycles}}


def _steps(cost: Cost | None) -> dict[str, Any]:
    if cost is None:
        return {"steps": {"min": None, "typical": None, "max": None}, "words": None}
    return {"steps": {"min": cost.least, "typical": cost.typical, "max": cost.most}, "words": cost.words}
