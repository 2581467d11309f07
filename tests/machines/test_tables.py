"""Memory on the CPU: tables of records, uniform and varying access, checks, atomics, local arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tasuki.diagnostics import MachineError, Span
from tasuki.ir import nodes as n
from tasuki.ir.interpret import interpret
from tasuki.ir.memory import MemoryTable
from tasuki.ir.types import BOOL, F32, I32, MAT4, VEC3, Array, Record, Table, Tuple
from tests.ir.build import b, construct, element, f, function, i, load, local, member, op, pair, program
from tests.machines.running import WIDTHS, assert_same_bits, compile_program, run_compiled, spread

MIXED = Record(
    "Mixed",
    (
        ("visible", BOOL),
        ("weight", F32),
        ("place", VEC3),
        ("solid", BOOL),
        ("frame", MAT4),
        ("count", I32),
        ("inner", Record("Inner", (("marked", BOOL), ("axis", VEC3)))),
    ),
)
"""Scalars that share a row, a bool in a vector's fourth bank, a matrix, a record within."""
COUNTER = Record("Counter", (("total", I32), ("least", I32), ("most", I32)))
MIXED_TABLE = n.NamedTable("things", Table(MIXED))
COUNTERS = n.NamedTable("counters", Table(COUNTER))
COUNT = 7
PATHS = [(), ("visible",), ("weight",), ("place",), ("place", "y"), ("frame",), ("frame", "2"), ("frame", "3", "w")]
PATHS += [("count",), ("inner",), ("inner", "marked"), ("inner", "axis", "z"), ("solid",)]
widths = pytest.mark.parametrize("width", WIDTHS)


def random_memory(record: Record, count: int, seed: int = 0) -> np.ndarray:
    """Rows before the table, the table, rows after: float32 of shape (rows, 4), any words; bools 0, 1 and others."""
    words = np.random.default_rng(seed).integers(-(2**31), 2**31, (count * record.rows + 4, 4)).astype(np.int32)
    words[::2] &= 1
    return words.view(np.float32)


def both(made: n.Program, values: list[Any], items: int, width: int, *, bindings: Any = None, **options: Any) -> None:
    """The CPU and the interpreter return the same and leave the same memory, rows outside the tables included.

    `memory`: by the name of each table its rows, of which the first two and the last two are not the table's.
    """
    memory = options.pop("memory")
    bindings = bindings or ["items"] * len(values)
    outcomes = []
    for machine in ("cpu", "interpreter"):
        mine = {name: rows.copy() for name, rows in memory.items()}
        tables = {name: MemoryTable(rows, 2, (len(rows) - 4) // made.tables[name].rows) for name, rows in mine.items()}
        if machine == "cpu":
            executable = compile_program(made, bindings, width, **options)
            leaves = run_compiled(executable, bindings, values, items, tables=tables)
        else:
            leaves = interpret(made, spread(bindings, values, items), lanes=items, tables=tables, width=width)
        outcomes.append([*leaves, *(rows.view(np.int32).reshape(-1) for rows in mine.values())])
    assert_same_bits(*outcomes, f"width {width}, {bindings}")


def index_values(items: int) -> list[np.ndarray]:
    return [np.random.default_rng(items).integers(0, COUNT, items).astype(np.int32)]


# --- loads and stores -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("binding", ["items", "same"])
@pytest.mark.parametrize("checked", [True, False])
@widths
def test_loads_of_records_and_members(width, checked, binding):
    value = pair(*(load(MIXED_TABLE, local("at", I32), *path) for path in PATHS), n.Length(MIXED_TABLE, I32))
    made = program(function([n.Return(value)], {"at": I32}, value.type), tables={"things": MIXED})
    memory = {"things": random_memory(MIXED, COUNT)}
    for items in (1, 21):
        both(made, [index_values(items)], items, width, bindings=[binding], checked=checked, memory=memory)


@pytest.mark.parametrize("path", PATHS, ids="-".join)
@widths
def test_stores_reach_active_lanes_only(width, path):
    """Lane k writes record k where it is odd; everything else in memory stays."""
    source = n.NamedTable("source", Table(MIXED))
    value = load(source, op("modulo", local("lane", I32), i(COUNT)), *path)
    odd = op("equal", op("bit_and", local("lane", I32), i(1)), i(1))
    body = [n.If(odd, (n.Store(MIXED_TABLE, local("lane", I32), value, path),))]
    made = program(function(body, {"lane": I32}), tables={"things": MIXED, "source": MIXED})
    items = 19
    memory = {"things": random_memory(MIXED, items), "source": random_memory(MIXED, COUNT, 1)}
    for checked in (True, False):
        both(made, [[np.arange(items, dtype=np.int32)]], items, width, checked=checked, memory=memory)


@widths
def test_store_of_one_value_at_one_index(width):
    at = local("at", I32)
    body = [
        n.Store(MIXED_TABLE, at, local("truth", BOOL), ("solid",)),
        n.Store(MIXED_TABLE, at, construct(VEC3, f(1), f(2), f(3)), ("place",)),
    ]
    made = program(function(body, {"at": I32, "truth": BOOL}), tables={"things": MIXED})
    values = [[np.array([3], np.int32)], [np.array([True])]]
    both(made, values, 1, width, bindings=["same", "same"], memory={"things": random_memory(MIXED, COUNT)})


@widths
def test_bools_are_stored_as_one_or_zero_and_read_as_not_zero(width):
    flag = Record("Flag", (("set", BOOL),))
    table = n.NamedTable("flags", Table(flag))
    at = local("lane", I32)
    body = [
        n.Assign("was", load(table, at, "set")),
        n.Store(table, at, op("bit_not", local("was", BOOL)), ("set",)),
        n.Return(local("was", BOOL)),
    ]
    made = program(function(body, {"lane": I32}, BOOL, {"was": BOOL}), tables={"flags": flag})
    memory = np.zeros((5, 4), np.float32)
    memory.view(np.int32)[:, 0] = [0, 1, -1, -(2**31), 256]
    executable = compile_program(made, ["items"], width)
    lanes = [[np.arange(5, dtype=np.int32)]]
    found = run_compiled(executable, ["items"], lanes, 5, tables={"flags": MemoryTable(memory, 0, 5)})
    assert found[0].tolist() == [False, True, True, True, True]
    assert memory.view(np.int32)[:, 0].tolist() == [1, 0, 0, 0, 0]


@widths
def test_tables_as_parameters(width):
    """A table goes through a call, and by its own binding into the entry."""
    table = local("table", Table(MIXED))
    inner = function(
        [n.Return(load(table, local("at", I32), "place"))],
        {"table": Table(MIXED), "at": I32},
        VEC3,
        name="inner",
    )
    body = [
        n.Call("one", "inner", (table, local("at", I32))),
        n.Call("two", "inner", (MIXED_TABLE, local("at", I32))),
        n.Return(pair(local("one", VEC3), local("two", VEC3))),
    ]
    parameters = {"table": Table(MIXED), "at": I32}
    main = function(body, parameters, Tuple((VEC3, VEC3)), {"one": VEC3, "two": VEC3})
    made = program(main, inner, tables={"things": MIXED})
    rows = random_memory(MIXED, COUNT, 5)
    given = MemoryTable(rows, 2, COUNT)
    both(made, [given, index_values(33)], 33, width, memory={"things": random_memory(MIXED, COUNT)})


def test_a_table_that_is_not_reached_need_not_be_given():
    made = program(function([n.Return(i(5))], {"x": I32}, I32), tables={"things": MIXED})
    found = run_compiled(compile_program(made, ["items"], 4), ["items"], [[np.zeros(3, np.int32)]], 3)
    assert found[0].tolist() == [5, 5, 5]


def test_a_missing_table_is_named():
    made = program(function([n.Return(n.Length(MIXED_TABLE, I32))], {"x": I32}, I32), tables={"things": MIXED})
    executable = compile_program(made, ["items"], 4)
    with pytest.raises(MachineError, match="`things`"):
        run_compiled(executable, ["items"], [[np.zeros(3, np.int32)]], 3)


# --- checks -----------------------------------------------------------------------------------------------------------

SPAN = Span("scene.py", 12, 4)


def access(kind: str) -> Any:
    at = local("at", I32)
    if kind == "load":
        return n.Assign("x", n.Load(MIXED_TABLE, at, ("weight",), F32, span=SPAN))
    if kind == "store":
        return n.Store(MIXED_TABLE, at, f(1.0), ("weight",), span=SPAN)
    return n.Atomic("old", "add", MIXED_TABLE, at, i(1), ("count",), span=SPAN)


def accessing(kind: str) -> n.Program:
    """Accesses record `at` where `wants` holds."""
    body = [n.If(local("wants", BOOL), (access(kind),)), n.Return(local("x", F32))]
    entry = function(
        [n.Assign("x", f(0.0)), *body], {"at": I32, "wants": BOOL}, F32, {"x": F32, "old": I32}, name="scenes:shade"
    )
    return program(entry, tables={"things": MIXED})


@pytest.mark.parametrize("binding", ["items", "same"])
@pytest.mark.parametrize("kind", ["load", "store", "atomic"])
@pytest.mark.parametrize("bad", [COUNT, -1, 2**31 - 1, -(2**31)])
@widths
def test_an_access_outside_is_reported(width, bad, kind, binding):
    rows = random_memory(MIXED, COUNT)
    before = rows.copy()
    at = np.full(21, 2, np.int32)
    at[13] = bad
    if binding == "same":
        at[:] = bad
    bindings: Any = [binding, "items"]
    executable = compile_program(accessing(kind), bindings, width)
    with pytest.raises(MachineError) as caught:
        run_compiled(
            executable, bindings, [[at], [np.ones(21, bool)]], 21, tables={"things": MemoryTable(rows, 2, COUNT)}
        )
    text = str(caught.value)
    assert "table `things`" in text
    assert "module `shade`" in text
    assert f"index {bad}" in text
    assert text.startswith("scene.py:12:5: error")
    # What lies outside the table is untouched.
    outside = [0, 1, *range(2 + COUNT * MIXED.rows, len(rows))]
    np.testing.assert_array_equal(rows[outside].view(np.int32), before[outside].view(np.int32))


@pytest.mark.parametrize("kind", ["load", "store", "atomic"])
@widths
def test_lanes_that_do_not_take_part_are_not_checked(width, kind):
    at = np.where(np.arange(21) % 3 == 0, 99, np.arange(21) % COUNT).astype(np.int32)
    at[np.arange(21) % 3 == 0] = -5
    wants = np.arange(21) % 3 != 0
    memory = {"things": random_memory(MIXED, COUNT)}
    if kind == "store":
        # No two lanes may write one row.
        at[wants] = np.arange(14)
        memory = {"things": random_memory(MIXED, 14)}
    both(accessing(kind), [[at], [wants]], 21, width, memory=memory)


def test_the_first_failure_is_the_one_reported():
    """One thread, two bad items: the earlier packet's. Nothing is begun after it."""
    at = np.zeros(64, np.int32)
    at[[20, 50]] = [77, 88]
    bindings: Any = ["items", "items"]
    executable = compile_program(accessing("load"), bindings, 4)
    table = MemoryTable(random_memory(MIXED, COUNT), 2, COUNT)
    with pytest.raises(MachineError, match="index 77"):
        run_compiled(executable, bindings, [[at], [np.ones(64, bool)]], 64, tables={"things": table}, chunk=4)


@widths
def test_an_empty_table_has_length_zero_and_no_record(width):
    table = MemoryTable(np.zeros((1, 4), np.float32), 0, 0)
    length = program(function([n.Return(n.Length(MIXED_TABLE, I32))], {"x": I32}, I32), tables={"things": MIXED})
    executable = compile_program(length, ["items"], width)
    lanes = [[np.zeros(5, np.int32)]]
    assert run_compiled(executable, ["items"], lanes, 5, tables={"things": table})[0].tolist() == [0] * 5
    bindings: Any = ["items", "items"]
    for kind in ("load", "store", "atomic"):
        executable = compile_program(accessing(kind), bindings, width)
        with pytest.raises(MachineError, match="index 0"):
            run_compiled(executable, bindings, [*lanes, [np.ones(5, bool)]], 5, tables={"things": table})


@widths
def test_a_loop_that_does_not_end_stops_when_an_access_has_failed(width):
    """The failed access reads record 0 in its stead, and the loop's condition never changes: the check ends it."""
    body = [
        n.Assign("x", f(0.0)),
        n.Loop(b(True), (n.Assign("x", n.Load(MIXED_TABLE, local("at", I32), ("weight",), F32)),)),
    ]
    made = program(function(body, {"at": I32}, variables={"x": F32}), tables={"things": MIXED})
    executable = compile_program(made, ["items"], width)
    table = MemoryTable(random_memory(MIXED, COUNT), 2, COUNT)
    with pytest.raises(MachineError, match="index 7"):
        run_compiled(executable, ["items"], [[np.full(5, COUNT, np.int32)]], 5, tables={"things": table})


# --- atomics ----------------------------------------------------------------------------------------------------------


def counting(index: Any) -> n.Program:
    """Adds, and takes the least and greatest, in record `index`; returns what each lane saw before adding."""
    value = local("value", I32)
    updates = [
        n.Atomic("old", "add", COUNTERS, index, value, ("total",)),
        n.Atomic(None, "minimum", COUNTERS, index, value, ("least",)),
        n.Atomic(None, "maximum", COUNTERS, index, value, ("most",)),
    ]
    wanted = op("not_equal", op("bit_and", value, i(3)), i(0))
    body = [n.Assign("old", i(-1)), n.If(wanted, tuple(updates)), n.Return(local("old", I32))]
    entry = function(body, {"at": I32, "value": I32}, I32, {"old": I32})
    return program(entry, tables={"counters": COUNTER})


@pytest.mark.parametrize("binding", ["items", "same"])
@widths
def test_atomics_of_one_thread(width, binding):
    """In the order of the lanes, as the interpreter does them: so the values from before agree too."""
    draw = np.random.default_rng(3)
    values = [[draw.integers(0, COUNT, 101).astype(np.int32)], [draw.integers(-(2**31), 2**31, 101).astype(np.int32)]]
    memory = {"counters": random_memory(COUNTER, COUNT)}
    both(counting(local("at", I32)), values, 101, width, bindings=[binding, "items"], memory=memory)


@widths
def test_atomics_of_many_threads_add_up(width):
    items = 40_000
    draw = np.random.default_rng(4)
    at, value = (draw.integers(0, bound, items).astype(np.int32) for bound in (3, 1000))
    rows = np.zeros((3, 4), np.float32)
    rows.view(np.int32)[:, 1] = 2**31 - 1
    executable = compile_program(counting(local("at", I32)), ["items", "items"], width)
    table = {"counters": MemoryTable(rows, 0, 3)}
    [old] = run_compiled(executable, ["items", "items"], [[at], [value]], items, tables=table, threads=4, chunk=64)
    counted = value & 3 != 0
    for row in range(3):
        mine = value[counted & (at == row)]
        assert rows.view(np.int32)[row, :3].tolist() == [mine.sum(), mine.min(), mine.max()]
        # The totals that the lanes saw are the sums before each of them, in some order.
        seen = np.sort(old[counted & (at == row)])
        assert seen[0] == 0
        assert len(np.unique(seen)) == len(mine)
    assert (old[~counted] == -1).all()


# --- local arrays -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bindings", [["items", "items"], ["same", "items"], ["items", "same"], ["same", "same"]])
@widths
def test_indices_of_local_arrays_are_clamped(width, bindings):
    kind = Array(F32, 5)
    at, value = local("at", I32), local("value", F32)
    body = [
        n.Clear("a"),
        n.SetElement("a", at, value),
        n.SetElement("a", op("add", at, i(1)), op("multiply", value, f(2))),
        n.Return(pair(*(element("a", kind, i(k)) for k in (-1, 0, 1, 2, 3, 4, 5)), element("a", kind, at))),
    ]
    made = program(function(body, {"at": I32, "value": F32}, Tuple((F32,) * 8), {"a": kind}))
    for first in (-(2**31), -2, 0, 3, 4, 9, 2**31 - 1):
        at_values = np.array([first, 2, -7, 4, 3, 5, 2**31 - 1, -(2**31)], np.int32)
        values = [[at_values], [np.arange(8, dtype=np.float32) + 1]]
        both(made, values, 8, width, bindings=bindings, memory={})


@pytest.mark.parametrize("at", ["uniform", "varying"])
@widths
def test_arrays_of_records_and_bools_under_divergence(width, at):
    """Lanes that part write and clear their own elements only."""
    record = Record("Pair", (("mark", BOOL), ("place", VEC3)))
    marks, places = Array(BOOL, 3), Array(record, 2)
    index = i(1) if at == "uniform" else op("modulo", local("lane", I32), i(2))
    low = op("less", local("lane", I32), i(3))
    inner = [
        n.SetElement("marks", index, low),
        n.SetElement("places", index, local("v", VEC3), ("place",)),
        n.SetElement("places", index, b(True), ("mark",)),
        n.If(op("equal", local("lane", I32), i(2)), (n.Clear("places"), n.Clear("marks"))),
    ]
    body = [n.Clear("marks"), n.Clear("places"), n.SetElement("marks", i(0), b(True))]
    body.append(n.If(low, tuple(inner), (n.SetElement("places", i(0), local("v", VEC3), ("place",)),)))
    shown = [element("marks", marks, i(k)) for k in range(3)] + [element("places", places, i(k)) for k in range(2)]
    value = pair(*shown, member(element("places", places, index), "place"))
    body.append(n.Return(value))
    made = program(function(body, {"lane": I32, "v": VEC3}, value.type, {"marks": marks, "places": places}))
    values = [
        [np.arange(21, dtype=np.int32) % 6],
        list(np.random.default_rng(0).normal(size=(3, 21)).astype(np.float32)),
    ]
    both(made, values, 21, width, memory={})


@widths
def test_an_array_is_zero_again_when_its_life_begins_again(width):
    kind = Array(I32, 2)
    k = local("k", I32)
    body = [
        n.Assign("k", i(0)),
        n.Assign("sum", i(0)),
        n.Loop(
            op("less", k, local("count", I32)),
            (
                n.Clear("a"),
                n.SetElement("a", i(0), op("add", element("a", kind, i(0)), i(1))),
                n.Assign("sum", op("add", local("sum", I32), element("a", kind, i(0)))),
            ),
            step=(n.Assign("k", op("add", k, i(1))),),
        ),
        n.Return(local("sum", I32)),
    ]
    made = program(function(body, {"count": I32}, I32, {"k": I32, "sum": I32, "a": kind}))
    counts = np.array([0, 5, 2, 7, 1, 3], np.int32)
    executable = compile_program(made, ["items"], width)
    assert run_compiled(executable, ["items"], [[counts]], 6)[0].tolist() == counts.tolist()


def test_memory_that_begins_between_rows_is_refused():
    words = np.zeros(4 * 64, np.float32)
    start = 1 if words.ctypes.data % 16 == 0 else 0
    memory = words[start : start + 4 * 32].reshape(32, 4)
    made = program(function([n.Return(n.Length(MIXED_TABLE, I32))], {"x": I32}, I32), tables={"things": MIXED})
    executable = compile_program(made, ["items"], 4)
    with pytest.raises(MachineError, match="multiple of 16 bytes"):
        run_compiled(executable, ["items"], [[np.zeros(3, np.int32)]], 3, tables={"things": MemoryTable(memory, 0, 1)})
