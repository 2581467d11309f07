"""Every operation of the table on the CPU, bit for bit as the interpreter does it, with the arguments that hurt.

All operations on the same types of arguments stand in one program with one result each, so that few programs are
compiled. A pattern says which parameters are the same for all lanes: of "svv" the first, the others vary.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasuki.ir import nodes as n
from tasuki.ir.interpret import interpret
from tasuki.ir.ops import OPERATIONS
from tasuki.ir.types import BOOL, F32, I32, MAT4, VEC3, VEC4, Tuple, Type
from tasuki.machines.cpu.launch import Binding
from tasuki.machines.cpu.machine import Executable
from tests.ir.build import construct, function, local, op, pair, program
from tests.ir.random_programs import HIT, NASTY_F32, NASTY_I32
from tests.machines.running import WIDTHS, assert_same_bits, compile_program, run_compiled, spread

HALVES = [0.49999997, 1.4999999, 2.5, -0.5, -1.5, -2.5, 8388607.5, 2147483520.0, -2147483904.0, 16777216.0]
"""Near where rounding, truncation and saturation turn."""
F32_VALUES = np.array([*NASTY_F32, *HALVES], np.float32)
I32_VALUES = np.array([*NASTY_I32, -31, -32, -33, 64, -(2**31) + 1, 2**24 + 3, -(2**24) - 1], np.int32)

Slot = tuple[Type, int]
"""A parameter of a test program: the `position`-th argument of some type."""


def signatures() -> list[tuple[str, tuple[Type, ...]]]:
    """(operation, types of its arguments): the table's, and forms that go element by element."""
    found = []
    for name, operation in OPERATIONS.items():
        if operation.sort == "lanes":
            continue
        for types, _ in operation.signatures:
            found.append((name, types))
            if operation.sort == "primitive" and F32 in types:
                forms = {tuple(shape if t == F32 else t for t in types) for shape in (VEC3, VEC4, MAT4)}
                forms |= {(VEC3, *types[1:]), (*types[:-1], VEC4)}
                found += [(name, form) for form in sorted(forms, key=str) if operation.result(form) is not None]
    return [*found, ("select", (BOOL, HIT, HIT))]


def scalar_signatures() -> list[tuple[str, tuple[Type, ...]]]:
    return [(name, types) for name, types in signatures() if set(types) <= {F32, I32, BOOL}]


def whole_signatures() -> list[tuple[str, tuple[Type, ...]]]:
    return [(name, types) for name, types in signatures() if not set(types) <= {F32, I32, BOOL}]


def parameter_name(kind: Type, position: int) -> str:
    return f"{str(kind).lower()}_{position}"


def make_program(cases: Sequence[tuple[str, tuple[Type, ...]]]) -> tuple[n.Program, list[Slot]]:
    """A program that returns the result of every case, and what its parameters are."""
    slots: list[Slot] = []
    results = []
    for name, types in cases:
        arguments = []
        for position, kind in enumerate(types):
            if (kind, position) not in slots:
                slots.append((kind, position))
            arguments.append(local(parameter_name(kind, position), kind))
        results.append(op(name, *arguments))
    parameters = {parameter_name(kind, position): kind for kind, position in slots}
    value = pair(*results)
    return program(function([n.Return(value)], parameters, value.type)), slots


def bindings_of(slots: Sequence[Slot], pattern: str) -> list[Binding]:
    """`pattern`: for each position of an argument "s" (the same for all items) or "v" (varying)."""
    return ["same" if pattern[position] == "s" else "items" for _, position in slots]


@cache
def compiled(which: str, pattern: str, width: int, checked: bool) -> tuple[n.Program, list[Slot], Executable]:
    made, slots = make_program(scalar_signatures() if which == "scalar" else whole_signatures())
    return made, slots, compile_program(made, bindings_of(slots, pattern), width, checked=checked)


def all_triples(kind: Type, position: int, items: int) -> list[np.ndarray]:
    """The nasty values of a scalar type, turning at a rate that belongs to the position, so that all triples occur."""
    values = {F32: F32_VALUES, I32: I32_VALUES, BOOL: np.array([False, True])}[kind]
    return [values[(np.arange(items) // len(values) ** position) % len(values)]]


def random_leaves(kind: Type, seed: int, items: int) -> list[np.ndarray]:
    """Each leaf one of the nasty values, or any bits."""
    draw = np.random.default_rng(seed)
    results = []
    for leaf in kind.leaves:
        if leaf == "bool":
            results.append(draw.integers(0, 2, items) > 0)
            continue
        nasty = F32_VALUES.view(np.int32) if leaf == "f32" else I32_VALUES
        any_bits = draw.integers(-(2**31), 2**31, items).astype(np.int32)
        tame = draw.normal(size=items).astype(np.float32).view(np.int32)
        words = np.choose(draw.integers(0, 3, items), [draw.choice(nasty, items), any_bits, tame]).astype(np.int32)
        results.append(words.view(np.float32) if leaf == "f32" else words)
    return results


def compare(
    made: n.Program, bindings: Sequence[Binding], executable: Executable, values: list[list[np.ndarray]], what: str
) -> None:
    items = len(values[0][0])
    found = run_compiled(executable, bindings, values, items)
    expected = interpret(made, spread(bindings, values, items), lanes=items)
    assert_same_bits(found, expected, what)


def test_every_operation_has_a_case():
    covered = {name for name, _ in signatures()}
    assert covered == {name for name, operation in OPERATIONS.items() if operation.sort != "lanes"}
    for name in covered:
        listed = {types for types, _ in OPERATIONS[name].signatures}
        assert listed <= {types for other, types in signatures() if other == name}


@pytest.mark.parametrize("checked", [True, False])
@pytest.mark.parametrize("width", WIDTHS)
def test_all_triples_of_nasty_scalars(width, checked):
    made, slots, executable = compiled("scalar", "vvv", width, checked)
    # Not a multiple of the width: the last packet is partial.
    items = len(F32_VALUES) ** 3
    values = [all_triples(kind, position, items) for kind, position in slots]
    compare(made, bindings_of(slots, "vvv"), executable, values, f"width {width}")


@pytest.mark.parametrize("pattern", ["svv", "vsv", "vvs", "ssv", "svs", "vss"])
@pytest.mark.parametrize("width", [4, 16])
def test_uniform_beside_varying_arguments(width, pattern):
    made, slots, executable = compiled("scalar", pattern, width, False)
    bindings = bindings_of(slots, pattern)
    for turn in range(24):
        values = [random_leaves(kind, 1000 * turn + 10 * i + position, 203) for i, (kind, position) in enumerate(slots)]
        compare(made, bindings, executable, values, f"width {width}, pattern {pattern}")


@pytest.mark.parametrize("width", [1, 16])
def test_all_pairs_of_nasty_scalars_when_nothing_varies(width):
    made, slots, executable = compiled("scalar", "sss", width, False)
    bindings = bindings_of(slots, "sss")
    count = len(F32_VALUES) ** 2
    values = [all_triples(kind, position, count) for kind, position in slots]
    expected = interpret(made, values, lanes=count)
    found = [
        run_compiled(executable, bindings, [[leaf[item : item + 1] for leaf in value] for value in values], 1)
        for item in range(count)
    ]
    assert_same_bits([np.concatenate(column) for column in zip(*found, strict=True)], expected)


@pytest.mark.parametrize("pattern", ["vvv", "svv", "vsv", "vvs", "sss"])
@pytest.mark.parametrize("width", WIDTHS)
def test_vectors_matrices_and_records(width, pattern):
    made, slots, executable = compiled("whole", pattern, width, False)
    bindings = bindings_of(slots, pattern)
    turns, items = (1, 1001) if pattern == "vvv" else (8, 37)
    for turn in range(turns):
        values = [random_leaves(kind, 99 * turn + i, items) for i, (kind, _) in enumerate(slots)]
        compare(made, bindings, executable, values, f"width {width}, pattern {pattern}")


@pytest.mark.parametrize("width", [1, 8])
def test_operations_on_constants(width):
    """What LLVM folds at compile time is what it computes at run time."""
    results = []
    for name, types in scalar_signatures():
        sources = [{F32: F32_VALUES, I32: I32_VALUES, BOOL: [False, True]}[kind] for kind in types]
        combinations = list(product(*sources))
        chosen = np.random.default_rng(len(results)).permutation(len(combinations))[:40]
        for at in chosen:
            numbers = [np.asarray(value).item() for value in combinations[at]]
            results.append(op(name, *map(n.Constant, numbers, types)))
    for first in range(0, len(results), 500):
        value = pair(*results[first : first + 500])
        made = program(function([n.Return(value)], {"lane": I32}, value.type))
        compare(made, ["items"], compile_program(made, ["items"], width), [[np.zeros(3, np.int32)]], "constants")


@settings(max_examples=60, deadline=None)
@given(data=st.data())
@pytest.mark.parametrize("width", WIDTHS)
def test_any_scalars(width, data):
    made, slots, executable = compiled("scalar", "vvv", width, True)
    items = data.draw(st.integers(1, 20))
    words = st.lists(st.integers(-(2**31), 2**31 - 1), min_size=items, max_size=items)
    values = []
    for kind, _ in slots:
        drawn = np.array(data.draw(words), np.int32)
        values.append([{F32: drawn.view(np.float32), I32: drawn, BOOL: drawn & 1 == 1}[kind]])
    compare(made, bindings_of(slots, "vvv"), executable, values, f"width {width}")


def test_a_vector_of_one_scalar_has_it_in_every_component():
    value = construct(Tuple((VEC3, VEC4)), construct(VEC3, local("x", F32)), construct(VEC4, local("x", F32)))
    made = program(function([n.Return(value)], {"x": F32}, value.type))
    for width in WIDTHS:
        compare(made, ["items"], compile_program(made, ["items"], width), [[F32_VALUES]], f"width {width}")
