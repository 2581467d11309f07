"""Formulas as text: both forms say the same, ranks hold, and what is wrong is named with its column."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tasuki.scene.formula_text import BINARY, UNARY, FormulaError, parse_infix, parse_polish

PARTS = ["plate", "hole", "hole_2", "穴"]
SIGNS = {operation: [sign for sign in BINARY if BINARY[sign] == operation] for operation in BINARY.values()}

expressions = st.recursive(
    st.sampled_from(PARTS),
    lambda inner: st.tuples(st.sampled_from(list(SIGNS)), inner, inner) | st.tuples(st.just("complement"), inner),
    max_leaves=20,
)
spaces = st.sampled_from(["", " ", "\n", "   "])


@st.composite
def spelled(draw):
    """An expression, and its text in infix (with every parenthesis) and in Polish form, signs and spaces at random."""
    expression = draw(expressions)

    def infix(one):
        if isinstance(one, str):
            return draw(spaces) + one + draw(spaces)
        if one[0] == "complement":
            return draw(st.sampled_from(list(UNARY))) + infix(one[1])
        return f"({infix(one[1])}{draw(st.sampled_from(SIGNS[one[0]]))}{infix(one[2])})"

    def polish(one):
        if isinstance(one, str):
            return one + " "
        sign = draw(st.sampled_from(list(UNARY) if one[0] == "complement" else SIGNS[one[0]]))
        return sign + draw(spaces) + "".join(map(polish, one[1:]))

    return expression, infix(expression), polish(expression)


@given(spelled())
def test_both_forms_say_the_same(case):
    expression, infix, polish = case
    assert parse_infix(infix, PARTS) == expression
    assert parse_polish(polish, PARTS) == expression


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("a - b - c", ("difference", ("difference", "a", "b"), "c")),
        ("a - b + c", ("union", ("difference", "a", "b"), "c")),
        ("a + b & c", ("union", "a", ("intersection", "b", "c"))),
        ("~a & b", ("intersection", ("complement", "a"), "b")),
        ("~(a & b)", ("complement", ("intersection", "a", "b"))),
        ("~!a", ("complement", ("complement", "a"))),
        (r"a \ (b ∪ c ∩ a)", ("difference", "a", ("union", "b", ("intersection", "c", "a")))),
    ],
)
def test_ranks_and_order(text, meaning):
    assert parse_infix(text, "abc") == meaning


@pytest.mark.parametrize(
    ("text", "column", "message", "found"),
    [
        ("", 0, "this formula is empty", "nothing"),
        ("plate -", 7, "an operand is missing", "the end of the formula"),
        ("plate - - hole", 8, "an operand is missing", "'-'"),
        ("plate & ()", 9, "an operand is missing", "')'"),
        ("plate - (hole", 8, "this parenthesis is not closed", "the end of the formula"),
        ("plate - hole)", 12, "this parenthesis closes nothing", "')'"),
        ("plate hole", 6, "an operator is missing", "'hole'"),
        ("plate ~ hole", 6, "an operator is missing", "'~'"),
        ("plate / hole", 6, "no such operator", "'/'"),
        ("plate - hole_3", 8, "no such part", "'hole_3'"),
        ("穴 - 2", 4, "no such operator", "'2'"),
    ],
)
def test_what_is_wrong_with_infix(text, column, message, found):
    with pytest.raises(FormulaError) as caught:
        parse_infix(text, PARTS)
    error = caught.value
    assert (error.column, error.message, error.found) == (column, message, found)


@pytest.mark.parametrize(
    ("text", "column", "message", "found"),
    [
        (" ", 0, "this formula is empty", "nothing"),
        ("- plate", 0, "an operand of this operator is missing", "1"),
        ("- plate + hole", 8, "an operand of this operator is missing", "1"),
        ("plate hole", 6, "the formula is complete before this", "'hole'"),
        ("- (plate) hole", 2, "the Polish form has no parentheses", "'('"),
        ("- plate hol", 8, "no such part", "'hol'"),
    ],
)
def test_what_is_wrong_with_polish(text, column, message, found):
    with pytest.raises(FormulaError) as caught:
        parse_polish(text, PARTS)
    error = caught.value
    assert (error.column, error.message, error.found) == (column, message, found)


def test_an_error_draws_the_formula_and_hints():
    with pytest.raises(FormulaError) as caught:
        parse_infix("plate - hole_3", PARTS)
    assert str(caught.value).splitlines() == [
        "formula:1:9: error: no such part",
        "    1 | plate - hole_3",
        "      |         ^^^^^^",
        "  expected: one of plate, hole, hole_2, 穴",
        "  found: 'hole_3'",
        "  hint: did you mean 'hole_2'?",
    ]


def test_formulas_of_thousands_of_parts_do_not_overflow():
    for text in (" - ".join(["plate"] * 20_000), "(" * 20_000 + "plate" + ")" * 20_000, "~" * 20_000 + "plate"):
        parse_infix(text, PARTS)
    parse_polish("+ plate " * 20_000 + "hole", PARTS)
