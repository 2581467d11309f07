"""Linking: sockets, dispatch over kinds, recursion, and programs of many modules."""

from __future__ import annotations

import numpy as np
import pytest

from tasuki.diagnostics import LinkError, SourceError
from tasuki.ir.interpret import interpret
from tasuki.ir.memory import MemoryTable
from tasuki.ir.nodes import Call, If
from tasuki.ir.verify import verify
from tasuki.language import Case, Table, compatible, f32, i32, link, mismatch, module, record, socket, vec3


@record
class Ball:
    radius: f32
    kind: i32


@record
class Slab:
    low: vec3
    thickness: f32


balls = Table(Ball)
slabs = Table(Slab)


@socket
def shading(x: f32) -> f32:
    """What x looks like."""
    ...


@socket(dispatch=True)
def extent(kind: i32, index: i32, scale: f32) -> f32: ...


@socket(dispatch=True)
def mark(kind: i32, index: i32): ...


@module
def bright(x: f32) -> f32:
    return x + 1.0


@module
def twice_shaded(x: f32) -> f32:
    return shading(x) + shading(2 * x)


@module
def shades_itself(x: f32) -> f32:
    return twice_shaded(x)


@module
def of_vectors(x: vec3) -> f32:
    return x.x


@module
def ball_extent(ball: Ball, scale: f32) -> f32:
    return ball.radius * scale


@module
def slab_extent(slab: Slab, scale: f32) -> f32:
    return slab.thickness * scale + 0.5


@module
def mark_ball(ball: Ball):
    balls[0].kind = ball.kind + 1


@module
def measure(kind: i32, index: i32) -> f32:
    return extent(kind, index, scale=2.0)


@module
def marks(kind: i32, index: i32):
    mark(kind, index)


BALL = Case(0, ball_extent, balls, "balls")
SLAB = Case(3, slab_extent, slabs, "slabs")


def memory():
    """Two balls of radius 10 and 20 in rows 0 and 1; one slab of thickness 30 in row 2."""
    rows = np.zeros((3, 4), np.float32)
    rows[:2, 0] = [10, 20]
    rows[2, 3] = 30
    return rows


def run(program, *arguments):
    verify(program)
    rows = memory()
    tables = {"balls": MemoryTable(rows, 0, 2), "slabs": MemoryTable(rows, 2, 1)}
    lanes = len(arguments[0])
    arrays = [[np.array(a, np.int32 if isinstance(a[0], int) else np.float32)] for a in arguments]
    used = {name: tables[name] for name in program.tables}
    return [leaf.tolist() for leaf in interpret(program, arrays, lanes=lanes, tables=used)], rows


def test_a_socket_is_filled_by_the_module_itself():
    program = link(twice_shaded, {"shading": bright})
    assert set(program.functions) == {twice_shaded.qualified_name, bright.qualified_name}
    assert run(program, [1.0])[0] == [[5.0]]


def test_an_unfilled_socket_is_named_with_its_caller():
    with pytest.raises(LinkError) as caught:
        link(twice_shaded)
    text = str(caught.value)
    assert "socket `shading`, which `twice_shaded` calls, is not filled" in text
    assert "(f32) -> f32 can fill it" in text
    assert "    return shading(x)" in text


def test_fillers_of_other_sockets_are_left_out():
    program = link(bright, {"shading": of_vectors, "no such socket": bright})
    assert set(program.functions) == {bright.qualified_name}


def test_a_filler_must_have_the_signature():
    assert compatible(bright, shading)
    assert not compatible(of_vectors, shading)
    found = mismatch(of_vectors, shading)
    assert (found.expected, found.found) == ("(f32) -> f32", "(vec3) -> f32")
    with pytest.raises(LinkError, match="`of_vectors` cannot fill socket `shading`"):
        link(twice_shaded, {"shading": of_vectors})


def test_recursion_through_a_socket():
    with pytest.raises(SourceError, match="twice_shaded -> shades_itself -> twice_shaded"):
        link(twice_shaded, {"shading": shades_itself})


def test_dispatch_takes_the_record_from_the_table_of_its_kind():
    program = link(measure, {"extent": [BALL, SLAB]})
    assert program.tables == {"balls": Ball.ir, "slabs": Slab.ir}
    found, _ = run(program, [0, 3, 0], [0, 0, 1])
    assert found == [[20.0, 60.5, 40.0]]


def test_one_case_needs_no_test_and_no_case_gives_zero():
    one = link(measure, {"extent": [BALL]})
    body = one.functions[extent.qualified_name].body
    assert not any(isinstance(statement, If) for statement in body)
    assert sum(isinstance(statement, Call) for statement in body) == 1
    assert run(one, [7], [1])[0] == [[40.0]]
    assert run(link(measure, {"extent": []}), [0], [0])[0] == [[0.0]]


def test_dispatch_without_a_result():
    program = link(marks, {"mark": [Case(0, mark_ball, balls, "balls")]})
    assert run(program, [0], [1])[1].view(np.int32)[0, 1] == 1
    assert run(link(marks, {"mark": []}), [0], [0])[0] == []


def test_a_case_takes_the_record_of_its_table_first():
    assert compatible(ball_extent, extent)
    assert not compatible(bright, extent)
    found = mismatch(bright, extent)
    assert (found.expected, found.found) == ("(record, f32) -> f32", "(f32) -> f32")
    with pytest.raises(LinkError) as caught:
        link(measure, {"extent": [Case(0, ball_extent, slabs, "slabs"), Case(1, bright, balls, "balls")]})
    assert "expected: (Slab, f32) -> f32" in str(caught.value)
    assert "expected: (Ball, f32) -> f32" in str(caught.value)


@pytest.mark.parametrize(
    ("entry", "fillers", "message"),
    [
        (measure, {"extent": ball_extent}, "`extent` is filled by cases"),
        (twice_shaded, {"shading": [BALL]}, "`shading` is filled by one module"),
        (measure, {"extent": [BALL, Case(1, ball_extent, Table(Ball), "balls")]}, "two different tables .* `balls`"),
    ],
)
def test_wrong_sorts_of_fillers(entry, fillers, message):
    with pytest.raises(LinkError, match=message):
        link(entry, fillers)


def test_a_dispatch_socket_begins_with_kind_and_index():
    @socket(dispatch=True)
    def wrong(index: i32) -> f32: ...

    @module
    def caller(index: i32) -> f32:
        return wrong(index)

    with pytest.raises(LinkError, match="does not begin with a kind and an index"):
        link(caller, {"wrong": []})


def test_a_socket_has_no_body():
    @socket
    def wrong(x: f32) -> f32:
        return x

    @module
    def caller(x: f32) -> f32:
        return wrong(x)

    with pytest.raises(LinkError, match="socket `wrong` has a body"):
        link(caller, {"wrong": bright})


def test_a_module_that_many_call_is_linked_once():
    @module
    def one(x: f32) -> f32:
        return bright(x)

    @module
    def many(x: f32) -> f32:
        return one(x) + bright(x) + one(x)

    assert len(link(many).functions) == 3
