"""Registries: what users bring, by name, and the file that brought it.

A file that is run again, because it has changed, replaces what it registered before; another file does not.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from tasuki.diagnostics import Diagnostic, Note, SceneError, Span

_Thing = TypeVar("_Thing")


@dataclass(frozen=True)
class Origin:
    """Who registers something: a file, or, in a notebook, the name of its namespace; the line; whether it is ours."""

    file: str
    line: int
    is_ours: bool

    @classmethod
    def of_caller(cls) -> Origin:
        """Who has called the function that calls this one."""
        frame = sys._getframe(2)
        name, file = frame.f_globals.get("__name__", ""), frame.f_globals.get("__file__")
        return cls(str(Path(file).resolve()) if file else name, frame.f_lineno, name.startswith("tasuki."))


class Registry(Mapping[str, _Thing]):
    """Things by name, in the order of their numbers. `noun` is what messages call one; there is room for `most`."""

    def __init__(self, noun: str, most: int | None = None) -> None:
        self.noun = noun
        self.most = most
        self._things: dict[str, _Thing] = {}
        self._origins: dict[str, Origin] = {}

    def __getitem__(self, name: str) -> _Thing:
        return self._things[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._things)

    def __len__(self) -> int:
        return len(self._things)

    def copy(self) -> Registry[_Thing]:
        """The same things; what is entered into one of the two is not in the other."""
        made: Registry[_Thing] = Registry(self.noun, self.most)
        made._things, made._origins = dict(self._things), dict(self._origins)
        return made

    def number(self, name: str, origin: Origin) -> int:
        """The number of what `origin` enters as `name`: that which it replaces had it too, so scenes keep theirs.

        SceneError where another file has registered something under this name, or there is no room.
        """
        if name in self._things:
            self._check_same_file(name, origin)
            return list(self._things).index(name)
        if len(self._things) == self.most:
            raise SceneError(str(Diagnostic(f"no room for {self.noun} {name!r}: there are {self.most} already")))
        return len(self._things)

    def enter(self, name: str, thing: _Thing, origin: Origin) -> _Thing:
        """Have `thing` known as `name`. Errors as for `number`."""
        self.number(name, origin)
        self._things[name], self._origins[name] = thing, origin
        return thing

    def _check_same_file(self, name: str, origin: Origin) -> None:
        first = self._origins[name]
        if first.file == origin.file:
            return
        article = "an" if self.noun[0] in "aeiou" else "a"
        message = f"there is {article} {self.noun} {name!r} already"
        found = "one that comes with Tasuki" if first.is_ours else None
        notes = () if first.is_ours else (Note("it was registered here first", Span(first.file, first.line)),)
        raise SceneError(str(Diagnostic(message, None, "another name", found, notes=notes)))
