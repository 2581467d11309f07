"""Whole programs on the PU: control flow, calls, memory, few registers; bit for bit as the interpreter does them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasuki.diagnostics import MachineError, SourceError
from tasuki.ir import nodes as n
from tasuki.ir.memory import MemoryTable
from tasuki.ir.types import BOOL, F32, I32, VEC3, Array, Record, Table
from tasuki.machines.pu.lower import Executable, allocate
from tasuki.machines.pu.lower import program as lowering
from tests.ir.build import element, f, function, i, load, local, op, pair, program
from tests.ir.random_programs import random_arguments, random_programs, random_tables
from tests.machines.pu.lowering import agree
from tests.machines.test_tables import COUNT, MIXED, MIXED_TABLE, PATHS, accessing, counting, random_memory

ITEMS = 3


@settings(max_examples=50, deadline=None)
@given(data=st.data())
def test_random_programs(data):
    made = data.draw(random_programs(lane_operations=True))
    agree(made, data.draw(random_arguments(made, ITEMS)), ITEMS)


@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_random_programs_with_tables(data):
    made = data.draw(random_programs(tables=True))
    agree(made, data.draw(random_arguments(made, ITEMS)), ITEMS, data.draw(random_tables(ITEMS)))


@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_random_programs_of_subroutines_with_hardly_a_register(data):
    """Every call is a call, and most values live in memory."""
    made = data.draw(random_programs(lane_operations=True))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lowering, "INLINED", -1)
        patch.setattr(allocate, "ROWS", 3)
        patch.setattr(allocate, "INTEGERS", 3)
        agree(made, data.draw(random_arguments(made, ITEMS)), ITEMS)


@pytest.mark.parametrize("checked", [False, True])
def test_loads_of_records_and_members(checked):
    value = pair(*(load(MIXED_TABLE, local("at", I32), *path) for path in PATHS), n.Length(MIXED_TABLE, I32))
    made = program(function([n.Return(value)], {"at": I32}, value.type), tables={"things": MIXED})
    memory = random_memory(MIXED, COUNT)
    at = np.arange(COUNT, dtype=np.int32)
    agree(made, [[at]], COUNT, {"things": MemoryTable(memory, 2, COUNT)}, checked=checked)


@pytest.mark.parametrize("path", PATHS, ids="-".join)
def test_stores_reach_what_they_name(path):
    source = n.NamedTable("source", Table(MIXED))
    body = [n.Store(MIXED_TABLE, local("at", I32), load(source, i(1), *path), path)]
    made = program(function(body, {"at": I32}), tables={"things": MIXED, "source": MIXED})
    tables = {
        "things": MemoryTable(random_memory(MIXED, COUNT), 2, COUNT),
        "source": MemoryTable(random_memory(MIXED, COUNT, 1), 2, COUNT),
    }
    agree(made, [[np.array([3, 5], np.int32)]], 2, tables)


def test_tables_as_parameters():
    """A table goes through a call, and into the entry; a subroutine is made for each table that it is given."""
    inner = function(
        [n.Return(load(local("table", Table(MIXED)), local("at", I32), "place"))],
        {"table": Table(MIXED), "at": I32},
        VEC3,
        name="inner",
    )
    body = [
        n.Call("one", "inner", (local("table", Table(MIXED)), local("at", I32))),
        n.Call("two", "inner", (MIXED_TABLE, local("at", I32))),
        n.Return(pair(local("one", VEC3), local("two", VEC3))),
    ]
    result = pair(local("one", VEC3), local("two", VEC3)).type
    main = function(body, {"table": Table(MIXED), "at": I32}, result, {"one": VEC3, "two": VEC3})
    made = program(main, inner, tables={"things": MIXED})
    given_table = MemoryTable(random_memory(MIXED, COUNT, 5), 2, COUNT)
    tables = {"things": MemoryTable(random_memory(MIXED, COUNT), 2, COUNT)}
    at = [np.arange(COUNT, dtype=np.int32)]
    for inlined in (-1, lowering.INLINED):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(lowering, "INLINED", inlined)
            agree(made, [given_table, at], COUNT, tables)


def test_atomics_and_what_they_saw():
    record = Record("Counter", (("total", I32), ("least", I32), ("most", I32)))
    draw = np.random.default_rng(3)
    at, value = draw.integers(0, COUNT, 50).astype(np.int32), draw.integers(-(2**31), 2**31, 50).astype(np.int32)
    tables = {"counters": MemoryTable(random_memory(record, COUNT), 2, COUNT)}
    agree(counting(local("at", I32)), [[at], [value]], 50, tables)


def test_indices_of_local_arrays_are_clamped_and_arrays_begin_empty():
    array = Array(VEC3, 5)
    at, x = local("at", I32), local("x", F32)
    value = n.Construct((x, x, op("to_f32", at)), VEC3)
    body = [
        n.Loop(
            op("less", local("n", I32), i(2)),
            (
                n.Clear("list"),
                n.Assign("sum", op("add", local("sum", VEC3), element("list", array, i(9)))),
                n.SetElement("list", at, value),
                n.SetElement("list", i(-3), op("absolute", x), ("y",)),
                n.Assign("sum", op("add", local("sum", VEC3), element("list", array, op("add", at, i(1))))),
            ),
            step=(n.Assign("n", op("add", local("n", I32), i(1))),),
        ),
        n.Return(op("add", local("sum", VEC3), element("list", array, i(0)))),
    ]
    start = [n.Assign("n", i(0)), n.Assign("sum", n.Construct((f(0.0),), VEC3))]
    variables = {"list": array, "n": I32, "sum": VEC3}
    made = program(function([*start, *body], {"at": I32, "x": F32}, VEC3, variables))
    indices = np.array([-(2**31), -1, 0, 1, 4, 5, 2**31 - 1], np.int32)
    agree(made, [[indices], [np.linspace(-3, 3, 7).astype(np.float32)]], 7)


@pytest.mark.parametrize("inlined", [-1, lowering.INLINED])
@pytest.mark.parametrize("schedule", ["macro", "compact"])
@pytest.mark.parametrize("kind", ["load", "store", "atomic"])
@pytest.mark.parametrize("bad", [COUNT, -1, 2**31 - 1, -(2**31)])
def test_an_access_outside_is_reported(bad, kind, schedule, inlined, monkeypatch):
    """By the first item that makes it, also from within a subroutine; what lies outside the table is untouched."""
    monkeypatch.setattr(lowering, "INLINED", inlined)
    inner = accessing(kind)
    arguments = (local("at", I32), local("wants", BOOL))
    body = [n.Call("y", "scenes:shade", arguments), n.Call("y", "scenes:shade", arguments), n.Return(local("y", F32))]
    main = function(body, {"at": I32, "wants": BOOL}, F32, {"y": F32})
    made = program(main, *inner.functions.values(), tables=dict(inner.tables))
    rows = random_memory(MIXED, COUNT)
    before = rows.copy()
    at = np.array([2, 3, bad, 99], np.int32)
    executable = Executable(made, schedule, checked=True)
    tables = {"things": MemoryTable(rows, 2, COUNT)}
    with pytest.raises(MachineError) as caught:
        executable.run([[at], [np.ones(4, bool)]], 4, tables=tables)
    assert str(caught.value).startswith("scene.py:12:5: error: an access outside table `things` in module `shade`")
    assert f"index {bad}" in str(caught.value)
    outside = [0, 1, *range(2 + COUNT * MIXED.rows, len(rows))]
    assert np.array_equal(rows[outside].view(np.int32), before[outside].view(np.int32))
    executable.run([[at], [np.zeros(4, bool)]], 4, tables=tables)


def test_a_missing_table_is_named():
    made = program(function([n.Return(n.Length(MIXED_TABLE, I32))], {"x": I32}, I32), tables={"things": MIXED})
    with pytest.raises(MachineError, match="`things`"):
        Executable(made).run([[np.zeros(3, np.int32)]], 3)


def test_a_loop_that_does_not_end_meets_its_limit():
    made = program(function([n.Loop(n.Constant(True, BOOL), ())], {"x": I32}))
    with pytest.raises(MachineError, match="item 0: no halt within 1000 steps"):
        Executable(made).run([[np.zeros(1, np.int32)]], 1, limit=1000)


def test_a_table_whose_memory_is_read_only_stays_as_it_is():
    memory = random_memory(MIXED, COUNT)
    memory.flags.writeable = False
    body = [n.Store(MIXED_TABLE, local("at", I32), f(1.0), ("weight",))]
    made = program(function(body, {"at": I32}), tables={"things": MIXED})
    with pytest.raises(MachineError, match="read-only"):
        Executable(made).run([[np.zeros(1, np.int32)]], 1, tables={"things": MemoryTable(memory, 2, COUNT)})


def test_more_tables_than_the_address_generator_has_registers_are_refused():
    names = [f"t{number}" for number in range(40)]
    record = Record("One", (("x", F32),))
    value = f(0.0)
    for name in names:
        value = op("add", value, load(n.NamedTable(name, Table(record)), i(0), "x"))
    made = program(function([n.Return(value)], {"x": I32}, F32), tables=dict.fromkeys(names, record))
    with pytest.raises(SourceError, match="too many tables"):
        Executable(made)


def test_inlining_does_not_grow_beyond_measure():
    """Twelve functions that call each other twice: 4,096 copies of the last, if nobody looked."""
    x, y = local("x", F32), local("y", F32)
    functions = [function([n.Return(op("multiply", x, f(0.5)))], {"x": F32}, F32, name="f0")]
    for number in range(1, 13):
        inner = (n.Call("y", f"f{number - 1}", (x,)), n.Call("y", f"f{number - 1}", (y,)))
        functions.append(function([*inner, n.Return(y)], {"x": F32}, F32, {"y": F32}, name=f"f{number}"))
    made = program(*reversed(functions))
    assert len(Executable(made).compiled.words.words) < 1000
    agree(made, [[np.array([3.0], np.float32)]], 1)


def test_calls_deeper_than_the_call_stack_are_refused():
    x = local("x", F32)
    functions = [function([n.Return(op("sqrt", x))], {"x": F32}, F32, name="f0")]
    for number in range(1, 20):
        inner = (n.Call("y", f"f{number - 1}", (x,)), n.Call("y", f"f{number - 1}", (local("y", F32),)))
        functions.append(function([*inner, n.Return(local("y", F32))], {"x": F32}, F32, {"y": F32}, name=f"f{number}"))
    made = program(*reversed(functions))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lowering, "INLINED", -1)
        with pytest.raises(SourceError, match="nested too deeply"):
            Executable(made)
