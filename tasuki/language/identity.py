"""What a module's meaning depends on, as data that can be compared: the key under which compiled code is kept.

A module means what its text says, with the global names in it standing for what they stand for now: a number, another
module, a record, a table, wherever they come from. Neither parses nor checks.
"""

from __future__ import annotations

import builtins
from pathlib import Path
from types import ModuleType
from typing import Any

from tasuki.language.annotations import is_record_class
from tasuki.language.context import MISSING
from tasuki.language.declare import Declaration, Module
from tasuki.language.names import Builtin, TypeName
from tasuki.language.tables import Table

PACKAGE = str(Path(__file__).parent.parent)


class Identities:
    """Describes modules, tables and whatever else a module may name, as lists, strings and dictionaries.

    What has been described before is only referred to. What belongs to this package is described by its name: whoever
    keeps descriptions keeps a digest of the package's sources beside them.
    """

    def __init__(self) -> None:
        self._known: dict[int, int] = {}

    def of(self, thing: Any, mentioned: tuple[str, ...] = ()) -> Any:
        """Description of a module, or of what a name stands for; of a Python module, its members that are `mentioned`.

        Raises SourceError for a module whose text or signature is wrong.
        """
        if isinstance(thing, bool | int | float):
            return repr(thing)
        if isinstance(thing, TypeName | Builtin):
            return f"{type(thing).__name__} {thing.name}"
        if isinstance(thing, Table):
            return ["table", thing.name, repr(thing.record.ir)]
        if is_record_class(thing):
            return ["record", repr(thing.ir)]
        if isinstance(thing, Declaration):
            return self._once(thing, lambda: self._declaration(thing))
        if isinstance(thing, ModuleType):
            return self._once(thing, lambda: self._members(thing, mentioned))
        # Anything else a module cannot use: checking it will say so.
        return type(thing).__qualname__

    def _once(self, thing: Any, describe: Any) -> Any:
        if id(thing) in self._known:
            return ["as before", self._known[id(thing)]]
        self._known[id(thing)] = len(self._known)
        return describe()

    def _declaration(self, declared: Declaration) -> Any:
        head = [declared.kind, declared.qualified_name]
        if declared.file.startswith(PACKAGE):
            return head
        names = declared.names
        code = declared.function.__code__
        mentioned = (*code.co_names, *code.co_freevars)
        found = {name: names.get(name, getattr(builtins, name, MISSING)) for name in mentioned}
        text = declared.source_digest if isinstance(declared, Module) else ""
        meanings = {name: self.of(value, mentioned) for name, value in found.items()}
        return [*head, declared.file, declared.line, text, repr(declared.signature), meanings]

    def _members(self, namespace: ModuleType, mentioned: tuple[str, ...]) -> Any:
        found = {name: getattr(namespace, name) for name in mentioned if hasattr(namespace, name)}
        return [namespace.__name__, {name: self.of(value, mentioned) for name, value in found.items()}]
