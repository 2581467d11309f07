"""Macros on nasty operands: zeros of both signs, subnormal numbers, the largest ones, infinities and NaN.

What is one rounding for each operation must be NumPy's float32 result, bit for bit; quotients keep to their error and
agree with IEEE 754 on what is NaN, infinite or zero.
"""

import numpy as np
import pytest

from tasuki.machines.pu import simulate, table1
from tasuki.machines.pu.macro import assemble

NASTY = np.array(
    [
        *[0.0, -0.0, 1.0, -1.0, 1 / 3, -7.25, 1e10, -1e-10, 3.4e38, -3.4e38, np.inf, -np.inf, np.nan],
        *[2.0**-126, -(2.0**-126), 1e-40, -1e-45, 2.0**125, 16777216.0, -1.0000001],
    ],
    np.float32,
)
CANONICAL_NAN = 0x7FC00000


def rows(macro: str) -> table1.Row:
    return next(one for row in table1.ROWS for one in (row, *table1.shorter_rows(row)) if one.macro == macro)


def run(macro: str, *operands):
    row = rows(macro)
    return table1.run(row, operands, "fast")[0]


def pairs():
    first, second = np.meshgrid(NASTY, NASTY)
    return first.ravel(), second.ravel()


def nasty_vectors(count: int, shape: tuple[int, ...], seed: int):
    """Random rows in which every fourth element is a nasty one."""
    rng = np.random.default_rng(seed)
    numbers = rng.normal(size=(count, *shape)).astype(np.float32)
    return np.where(rng.random((count, *shape)) < 0.25, rng.choice(NASTY, (count, *shape)), numbers)


def same_bits(found, expected) -> None:
    bits = np.where(np.isnan(expected), np.uint32(CANONICAL_NAN), expected.astype(np.float32).view(np.uint32))
    np.testing.assert_array_equal(np.ascontiguousarray(found).view(np.uint32), bits)


@pytest.fixture(autouse=True)
def _quiet():
    with np.errstate(all="ignore"):
        yield


@pytest.mark.parametrize(("macro", "exact"), [("add", np.add), ("sub", np.subtract), ("mul", np.multiply)])
def test_scalar_arithmetic_rounds_once(macro, exact):
    a, b = pairs()
    same_bits(run(macro, table1.scalars(a), table1.scalars(b))[:, 0, 3], exact(a, b))


@pytest.mark.parametrize(("macro", "exact"), [("vadd", np.add), ("vsub", np.subtract), ("vmul", np.multiply)])
def test_vector_arithmetic_rounds_once(macro, exact):
    a, b = nasty_vectors(2000, (1, 4), 1), nasty_vectors(2000, (1, 4), 2)
    same_bits(run(macro, a, b), exact(a, b))


def test_vector_times_scalar_rounds_once():
    a, b = nasty_vectors(2000, (1, 4), 3), nasty_vectors(2000, (1, 4), 4)
    same_bits(run("vscale", a, b), a * b[..., 3:])


def test_inner_products_are_summed_in_the_order_that_is_stated():
    a, b = nasty_vectors(2000, (1, 4), 5), nasty_vectors(2000, (1, 4), 6)
    product = a * b
    same_bits(run("dot", a, b)[..., 3], product[..., 0] + product[..., 1] + product[..., 2])


def paired(product):
    """(x + y) + (z + s), over the last axis."""
    return (product[..., 0] + product[..., 1]) + (product[..., 2] + product[..., 3])


def test_vector_times_matrix_sums_pairs():
    a, m = nasty_vectors(2000, (1, 4), 7), nasty_vectors(2000, (4, 4), 8)
    same_bits(run("vecmat", a, m)[:, 0], paired(a * m))


def test_matrix_times_matrix_sums_pairs():
    a, b = nasty_vectors(1000, (4, 4), 9), nasty_vectors(1000, (4, 4), 10)
    # a[n, k, i] and b[n, j, k] hold columns; so does the result [n, j, i].
    same_bits(run("matmat", a, b), paired(a.transpose(0, 2, 1)[:, None] * b[:, :, None]))


def test_matrix_by_columns_sums_one_after_another():
    a, b = nasty_vectors(1000, (4, 4), 11), nasty_vectors(1000, (4, 4), 12)
    products = [a[:, None, k] * b[:, :, k, None] for k in range(4)]
    same_bits(run("matmat41", a, b), products[0] + products[1] + products[2] + products[3])


def like_a_quotient(found, a, b) -> None:
    """NaN, infinity and zero where IEEE 754 has them, else within 3 ulp, as long as 1/b is normal."""
    exact = a.astype(np.float64) / b.astype(np.float64)
    promised = (np.abs(b) <= 2.0**125) & (np.abs(b) >= 2.0**-126) | (b == 0) | np.isinf(b) | np.isnan(b)
    rounded = exact.astype(np.float32)
    ulp = np.ldexp(1.0, np.maximum(np.frexp(np.where(np.isfinite(exact), exact, 1))[1] - 24, -149))
    close = np.abs(found.astype(np.float64) - exact) <= 3 * ulp
    same = (np.isnan(found) & np.isnan(rounded)) | (found == rounded)
    assert np.all(same | close | ~promised)
    zero = (found == 0) & promised
    np.testing.assert_array_equal(np.signbit(found[zero]), np.signbit(exact[zero]))


def test_scalar_quotients():
    a, b = pairs()
    like_a_quotient(run("div", table1.scalars(a), table1.scalars(b))[:, 0, 3], a, b)


@pytest.mark.parametrize(("macro", "lanes"), [("vdiv", 4), ("vdiv15", 3)])
def test_vector_quotients(macro, lanes):
    a, b = nasty_vectors(4000, (1, 4), 13), nasty_vectors(4000, (1, 4), 14)
    like_a_quotient(run(macro, a, b)[..., :lanes], a[..., :lanes], b[..., :lanes])


def test_vector_over_scalar():
    a, b = nasty_vectors(4000, (1, 4), 15), nasty_vectors(4000, (1, 4), 16)
    like_a_quotient(run("vover", a, b), a, np.broadcast_to(b[..., 3:], a.shape))


@pytest.mark.parametrize("macro", ["norm", "norm9"])
def test_norms_of_nasty_vectors(macro):
    """NaN where an element is NaN, infinite where the square overflows, zero for zero."""
    a = nasty_vectors(4000, (1, 4), 17)
    square = np.sum(np.square(a[:, 0, :3]).astype(np.float64), axis=1).astype(np.float32)
    found = run(macro, a)[:, 0, 3]
    np.testing.assert_array_equal(np.isnan(found), np.isnan(a[:, 0, :3]).any(axis=1))
    np.testing.assert_array_equal(np.isinf(found), np.isinf(square))
    np.testing.assert_array_equal(found == 0, square == 0)


def test_operands_may_be_the_result():
    """In place: the results are those of separate registers."""
    cases = {"div": "div s0, s0, s1", "sqrt": "sqrt s0, s0", "rcp": "rcp s0, s0", "sin": "sin s0, s0"}
    cases |= {"vdiv": "vdiv v0, v0, v1", "vover": "vover v0, v0, s1", "normalize": "normalize v0, v0"}
    for macro, call in cases.items():
        row = rows(macro)
        operands = row.sample(np.random.default_rng(18), 50)
        apart = table1.run(row, operands)[0]
        together = run_call(row, operands, f"{call}\n    move v8, v0")
        lanes = slice(3, 4) if row.result == "s" else slice(0, row.lanes)
        np.testing.assert_array_equal(together[..., lanes], apart[..., lanes])


def run_call(row, operands, call):
    memory = np.concatenate([*operands, np.zeros((len(operands[0]), 1, 4), np.float32)], axis=1)
    program = assemble(table1.program(row, len(memory), call)).program
    after = simulate.run(program, memory=memory.reshape(-1, 4)).state.memory[: memory.shape[0] * memory.shape[1]]
    return after.view(np.float32).reshape(memory.shape)[:, -1:]


def test_a_matrix_product_may_replace_its_left_operand():
    row = rows("matmat")
    a, b = row.sample(np.random.default_rng(19), 20)
    apart = table1.run(row, [a, b])[0]
    memory = np.concatenate([a, b, np.zeros_like(a)], axis=1)
    source = table1.program(row, len(a), "matmat m0, m0, m4\n    move m8, m0")
    after = simulate.run(assemble(source).program, memory=memory.reshape(-1, 4)).state.memory[: 12 * len(a)]
    np.testing.assert_array_equal(after.view(np.float32).reshape(memory.shape)[:, 8:], apart)
