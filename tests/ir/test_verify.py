"""The verifier: a sound program passes; a violation of each invariant is named, with its function and statement."""

from __future__ import annotations

import pytest

from tasuki.diagnostics import VerifyError
from tasuki.ir import nodes as n
from tasuki.ir.types import F32, I32, VEC3, VOID, Array, Record, Scalar, Table, Tuple
from tasuki.ir.verify import verify
from tests.ir.build import b, construct, element, f, function, i, load, local, member, op, pair, program

ROW = Record("Row", (("n", I32), ("v", VEC3)))
OTHER = Record("Other", (("x", F32),))
ROWS = n.NamedTable("rows", Table(ROW))
X, K, V, A = local("x", F32), local("k", I32), local("v", VEC3), Array(F32, 4)


def complaints(body, result=VOID, callees=(), parameters=None, variables=None, tables=None):
    """What the verifier says of a function with locals x: f32, k: i32, v: vec3, a: array, and table parameter t."""
    given = {"x": F32, "t": Table(ROW)} if parameters is None else parameters
    held = {"k": I32, "v": VEC3, "a": A} if variables is None else variables
    main = function(body, given, result, held)
    try:
        verify(program(main, *callees, tables={"rows": ROW} if tables is None else tables))
    except VerifyError as error:
        return str(error).splitlines()
    return []


def test_a_sound_program_passes():
    helper = function([n.Return(op("add", X, f(1.0)))], {"x": F32, "t": Table(ROW)}, F32, name="helper")
    body = [
        n.Clear("a"),
        n.SetElement("a", i(0), X),
        n.Assign("v", f(1.0), ("x",)),
        n.Call(None, "helper", (element("a", A, K), ROWS)),
        n.Call("x", "helper", (X, local("t", Table(ROW)))),
        n.Store(ROWS, i(0), f(1.0), ("v", "y")),
        n.Atomic("k", "add", ROWS, i(0), i(1), ("n",)),
        n.Loop(
            b(True),
            (
                n.If(op("less", X, f(0.0)), (n.Break(),), (n.Continue(),)),
                n.Assign("x", member(load(ROWS, K), "v", "x")),
            ),
        ),
        n.Return(pair(construct(VEC3, X), n.Length(ROWS, I32))),
    ]
    assert complaints(body, Tuple((VEC3, I32)), [helper]) == []


def test_an_endless_loop_needs_no_return_after_it():
    assert complaints([n.Loop(b(True), (n.If(op("less", X, f(0.0)), (n.Return(X),)),))], F32) == []
    leaves = n.Loop(b(True), (n.If(op("less", X, f(0.0)), (n.Break(),), (n.Return(X),)),))
    assert complaints([leaves], F32) == ["main: a path ends without Return"]


VIOLATIONS = {
    "assign undeclared": ([n.Assign("y", X)], "main: body[0]: `y` is not declared"),
    "assign of another type": ([n.Assign("k", X)], "main: body[0]: `k` is i32, not f32"),
    "assign to no member": ([n.Assign("v", X, ("w",))], "main: body[0]: vec3 has no `w`: no member 'w'"),
    "assign an array": ([n.Assign("a", X)], "main: body[0]: `a` is assigned, but is a array[f32, 4]"),
    "assign a table": ([n.Assign("t", X)], "main: body[0]: `t` is assigned, but is a Table[Row]"),
    "read undeclared": ([n.Assign("x", local("y", F32))], "main: body[0]: `y` is not declared"),
    "read as another type": (
        [n.Assign("k", local("x", I32))],
        "main: body[0]: Local has the type i32; its parts give f32",
    ),
    "read an array": ([n.Assign("x", local("a", A))], "main: body[0]: `a`, a array[f32, 4], is read whole"),
    "read a table": ([n.Assign("x", local("t", Table(ROW)))], "main: body[0]: `t`, a Table[Row], is read whole"),
    "read a named table": ([n.Assign("x", ROWS)], "main: body[0]: table `rows` is read whole"),
    "unknown operation": (
        [n.Assign("x", n.Operate("hypot", (X, X), F32))],
        "main: body[0]: `hypot` is no operation",
    ),
    "operation on other types": (
        [n.Assign("x", n.Operate("add", (X, K), F32))],
        "main: body[0]: `add` does not take (f32, i32)",
    ),
    "operation of another type": (
        [n.Assign("k", n.Operate("add", (X, X), I32))],
        "main: body[0]: `add` has the type i32; its parts give f32",
    ),
    "no such member": ([n.Assign("x", n.Member(V, "w", F32))], "main: body[0]: vec3 has no `w`: no member 'w'"),
    "member of another type": (
        [n.Assign("k", n.Member(V, "x", I32))],
        "main: body[0]: Member has the type i32; its parts give f32",
    ),
    "no such array": ([n.Assign("x", element("x", A, K))], "main: body[0]: `x` is not declared as an array"),
    "clear no array": ([n.Clear("x")], "main: body[0]: `x` is not declared as an array"),
    "element of another type": (
        [n.Assign("k", n.Element("a", K, I32))],
        "main: body[0]: Element has the type i32; its parts give f32",
    ),
    "index is no i32": ([n.SetElement("a", X, X)], "main: body[0]: an index is i32, not f32"),
    "set another type": ([n.SetElement("a", K, K)], "main: body[0]: the element of `a` is f32, not i32"),
    "too few members": (
        [n.Assign("v", construct(VEC3, X, X))],
        "main: body[0]: a vec3 is constructed from 2 members; it has 3",
    ),
    "member of the wrong type": (
        [n.Assign("v", construct(VEC3, X, X, K))],
        "main: body[0]: member 2 of vec3 is f32, not i32",
    ),
    "construct a scalar": ([n.Assign("x", construct(F32, X))], "main: body[0]: a f32 is constructed"),
    "load no member": ([n.Assign("x", n.Load(ROWS, K, ("w",), F32))], "main: body[0]: Row has no `w`: no member 'w'"),
    "load by f32": ([n.Assign("k", load(ROWS, X, "n"))], "main: body[0]: an index is i32, not f32"),
    "table not declared": (
        [n.Assign("k", load(n.NamedTable("lines", Table(ROW)), K, "n"))],
        "main: body[0]: `lines` is not declared as a table",
    ),
    "table of another record": (
        [n.Assign("x", load(n.NamedTable("rows", Table(OTHER)), K, "x"))],
        "main: body[0]: table `rows` is Table[Row], not Table[Other]",
    ),
    "load from no table": (
        [n.Assign("k", n.Load(V, K, ("n",), I32))],
        "main: body[0]: `v` is not declared as a table",
    ),
    "store another type": ([n.Store(ROWS, K, X, ("n",))], "main: body[0]: the record at this path is i32, not f32"),
    "atomic on an f32": (
        [n.Atomic(None, "add", ROWS, K, i(1), ("v", "x"))],
        "main: body[0]: an atomic's field is i32, not f32",
    ),
    "atomic of an f32": (
        [n.Atomic(None, "add", ROWS, K, X, ("n",))],
        "main: body[0]: an atomic's value is i32, not f32",
    ),
    "atomic into an f32": ([n.Atomic("x", "add", ROWS, K, i(1), ("n",))], "main: body[0]: `x` is f32, not i32"),
    "no such atomic": (
        [n.Atomic(None, "swap", ROWS, K, i(1), ("n",))],
        "main: body[0]: `swap` is no atomic operation",
    ),
    "test is no bool": ([n.If(K, ())], "main: body[0]: the test is bool, not i32"),
    "loop's test is no bool": ([n.Loop(X, ())], "main: body[0]: the test is bool, not f32"),
    "break outside": ([n.If(b(True), (n.Break(),))], "main: body[0].then[0]: Break outside the body of a loop"),
    "continue in a setup": (
        [n.Loop(b(True), (n.Break(),), (n.Continue(),))],
        "main: body[0].setup[0]: Continue outside the body of a loop",
    ),
    "break in the step of an inner loop": (
        [n.Loop(b(True), (n.Loop(b(False), (), (), (n.Break(),)), n.Break()))],
        "main: body[0].body[0].step[0]: Break outside the body of a loop",
    ),
    "return of a value": ([n.Return(X)], "main: body[0]: Return with a value from a function without a result"),
    "call of nothing": ([n.Call(None, "g", ())], "main: body[0]: `g` is called, but is no function of the program"),
    "inexact constant": ([n.Assign("x", n.Constant(0.1, F32))], "main: body[0]: 0.1 is not exactly a value of f32"),
    "whole f32 constant": ([n.Assign("x", n.Constant(1, F32))], "main: body[0]: 1 is not exactly a value of f32"),
    "i32 constant too large": (
        [n.Assign("k", n.Constant(2**31, I32))],
        "main: body[0]: 2147483648 is not exactly a value of i32",
    ),
    "bool as an i32 constant": (
        [n.Assign("k", n.Constant(True, I32))],
        "main: body[0]: True is not exactly a value of i32",
    ),
    "constant vector": ([n.Assign("v", n.Constant(1.0, VEC3))], "main: body[0]: a constant of type vec3"),
}


@pytest.mark.parametrize(("body", "complaint"), VIOLATIONS.values(), ids=VIOLATIONS)
def test_a_violation_is_named(body, complaint):
    assert complaints(body) == [complaint]


def test_calls_match_their_signature():
    callee = function([n.Return(X)], {"x": F32, "t": Table(ROW)}, F32, name="g")
    table = local("t", Table(ROW))
    assert complaints([n.Call("k", "g", (X, table))], callees=[callee]) == ["main: body[0]: `k` is i32, not f32"]
    assert complaints([n.Call("x", "g", (X,))], callees=[callee]) == ["main: body[0]: `g` takes 2 arguments, not 1"]
    assert complaints([n.Call("x", "g", (K, table))], callees=[callee]) == [
        "main: body[0]: parameter `x` of `g` is f32, not i32"
    ]
    assert complaints([n.Call("x", "g", (X, X))], callees=[callee]) == [
        "main: body[0]: parameter `t` of `g` is Table[Row], not f32"
    ]


def test_a_function_with_a_result_returns_it():
    assert complaints([], F32) == ["main: a path ends without Return"]
    assert complaints([n.If(b(True), (n.Return(X),))], F32) == ["main: a path ends without Return"]
    assert complaints([n.Return(K)], F32) == ["main: body[0]: the result is f32, not i32"]
    assert complaints([n.Return()], F32) == ["main: body[0]: Return without a value from a function with a result"]


def test_recursion_is_named_with_its_circle():
    def caller(name, callee):
        return function([n.Call(None, callee, ())], {}, VOID, name=name)

    with pytest.raises(VerifyError, match="functions call themselves: f -> g -> f"):
        verify(program(caller("main", "f"), caller("f", "g"), caller("g", "f")))


@pytest.mark.parametrize(
    ("parameters", "variables", "result", "complaint"),
    [
        ({"x": F32}, {"x": I32}, VOID, "main: `x` is declared twice"),
        ({"x": A}, {}, VOID, "main: parameter `x`: array[f32, 4] is not the type of a value"),
        ({}, {"t": Table(ROW)}, VOID, "main: variable `t`: Table[Row] is not the type of a value"),
        ({}, {"a": Array(F32, 0)}, VOID, "main: array `a` has length 0"),
        ({}, {"a": Array(A, 2)}, VOID, "main: variable `a`: array[f32, 4] is not the type of a value"),
        ({"x": Tuple((F32, A))}, {}, VOID, "main: parameter `x`: array[f32, 4] is not the type of a value"),
        ({"x": Record("Empty", ())}, {}, VOID, "main: parameter `x`: record Empty has no fields"),
        ({"x": Record("D", (("f", F32), ("f", I32)))}, {}, VOID, "main: parameter `x`: D has two members of one name"),
    ],
)
def test_declarations_are_of_values(parameters, variables, result, complaint):
    assert complaints([], result, parameters=parameters, variables=variables) == [complaint]


def test_the_program_holds_its_entry_under_its_name():
    main = function([])
    with pytest.raises(VerifyError, match="the entry `other` is no function"):
        verify(n.Program({"main": main}, "other", {}))
    with pytest.raises(VerifyError, match="function `main` stands under the name `x`"):
        verify(n.Program({"x": main}, "x", {}))
    with pytest.raises(VerifyError, match=r"table `t`: array\[f32, 4\] is not the type of a value"):
        verify(program(main, tables={"t": Record("R", (("a", A),))}))


def test_all_violations_are_named_at_once():
    found = complaints([n.Assign("y", X), n.Assign("k", X), n.Break()], F32)
    assert len(found) == 3


def test_unknown_scalars_are_named():
    half = Scalar("f16")
    assert complaints([n.Assign("x", n.Constant(1.0, half))]) == ["main: body[0]: 1.0 is not exactly a value of f16"]
