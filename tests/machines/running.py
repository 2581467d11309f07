"""What the tests of the CPU machine share: compile a program of the IR without any cache, run it, compare."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tasuki.ir import nodes as n
from tasuki.ir.memory import MemoryTable
from tasuki.ir.types import Table
from tasuki.ir.verify import verify
from tasuki.machines.cpu.launch import Binding, emit_kernel, sorted_tables
from tasuki.machines.cpu.machine import Argument, Executable, Items, Number, Same, Shape
from tasuki.native.compile import compile_object

WIDTHS = (1, 4, 8, 16)


def compile_program(
    program: n.Program, bindings: Sequence[Binding], width: int, *, checked: bool = True, profile: bool = False
) -> Executable:
    """`program`, verified, for packets of `width` lanes, its entry's parameters bound as `bindings` says."""
    verify(program)
    kernel = emit_kernel(program, bindings, width, checked=checked, profile=profile)
    entry = program.functions[program.entry]
    scalars = [p.type.record.rows if isinstance(p.type, Table) else list(p.type.leaves) for p in entry.parameters]
    tables = {name: program.tables[name].rows for name in sorted_tables(program)}
    shape = Shape(scalars, list(entry.result.leaves), tables, width, kernel.sites, kernel.profiled)
    return Executable(compile_object(kernel.text), shape)


def run_compiled(
    executable: Executable,
    bindings: Sequence[Binding],
    values: Sequence[Any],
    items: int,
    *,
    tables: Mapping[str, MemoryTable] | None = None,
    threads: int = 1,
    chunk: int = 1024,
) -> list[np.ndarray]:
    """The leaves of the result. `values`: for each parameter its leaves, each of shape (items,), or a MemoryTable.

    Of a parameter that is the "same" for all items the first item's value is taken.
    """
    arguments = [bind(binding, value) for binding, value in zip(bindings, values, strict=True)]
    return executable.run(arguments, items, tables=tables, threads=threads, chunk=chunk)


def bind(binding: Binding, value: Any) -> Argument:
    if isinstance(value, MemoryTable):
        return value
    if binding == "number":
        return Number()
    return Items(value) if binding == "items" else Same([leaf.flat[0].item() for leaf in value])


def spread(bindings: Sequence[Binding], values: Sequence[Any], items: int) -> list[Any]:
    """The same arguments, as the interpreter takes them."""
    results: list[Any] = []
    for binding, value in zip(bindings, values, strict=True):
        if isinstance(value, MemoryTable):
            results.append(value)
        elif binding == "number":
            results.append([np.arange(items, dtype=np.int32)])
        else:
            results.append([leaf if binding == "items" else leaf[:1].repeat(items) for leaf in value])
    return results


def differing(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Where two leaves differ in a bit; any NaN equals any NaN."""
    assert one.dtype == other.dtype
    assert one.shape == other.shape
    if one.dtype != np.float32:
        return one != other
    return (one.view(np.int32) != other.view(np.int32)) & ~(np.isnan(one) & np.isnan(other))


def assert_same_bits(found: Sequence[np.ndarray], expected: Sequence[np.ndarray], what: str = "") -> None:
    assert len(found) == len(expected)
    for position, (one, other) in enumerate(zip(found, expected, strict=True)):
        wrong = np.flatnonzero(differing(one, other))
        if len(wrong):
            item = wrong[0]
            raise AssertionError(
                f"{what}: leaf {position} of item {item} ({len(wrong)} of {len(one)} items): "
                f"found {one[item]!r}, expected {other[item]!r}"
            )
