"""Checking of single modules: what the result says, when it is made anew, and what the program then means."""

from __future__ import annotations

import ast
import builtins
import linecache
import math
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tasuki.language as tl
from tasuki.diagnostics import SourceError
from tasuki.ir.interpret import interpret
from tasuki.ir.nodes import Constant, Return
from tasuki.ir.types import F32, I32
from tasuki.ir.verify import verify
from tasuki.language import Table, array, f32, i32, link, module, record, vec3

SCALE = 3
HALF = 0.5


@module
def scaled(x: f32) -> f32:
    return x * SCALE * HALF * math.pi


@module
def by_dotted_names(x: tl.f32) -> tl.f32:
    return tl.sqrt(x) + tl.max(x, builtins.min(x, 1))


def run(entry, *arguments, lanes=1):
    """The results of `entry` on the interpreter, as lists over lanes, one for each leaf."""
    program = link(entry)
    verify(program)
    return [leaf.tolist() for leaf in interpret(program, arguments, lanes=lanes)]


def one(value, dtype=np.float32):
    return [np.array([value], dtype)]


def cell(text, **names):
    """What a notebook cell defines: source that is known to Python under a name that is no file."""
    name = f"<cell {hash(text)}>"
    linecache.cache[name] = (len(text), None, text.splitlines(keepends=True), name)
    namespace = {"module": module, "f32": f32, "i32": i32, "__name__": "__main__", **names}
    exec(compile(text, name, "exec"), namespace)
    return namespace


def test_checked_names_what_went_in():
    checked = scaled.check()
    assert checked is scaled.check()
    assert checked.constants == {(__file__, "SCALE"): 3, (__file__, "HALF"): 0.5, (__file__, "math.pi"): math.pi}
    assert checked.calls == {}
    assert checked.function.name == scaled.qualified_name
    assert checked.function.span.file == __file__


def test_python_names_of_the_vocabulary_may_be_dotted():
    assert run(by_dotted_names, one(4.0)) == [[6.0]]


def test_a_module_is_checked_anew_when_a_name_means_something_else():
    names = cell("FACTOR = 2\n\n@module\ndef f(x: f32) -> f32:\n    return x * FACTOR\n")
    f = names["f"]
    first = f.check()
    assert run(f, one(3.0)) == [[6.0]]
    names["FACTOR"] = 5
    assert f.check() is not first
    assert run(f, one(3.0)) == [[15.0]]
    del names["FACTOR"]
    with pytest.raises(SourceError, match="unknown name `FACTOR`"):
        f.check()


def test_a_call_finds_the_module_that_a_cell_defined_last():
    names = cell("@module\ndef inner(x: f32) -> f32:\n    return x + 1.0\n")
    names |= cell("@module\ndef outer(x: f32) -> f32:\n    return inner(x)\n", **names)
    outer = names["outer"]
    assert run(outer, one(1.0)) == [[2.0]]
    again = cell("@module\ndef inner(x: f32) -> f32:\n    return x + 2.0\n")["inner"]
    outer.function.__globals__["inner"] = again
    assert run(outer, one(1.0)) == [[3.0]]


def test_errors_in_a_notebook_cell_show_the_cell():
    names = cell("# a cell\n@module\ndef f(x: f32) -> f32:\n    return x + 'text'\n")
    with pytest.raises(SourceError) as caught:
        names["f"].check()
    text = str(caught.value)
    assert "    4 |     return x + 'text'" in text
    assert "      |                ^^^^^^" in text


def test_the_digest_of_a_cell_follows_its_text():
    before = cell("@module\ndef f(x: f32) -> f32:\n    return x\n")["f"]
    same = cell("@module\ndef f(x: f32) -> f32:\n    return x\n")["f"]
    other = cell("@module\ndef f(x: f32) -> f32:\n    return -x\n")["f"]
    assert before.source_digest == same.source_digest != other.source_digest


def test_a_changed_file_is_noticed():
    names = cell("@module\ndef f(x: f32) -> f32:\n    return x\n")
    f = names["f"]
    text = "\n\n# moved\n@module\ndef f(x: f32) -> f32:\n    return x\n"
    linecache.cache[f.file] = (len(text), None, text.splitlines(keepends=True), f.file)
    with pytest.raises(SourceError, match="is not where it was"):
        f.check()


def test_a_module_in_a_function_sees_its_closure():
    def make(factor):
        @record
        class Half:
            x: f32

        @record
        class Pair:
            a: f32
            b: Half

        @module
        def times(pair: Pair) -> f32:
            return (pair.a + pair.b.x) * factor

        return times

    assert run(make(2), [*one(1.0), *one(2.0)]) == [[6.0]]
    assert run(make(0.5), [*one(1.0), *one(2.0)]) == [[1.5]]


def test_modules_of_one_name_in_one_program():
    def make(factor):
        @module
        def times(x: f32) -> f32:
            return x * factor

        return times

    double, triple = make(2), make(3)

    @module
    def both(x: f32) -> f32:
        return double(x) + triple(x)

    assert run(both, one(1.0)) == [[5.0]]


def test_two_tables_of_one_name_are_an_error():
    @record
    class Thing:
        x: f32

    elsewhere = ModuleType("elsewhere")
    elsewhere.things = Table(Thing, name="things")
    things = Table(Thing, name="things")

    @module
    def reads(i: i32) -> f32:
        return things[i].x + elsewhere.things[i].x

    with pytest.raises(SourceError, match="two tables are called `things`"):
        reads.check()


@module
def swapped(a: f32, b: f32, n: i32) -> tuple[f32, f32, f32]:
    values = array(f32, 3)
    values[0], values[1], values[2] = a, b, a
    i = 0
    i, values[i] = 2, 7.0
    values[0], values[i] = values[i], values[0]
    v = vec3(a, b, 0)
    v.x, v.y = v.y, v.x
    a, b = b, a
    return v.x + a, values[0], values[2] + b * f32(n)


def test_all_values_are_read_before_the_first_is_assigned():
    assert run(swapped, one(1.0), one(2.0), one(10, np.int32)) == [[4.0], [7.0], [11.0]]


@module
def looped(n: i32) -> tuple[i32, i32, i32]:
    stop = n
    up = 0
    for i in range(stop):
        stop = 0
        up += i
    down = 0
    for i in range(n, -n, -3):
        if i == 0:
            continue
        down = down * 10 + i
    odd = 0
    for i in range(1, n):
        for j in range(i):
            if j > 1:
                break
            odd += 1
    return up, down, odd


@given(st.integers(0, 6))
def test_loops_count_as_in_python(n):
    up = sum(range(n))
    down = 0
    for i in range(n, -n, -3):
        down = down * 10 + i if i else down
    odd = sum(min(i, 2) for i in range(1, n))
    assert run(looped, one(n, np.int32)) == [[up], [down], [odd]]


numbers = st.floats(-1e6, 1e6).map(lambda x: repr(abs(x)))
whole = st.integers(0, 10**6).map(str)


def constant_expressions(leaves):
    return st.recursive(
        leaves,
        lambda inner: (
            st.tuples(inner, st.sampled_from("+-*"), inner).map(" ".join).map("({})".format) | inner.map("(-{})".format)
        ),
        max_leaves=8,
    )


def folded(text):
    """The constant that a module returning `text` returns."""
    kind = F32 if set(text) & set(".e") else I32
    function = cell(f"@module\ndef f() -> {kind}:\n    return {text}\n")["f"].check().function
    (statement,) = function.body
    assert isinstance(statement, Return)
    assert isinstance(statement.value, Constant)
    assert statement.value.type == kind
    return statement.value.value


def rounded_at_every_step(node):
    """The value of an expression of Python, computed in float32."""
    match node:
        case ast.Constant():
            return np.float32(node.value)
        case ast.UnaryOp():
            return -rounded_at_every_step(node.operand)
        case ast.BinOp():
            apply = {ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply}[type(node.op)]
            return apply(rounded_at_every_step(node.left), rounded_at_every_step(node.right))


@given(constant_expressions(numbers))
def test_constants_are_folded_in_float32(text):
    with np.errstate(all="ignore"):
        expected = rounded_at_every_step(ast.parse(text, mode="eval").body)
    found = np.float32(folded(text))
    assert found.tobytes() == expected.tobytes() or (np.isnan(found) and np.isnan(expected))


@given(constant_expressions(whole))
def test_whole_constants_wrap(text):
    expected = eval(text)
    assert folded(text) == (expected + 2**31) % 2**32 - 2**31


def test_a_hundred_nested_operators_and_a_long_chain_of_elifs_check():
    deep = "(" * 60 + "x" + " + 1.0)" * 60
    ladder = "".join(f"    elif x < {i}.0:\n        y = {i}.0\n" for i in range(1, 100))
    text = f"@module\ndef f(x: f32) -> f32:\n    if x < 0.0:\n        y = {deep}\n{ladder}    else:\n        y = 0.0\n"
    f = cell(text + "    return y\n")["f"]
    assert run(f, one(41.5)) == [[42.0]]


def test_an_expression_that_is_too_deep_is_an_error_like_any_other():
    f = cell("@module\ndef f(x: f32) -> f32:\n    return " + " + ".join(["x"] * 900) + "\n")["f"]
    with pytest.raises(SourceError, match="`f` is nested too deeply"):
        f.check()
