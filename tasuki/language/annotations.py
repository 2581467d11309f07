"""From the annotation that a user wrote (an object, or text under `from __future__ import annotations`) to its type."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import FrameType, FunctionType, GenericAlias
from typing import Any

from tasuki.ir.types import BOOL, VOID, Matrix, Record, Scalar, Table, Tuple, Type, Vector
from tasuki.language.names import VOCABULARY, TypeName

PYTHON_HINTS = {float: "f32", int: "i32"}
"""What is meant by types of Python that the language does not have."""


@dataclass(frozen=True)
class TableType:
    """`Table[Record]` in an annotation."""

    record: Any

    def __repr__(self) -> str:
        return f"Table[{getattr(self.record, '__name__', self.record)}]"


class AnnotationError(Exception):
    """An annotation that names no type of the language; the caller knows the place."""

    def __init__(self, found: str, hint: str | None = None) -> None:
        self.found = found
        self.hint = hint


class Names(Mapping[str, Any]):
    """What a function's free names stand for: its closure, then `mentioned`, then its globals."""

    def __init__(self, function: FunctionType, mentioned: Mapping[str, Any]) -> None:
        self.globals = function.__globals__
        self.closure: dict[str, Any] = dict(mentioned)
        for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
            try:
                self.closure[name] = cell.cell_contents
            except ValueError:  # not bound yet: the name belongs to a function that is still running
                continue

    def __getitem__(self, name: str) -> Any:
        return self.closure[name] if name in self.closure else self.globals[name]

    def __iter__(self) -> Any:
        return iter({**self.globals, **self.closure})

    def __len__(self) -> int:
        return len({**self.globals, **self.closure})


def mentioned_names(annotations: Mapping[str, Any], frame: FrameType) -> dict[str, Any]:
    """Local names of `frame`, a running function, that textual `annotations` mention: no closure keeps these."""
    if frame.f_locals is frame.f_globals:
        return {}
    words = {word for text in annotations.values() if isinstance(text, str) for word in re.findall(r"\w+", text)}
    return {word: frame.f_locals[word] for word in words if word in frame.f_locals}


def type_of(annotation: Any, names: Mapping[str, Any]) -> Type:
    """The type that `annotation` stands for; strings are evaluated among `names`. Raises `AnnotationError`."""
    if isinstance(annotation, str):
        return type_of(_evaluate(annotation, names), names)
    if annotation is None or annotation is type(None):
        return VOID
    if annotation is bool:
        return BOOL
    if isinstance(annotation, TypeName):
        return annotation.type
    if isinstance(annotation, TableType) and is_record_class(annotation.record):
        return Table(annotation.record.ir)
    if isinstance(annotation, GenericAlias) and annotation.__origin__ is tuple:
        return Tuple(tuple(type_of(item, names) for item in annotation.__args__))
    if is_record_class(annotation):
        return annotation.ir
    hint = PYTHON_HINTS.get(annotation) if isinstance(annotation, type) else None
    raise AnnotationError(_describe(annotation), f"write {hint}" if hint else None)


def is_record_class(thing: Any) -> bool:
    """Whether `thing` is a class made by `@record` (whose fields may still be wrong)."""
    return isinstance(thing, type) and hasattr(type(thing), "ir")


def is_value(type: Type) -> bool:
    """Whether a variable, a parameter or a field can have this type."""
    return isinstance(type, Scalar | Vector | Matrix | Record)


def is_result(type: Type) -> bool:
    """Whether a module can return this type."""
    return all(map(is_result, type.items)) if isinstance(type, Tuple) else is_value(type)


def _evaluate(text: str, names: Mapping[str, Any]) -> Any:
    try:
        return eval(text, {}, names)
    except NameError as error:
        types = [name for name, thing in {**VOCABULARY, **names}.items() if isinstance(thing, TypeName | type)]
        close = difflib.get_close_matches(error.name or "", types, n=1)
        hint = f"did you mean `{close[0]}`?" if close else None
        raise AnnotationError(f"the unknown name `{error.name}`", hint) from None
    except Exception as error:
        raise AnnotationError(text, str(error)) from None


def _describe(annotation: Any) -> str:
    return annotation.__name__ if isinstance(annotation, type) else repr(annotation)
