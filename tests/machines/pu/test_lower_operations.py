"""Every operation of the table on the PU, bit for bit as the interpreter does it under the PU's arithmetic."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasuki.ir import nodes as n
from tasuki.ir.types import F32, MAT4, VEC3, VEC4, Tuple
from tasuki.machines.pu.isa import tables
from tasuki.machines.pu.lower import arithmetic
from tests.ir.build import construct, function, local, member, op, pair, program
from tests.machines.pu.lowering import agree
from tests.machines.test_conformance import (
    F32_VALUES,
    all_triples,
    make_program,
    random_leaves,
    scalar_signatures,
    whole_signatures,
)

GROUP = 12
"""Operations in one program: its results fill that many registers."""
BOTH = [*scalar_signatures(), *whole_signatures()]
GROUPS = [BOTH[first : first + GROUP] for first in range(0, len(BOTH), GROUP)]


@pytest.mark.parametrize("group", range(len(GROUPS)))
def test_operations_on_nasty_and_random_operands(group):
    made, slots = make_program(GROUPS[group])
    values = [random_leaves(kind, 100 * group + i, 400) for i, (kind, _) in enumerate(slots)]
    agree(made, values, 400, simulator="fast")


@pytest.mark.parametrize("first", range(0, len(scalar_signatures()), GROUP))
def test_all_pairs_of_nasty_scalars(first):
    made, slots = make_program(scalar_signatures()[first : first + GROUP])
    items = len(F32_VALUES) ** 2
    values = [all_triples(kind, position, items) for kind, position in slots]
    agree(made, values, items, simulator="fast")


@settings(max_examples=50, deadline=None)
@given(words=st.lists(st.tuples(*[st.integers(0, 2**32 - 1)] * 2), min_size=1, max_size=8))
def test_any_bits_through_the_microcode_of_functions(words):
    """Division, square root, sine and cosine are what the machine's arithmetic says, on any words."""
    a, b = (np.array(column, np.uint32).view(np.float32) for column in zip(*words, strict=True))
    x, y = local("x", F32), local("y", F32)
    value = pair(op("divide", x, y), op("sqrt", x), op("reciprocal", y), op("sin", x), op("cos", y), op("fma", x, y, x))
    made = program(function([n.Return(value)], {"x": F32, "y": F32}, value.type))
    agree(made, [[a], [b]], len(a))


@settings(max_examples=200, deadline=None)
@given(words=st.lists(st.integers(0, 2**32 - 1), min_size=1, max_size=50))
def test_the_tables_for_arrays_are_the_tables(words):
    """The seeds that the arithmetic starts from are those of the reference, `isa.tables.lookup`."""
    a = np.array(words, np.uint32).view(np.float32)
    with np.errstate(all="ignore"):
        seed, point, special = arithmetic.reciprocal_seed(a)
        root = arithmetic.root_seed(a)
    for i, word in enumerate(words):
        assert (int(seed[i : i + 1].view(np.uint32)[0]), bool(special[i])) == tables.lookup("rcp", word)
        assert int(point[i : i + 1].view(np.uint32)[0]) == tables.lookup("point", word)[0]
        assert int(root[i : i + 1].view(np.uint32)[0]) == tables.lookup("sqrt", word)[0]


@pytest.mark.parametrize("kind", [VEC3, VEC4])
def test_operands_of_every_bank(kind):
    """Scalars are computed in the bank where they lie, or brought together from several."""
    v, s = local("v", kind), local("s", F32)
    parts = [member(v, name) for name in "xyzw"[: kind.size]] + [s]
    results = [
        op(name, a, b) for name in ("subtract", "minimum", "copysign", "divide", "less") for a in parts for b in parts
    ]
    results += [op("select", op("less", a, b), b, a) for a in parts for b in parts]
    results += [op("multiply", construct(kind, a), v) for a in parts] + [op("subtract", v, a) for a in parts]
    value = construct(Tuple(tuple(one.type for one in results)), *results)
    made = program(function([n.Return(value)], {"v": kind, "s": F32}, value.type))
    agree(made, [random_leaves(kind, 1, 60), random_leaves(F32, 2, 60)], 60, simulator="fast")


def test_products_of_matrices_that_are_assigned_to_their_operands():
    a, b = local("a", MAT4), local("b", MAT4)
    body = [
        n.Assign("a", op("compose", a, b)),
        n.Assign("b", op("transpose", op("add", a, b))),
        n.Return(op("compose", b, b)),
    ]
    made = program(function(body, {"a": MAT4, "b": MAT4}, MAT4))
    agree(made, [random_leaves(MAT4, 1, 50), random_leaves(MAT4, 2, 50)], 50, simulator="fast")
