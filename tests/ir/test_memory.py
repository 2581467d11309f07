"""Tables: layout, loads and stores of every leaf type, atomics, checked access and its errors."""

from __future__ import annotations

import numpy as np
import pytest

from tasuki.diagnostics import MachineError
from tasuki.ir.interpret import interpret
from tasuki.ir.memory import MemoryTable
from tasuki.ir.parse import parse_program
from tasuki.ir.verify import verify

HEAD = """
record Row {
  n: i32
  f: f32
  on: bool
  v: vec3
  w: f32
}
table rows: Row
entry main
"""


def memory(count, base=1):
    """Room for `count` records of two rows, with rows before and after that belong to nobody."""
    return MemoryTable(np.zeros((base + 2 * count + 3, 4), np.float32), base, count)


def run(text, arguments, rows, **options):
    program = parse_program(HEAD + text)
    verify(program)
    values = [a if isinstance(a, list | MemoryTable) else [a] for a in arguments]
    lanes = max(np.atleast_1d(leaf).shape[0] for value in values if isinstance(value, list) for leaf in value)
    return interpret(program, values, lanes=lanes, tables={"rows": rows}, **options)


def ints(*values):
    return np.array(values, np.int32)


WRITE = """function main(i: i32, f: f32, on: bool) {
  store @rows[i] = new Row(i * 10, f, on, vec3(f, f + 1.0, f + 2.0), -f)
}"""


def test_a_record_stands_where_its_layout_says():
    rows = memory(3)
    run(WRITE, [ints(2, 0), np.float32([0.5, 1.5]), np.array([True, False])], rows)
    words = rows.memory.view(np.int32)
    np.testing.assert_array_equal(rows.memory[2], [1.5, 2.5, 3.5, -1.5])
    np.testing.assert_array_equal(rows.memory[6], [0.5, 1.5, 2.5, -0.5])
    assert list(words[1]) == [0, np.float32(1.5).view(np.int32), 0, 0]
    assert list(words[5]) == [20, np.float32(0.5).view(np.int32), 1, 0]
    assert not words[[0, 3, 4, 7, 8, 9]].any()


def test_loads_read_back_what_was_stored():
    rows = memory(3)
    run(WRITE, [ints(0, 1, 2), np.float32([np.nan, 1e-40, -0.0]), np.array([True, False, True])], rows)
    text = """function main(i: i32) -> tuple[Row, f32, vec3, f32, i32] {
      return (@rows[i], @rows[i].f, @rows[i].v, @rows[i].v.y, length(@rows))
    }"""
    found = run(text, [ints(2, 1, 0)], rows)
    assert list(found[0]) == [20, 10, 0]
    np.testing.assert_array_equal(found[1].view(np.int32), np.float32([-0.0, 1e-40, np.nan]).view(np.int32))
    assert list(found[2]) == [True, False, True]
    np.testing.assert_array_equal(found[7], found[1])
    np.testing.assert_array_equal(found[11], found[4])
    assert list(found[-1]) == [3, 3, 3]


def test_any_word_but_zero_is_true():
    rows = memory(3)
    rows.words[[1, 3, 5], 2] = [0, -7, 2**31 - 1]
    text = "function main(i: i32) -> bool {\n  return @rows[i].on\n}"
    assert list(run(text, [ints(0, 1, 2)], rows)[0]) == [False, True, True]


def test_only_active_lanes_touch_memory():
    rows = memory(2)
    text = """function main(i: i32) -> f32 {
      if i < 2 {
        store @rows[i].w = 3.0
        return @rows[i].w
      }
      return 0.0
    }"""
    assert list(run(text, [ints(0, 99, 1)], rows)[0]) == [3, 0, 3]


def test_float64_widens_what_it_loads_and_narrows_what_it_stores():
    rows = memory(1)
    text = """function main(a: f32) -> f32 {
      store @rows[0].f = a
      return @rows[0].f
    }"""
    [found] = run(text, [np.float64([0.1])], rows, precision=np.float64)
    assert found.dtype == np.float64
    assert found[0] == float(np.float32(0.1))


def test_tables_are_passed_to_functions():
    rows, other = memory(2), memory(2)
    other.words[1, 0] = 42
    text = """function main(t: Table[Row]) -> tuple[i32, i32] {
      var a: i32
      var b: i32
      a = call first(t)
      b = call first(@rows)
      return (a, b)
    }
    function first(t: Table[Row]) -> i32 {
      return t[0].n
    }"""
    program = parse_program(HEAD + text)
    verify(program)
    a, b = interpret(program, [other], lanes=1, tables={"rows": rows})
    assert (a[0], b[0]) == (42, 0)


@pytest.mark.parametrize(
    ("operation", "after", "before"),
    [
        ("add", [2**31 - 1 + 4 - 2**32, 5], [2**31 - 1, 2, -(2**31)]),
        ("minimum", [1, 2], [2**31 - 1, 2, 1]),
        ("maximum", [2**31 - 1, 3], [2**31 - 1, 2, 2**31 - 1]),
    ],
)
def test_atomics_go_lane_by_lane(operation, after, before):
    rows = memory(2)
    rows.words[[1, 3], 0] = [2**31 - 1, 2]
    text = f"""function main(i: i32, value: i32) -> i32 {{
      var old: i32
      old = 0
      old = atomic {operation} @rows[i].n, value
      return old
    }}"""
    [old] = run(text, [ints(0, 1, 0), ints(1, 3, 3)], rows)
    assert list(rows.words[[1, 3], 0]) == after
    assert list(old) == before


@pytest.mark.parametrize("statement", ["f = @rows[i].f", "store @rows[i].f = f", "atomic add @rows[i].n, 1"])
@pytest.mark.parametrize("index", [-1, 3, 2**31 - 1, -(2**31)])
def test_an_index_outside_names_everything(statement, index):
    text = f"function main(i: i32) {{\n  var f: f32\n  f = 1.0\n  {statement}\n}}"
    with pytest.raises(MachineError) as caught:
        run(text, [ints(0, 1, index)], memory(3), width=2)
    message = str(caught.value)
    for part in ("outside table `rows`", "in `main`", f"found: {index}, in lane 2", "has 3 records", "<ir>:14:"):
        assert part in message


def test_an_index_outside_a_parameter_names_the_parameter():
    text = "function main(t: Table[Row], i: i32) -> i32 {\n  return t[i].n\n}"
    with pytest.raises(MachineError, match=r"outside table `t` in `main`"):
        run(text, [memory(1), ints(1)], memory(1))


def test_an_empty_table_has_no_indices():
    with pytest.raises(MachineError, match=r"the table is empty"):
        run("function main(i: i32) -> i32 {\n  return @rows[i].n\n}", [ints(0)], memory(0))


def test_unchecked_access_ends_where_the_memory_ends():
    rows = memory(1)
    rows.words[3, 0] = 9
    text = "function main(i: i32) -> i32 {\n  return @rows[i].n\n}"
    assert run(text, [ints(1)], rows, checked=False)[0][0] == 9
    for index in (100, -(2**31)):  # Two rows each: the second would wrap to the table's first in 32 bits.
        with pytest.raises(MachineError):
            run(text, [ints(index)], rows, checked=False)


def test_tables_that_do_not_fit_are_refused():
    program = parse_program(HEAD + "function main() {\n}")
    with pytest.raises(MachineError, match=r"not given: `rows`"):
        interpret(program, [], lanes=1)
    with pytest.raises(MachineError, match=r"rows 1 to 5 of a memory that has 3"):
        interpret(program, [], lanes=1, tables={"rows": MemoryTable(np.zeros((3, 4), np.float32), 1, 2)})
    for wrong in (np.zeros((3, 4)), np.zeros((3, 3), np.float32), np.zeros((4, 3), np.float32).T):
        with pytest.raises(MachineError, match=r"C-contiguous float32 array"):
            MemoryTable(wrong, 0, 0)


def test_a_read_only_memory_is_not_written():
    rows = memory(3)
    rows.memory.flags.writeable = False
    with pytest.raises(MachineError, match=r"store to table `rows` in `main`"):
        run("function main(i: i32) {\n  store @rows[i].f = 1.0\n}", [ints(0)], rows)
