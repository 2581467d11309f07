"""Table 1: the steps and the errors that are promised, and that no microinstruction is idle."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tasuki.machines.pu import simulate, table1
from tasuki.machines.pu.macro import assemble

PAGE = Path(__file__).parents[3] / "docs" / "table-1.md"
ROWS = [one for row in table1.ROWS for one in (row, *table1.shorter_rows(row))]
NAMES = [row.macro for row in ROWS]

STEPS = {
    "add": 1,
    "subtract": 1,
    "multiply": 1,
    "divide": 6,
    "sqrt": 9,
    "reciprocal": 5,
    "sin": 15,
    "vector add": 1,
    "vector subtract": 1,
    "vector multiply": 1,
    "vector times scalar": 1,
    "vector over scalar": 6,
    "dot": 3,
    "norm": 12,
    "normalize": 18,
    "vector times matrix": 12,
    "matrix times matrix": 64,
}
DAMAGED = {"vector divide", "vector over scalar"}
ERRORS = {
    "div": 3.0,
    "sqrt": 2.0,
    "rcp": 2.0,
    "sin": 1e-6,
    "vdiv": 3.0,
    "vover": 3.0,
    "dot": 2.0,
    "norm": 3.0,
    "normalize": 5.0,
    "vecmat": 2.5,
    "matmat": 2.5,
    "div5": 4.0,
    "sqrt6": 2.0,
    "rcp4": 3.0,
    "sin11": 1e-6,
    "vdiv15": 3.0,
    "norm9": 3.0,
    "normalize11": 5.0,
    "matmat41": 3.0,
}
"""The greatest error allowed, in the unit of the row; the other operations round once."""


@pytest.fixture(scope="module")
def measured():
    return {row.macro: table1.measure(row) for row in ROWS}


def test_every_row_of_the_paper_is_there():
    assert [row.operation for row in table1.ROWS] == [
        *["add", "subtract", "multiply", "divide", "sqrt", "reciprocal", "sin"],
        *["vector add", "vector subtract", "vector multiply", "vector divide", "vector times scalar"],
        *["vector over scalar", "dot", "norm", "normalize", "vector times matrix", "matrix times matrix"],
    ]
    assert {row.operation for row in table1.ROWS if row.published is None} == DAMAGED


@pytest.mark.parametrize("row", table1.ROWS, ids=[row.macro for row in table1.ROWS])
def test_steps_are_the_published_ones(row, measured):
    steps = measured[row.macro]["steps"]
    assert steps == STEPS.get(row.operation, steps)
    assert row.published in (None, steps)


@pytest.mark.parametrize("row", ROWS, ids=NAMES)
def test_errors_on_a_million_values_and_on_whole_octaves(row, measured):
    one = measured[row.macro]
    assert one["values"] >= 1_000_000 + (1 << 23 if row.whole else 0)
    assert one["error"]["value"] <= ERRORS.get(row.macro, 0.5)


@pytest.mark.parametrize("row", [row for row in table1.ROWS if row.shorter], ids=lambda row: row.macro)
def test_shorter_macros_are_shorter(row, measured):
    for macro in row.shorter:
        assert measured[macro]["steps"] < measured[row.macro]["steps"]


@pytest.mark.parametrize("row", ROWS, ids=NAMES)
def test_every_microinstruction_is_needed(row):
    """Without any one of its microinstructions a macro's results are wrong by far more than its error."""
    count = 16
    operands = row.sample(np.random.default_rng(7), count)
    program = assemble(table1.program(row, count)).program
    memory = np.concatenate([*operands, np.zeros((count, 4 if row.result == "m" else 1, 4), np.float32)], axis=1)
    rows = memory.shape[1]
    allowed = 4 * ERRORS.get(row.macro, 0.5)

    def error(words):
        outcome = simulate.run(replace(program, words=words), memory=memory.reshape(-1, 4), machine="plain")
        after = outcome.state.memory[: count * rows].view(np.float32).reshape(count, rows, 4)
        results = after[:, -4 if row.result == "m" else -1 :]
        return np.nan_to_num(table1.error(row, operands, results), nan=np.inf)

    assert error(program.words) <= allowed
    for address in range(program.labels["measured"], program.labels["rest"]):
        without = program.words[:address] + program.words[address + 1 :]
        assert error(without) > allowed, f"microinstruction {address - program.labels['measured'] + 1} is idle"


# --- outside the promised range: what the manual says -----------------------------------------------------------------

INF, NAN, TINY = np.inf, np.nan, np.float32(1e-45)


def scalar(macro: str, *columns):
    row = next(one for one in ROWS if one.macro == macro)
    operands = [table1.scalars(np.array(column, np.float32)) for column in columns]
    return table1.run(row, operands, "plain")[0][:, 0, 3]


def same(found, expected):
    """Equal, NaN like NaN, and the sign of zero too."""
    np.testing.assert_array_equal(found, np.array(expected, np.float32))
    zero = np.array(expected) == 0
    np.testing.assert_array_equal(np.signbit(found[zero]), np.signbit(np.array(expected)[zero]))


def test_reciprocal_of_special_numbers():
    same(scalar("rcp", [0.0, -0.0, INF, -INF, NAN, TINY, -TINY]), [INF, -INF, 0.0, -0.0, NAN, INF, -INF])


def test_square_root_of_special_numbers():
    same(scalar("sqrt", [0.0, -0.0, INF, -INF, NAN, -1.0, -TINY]), [0.0, -0.0, INF, NAN, NAN, NAN, NAN])


def test_square_root_of_subnormal_numbers():
    numbers = np.arange(1, 2000, dtype=np.uint32).view(np.float32)
    exact = np.sqrt(numbers.astype(np.float64))
    found = scalar("sqrt", numbers)
    assert np.all(np.abs(found - exact) <= 2 * np.spacing(exact.astype(np.float32)))


def test_quotients_of_special_numbers():
    dividends = [1.0, -1.0, 0.0, INF, INF, NAN, 1.0, 1.0]
    divisors = [0.0, 0.0, 0.0, 2.0, INF, 1.0, INF, NAN]
    same(scalar("div", dividends, divisors), [INF, -INF, NAN, INF, NAN, NAN, 0.0, NAN])


def test_quotients_by_very_small_divisors_are_infinite():
    """Below 2**-128 the reciprocal overflows, so that the quotient does, whatever the dividend."""
    same(scalar("div", [1e-30], [2.0**-130]), [INF])


def test_quotients_by_very_large_divisors_lose_bits():
    """Above 2**126 the reciprocal is subnormal: its last two bits are lost."""
    divisors = np.linspace(2.0**126, 2.0**128, 3000, endpoint=False).astype(np.float32)
    found = scalar("div", np.full(3000, 2.0**100), divisors)
    exact = 2.0**100 / divisors.astype(np.float64)
    off = np.abs(found - exact) / np.spacing(exact.astype(np.float32))
    assert 3.0 < off.max() < 8.0


def test_norm_of_vectors_whose_square_underflows_is_zero():
    row = next(one for one in ROWS if one.macro == "norm")
    assert table1.run(row, [np.full((1, 1, 4), 1e-30, np.float32)], "plain")[0][0, 0, 3] == 0.0


def test_sine_of_special_numbers():
    assert np.isnan(scalar("sin", [INF, -INF, NAN])).all()
    assert (scalar("sin", [0.0, -0.0]) == 0).all()


def test_sine_beyond_the_promised_range():
    angles = np.linspace(-6400, 6400, 2000, dtype=np.float32)
    assert np.abs(scalar("sin", angles) - np.sin(angles.astype(np.float64))).max() < 1e-6


def test_norm_of_vectors_whose_square_overflows_is_infinite():
    row = next(one for one in ROWS if one.macro == "norm")
    operands = [np.full((1, 1, 4), 1e20, np.float32)]
    assert table1.run(row, operands, "plain")[0][0, 0, 3] == INF


def test_normalising_the_zero_vector_gives_nan():
    row = next(one for one in ROWS if one.macro == "normalize")
    assert np.isnan(table1.run(row, [np.zeros((1, 1, 4), np.float32)], "plain")[0][0, 0, :3]).all()


def test_every_shorter_macro_says_what_it_gives_up():
    assert all(one.note for row in table1.ROWS for one in table1.shorter_rows(row))


# --- docs/table-1.md --------------------------------------------------------------------------------------------------


def cells(page: str) -> list[list[str]]:
    section = page.split("<!-- generated: table 1 -->\n", 1)[1].split("<!-- end -->", 1)[0]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in section.splitlines()]


def test_the_page_shows_the_table(measured):
    """Steps exactly; errors within 5 %, because float64 functions differ a little between platforms."""
    rows = []
    for row in table1.ROWS:
        rows.append({**measured[row.macro], "shorter": [measured[macro] for macro in row.shorter]})
    page = PAGE.read_text()
    found, expected = cells(page), cells(table1.renewed(page, rows))
    hint = "run: python -m tasuki.machines.pu.table1 docs/table-1.md"
    assert [[*line[:4], line[5]] for line in found] == [[*line[:4], line[5]] for line in expected], hint
    for mine, theirs in zip(found[2:], expected[2:], strict=True):
        (value, unit), (right, right_unit) = mine[4].split(" ", 1), theirs[4].split(" ", 1)
        assert unit == right_unit
        assert float(value) == pytest.approx(float(right), rel=0.05), hint
