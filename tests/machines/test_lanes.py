"""Operations that see the lanes of a packet, what is uniform, and what is said where `same_lanes` does not hold."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasuki.diagnostics import SourceError
from tasuki.ir import nodes as n
from tasuki.ir.types import BOOL, F32, I32, VEC3, Array, Tuple
from tasuki.language import all_lanes, any_lane, array, count_lanes, f32, i32, link, load_modules, module, same_lanes
from tasuki.machines.cpu.launch import pattern
from tasuki.machines.cpu.lower import lower_program
from tasuki.machines.cpu.variance import VarianceAnalysis
from tests.ir.build import construct, f, function, i, local, member, op, program
from tests.machines.running import WIDTHS, compile_program, run_compiled

LANES = Path(__file__).parent / "lanes"
widths = pytest.mark.parametrize("width", WIDTHS)


def run_module(entry, width, *columns):
    """The leaves of a module's result for arrays of its scalar parameters."""
    linked = link(entry, {})
    bindings = ["items"] * len(columns)
    return run_compiled(compile_program(linked, bindings, width), bindings, [[c] for c in columns], len(columns[0]))


# --- same_lanes -------------------------------------------------------------------------------------------------------


def test_what_is_said_where_lanes_may_differ(golden):
    """The whole chain of reasons, with every place in the source."""
    texts = []
    for entry in load_modules(LANES / "varying.py"):
        if not hasattr(entry, "check"):
            continue
        linked = link(entry, {})
        parameters = ["items"] * len(linked.functions[linked.entry].parameters)
        varying = pattern(linked.functions[linked.entry], parameters, 8)
        if "same_lanes" not in str(linked.functions[linked.entry].body):
            continue
        with pytest.raises(SourceError) as caught:
            lower_program(linked, varying, 8, checked=True, profile=False)
        texts.append(f"--- {entry.name}\n{caught.value}\n")
    golden(LANES / "varying.txt", "\n".join(texts).replace(f"{LANES}/", ""))


def test_one_lane_always_agrees_with_itself():
    for entry in load_modules(LANES / "varying.py"):
        if getattr(entry, "name", "") == "through_a_loop":
            [found] = run_module(entry, 1, np.array([2.5, -1, 9], np.float32))
            assert found.tolist() == [3, 0, 9]


@module
def decided_together(x: f32) -> i32:
    most = 0
    for k in range(8):
        if any_lane(x > f32(k)):
            most = k + 1
    return same_lanes(most)


@pytest.mark.parametrize("width", [4, 8, 16])
def test_what_is_decided_together_is_the_same(width):
    x = np.random.default_rng(0).uniform(-2, 8, 64).astype(np.float32)
    [found] = run_module(decided_together, width, x)
    packets = x.reshape(-1, width)
    most = np.clip(np.ceil(packets.max(axis=1)), 0, 8)
    np.testing.assert_array_equal(found.reshape(-1, width), np.repeat(most[:, None], width, axis=1))


# --- any, all, count --------------------------------------------------------------------------------------------------


@module
def counted(a: bool, b: bool) -> tuple[bool, bool, i32, i32, i32, bool]:
    active = count_lanes(True)
    inner = 0
    none = False
    if b:
        inner = count_lanes(a)
        none = any_lane(not b)
    return any_lane(a), all_lanes(a), count_lanes(a), active, inner, none


@settings(max_examples=50, deadline=None)
@given(data=st.data())
@widths
def test_laws_of_any_all_and_count(width, data):
    """They see the lanes of the packet whose items exist, and under a branch those that took it."""
    items = data.draw(st.integers(1, 40))
    flags = st.lists(st.booleans(), min_size=items, max_size=items)
    a, b = np.array(data.draw(flags)), np.array(data.draw(flags))
    executable = compiled_counted(width)
    found = run_compiled(executable, ["items", "items"], [[a], [b]], items)
    for first in range(0, items, width):
        packet = slice(first, first + width)
        mine, taken = a[packet], b[packet]
        some, every, count, active, inner, none = (leaf[packet] for leaf in found)
        assert (some == mine.any()).all()
        assert (every == mine.all()).all()
        assert (count == mine.sum()).all()
        assert (active == len(mine)).all()
        np.testing.assert_array_equal(inner, np.where(taken, mine[taken].sum(), 0))
        assert not none.any()
        # Laws that hold whatever the lanes are.
        assert (some == (count > 0)).all()
        assert (every == (count == active)).all()


_COUNTED: dict = {}


def compiled_counted(width):
    if width not in _COUNTED:
        _COUNTED[width] = compile_program(link(counted, {}), ["items", "items"], width)
    return _COUNTED[width]


@module
def leave_one_by_one(x: i32) -> tuple[i32, i32]:
    rounds = 0
    total = 0
    for k in range(20):
        if x <= k:
            break
        total += count_lanes(True)
        rounds += 1
    return rounds, total


@widths
def test_lanes_that_left_a_loop_are_not_counted(width):
    x = np.random.default_rng(5).integers(0, 20, 50).astype(np.int32)
    rounds, total = run_module(leave_one_by_one, width, x)
    np.testing.assert_array_equal(rounds, x)
    for first in range(0, 50, width):
        packet = x[first : first + width]
        expected = [sum(int((packet > k).sum()) for k in range(mine)) for mine in packet]
        assert total[first : first + width].tolist() == expected


# --- nothing runs with no lane active ---------------------------------------------------------------------------------


@module
def forever_unless_taken(x: i32) -> i32:
    out = 0
    if x > 1000:
        while True:
            out += 1
            if any_lane(x < 0):
                break
    while x > 0:
        return x
    return out


@widths
def test_a_branch_that_no_lane_takes_is_not_run(width):
    x = np.arange(-5, 30, dtype=np.int32)
    [found] = run_module(forever_unless_taken, width, x)
    np.testing.assert_array_equal(found, np.maximum(x, 0))


# --- what is uniform --------------------------------------------------------------------------------------------------


@module
def partly_uniform(x: f32, k: i32) -> tuple[f32, i32]:
    values = array(f32, 3)
    for position in range(k):
        values[position] = x
    return values[k], k * 2


def test_leaves_vary_one_by_one():
    """Of one result, what depends on the items varies and the rest does not."""
    linked = link(partly_uniform, {})
    variance = VarianceAnalysis(linked).analyse(linked.entry, ((True,), (False,)))
    assert [reason is not None for reason in variance.result] == [True, False]
    assert variance.variables["k"] == [None]
    assert not variance.parted


def test_members_of_a_vector_vary_one_by_one():
    value = construct(VEC3, local("x", F32), f(1), f(2))
    body = [n.Assign("v", value), n.Assign("v", f(3), ("y",)), n.Return(member(local("v", VEC3), "y"))]
    made = program(function(body, {"x": F32}, F32, {"v": VEC3}))
    variance = VarianceAnalysis(made).analyse("main", ((True,),))
    assert [reason is not None for reason in variance.variables["v"]] == [True, False, False]
    assert variance.result == [None]


def test_clearing_an_array_where_lanes_have_parted_makes_it_vary():
    kind = Array(I32, 2)
    body = [
        n.Clear("a"),
        n.SetElement("a", i(0), i(5)),
        n.If(local("p", BOOL), (n.Clear("a"),)),
        n.Return(n.Element("a", i(0), I32)),
    ]
    made = program(function(body, {"p": BOOL}, I32, {"a": kind}))
    for width in WIDTHS:
        executable = compile_program(made, ["items"], width)
        found = run_compiled(executable, ["items"], [[np.array([True, False, True, False, False])]], 5)
        assert found[0].tolist() == [0, 5, 0, 5, 5]


def test_a_variable_of_one_pass_needs_no_blending():
    """Its home is the loop's body: what parts lanes outside of it does not make it vary."""
    inside = [n.Assign("t", op("multiply", local("k", I32), i(3))), n.Assign("sum", op("add", local("sum", I32), i(1)))]
    body = [
        n.Assign("k", i(0)),
        n.Assign("sum", i(0)),
        n.If(local("p", BOOL), (n.Loop(op("less", local("k", I32), i(3)), tuple(inside)),)),
        n.Return(local("sum", I32)),
    ]
    made = program(function(body, {"p": BOOL}, I32, {"k": I32, "t": I32, "sum": I32}))
    variance = VarianceAnalysis(made).analyse("main", ((True,),))
    assert variance.variables["t"] == [None]
    assert variance.variables["sum"] != [None]


def test_results_that_do_not_vary_reach_every_item():
    value = construct(Tuple((I32, BOOL)), local("k", I32), op("less", local("k", I32), i(3)))
    made = program(function([n.Return(value)], {"k": I32, "x": F32}, value.type))
    for width in WIDTHS:
        bindings = ["same", "items"]
        executable = compile_program(made, bindings, width)
        found = run_compiled(executable, bindings, [[np.array([2], np.int32)], [np.zeros(19, np.float32)]], 19)
        assert [leaf.tolist() for leaf in found] == [[2] * 19, [True] * 19]
