"""Modules from a user's own file, named as on the command line: `FILE.py:NAME`.

Whatever goes wrong while such a file is read and run becomes one error with a place.
"""

from __future__ import annotations

import difflib
import hashlib
import importlib
import linecache
import sys
import tokenize
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from tasuki.diagnostics import Diagnostic, SourceError, Span, TasukiError
from tasuki.language.declare import Declaration, Module, RecordType
from tasuki.language.source import Source
from tasuki.language.tables import Table

Declared = Declaration | RecordType | Table


def load_modules(path: str | Path) -> list[Declared]:
    """Runs a file of Python; the modules, sockets, records and tables that it declares, in order.

    A file that has been loaded before and has not changed since is not run again. Raises `SourceError`, with the place,
    for a file that is missing, is not Python, or fails while it runs.
    """
    return declared(load_file(path))


def declared(namespace: ModuleType) -> list[Declared]:
    """What a Python module declares itself; what it imports is left out."""
    return [thing for thing in vars(namespace).values() if _is_declared_in(thing, namespace)]


def resolve_module(spec: str) -> Module:
    """The module that `FILE.py:NAME` (or `package.module:NAME`) names. `SourceError` where there is none."""
    where, colon, name = spec.rpartition(":")
    if not colon or not where or not name:
        raise _error(f"`{spec}` names no module", expected="FILE.py:NAME")
    namespace = load_file(where) if where.endswith(".py") else _import(where)
    found = getattr(namespace, name, None)
    if isinstance(found, Module):
        return found
    names = [thing.name for thing in declared(namespace) if isinstance(thing, Module)]
    close = difflib.get_close_matches(name, names, n=1)
    raise _error(
        f"`{where}` has no module `{name}`" if found is None else f"`{name}` in `{where}` is not a module",
        expected=", ".join(names) or "a function with @module; there is none",
        hint=f"did you mean `{close[0]}`?" if close else None,
    )


def load_file(path: str | Path) -> ModuleType:
    """The file as an imported Python module, under a name of its own."""
    file = str(Path(path).resolve())
    text = _read(path, file)
    digest = hashlib.sha256(text.encode()).hexdigest()
    name = f"{Path(file).stem}_{hashlib.sha256(file.encode()).hexdigest()[:8]}"
    loaded = sys.modules.get(name)
    if loaded is not None and getattr(loaded, "__tasuki_digest__", None) == digest:
        return loaded
    linecache.checkcache(file)
    namespace = ModuleType(name)
    vars(namespace).update(__file__=file, __tasuki_digest__=digest)
    sys.modules[name] = namespace
    try:
        with _importable(Path(file).parent):
            exec(compile(text, file, "exec", dont_inherit=True), vars(namespace))
        source = Source(file, text)  # what was run, whatever becomes of the file
        for thing in declared(namespace):
            if isinstance(thing, Declaration):
                thing.source = source
    except BaseException as error:
        del sys.modules[name]
        if isinstance(error, TasukiError | KeyboardInterrupt):
            raise
        raise SourceError([_while_running(error, file, text)]) from error
    return namespace


def _is_declared_in(thing: Any, namespace: ModuleType) -> bool:
    if isinstance(thing, Table):
        return thing.declared_in == namespace.__name__
    return isinstance(thing, Declaration | RecordType) and thing.__module__ == namespace.__name__


def _read(path: str | Path, file: str) -> str:
    try:
        with tokenize.open(file) as stream:
            text = stream.read()
    except FileNotFoundError:
        raise _error(f"there is no file `{path}`") from None
    except IsADirectoryError:
        raise _error(f"`{path}` is a folder", expected="a file of Python") from None
    except (UnicodeDecodeError, SyntaxError):  # SyntaxError: an unknown encoding is declared
        raise _error(f"`{path}` is not text", expected="Python source in UTF-8") from None
    except OSError as error:
        raise _error(f"`{path}` cannot be read: {error.strerror}") from None
    if "\0" in text:
        raise _error(f"`{path}` is not text", expected="Python source in UTF-8")
    return text


def _import(name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except Exception as error:
        if isinstance(error, ModuleNotFoundError) and error.name and f"{name}.".startswith(f"{error.name}."):
            hint = "a file is named with its ending: FILE.py:NAME"
            raise _error(f"there is no Python module `{name}`", hint=hint) from None
        raise _error(f"`{name}` cannot be imported: {type(error).__name__}: {error}") from error


@contextmanager
def _importable(folder: Path) -> Iterator[None]:
    """While a file runs it can import its neighbours, as a script can."""
    sys.path.insert(0, str(folder))
    try:
        yield
    finally:
        sys.path.remove(str(folder))


def _while_running(error: BaseException, file: str, text: str) -> Diagnostic:
    """What went wrong, at the last place in the user's file that was reached."""
    if isinstance(error, SyntaxError) and error.filename == file and error.lineno:
        column = max((error.offset or 1) - 1, 0)
        span = Span(file, error.lineno, column, error.end_lineno or 0, max((error.end_offset or 0) - 1, 0))
        return Diagnostic(f"this is not Python: {error.msg}", span, source=text)
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    span = Span(file, (frames[-1].lineno if frames else 1) or 1)
    return Diagnostic(f"the file fails here: {type(error).__name__}: {error}", span, source=text)


def _error(message: str, expected: str | None = None, hint: str | None = None) -> SourceError:
    return SourceError([Diagnostic(message, expected=expected, hint=hint)])
