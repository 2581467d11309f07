"""The interpreter: control flow under divergence, lane operations, arrays, calls, arguments, errors."""

from __future__ import annotations

import numpy as np
import pytest

from tasuki.diagnostics import MachineError
from tasuki.ir.interpret import interpret
from tasuki.ir.parse import parse_program
from tasuki.ir.verify import verify


def run(text, *arguments, lanes=None, **options):
    """Runs the text of a program; each argument is one leaf, or a list of leaves."""
    program = parse_program("entry main\n" + text)
    verify(program)
    values = [argument if isinstance(argument, list) else [argument] for argument in arguments]
    lanes = lanes or len(np.atleast_1d(values[0][0]))
    return interpret(program, values, lanes=lanes, max_iterations=1000, **options)


def ints(*values):
    return np.array(values, np.int32)


@pytest.mark.parametrize("width", [None, 1, 3, 4])
def test_nested_loops_part_and_rejoin(width):
    # The count of pairs (i, j) with i < n, j < i, leaving out i == 2, stopping at the first i * j == 12.
    text = """
    function main(n: i32) -> i32 {
      var i: i32
      var j: i32
      var count: i32
      count = 0
      i = 0
      while i < n {
        if i == 2 {
          continue
        }
        j = 0
        while true {
          if j >= i {
            break
          }
          if i * j == 12 {
            return -count
          }
          count = count + 1
        } step {
          j = j + 1
        }
      } step {
        i = i + 1
      }
      return count
    }"""

    def count(n):
        found = 0
        for i in range(n):
            for j in range(i):
                if i == 2:
                    continue
                if i * j == 12:
                    return -found
                found += 1
        return found

    n = ints(0, 1, 2, 3, 4, 5, 6, 7, -1, 9)
    [found] = run(text, n, width=width)
    assert list(found) == [count(k) for k in n]


def test_a_return_in_a_branch_leaves_the_others_running():
    text = """
    function main(n: i32) -> i32 {
      if n < 0 {
        return 100
      } else {
        if n == 0 {
          return 200
        }
      }
      return n
    }"""
    assert list(run(text, ints(-1, 0, 1, 2))[0]) == [100, 200, 1, 2]


def test_the_setup_of_a_loop_runs_before_each_test():
    text = """
    function main(n: i32) -> tuple[i32, i32] {
      var tests: i32
      var passes: i32
      tests = 0
      passes = 0
      loop {
        tests = tests + 1
      } while tests <= n {
        passes = passes + 1
      }
      return (tests, passes)
    }"""
    tests, passes = run(text, ints(0, 1, 5))
    assert list(tests) == [1, 2, 6]
    assert list(passes) == [0, 1, 5]


LANE_OPERATIONS = """
    function main(a: i32) -> tuple[bool, bool, i32] {
      if a > 0 {
        return (any_lane(a == 2), all_lanes(a < 3), count_lanes(a != 2))
      }
      return (any_lane(a == 2), all_lanes(a == 0), count_lanes(true))
    }"""


def test_lane_operations_see_the_active_lanes():
    found = run(LANE_OPERATIONS, ints(0, 1, 2, 0, 1))
    assert [list(leaf) for leaf in found] == [[0, 1, 1, 0, 1], [1, 1, 1, 1, 1], [2, 2, 2, 2, 2]]


def test_lane_operations_see_their_packet_only():
    found = run(LANE_OPERATIONS, ints(0, 1, 2, 0, 1), width=2)
    assert [list(leaf) for leaf in found] == [[0, 0, 1, 0, 0], [1, 1, 1, 1, 1], [1, 1, 0, 1, 1]]


def test_same_lanes_looks_at_active_lanes_only():
    text = """
    function main(a: f32, on: bool) -> f32 {
      if on {
        return same_lanes(a)
      }
      return 0.0
    }"""
    on = np.array([True, False, True])
    assert list(run(text, np.float32([2, 3, 2]), on)[0]) == [2, 0, 2]
    assert np.isnan(run(text, np.float32([np.nan, 3, np.nan]), on)[0][[0, 2]]).all()
    with pytest.raises(MachineError, match=r"lanes disagree in same_lanes \(in `main`\)") as caught:
        run(text, np.float32([2, 3, 4]), on)
    assert "<ir>:5:" in str(caught.value)
    assert "2.0, 4.0" in str(caught.value)
    with pytest.raises(MachineError):
        run(text, np.float32([0.0, 3, -0.0]), on)


def test_arrays_are_zero_when_their_life_begins_and_clamp_their_indices():
    text = """
    function main(n: i32) -> tuple[i32, i32, i32] {
      var a: array[i32, 3]
      var first: i32
      clear a
      a[n] = n
      first = a[-5]
      if n > 2 {
        clear a
      }
      return (first, a[n], a[1])
    }"""
    first, own, second = run(text, ints(-1, 0, 1, 2, 7))
    assert list(first) == [-1, 0, 0, 0, 0]
    assert list(own) == [-1, 0, 1, 2, 0]
    assert list(second) == [0, 0, 1, 0, 0]


def test_an_index_past_the_end_is_the_last():
    text = """
    function main(n: i32) -> tuple[i32, i32] {
      var a: array[i32, 3]
      clear a
      a[2] = 5
      a[n] = a[n] + n
      return (a[2], a[0])
    }"""
    last, first = run(text, ints(3, 2**31 - 1, -1))
    assert list(last) == [8, 5 + 2**31 - 1 - 2**32, 5]
    assert list(first) == [0, 0, -1]


def test_members_of_elements_and_records_are_assigned_alone():
    text = """
    record Hit {
      t: f32
      at: vec3
    }
    function main(t: f32) -> tuple[Hit, f32] {
      var hit: Hit
      var other: Hit
      var hits: array[Hit, 2]
      hit = new Hit(t, vec3(1.0))
      other = hit
      other.at.y = 5.0
      clear hits
      hits[1].at = vec3(t, 2.0, 3.0)
      hits[1].at.z = 9.0
      hit.t = hits[1].at.z + other.at.y
      return (hit, hits[1].at.x)
    }"""
    found = run(text, np.float32([7, 8]))
    assert [list(leaf) for leaf in found] == [[14, 14], [1, 1], [1, 1], [1, 1], [7, 8]]


def test_a_callee_keeps_its_hands_off_its_callers_values():
    text = """
    function main(v: vec3) -> tuple[vec3, vec3] {
      var w: vec3
      w = call double(v)
      return (v, w)
    }
    function double(v: vec3) -> vec3 {
      v.x = v.x * 2.0
      return v
    }"""
    found = run(text, [np.float32([1, 2])] * 3)
    assert [list(leaf) for leaf in found] == [[1, 2], [1, 2], [1, 2], [2, 4], [1, 2], [1, 2]]


def test_a_call_reaches_the_active_lanes_only():
    text = """
    function main(n: i32) -> i32 {
      var r: i32
      r = -1
      if n > 1 {
        r = call count(n)
      }
      return r
    }
    function count(n: i32) -> i32 {
      return count_lanes(true) * n
    }"""
    assert list(run(text, ints(0, 1, 2, 3))[0]) == [-1, -1, 4, 6]


def test_a_void_program_gives_nothing():
    assert run("function main(n: i32) {\n  if n == 1 {\n    return\n  }\n}", ints(0, 1)) == []


def test_arguments_may_be_shared_by_all_lanes():
    text = "function main(a: f32, n: i32) -> f32 {\n  return a * to_f32(n)\n}"
    assert list(run(text, np.float32(2), ints(1, 2), lanes=2)[0]) == [2, 4]


def test_no_lanes_give_no_results():
    program = parse_program("entry main\nfunction main(n: i32) -> i32 {\n  return n\n}")
    [found] = interpret(program, [[ints()]], lanes=0)
    assert found.shape == (0,)
    assert found.dtype == np.int32


def test_float64_keeps_float32_constants():
    text = "function main(a: f32) -> f32 {\n  return a + 0.1\n}"
    [found] = run(text, np.float64([0.0]), precision=np.float64)
    assert found.dtype == np.float64
    assert found[0] == float(np.float32(0.1))


def test_an_endless_loop_is_stopped():
    with pytest.raises(MachineError, match=r"a loop does not end") as caught:
        run("function main(n: i32) {\n  while n == n {\n  }\n}", ints(0))
    assert "<ir>:3:" in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], r"takes 2 arguments \(a: f32, n: i32\), not 0"),
        ([[np.float32([1, 2])], [np.float32([1, 2])]], r"`n` of `main` is i32 of shape \(2,\) or \(\), not float32"),
        ([[np.float32([1, 2, 3])], [ints(1, 2)]], r"not float32 of shape \(3,\)"),
        ([[np.float32([1, 2])] * 2, [ints(1, 2)]], r"has 1 leaves, not 2"),
        ([[np.float32([1, 2])], [np.int64([1, 2**40])]], r"a value outside i32"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(arguments, message):
    program = parse_program("entry main\nfunction main(a: f32, n: i32) {\n}")
    with pytest.raises(MachineError, match=message):
        interpret(program, arguments, lanes=2)


def test_an_unlinked_call_is_an_error():
    program = parse_program("entry main\nfunction main(n: i32) {\n  call shading(n)\n}")
    with pytest.raises(MachineError, match=r"`shading` is called, but nothing of that name is linked"):
        interpret(program, [[ints(1)]], lanes=1)
