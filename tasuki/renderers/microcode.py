"""Microcode written by hand in a picture: which of its modules the files of a user stand in for.

A module is named as `tasuki modules` lists it, or as "package.module:NAME" or "FILE.py:NAME"; its stand-in is a file of
macro assembler text (docs/pu-compiler.md has the convention).
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from pathlib import Path

from tasuki.diagnostics import Diagnostic, LinkError
from tasuki.ir.canonical import reachable
from tasuki.ir.nodes import Program
from tasuki.language.load import resolve_module


def stand_ins(given: Mapping[str, Path], programs: Sequence[Program]) -> list[dict[str, Path]]:
    """Of each of a picture's `programs` the files that stand in for its modules, by the modules' qualified names.

    LinkError where a module that is `given` is in none of them, or its name means several, or two names mean one.
    """
    known = [{function.name for function in reachable(program)} for program in programs]
    files: dict[str, Path] = {}
    for name, path in given.items():
        module = _module(name, sorted(set().union(*known)))
        if module in files:
            message = f"two files stand in for `{module}`"
            raise LinkError(str(Diagnostic(message, expected="one", found=f"{files[module]}, {path}")))
        files[module] = path
    return [{module: path for module, path in files.items() if module in functions} for functions in known]


def _module(name: str, known: Sequence[str]) -> str:
    """The qualified name of the module that `name` means."""
    where, _, _ = name.rpartition(":")
    if where.endswith(".py"):
        name = resolve_module(name).qualified_name
    found = [one for one in known if name in (one, one.rpartition(":")[2])]
    if len(found) == 1:
        return found[0]
    if found:
        message, expected = f"{len(found)} modules of this picture are called `{name}`", " or ".join(found)
        raise LinkError(str(Diagnostic(message, expected=expected, found=name)))
    close = difflib.get_close_matches(name, [*(one.rpartition(":")[2] for one in known), *known], n=1)
    hint = f"did you mean `{close[0]}`?" if close else "--profile lists those that take part"
    raise LinkError(str(Diagnostic(f"no module `{name}` takes part in this picture", found=name, hint=hint)))
