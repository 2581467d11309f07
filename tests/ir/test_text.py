"""The text form: every node comes back as it was, the text is as documented, errors point at their place."""

from __future__ import annotations

import contextlib
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tasuki.diagnostics import SourceError
from tasuki.ir import nodes as n
from tasuki.ir import text as text_form
from tasuki.ir.parse import parse_program
from tasuki.ir.text import print_expression, print_function, print_program
from tasuki.ir.types import BOOL, F32, I32, MAT4, VEC3, VEC4, VOID, Array, Record, Table, Tuple
from tasuki.ir.verify import verify
from tests.ir.build import b, construct, element, f, function, i, load, local, member, op, pair, program

INNER = Record("Inner", (("p", VEC3), ("step", F32)))
ROW = Record("Row", (("n", I32), ("inner", INNER)))
ROWS = n.NamedTable("rows", Table(ROW))
X, Y, K, V = local("x", F32), local("y", F32), local("k", I32), local("v", VEC3)
HITS = Array(ROW, 3)
LOCALS = {"x": F32, "y": F32, "k": I32, "v": VEC3, "on": BOOL, "hits": HITS, "row": ROW, "m": MAT4, "$1": F32}


def round_trip(*functions, tables=None):
    before = program(*functions, tables={"rows": ROW} if tables is None else tables)
    text = print_program(before)
    assert parse_program(text) == before, text
    assert print_program(parse_program(text)) == text
    return text


EXPRESSIONS = {
    "x + y * x": op("add", X, op("multiply", Y, X)),
    "(x + y) * x": op("multiply", op("add", X, Y), X),
    "x - (y - x)": op("subtract", X, op("subtract", Y, X)),
    "x - y - x": op("subtract", op("subtract", X, Y), X),
    "(x < y) == (x > y)": op("equal", op("less", X, Y), op("greater", X, Y)),
    "k << 2 & 7 | k ^ 1": op("bit_or", op("bit_and", op("shift_left", K, i(2)), i(7)), op("bit_xor", K, i(1))),
    "k // 3 % -4": op("modulo", op("floor_divide", K, i(3)), i(-4)),
    "-x * -1.5": op("multiply", op("negate", X), f(-1.5)),
    "negate(1.5)": op("negate", f(1.5)),
    "-negate(-1.5)": op("negate", op("negate", f(-1.5))),
    "--x": op("negate", op("negate", X)),
    "-(x + y)": op("negate", op("add", X, Y)),
    "~k": op("bit_not", K),
    "bit_not(true)": op("bit_not", b(True)),
    "(-v).x": member(op("negate", V), "x"),
    "(v + v).x": member(op("add", V, V), "x"),
    "cross(v, v).x": member(op("cross", V, V), "x"),
    "vec3(x, y, 0.0)": construct(VEC3, X, Y, f(0.0)),
    "vec3(x)": construct(VEC3, X),
    "transpose(m).3.w": member(op("transpose", local("m", MAT4)), "3", "w"),
    "mat4(m.0, m.1, m.2, vec4(1.0))": construct(
        MAT4, *(member(local("m", MAT4), str(k)) for k in range(3)), construct(VEC4, f(1.0))
    ),
    "()": construct(VOID),
    "(x,)": construct(Tuple((F32,)), X),
    "(x, (k, v)).1.0": member(pair(X, pair(K, V)), "1", "0"),
    "new Row(k, new Inner(v, x))": construct(ROW, K, construct(INNER, V, X)),
    "row.inner.step": member(local("row", ROW), "inner", "step"),
    "hits[k + 1].inner.p.z": member(element("hits", HITS, op("add", K, i(1))), "inner", "p", "z"),
    "@rows[k]": load(ROWS, K),
    "@rows[k].inner.p.z": load(ROWS, K, "inner", "p", "z"),
    "(@rows[k]).inner": member(load(ROWS, K), "inner"),
    "(@rows[k].inner).p": member(load(ROWS, K, "inner"), "p"),
    "length(@rows)": n.Length(ROWS, I32),
    "select(on, row, row)": op("select", local("on", BOOL), *[local("row", ROW)] * 2),
    "$1 + inf": op("add", local("$1", F32), f(float("inf"))),
    "-inf": f(float("-inf")),
    "-0.0": f(-0.0),
    "1e-45": f(1e-45),
    "3.4028235e+38": f(3.4028234663852886e38),
    "1.6777216e+07": f(2.0**24),
    "-2147483648": i(-(2**31)),
    "fma(x, y, x)": op("fma", X, Y, X),
    "any_lane(on)": op("any_lane", local("on", BOOL)),
}


@pytest.mark.parametrize(("text", "expression"), EXPRESSIONS.items(), ids=EXPRESSIONS)
def test_expressions(text, expression):
    assert print_expression(expression) == text
    result = expression.type
    printed = round_trip(function([n.Return(expression)], {}, result, LOCALS))
    assert f"  return {text}\n" in printed


@given(st.integers(0, 2**32 - 1))
def test_every_f32_reads_back_to_the_same_bits(bits):
    value = struct.unpack("<f", struct.pack("<I", bits))[0]
    expression = n.Constant(float(np.uint32(bits).view(np.float32)), F32)
    parsed = parse_program(f"entry e\nfunction e() -> f32 {{\n  return {print_expression(expression)}\n}}")
    [statement] = parsed.functions["e"].body
    found = np.float32(statement.value.value).view(np.uint32)
    quiet = bits | 0x00400000 if value != value else bits  # Widening to a double makes a NaN quiet.
    assert found in (bits, quiet)


def test_statements_come_back():
    table = local("t", Table(ROW))
    body = [
        n.Assign("row", X, ("inner", "p", "x")),
        n.Clear("hits"),
        n.SetElement("hits", K, X, ("inner", "step")),
        n.SetElement("hits", K, load(table, i(0))),
        n.Store(ROWS, K, local("row", ROW)),
        n.Store(table, K, X, ("inner", "step")),
        n.Atomic("k", "add", ROWS, K, i(1), ("n",)),
        n.Atomic(None, "minimum", table, K, i(-1), ("n",)),
        n.Call("x", "package.file:helper", (X, table)),
        n.Call(None, "package.file:helper", (X, ROWS)),
        n.If(op("less", X, Y), (n.Assign("x", Y),)),
        n.If(op("less", X, Y), (), (n.Assign("x", Y),)),
        n.If(op("less", X, Y), (n.Break(),), (n.If(local("on", BOOL), (n.Continue(),), (n.Return(),)),)),
        n.If(op("less", X, Y), (), (n.If(local("on", BOOL), ()), n.Return())),
        n.Loop(b(True), ()),
        n.Loop(b(True), (n.Break(),), (n.Assign("k", i(0)),)),
        n.Loop(b(True), (), (n.Assign("k", i(0)),), (n.Assign("k", i(1)),)),
        n.Loop(b(True), (n.Continue(),), (), (n.Assign("k", i(1)),)),
        n.Return(),
        n.Assign("x", Y),
    ]
    helper = function([n.Return(X)], {"x": F32, "t": Table(ROW)}, F32, name="package.file:helper")
    text = round_trip(function(body, {"t": Table(ROW)}, VOID, LOCALS), helper)
    assert 'x = call "package.file:helper"(x, t)' in text


def test_names_that_are_reserved_or_strange_are_quoted():
    names = [*sorted(text_form.RESERVED), 'a "b"\n', "", "dot", "変数", "_", "$2", "1x", "new~2"]
    body = [n.Assign(name, op("add", local(name, F32), f(1.0))) for name in names]
    held = Record("loop", (("if", F32), ("var", I32), ("x y", F32)))
    body += [n.Assign("r", f(1.0), (name,)) for name in ("if", "x y")]
    body.append(n.Return(pair(member(local("r", held), "x y"), load(n.NamedTable("@", Table(held)), i(0), "var"))))
    variables = dict.fromkeys(names, F32) | {"r": held}
    round_trip(function(body, {}, Tuple((F32, I32)), variables, name="if"), tables={"@": held})


def test_records_of_one_name_are_told_apart():
    first, second = Record("R", (("a", F32),)), Record("R", (("a", I32),))
    third = Record("R", (("inner", second),))
    variables = {"x": first, "y": second, "z": third}
    text = round_trip(function([n.Assign("z", local("y", second), ("inner",))], {}, VOID, variables), tables={})
    assert [line for line in text.splitlines() if line.startswith("record")] == [
        "record R {",
        "record R~2 {",
        "record R~3 {",
    ]


def test_the_documented_example_reads():
    lines = text_form.__doc__.splitlines()
    example = "\n".join(line[4:] for line in lines if line.startswith("    "))
    read = parse_program(example)
    verify(read)
    assert "".join(print_program(read).split()) == "".join(example.split())


def test_one_function_prints_alone():
    assert print_function(function([n.Return(X)], {"x": F32}, F32)) == (
        "function main(x: f32) -> f32 {\n  return x\n}\n"
    )


ERRORS = {
    "": "<ir>:1:1: error: the program names no entry\n  expected: entry NAME\n  found: the end of the text",
    "entry e\nfunction e(x: f33) {\n}": """\
<ir>:2:15: error: no type of this name is declared
    2 | function e(x: f33) {
      |               ^^^
  expected: a type
  found: `f33`""",
    "entry e\nfunction e(x: f32) {\n  x = x + yy\n}": """\
<ir>:3:11: error: `yy` is not declared
    3 |   x = x + yy
      |           ^^
  found: `yy`""",
    "entry e\nfunction e(x: f32) {\n  x = x + 1\n}": """\
<ir>:3:9: error: `add` does not take these arguments
    3 |   x = x + 1
      |         ^
  found: (f32, i32)""",
    "entry e\nfunction e(x: f32) {\n  x = hypot(x, x)\n}": """\
<ir>:3:7: error: `hypot` is no operation
    3 |   x = hypot(x, x)
      |       ^^^^^
  found: `hypot`""",
    "entry e\nfunction e(v: vec3) {\n  v.x = v.w\n}": """\
<ir>:3:10: error: vec3 has no member 'w'
    3 |   v.x = v.w
      |          ^^
  found: `.w`""",
    "entry e\nfunction e(x: f32) {\n  x = @rows[0]\n}": """\
<ir>:3:7: error: no table of this name is declared
    3 |   x = @rows[0]
      |       ^
  found: `@`""",
    "entry e\nfunction e(x: f32) {\n  x = x[0]\n}": """\
<ir>:3:8: error: neither a table nor an array
    3 |   x = x[0]
      |        ^
  expected: a table or array
  found: f32""",
    "entry e\nfunction e(x: f32) {\n  while = 1.0\n}": """\
<ir>:3:9: error: no expression begins here
    3 |   while = 1.0
      |         ^
  expected: an expression
  found: `=`""",
    "entry e\nfunction e(x: f32) {\n  x = 1.0 ?\n}": """\
<ir>:3:11: error: a name is expected here
    3 |   x = 1.0 ?
      |           ^
  expected: a name (in double quotes, if it is reserved)
  found: `?`""",
    "entry e\nfunction e(x: f32) {\n  x = nan(0x1ffffffff)\n}": """\
<ir>:3:7: error: more than 32 bits
    3 |   x = nan(0x1ffffffff)
      |       ^^^
  expected: the bits of an f32
  found: `nan`""",
    'entry e\nfunction e(x: f32) {\n  "\\q" = x\n}': """\
<ir>:3:8: error: a quoted name is malformed
    3 |   "\\q" = x
      |        ^
  expected: a name in double quotes, with JSON's escapes
  found: `=`""",
    "entry e\nfunction e() {\n}\nfunction e() {\n}": """\
<ir>:4:1: error: a function is declared twice
    4 | function e() {
      | ^^^^^^^^
  found: `function`""",
    "hello": """\
<ir>:1:1: error: no declaration begins here
    1 | hello
      | ^^^^^
  expected: record, table, entry, or function
  found: `hello`""",
}


@pytest.mark.parametrize(("text", "message"), ERRORS.items(), ids=[repr(text)[-30:] for text in ERRORS])
def test_errors_point_at_their_place(text, message):
    with pytest.raises(SourceError) as caught:
        parse_program(text)
    assert str(caught.value) == message


def test_every_declaration_gives_its_error():
    with pytest.raises(SourceError) as caught:
        parse_program("entry e\nfunction e( {\n}\nrecord R {\n  a b\n}\nfunction g() {\n  x = 1\n  x\n}\n", "file.ir")
    assert [d.span.line for d in caught.value.diagnostics] == [2, 5, 10]


@given(st.data())
def test_damaged_text_never_ends_in_a_traceback(data):
    text = print_program(program(function([n.Assign("row", X, ("inner", "step"))], {"x": F32}, VOID, {"row": ROW})))
    start = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(start, min(start + 5, len(text))))
    damage = data.draw(st.text('@[](){}.,:="~0xe1fn -\\\n', max_size=4))
    with contextlib.suppress(SourceError):
        parse_program(text[:start] + damage + text[end:])
