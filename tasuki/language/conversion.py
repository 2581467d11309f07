"""What Python and NumPy have for the values of the language, made into such values (`tasuki.language.values`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tasuki.ir import types
from tasuki.ir.paths import at_path
from tasuki.language.values import (
    F32,
    described,
    from_leaves,
    leaves,
    new_record,
    scalar_of,
    type_of,
    type_of_or_none,
)


def convert(type_: types.Type, value: Any) -> Any:
    """A value of `type_`, made from what Python and NumPy have for it.

    Numbers for scalars; a sequence or array for a vector; an array `[row][column]` for a matrix; an instance, mapping
    or structured scalar for a record; a sequence for a tuple. Raises TypeError with the place inside the value, and
    never converts between f32 and i32 values.
    """
    if isinstance(type_, types.Scalar):
        return scalar_of(type_, value)
    if isinstance(type_, types.Vector | types.Matrix):
        return _convert_compound(type_, value)
    if isinstance(type_, types.Record):
        return _convert_record(type_, value)
    if isinstance(type_, types.Tuple):
        return _convert_tuple(type_, value)
    raise TypeError(f"{type_} has no values that could be converted to")


def _convert_compound(type_: types.Type, value: Any) -> Any:
    if type_of_or_none(value) == type_:
        return value
    shape = (4, 4) if type_ == types.MAT4 else (len(type_.leaves),)
    try:
        numbers = np.asarray(value)
    except ValueError:
        numbers = np.empty(0)
    if numbers.shape != shape or numbers.dtype.kind not in "fiu":
        raise TypeError(f"expected {type_}: numbers of shape {shape}, found {described(value)}")
    # In memory, and so among the leaves, a matrix stands column by column.
    return from_leaves(type_, [F32(number) for number in numbers.T.reshape(-1)])


def _convert_record(type_: types.Record, value: Any) -> Any:
    if type_of_or_none(value) == type_:
        return value
    if isinstance(value, np.void) and value.dtype.names == tuple(name for name, _ in type_.fields):
        return from_leaves(type_, _structured_leaves(value))
    if not isinstance(value, Mapping):
        raise TypeError(f"expected {type_}, found {described(value)}")
    names = [name for name, _ in type_.fields]
    if set(value) != set(names):
        raise TypeError(f"{type_} has the fields {', '.join(names)}; found {', '.join(map(str, value))}")
    return new_record(type_, [_convert_inside(f"{type_}.{name}", t, value[name]) for name, t in type_.fields])


def _structured_leaves(value: np.void) -> list[Any]:
    """The numbers in a structured scalar, as they stand in memory: a matrix column by column, a bool as an integer."""
    numbers: list[Any] = []
    for name in value.dtype.names or ():
        field = value[name]
        numbers += _structured_leaves(field) if isinstance(field, np.void) else np.ravel(field).tolist()
    return numbers


def _convert_tuple(type_: types.Tuple, value: Any) -> Any:
    if type_ == types.VOID and value is None:
        return None
    if not isinstance(value, Sequence | np.ndarray) or isinstance(value, str) or len(value) != len(type_.items):
        raise TypeError(f"expected {type_}, found {described(value)}")
    return tuple(_convert_inside(f"item {i}", t, value[i]) for i, t in enumerate(type_.items))


def _convert_inside(place: str, type_: types.Type, value: Any) -> Any:
    try:
        return convert(type_, value)
    except TypeError as error:
        raise TypeError(f"{place}: {error}") from None


def updated(value: Any, path: Sequence[str], new: Any) -> Any:
    """`value` with the member at `path` replaced by `new`; `value` itself stays as it was."""
    type_ = type_of(value)
    member, place = at_path(type_, path)
    flat = leaves(value)
    flat[place.start : place.stop] = leaves(convert(member, new))
    return from_leaves(type_, flat)
