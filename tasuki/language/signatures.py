"""Signatures of modules and sockets, and fields of records, from their annotations; all errors at once."""

from __future__ import annotations

import ast
import inspect
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from tasuki.diagnostics import Diagnostic, SourceError, Span
from tasuki.ir import types as ir
from tasuki.ir.nodes import Signature
from tasuki.language.annotations import AnnotationError, is_result, is_value, type_of
from tasuki.language.source import read_source, source_order

if TYPE_CHECKING:
    from tasuki.language.declare import Declaration, RecordType

TYPES = "f32, i32, bool, vec3, vec4, mat4 or a record"
PARAMETER_TYPES = f"{TYPES}, or Table[record]"
RESULT_TYPES = f"{TYPES}, or tuple[...] of them, or nothing"


def read_signature(declaration: Declaration) -> Signature:
    """The signature that the annotations of a module or socket give."""
    problems: list[Diagnostic] = []
    _refuse_other_parameters(declaration, problems)
    annotations: Mapping[str, Any] = inspect.get_annotations(declaration.function)
    names = declaration.names
    types = []
    for name in declaration.parameters:
        try:
            if name not in annotations:
                raise AnnotationError("no annotation")
            type = type_of(annotations[name], names)
            if not is_value(type) and not isinstance(type, ir.Table):
                raise AnnotationError(str(type))
            types.append(type)
        except AnnotationError as error:
            problems.append(_problem(declaration, name, error))
        except SourceError as error:  # the annotation is a record whose fields are wrong
            problems += error.diagnostics
    result: ir.Type = ir.VOID
    try:
        result = type_of(annotations.get("return"), names)
        if not is_result(result):
            raise AnnotationError(str(result))
    except AnnotationError as error:
        problems.append(_problem(declaration, "return", error))
    except SourceError as error:
        problems += error.diagnostics
    if problems:
        raise SourceError(sorted(problems, key=source_order))
    return Signature(tuple(types), result)


def _refuse_other_parameters(declaration: Declaration, problems: list[Diagnostic]) -> None:
    """Plain parameters only: no defaults, no `*args`, nothing by keyword alone."""
    for parameter in inspect.signature(declaration.function).parameters.values():
        what = ""
        if parameter.kind not in (parameter.POSITIONAL_OR_KEYWORD, parameter.POSITIONAL_ONLY):
            what = f"`{parameter}` is not part of the language: parameters are plain names with types"
        elif parameter.default is not parameter.empty:
            what = f"parameter `{parameter.name}` has a default value, which is not part of the language"
        if what:
            source, _ = declaration.parsed
            problems.append(Diagnostic(what, _annotation_span(declaration, parameter.name), source=source.text))


def _problem(declaration: Declaration, name: str, error: AnnotationError) -> Diagnostic:
    source, _ = declaration.parsed
    if name == "return":
        message, expected = f"the result of `{declaration.name}` has no type of the language", RESULT_TYPES
    else:
        message, expected = f"parameter `{name}` has no type of the language", PARAMETER_TYPES
    span = _annotation_span(declaration, name)
    return Diagnostic(message, span, expected, error.found, error.hint, source=source.text)


def _annotation_span(declaration: Declaration, name: str) -> Span:
    source, definition = declaration.parsed
    if name == "return":
        return source.span(definition.returns or definition)
    every = definition.args
    arguments = [*every.posonlyargs, *every.args, *every.kwonlyargs, *filter(None, (every.vararg, every.kwarg))]
    argument = next(argument for argument in arguments if argument.arg == name)
    return source.span(argument.annotation or argument)


def read_record(cls: RecordType) -> ir.Record:
    """The type that the annotated fields of a record class give."""
    defined_in = sys.modules.get(cls.__module__)
    names = (vars(defined_in) if defined_in else {}) | cls._mentioned
    fields, problems = [], []
    for name, annotation in inspect.get_annotations(cls).items():
        try:
            type = type_of(annotation, names)
            if not is_value(type):
                raise AnnotationError(str(type))
            fields.append((name, type))
        except AnnotationError as error:
            problems.append(_field_problem(cls, name, error))
        except SourceError as error:
            problems += error.diagnostics
    if not fields and not problems:
        problems.append(Diagnostic(f"record `{cls.__name__}` has no fields", cls._place, "at least one `name: type`"))
    if problems:
        raise SourceError(problems)
    return ir.Record(cls.__name__, tuple(fields))


def _field_problem(cls: RecordType, name: str, error: AnnotationError) -> Diagnostic:
    message = f"field `{name}` of record `{cls.__name__}` has no type of the language"
    source = read_source(cls._place.file)
    definition = source.class_near(cls.__name__, cls._place.line) if source else None
    span = cls._place
    if source and definition:
        fields = [statement for statement in definition.body if isinstance(statement, ast.AnnAssign)]
        span = next((source.span(f.annotation) for f in fields if ast.unparse(f.target) == name), span)
    return Diagnostic(message, span, TYPES, error.found, error.hint, source=source.text if source else None)
