"""The canonical text: blind to names and spans, and to nothing else."""

from __future__ import annotations

import pytest

from tasuki.ir.canonical import canonical_text, digest
from tasuki.ir.parse import parse_program

TEXT = """
record Row {
  n: i32
  at: vec3
}
record Hit {
  t: f32
}
table rows: Row
table lines: Row
entry main
function main(x: f32, k: i32) -> tuple[Hit, f32] {
  var hit: Hit
  var y: f32
  var stack: array[Row, 4]
  clear stack
  stack[k].at.x = x
  y = call helper(@rows[k].at.y)
  hit = new Hit(y + 1.0)
  hit.t = x
  return (hit, stack[0].at.x)
}
function helper(x: f32) -> f32 {
  return -x
}
"""


def changed(*replacements: tuple[str, str]) -> str:
    text = TEXT
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    return digest(parse_program(text))


@pytest.mark.parametrize(
    "replacements",
    [
        [("hit", "nearest")],
        [("stack", "loops"), (" y", " yy"), ("(y", "(yy")],
        [("helper", "negated"), ("main", "start")],
        [("Row", "Line"), ("Hit", "Crossing")],
        [("Hit", "Row~2")],
        [("n: i32", "index: i32"), ("at", "place"), (".t ", ".time "), ("  t:", "  time:")],
        [("(x: f32) -> f32", "(a: f32) -> f32"), ("-x", "-a")],
        [("  var hit: Hit\n  var y: f32\n", "  var y: f32\n  var unused: i32\n  var hit: Hit\n")],
        [("entry main", "function lonely() {\n}\nentry main")],
        [("\n  clear", "\n\n\n    clear")],
    ],
)
def test_names_places_and_what_is_not_reached_do_not_matter(replacements):
    assert changed(*replacements) == digest(parse_program(TEXT))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("-x", "x"),
        ("1.0", "-1.0"),
        ("1.0", "1.0000001"),
        ("y + 1.0", "1.0 + y"),
        ("stack[k].at.x = x", "stack[k].at.y = x"),
        ("stack[k]", "stack[0]"),
        ("Row, 4", "Row, 5"),
        ("table lines: Row\n", ""),
        ("table lines", "table edges"),
        ("@rows", "@lines"),
        ("table rows: Row\ntable lines: Row", "table lines: Row\ntable rows: Row"),
        ("x: f32, k: i32", "k: i32, x: f32"),
        ("  n: i32\n  at: vec3", "  at: vec3\n  n: i32"),
        ("hit.t = x", "hit.t = y"),
        ("  clear stack\n", ""),
    ],
)
def test_anything_else_matters(old, new):
    assert changed((old, new)) != digest(parse_program(TEXT))


def test_signed_zeros_and_nans_are_told_apart():
    zero = "entry e\nfunction e() -> f32 {\n  return 0.0\n}"
    texts = [zero, zero.replace("0.0", "-0.0"), zero.replace("0.0", "nan(0x7fc00000)")]
    assert len({digest(parse_program(text)) for text in texts}) == 3


def test_the_canonical_text_reads_and_names_nothing():
    text = canonical_text(parse_program(TEXT))
    assert canonical_text(parse_program(text)) == text
    for word in ("hit", "stack", "helper", "main", "Row", "at", "k:"):
        assert word not in text
    assert len(digest(parse_program(TEXT))) == 64


def test_functions_stand_in_the_order_of_their_first_call():
    calls = "entry m\nfunction m() {\n  call b()\n  call a()\n}\n"
    one = parse_program(calls + "function a() {\n}\nfunction b() {\n  return\n}")
    other = parse_program("function b() {\n  return\n}\nfunction a() {\n}\n" + calls)
    assert digest(one) == digest(other)
