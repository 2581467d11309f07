"""What the tests of the modules share: arrays of records, directions, and runs that must agree in every bit."""

from __future__ import annotations

from typing import Any

import numpy as np

from tasuki.mapping import map_module
from tests.machines.running import WIDTHS, assert_same_bits

EPSILON = 2.0**-24
"""The most that one rounding to float32 changes a number, relatively."""


def flat(value: Any) -> list[np.ndarray]:
    """A result of `map_module` as arrays of shape (n,)."""
    if isinstance(value, tuple):
        return [leaf for part in value for leaf in flat(part)]
    if value.dtype.fields:
        return [leaf for name in value.dtype.names for leaf in flat(value[name])]
    return list(np.moveaxis(value.reshape(len(value), -1), 1, 0))


def everywhere(module: Any, *arguments: Any, **options: Any) -> Any:
    """The result of a module on arrays; by the interpreter and in packets of 1, 4, 8 and 16 it is the same."""
    expected = map_module(module, *arguments, machine="interpreter", **options)
    for width in WIDTHS:
        found = map_module(module, *arguments, machine="cpu", width=width, **options)
        assert_same_bits(flat(found), flat(expected), f"{module.name}, width {width}")
    return expected


def exactly(module: Any, *arguments: Any, **options: Any) -> Any:
    """The result in float64, for the same float32 arguments."""
    return map_module(module, *arguments, machine="interpreter", precision=np.float64, **options)


def records(kind: Any, count: int, **fields: Any) -> np.ndarray:
    """`count` records of a class made by `@record`; fields that are not given are zero."""
    result = np.zeros(count, kind.numpy_dtype())
    for name, value in fields.items():
        result[name] = value
    return result


def unit(vectors: np.ndarray) -> np.ndarray:
    return (vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)).astype(np.float32)


def random_directions(draw: np.random.Generator, count: int) -> np.ndarray:
    """Unit vectors; some along the axes and in the coordinate planes, with zeros of both signs."""
    directions = draw.normal(size=(count, 3))
    few = len(directions[::17])
    directions[::17] *= draw.permuted(np.tile([1.0, 0.0, -0.0], (few, 1)), axis=1)
    directions[1::17] *= draw.permuted(np.tile([1.0, -1.0, -0.0], (len(directions[1::17]), 1)), axis=1)
    return unit(directions)


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", a.astype(np.float64), b.astype(np.float64))
