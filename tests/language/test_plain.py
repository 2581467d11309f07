"""Modules as plain Python give the interpreter's results, bit for bit; breakpoints and tracebacks are the user's."""

import bdb
import importlib
import linecache
import math
import pkgutil
import sys
import traceback

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import tasuki.modules
from tasuki.diagnostics import LinkError, MachineError, SourceError
from tasuki.ir import types
from tasuki.ir.interpret import interpret
from tasuki.ir.memory import MemoryTable
from tasuki.language import (
    Case,
    Table,
    all_lanes,
    any_lane,
    array,
    atomic_add,
    atomic_max,
    atomic_min,
    bits,
    copysign,
    cos,
    count_lanes,
    cross,
    dot,
    f32,
    floor,
    fma,
    from_bits,
    i32,
    link,
    mat4,
    max,
    min,
    module,
    norm,
    normalize,
    reciprocal,
    record,
    same_lanes,
    select,
    sin,
    socket,
    sqrt,
    transpose,
    vec3,
    vec4,
)
from tasuki.language.conversion import convert
from tasuki.language.declare import Module
from tasuki.language.plain import memory_table, tables
from tasuki.language.values import F32, I32, Vec3, from_leaves, leaves

floats = st.floats(width=32) | st.sampled_from([0.0, -0.0, 2.0**-149, 2.0**128 - 2.0**104, np.inf, -np.inf, np.nan])
tame = st.floats(-100, 100, width=32)
ints = st.integers(-(2**31), 2**31 - 1) | st.sampled_from([0, 1, -1, 31, 32, 2**31 - 1, -(2**31)])
truths = st.booleans()

THIRD = 1.0 / 3.0
FAR = math.inf
MASK = 0xFF
LEAST = -2147483648
ON = True


@record
class Box:
    low: vec3
    count: i32
    high: vec3
    solid: bool


@record
class Pair:
    left: Box
    weight: f32
    right: Box


boxes = Table(Box)
pairs = Table(Pair)


# --- the comparison -------------------------------------------------------------------------------------------------


def same_bits(found, expected):
    """Equal type and equal bits; which NaN is not defined."""
    expected = np.asarray(expected)
    if isinstance(found, F32):
        value = np.float32(found)
        both_nan = np.isnan(value) and np.isnan(expected)
        return expected.dtype == np.float32 and bool(both_nan or value.tobytes() == expected.tobytes())
    if isinstance(found, I32):
        return expected.dtype == np.int32 and int(found) == int(expected)
    return isinstance(found, bool) and expected.dtype == np.bool_ and found == bool(expected)


def as_leaves(value):
    kinds = {F32: np.float32, I32: np.int32, bool: np.bool_}
    return [np.array([leaf], kinds[type(leaf)]) for leaf in leaves(value)]


def agree(entry, *arguments, fillers=None, memory=None):
    """Runs `entry` as plain Python and through the interpreter; their results, and what they leave in memory, agree."""
    memory = memory or {}
    copies = {name: MemoryTable(table.memory.copy(), table.base, table.count) for name, table in memory.items()}
    with tables(memory):
        found = entry(*arguments)
    flat = [as_leaves(convert(t, argument)) for t, argument in zip(entry.signature.parameters, arguments, strict=True)]
    expected = interpret(link(entry, fillers or {}), flat, lanes=1, tables=copies)
    plain = leaves(found)
    assert len(plain) == len(expected)
    for one, [other] in zip(plain, expected, strict=True):
        assert same_bits(one, other), f"{entry.name}{arguments}: {found} is not {expected}"
    for name, table in memory.items():
        np.testing.assert_array_equal(table.words, copies[name].words)
    return found


# --- modules with every construct -----------------------------------------------------------------------------------


@module
def float_operators(a: f32, b: f32) -> tuple[f32, f32, f32, f32, f32, f32, bool, bool, bool, bool, bool, bool]:
    return a + b, a - b, a * b, a / b, -a, +b, a < b, a <= b, a > b, a >= b, a == b, a != b


@module
def int_operators(a: i32, b: i32) -> tuple[i32, i32, i32, i32, i32, i32, i32, i32, i32, i32, i32, i32, bool, bool]:
    return a + b, a - b, a * b, a // b, a % b, -a, ~a, a & b, a | b, a ^ b, a << b, a >> b, a < b, a == b


@module
def bool_operators(a: bool, b: bool) -> tuple[bool, bool, bool, bool, bool, bool, bool, i32, f32]:
    return a and b, a or b, not a, a & b, a | b, a ^ b, a == b, i32(a), f32(b)


@module
def float_functions(a: f32, b: f32, c: f32) -> tuple[f32, f32, f32, f32, f32, f32, f32, f32, f32, f32, i32, f32]:
    folded = min(a, b, c, 0.5)
    return (
        folded,
        max(a, 1, b),
        abs(a),
        sqrt(b),
        floor(c),
        fma(a, b, c),
        copysign(a, b),
        reciprocal(a),
        sin(b),
        cos(c),
        i32(a),
        select(a < b, c, 1),
    )


@module
def int_functions(a: i32, b: i32) -> tuple[i32, i32, i32, f32, i32]:
    return min(a, b), max(a, b, 3), abs(a), f32(b), bits(f32(a)) + bits(from_bits(b & 0x3FFFFFFF))


@module
def literals(x: f32, n: i32) -> tuple[f32, f32, i32, i32, f32, bool, i32, f32]:
    third = 1.0 / 3.0
    folded: f32 = 2 * 3 + 1
    shifted = 1 << 35
    y = x * 2 + THIRD * 3 - 7
    wrapped = 2147483647 + 1
    ten = 0.1 * 3
    return third + ten, folded, shifted + n, wrapped, y, 0 < n <= MASK, LEAST + MASK // 0, math.pi * x


@module
def conditional_values(c: bool, x: f32, n: i32) -> tuple[f32, i32, f32, i32, f32]:
    a: f32 = 1 if c else 2
    b = (1 if c else 2147483647) + 1
    d = (x if c else 0) * 3
    e = (n if c else 2147483647) + 1
    d += (x if c else 7) / 2 + (16777217 if not c else x) + 1
    f, g = 0.0, 0.0
    f, g = (1, 2.5) if c else (0.5, x)
    return a, b, d, e, f + g if ON else 0


@module
def branches(x: f32, y: f32) -> f32:
    if (x < y and not x > 3.0) or 10.0 < y < FAR:
        result = x
    elif 0.0 < x <= y < 5.0:
        result = y
    else:
        result = x * y
        if result > 100:
            return -1
    return result


@module
def loops(n: i32, x: f32) -> tuple[i32, f32, i32]:
    total = 0
    steps = 0
    for i in range(n % 20):
        if i % 3 == 0:
            continue
        for j in range(i, -5, -2):
            total += i * j
            if total > 500:
                break
        if total < -200:
            return total, x, -1
    while x > 1.0 and steps < 40:
        x *= 0.5
        steps += 1
    for k in range(2, 9):
        total -= k
    return total, x, steps


@module
def vectors(a: vec3, b: vec3, s: f32) -> tuple[vec3, vec3, f32, vec3, vec3, vec4, f32, vec3, vec3]:
    v = a * 2 - b / s + 1
    v.x = 3
    v.y += a.z
    w = v
    w.z = s
    return (
        v,
        cross(a, b),
        dot(a, b),
        normalize(a),
        w.zyx,
        vec4(b, 1) * s,
        norm(vec4(s)),
        min(a, b),
        select(s < 1.0, a, b),
    )


@module
def matrices(a: vec4, b: vec4, c: vec4) -> tuple[vec4, mat4, mat4, vec4]:
    m = mat4(a, b, c, vec4(0, 0, 0, 1))
    n = m @ transpose(m)
    return a @ m, n, m * 2 + n, n.column(2)


@module
def grown(box: Box, by: f32) -> Box:
    box.low = box.low - by
    box.high += by
    box.count += 1
    return box


@module
def records(a: vec3, b: vec3, n: i32) -> tuple[Box, Box, Pair, bool]:
    box = Box(low=a, count=0, high=b, solid=True)
    before = box
    box.count = n
    box.low.x = 1
    box.high.y *= 2.0
    pair = Pair(box, 1, before)
    pair.left.low.z = 5
    pair.right.solid = pair.left.low.z > pair.right.low.z
    bigger = grown(pair.left, by=0.5)
    same = pair.left.count == bigger.count
    return before, bigger, pair, same


@module
def arrays(n: i32, x: f32, v: vec3) -> tuple[i32, f32, vec3, i32, vec3, i32]:
    stack = array(i32, 4)
    points = array(vec3, 3)
    items = array(Box, 2)
    top = 0
    for i in range(n % 7):
        stack[top] = i * n
        top += 2
    stack[n] += 5
    points[1] = v
    points[1].y = x
    points[n].z += 2
    items[1].low.x -= x
    items[0] = items[1]
    items[1].count = 9
    saved = points[1]
    points[1].x = 0
    a, stack[1], items[0].high.z = 1, 2, 3.0
    for i in range(2):
        fresh = array(i32, 2)
        fresh[0] += 7 + i
        a += fresh[0]
    total = stack[0] + stack[1] + stack[2] + stack[3] + stack[-5] + a + len(stack)
    return total, items[0].low.x, saved, items[0].count, points[1] + items[0].high, items[1].count


@module
def assignments(x: f32, y: f32, n: i32) -> tuple[f32, f32, f32, f32, i32, f32]:
    x, y = y, x
    a = b = x
    c: f32 = 0
    d = e = 3
    c, d = 2, d + n
    b += 1
    both = float_pair(x, b)
    first, second = both
    v = vec3(x, y, a)
    v.x, (v.y, g) = v.y, (v.x, 4.0)
    return first * g, second, both[0] + c, v.x - v.y, d * e, a


@module
def float_pair(a: f32, b: f32) -> tuple[f32, f32]:
    if a < b:
        return 0, a
    return b, 1


@module
def lanes(c: bool, n: i32) -> tuple[bool, bool, i32, i32]:
    return any_lane(c), all_lanes(c), count_lanes(c), same_lanes(n)


@given(a=floats, b=floats)
def test_float_operators(a, b):
    agree(float_operators, a, b)


@given(a=ints, b=ints)
def test_int_operators(a, b):
    agree(int_operators, a, b)


@given(a=truths, b=truths)
def test_bool_operators(a, b):
    agree(bool_operators, a, b)


@given(a=floats, b=floats, c=floats)
def test_float_functions(a, b, c):
    agree(float_functions, a, b, c)


@given(a=ints, b=ints)
def test_int_functions(a, b):
    agree(int_functions, a, b)


@given(x=floats, n=ints)
def test_literals(x, n):
    agree(literals, x, n)


@given(c=truths, x=floats, n=ints)
def test_conditional_values(c, x, n):
    agree(conditional_values, c, x, n)


@given(x=floats | tame, y=floats | tame)
def test_branches(x, y):
    agree(branches, x, y)


@given(n=ints, x=floats)
def test_loops(n, x):
    agree(loops, n, x)


@given(a=st.tuples(floats, floats, floats), b=st.tuples(tame, tame, tame), s=floats)
def test_vectors(a, b, s):
    agree(vectors, a, b, s)


@given(a=st.tuples(tame, tame, tame, floats), b=st.tuples(tame, tame, tame, tame), c=st.tuples(tame, tame, tame, tame))
def test_matrices(a, b, c):
    agree(matrices, a, b, c)


@given(a=st.tuples(floats, tame, floats), b=st.tuples(tame, tame, floats), n=ints)
def test_records(a, b, n):
    agree(records, a, b, n)


@given(n=st.integers(-3, 10), x=floats, v=st.tuples(floats, tame, tame))
def test_arrays(n, x, v):
    agree(arrays, n, x, v)


@given(x=floats, y=floats, n=ints)
def test_assignments(x, y, n):
    agree(assignments, x, y, n)


@given(c=truths, n=ints)
def test_lane_operations_on_one_lane(c, n):
    agree(lanes, c, n)


# --- tables ---------------------------------------------------------------------------------------------------------


@module
def bump(i: i32) -> i32:
    boxes[i].count += 1
    return boxes[i].count


@module
def table_work(i: i32, v: vec3) -> tuple[i32, vec3, bool, i32, i32, i32, i32]:
    box = boxes[i]
    boxes[i].low = v
    boxes[i].low.y += 1
    box.count += 10
    boxes[0] = box
    boxes[1].solid = not boxes[1].solid
    pairs[0].left.low.z = 7
    pairs[0].right = box
    before = atomic_add(boxes[i].count, 3)
    atomic_max(pairs[0].left.count, before)
    lowest = atomic_min(pairs[0].right.count, -1)
    sum = boxes[i].count + bump(i) * bump(0)
    return before, boxes[i].low, box.solid, len(boxes) + len(pairs), lowest, sum, bump(1)


@module
def total(items: Table[Box]) -> tuple[f32, i32]:
    sum = 0.0
    for i in range(len(items)):
        sum += items[i].low.x
    items[0].count = 99
    return sum, len(items)


@module
def total_of_named() -> tuple[f32, i32]:
    sum, n = total(boxes)
    return sum, n + boxes[0].count


def memory():
    three = [Box((i, 2, 3), i, (4.5, 5, np.inf), i == 1) for i in range(3)]
    return {"boxes": memory_table(three), "pairs": memory_table([Pair(three[0], 0.5, three[1])])}


@given(i=st.integers(0, 2), v=st.tuples(floats, tame, tame))
def test_tables(i, v):
    agree(table_work, i, v, memory=memory())


def test_tables_as_parameters():
    agree(total_of_named, memory=memory())
    found = total(memory()["boxes"])
    assert found == (F32(3), I32(3))
    with tables(memory()):
        assert total(boxes) == (F32(3), I32(3))
        assert boxes[0].count == 99


def test_an_index_outside_a_table_names_table_module_and_index():
    with tables(memory()), pytest.raises(MachineError, match=r"`boxes` in `bump`[\s\S]*0 to 2[\s\S]*3") as caught:
        bump(3)
    frame = next(f for f in traceback.extract_tb(caught.tb) if f.name == "bump")
    assert frame.filename == __file__
    assert frame.line == "boxes[i].count += 1"


def test_a_table_without_memory_is_an_error():
    with pytest.raises(MachineError, match="`boxes` stands in no memory"):
        bump(0)


def test_bindings_nest_and_end():
    outer, inner = memory(), memory()
    inner["boxes"].memory[:] = 0
    with tables(outer):
        with tables({"boxes": inner["boxes"]}):
            assert boxes[1].low.x == 0
            assert len(pairs) == 1
        assert boxes[1].low.x == 1
        assert [box.count for box in boxes] == [0, 1, 2]
    with pytest.raises(MachineError):
        boxes[0]


def test_a_table_is_written_and_shown_from_outside():
    with tables(memory()):
        boxes[2] = Box((1, 1, 1), 5, (2, 2, 2), True)
        assert boxes[2].count == 5
        with pytest.raises(TypeError, match="expected Box"):
            boxes[2] = 3


# --- the modules that we ship -----------------------------------------------------------------------------------------


def is_closed(member):
    """Whether `member` is a module that needs neither tables nor fillers: it can be run on its arguments alone."""
    if not isinstance(member, Module) or any(isinstance(t, types.Table) for t in member.signature.parameters):
        return False
    try:
        return not link(member).tables
    except LinkError:
        return False
    except SourceError:
        return True  # its own test will say what is wrong


def shipped_modules():
    """Every closed module of `tasuki.modules`."""
    packages = pkgutil.iter_modules(tasuki.modules.__path__, "tasuki.modules.")
    members = [member for package in packages for member in vars(importlib.import_module(package.name)).values()]
    return sorted(set(filter(is_closed, members)), key=lambda member: member.qualified_name)


SHIPPED = shipped_modules()
LEAVES = {"f32": st.floats(-4, 4, width=32), "i32": st.integers(-2, 40), "bool": truths}


def test_there_are_modules_to_hold():
    assert len(SHIPPED) >= 5


@pytest.mark.parametrize("entry", SHIPPED, ids=lambda entry: entry.qualified_name)
@settings(max_examples=20, deadline=None)
@given(data=st.data())
def test_shipped_modules(entry, data):
    parameters = entry.signature.parameters
    agree(entry, *(from_leaves(t, [data.draw(LEAVES[leaf]) for leaf in t.leaves]) for t in parameters))


# --- sockets, closures, globals -------------------------------------------------------------------------------------


@socket
def shading(point: vec3, s: f32) -> vec3: ...


@socket(dispatch=True)
def measure(kind: i32, index: i32, s: f32) -> f32: ...


@module
def dim(point: vec3, s: f32) -> vec3:
    return point * s


@module
def box_measure(box: Box, s: f32) -> f32:
    return (box.high.x - box.low.x) * s


@module
def pair_measure(pair: Pair, s: f32) -> f32:
    return pair.weight + s


@module
def through_sockets(p: vec3, kind: i32) -> vec3:
    return shading(p, 0.5) + measure(kind, 0, 2)


def test_sockets():
    cases = [Case(1, box_measure, boxes, "boxes"), Case(2, pair_measure, pairs, "pairs")]
    with shading.filled(dim), measure.filled(cases):
        for kind in (1, 2):
            agree(through_sockets, (1, 2, 3), kind, fillers={"shading": dim, "measure": cases}, memory=memory())
    with pytest.raises(LinkError, match="shading"):
        through_sockets((1, 2, 3), 1)


def make_scaled(factor):
    @module
    def scaled(x: f32) -> f32:
        y = 2 * factor
        return x * y

    return scaled


def test_a_module_in_a_function_sees_the_closure():
    agree(make_scaled(0.1), 3.0)
    agree(make_scaled(4.0), 3.0)


def test_a_global_that_is_bound_anew_counts_at_the_next_call():
    variables = {"module": module, "f32": f32, "SCALE": 2.0}
    text = "@module\ndef scaled(x: f32) -> f32:\n    return x * SCALE\n"
    linecache.cache["<cell 1>"] = (len(text), None, text.splitlines(True), "<cell 1>")
    exec(compile(text, "<cell 1>", "exec"), variables)
    assert variables["scaled"](1.5) == 3
    variables["SCALE"] = 4.0
    assert variables["scaled"](1.5) == 6


@module
def pythons_own(x: f32, y: f32) -> f32:
    return PYTHON_MIN(x, y, 1)


PYTHON_MIN = __builtins__["min"] if isinstance(__builtins__, dict) else __builtins__.min


@given(x=floats, y=floats)
def test_pythons_min_is_the_languages(x, y):
    agree(pythons_own, x, y)


@module
def taken_names(_tasuki: f32) -> f32:
    _tasuki += 1.5
    return _tasuki


def test_a_module_may_use_the_name_of_the_runtime():
    agree(taken_names, 1.0)


# --- calls from outside ---------------------------------------------------------------------------------------------


def test_arguments_and_results_take_the_declared_types():
    assert repr(float_pair(1, b=2.5)) == "(F32(0.0), F32(1.0))"
    box = grown({"low": (0, 0, 0), "count": 1, "high": np.ones(3), "solid": False}, 1)
    assert repr(box) == repr(Box(low=Vec3(-1), count=2, high=Vec3(2), solid=False))
    assert grown(np.zeros((), Box.numpy_dtype())[()], 0).count == 1


def test_a_record_that_was_passed_stays_as_it_was():
    box = Box((0, 0, 0), 1, (1, 1, 1), True)
    assert grown(box, 1).count == 2
    assert box == Box((0, 0, 0), 1, (1, 1, 1), True)


@pytest.mark.parametrize(
    ("arguments", "names", "message"),
    [
        ((1.0,), {}, "b is missing"),
        ((1.0, 2.0, 3.0), {}, "found 3 arguments"),
        ((1.0, 2.0), {"a": 1.0}, "a is given twice"),
        ((1.0,), {"c": 1.0}, "c is not among them"),
        ((1.0, "x"), {}, "float_pair, argument b: expected f32, found str 'x'"),
        ((1.0, I32(1)), {}, "expected f32, found i32"),
        ((True, 1.0), {}, "expected f32, found bool"),
    ],
)
def test_wrong_arguments(arguments, names, message):
    with pytest.raises(TypeError, match=message):
        float_pair(*arguments, **names)


def test_a_table_argument_must_be_a_table_of_that_record():
    with tables(memory()), pytest.raises(TypeError, match=r"expected Table\[Box\]"):
        total(pairs)


@module
def wrong(x: f32) -> i32:
    return x


def test_a_module_that_does_not_check_does_not_run():
    with pytest.raises(SourceError, match="expected: i32"):
        wrong(1.0)


# --- debugging ------------------------------------------------------------------------------------------------------


def line_of(text, file=__file__):
    """The number of the first line that contains `text`."""
    return next(number for number, line in enumerate(linecache.getlines(file), 1) if text in line)


class Debugger(bdb.Bdb):
    """Stops at one line, as a debugger does, and keeps what the locals were."""

    def __init__(self, line):
        super().__init__()
        self.stops = []
        assert self.set_break(__file__, line) is None

    def user_line(self, frame):
        if self.break_here(frame):
            self.stops.append((frame.f_code.co_name, dict(frame.f_locals)))
        self.set_continue()


def test_a_breakpoint_in_a_module_stops_with_its_values():
    debugger = Debugger(line_of("w.z = s"))
    debugger.runcall(vectors, (1, 2, 3), (4, 5, 6), 2.0)
    [(name, values)] = debugger.stops
    assert name == "vectors"
    assert repr(values["s"]) == "F32(2.0)"
    assert repr(values["v"]) == "Vec3(3.0, 5.5, 4.0)"
    assert repr(values["a"].x) == "F32(1.0)"


def test_a_breakpoint_in_a_loop_stops_each_time():
    debugger = Debugger(line_of("total -= k"))
    debugger.runcall(loops, 2, 1.0)
    assert [repr(values["k"]) for _, values in debugger.stops] == [f"I32({k})" for k in range(2, 9)]


@module
def with_breakpoint(x: f32) -> f32:
    y = x * 2
    breakpoint()
    return y


def test_breakpoint_calls_the_hook(monkeypatch):
    seen = []
    monkeypatch.setattr(sys, "breakpointhook", lambda: seen.append(sys._getframe(1).f_locals["y"]))
    assert with_breakpoint(1.5) == 3
    assert [repr(value) for value in seen] == ["F32(3.0)"]


def test_every_traced_line_is_a_line_of_the_module():
    lines = set()

    def trace(frame, event, _):
        if frame.f_code.co_name == "arrays" and event == "line":
            lines.add(frame.f_lineno)
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        arrays(3, 1.0, (1, 2, 3))
    finally:
        sys.settrace(before)
    first = line_of("def arrays(")
    last = line_of("return total, items[0].low.x")
    assert {first + 1, line_of("points[n].z += 2"), line_of("a, stack[1], items"), last} <= lines
    assert all(first < line <= last for line in lines)


def test_a_function_keeps_its_names():
    seen = []
    before = sys.gettrace()
    sys.settrace(lambda frame, *_: seen.append((frame.f_code.co_name, frame.f_code.co_filename)))
    try:
        dim((1, 2, 3), 2.0)
    finally:
        sys.settrace(before)
    assert ("dim", __file__) in seen
