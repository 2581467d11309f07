"""What users declare: modules, sockets and records. Declaring is cheap: nothing is parsed before it is needed."""

from __future__ import annotations

import hashlib
import importlib
import inspect
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import FrameType, FunctionType, MappingProxyType
from typing import TYPE_CHECKING, Any, overload

from tasuki.diagnostics import Diagnostic, LinkError, SourceError, Span
from tasuki.ir.nodes import Signature
from tasuki.ir.types import Record
from tasuki.language.annotations import Names, mentioned_names
from tasuki.language.source import Source, parse_function
from tasuki.language.tables import Table

if TYPE_CHECKING:
    import ast

    from tasuki.language.check import Checked


class Declaration:
    """What modules and sockets share: a Python function whose annotations are types of the language."""

    kind = "module"
    source: Source | None = None
    """The text in which the function stands, where it is known already."""

    def __init__(self, function: FunctionType) -> None:
        found = _other_than_a_function(function)
        if found:
            raise SourceError([Diagnostic(f"@{self.kind} goes before a function", _place(_caller()), "`def`", found)])
        self.function = function
        self._mentioned = mentioned_names(function.__annotations__, _caller())
        self.name: str = function.__name__
        qualified = function.__qualname__.replace(".<locals>", "")
        self.qualified_name: str = f"{function.__module__}:{qualified}"
        self.file: str = function.__code__.co_filename
        self.line: int = function.__code__.co_firstlineno
        self.doc: str = inspect.cleandoc(function.__doc__ or "")
        # What `help` and `inspect.signature` look at.
        self.__doc__ = function.__doc__
        self.__name__ = function.__name__
        self.__qualname__ = function.__qualname__
        self.__module__ = function.__module__
        self.__wrapped__ = function

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""
        code = self.function.__code__
        return code.co_varnames[: code.co_argcount]

    @cached_property
    def signature(self) -> Signature:
        """Types of parameters and result. `SourceError` with every annotation that is wrong."""
        from tasuki.language.signatures import read_signature

        return read_signature(self)

    @cached_property
    def parsed(self) -> tuple[Source, ast.FunctionDef]:
        """The text that the function stands in, and its definition. `SourceError` where they are not to be had."""
        return parse_function(self.function.__code__, f"{self.kind} `{self.name}`", self.source)

    @property
    def names(self) -> Names:
        """What the free names of the function stand for now."""
        return Names(self.function, self._mentioned)

    @property
    def place(self) -> Span:
        return Span(self.file, self.line)

    def __repr__(self) -> str:
        return f"<{self.kind} {self.qualified_name}>"


class Module(Declaration):
    """A typed function in the module language.

    `number` and `method` are the module's place in the paper's lists; `fills` names the socket that it is made for.
    """

    def __init__(
        self,
        function: FunctionType,
        number: int | None = None,
        method: str | None = None,
        fills: str | Socket | None = None,
    ) -> None:
        super().__init__(function)
        self.number = number
        self.method = method
        self.fills: str | None = fills.name if isinstance(fills, Socket) else fills
        self._checked: Checked | None = None
        self.plain: tuple[Checked, FunctionType] | None = None
        """What `tasuki.language.plain` runs, and the checking that it was made from."""

    def check(self) -> Checked:
        """The module as typed IR, kept until a name that it uses is bound anew. `SourceError` with all errors in it."""
        checked = self.examine()
        if checked.diagnostics:
            raise SourceError(checked.diagnostics)
        return checked

    def examine(self) -> Checked:
        """As `check`, but a module with errors gives them back: `Checked.diagnostics`."""
        from tasuki.language.check import check_module

        if self._checked is None or not self._checked.still_holds(self.names):
            self._checked = check_module(self)
        return self._checked

    @cached_property
    def source_digest(self) -> str:
        """SHA-256, in hexadecimal, of the file that the module stands in (of a notebook: of its own lines)."""
        path = Path(self.file)
        if path.is_file():
            return hashlib.sha256(path.read_bytes()).hexdigest()
        source, definition = self.parsed
        lines = source.lines[self.line - 1 : definition.end_lineno]
        return hashlib.sha256("\n".join(lines).encode()).hexdigest()

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Run the module as plain Python, for one lane, on the value types of `tasuki.language.values`."""
        from tasuki.language.plain import call_plain

        return call_plain(self, args, kwargs)

    def map(self, /, *arguments: Any, **options: Any) -> Any:
        """Apply the module to every element of arrays: see `tasuki.mapping.map_module`, which this calls.

        It stands above this layer, which knows it by name only.
        """
        return importlib.import_module("tasuki.mapping").map_module(self, *arguments, **options)


@dataclass(frozen=True)
class Case:
    """One way to fill a dispatch socket: rows of kind `number` stand in `table`, and go to `module` as records.

    `table_name` is the name under which the program is given the table.
    """

    number: int
    module: Module
    table: Table
    table_name: str


class Socket(Declaration):
    """A hole with a name and a signature. What fills it is said when a program is linked.

    A `dispatch` socket takes a kind and a row index first; it is filled by `Case`s, one module for each kind.
    """

    kind = "socket"

    def __init__(self, function: FunctionType, dispatch: bool = False) -> None:
        super().__init__(function)
        self.dispatch = dispatch

    @contextmanager
    def filled(self, filler: Module | Sequence[Case]) -> Iterator[Socket]:
        """While the context lasts, calling the socket as plain Python calls `filler`; in this thread alone."""
        before = _filled.set({**_filled.get(), self: filler})
        try:
            yield self
        finally:
            _filled.reset(before)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        filler = _filled.get().get(self)
        if filler is None:
            raise LinkError(f"socket `{self.name}` is not filled; run it within `with {self.name}.filled(module):`")
        if isinstance(filler, Module):
            return filler(*args, **kwargs)
        given = self.function.__code__.co_varnames[len(args) : len(self.parameters)]
        kind, index, *rest = [*args, *(kwargs[name] for name in given)]
        return self._dispatch(filler, kind, index, rest)

    def _dispatch(self, cases: Sequence[Case], kind: Any, index: Any, rest: list[Any]) -> Any:
        """As the linked program does it: the last case takes every kind that no other took."""
        if not cases:
            from tasuki.language.values import from_leaves

            result = self.signature.result
            return from_leaves(result, [0] * len(result.leaves))
        case = next((case for case in cases if case.number == int(kind)), cases[-1])
        return case.module(case.table[index], *rest)


_filled: ContextVar[Mapping[Socket, Module | Sequence[Case]]] = ContextVar("sockets", default=MappingProxyType({}))
"""What fills sockets that are called as plain Python."""


class RecordType(type):
    """The class of classes that `@record` makes. Such a class is a type of the language and a Python class at once."""

    _place: Span
    _mentioned: dict[str, Any]
    _ir: Record | None = None

    @property
    def ir(cls) -> Record:
        """The record as a type. `SourceError` with every field that is wrong."""
        if cls._ir is None:
            from tasuki.language.signatures import read_record
            from tasuki.language.values import register_record

            cls._ir = read_record(cls)
            register_record(cls._ir, cls)
        return cls._ir

    def numpy_dtype(cls) -> Any:
        """A structured `numpy.dtype` of one record as it stands in memory: rows of 16 bytes, the fields where they lie.

        A bool is an int32, 0 or 1; vectors and matrices are float32 subarrays (a matrix: its four columns).
        """
        from tasuki.language.tables import record_dtype

        return record_dtype(cls.ir)

    def __repr__(cls) -> str:
        return cls.__name__


class RecordValue(metaclass=RecordType):
    """One record as a Python value. Fields are converted to the types of the language when it is made."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        from tasuki.language.conversion import convert

        cls = type(self)
        fields = cls.ir.fields
        given = dict(zip((name for name, _ in fields), args, strict=False)) | kwargs
        if len(args) > len(fields) or len(given) < len(args) + len(kwargs) or given.keys() != dict(fields).keys():
            expected = ", ".join(f"{name}: {type}" for name, type in fields)
            raise TypeError(f"{cls.__name__} takes each of its fields once: {expected}")
        for name, type_ in fields:
            setattr(self, name, convert(type_, given[name]))

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and vars(self) == vars(other)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value}' for name, value in vars(self).items())})"


def record(cls: type) -> RecordType:
    """Class decorator: annotated fields become a record of the language, in the order in which they stand."""
    body = {name: value for name, value in vars(cls).items() if name not in ("__dict__", "__weakref__")}
    made = RecordType(cls.__name__, (RecordValue,), body)
    made._place = _place(_caller())
    made._mentioned = mentioned_names(made.__annotations__, _caller())
    return made


def _caller() -> FrameType:
    """The frame, outside this file, that makes a declaration."""
    frame = sys._getframe()
    while frame.f_code.co_filename == __file__ and frame.f_back:
        frame = frame.f_back
    return frame


def _other_than_a_function(thing: Any) -> str | None:
    """What `thing` is, in words, where no `def` made it."""
    if isinstance(thing, type):
        return f"class {thing.__name__}"
    if not inspect.isfunction(thing):
        return f"{thing!r}, of type {type(thing).__name__}"
    if thing.__name__ == "<lambda>":
        return "a lambda"
    if inspect.iscoroutinefunction(thing) or inspect.isasyncgenfunction(thing):
        return "an `async def`"
    return None


def _place(frame: FrameType) -> Span:
    return Span(frame.f_code.co_filename, frame.f_lineno)


@overload
def module(function: Callable[..., Any], /) -> Module: ...
@overload
def module(
    *, number: int | None = None, method: str | None = None, fills: str | Socket | None = None
) -> Callable[[Any], Module]: ...
def module(function: Any = None, /, **options: Any) -> Any:
    """Decorator, bare or with keywords `number`, `method`, `fills`: makes a `Module` of a function."""
    if function is None:
        return lambda function: Module(function, **options)
    return Module(function, **options)


@overload
def socket(function: Callable[..., Any], /) -> Socket: ...
@overload
def socket(*, dispatch: bool = False) -> Callable[[Any], Socket]: ...
def socket(function: Any = None, /, *, dispatch: bool = False) -> Any:
    """Decorator, bare or with `dispatch=True`: makes a `Socket` of a function whose body is `...`."""
    if function is None:
        return lambda function: Socket(function, dispatch)
    return Socket(function, dispatch)
