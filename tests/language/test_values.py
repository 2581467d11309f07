"""Values in plain Python: every operator is the operation of the table, bit for bit, and nothing converts by itself."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tasuki.ir import types
from tasuki.ir.ops import OPERATIONS
from tasuki.language.conversion import convert, updated
from tasuki.language.values import F32, I32, Mat4, Vec3, Vec4, evaluate, from_leaves, leaves, type_of

NASTY_FLOATS = (0.0, -0.0, 1.0, -1.5, 2.0**-149, -(2.0**-127), 2.0**128 - 2.0**104, np.inf, -np.inf, np.nan)
NASTY_INTS = (0, 1, -1, 2, -7, 31, 32, 33, -33, 2**31 - 1, -(2**31))

floats = st.floats(width=32) | st.sampled_from(NASTY_FLOATS)
ints = st.integers(-(2**31), 2**31 - 1) | st.sampled_from(NASTY_INTS)

FLOAT_OPERATORS = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "less": lambda a, b: a < b,
    "less_equal": lambda a, b: a <= b,
    "greater": lambda a, b: a > b,
    "greater_equal": lambda a, b: a >= b,
    "equal": lambda a, b: a == b,
    "not_equal": lambda a, b: a != b,
}
INT_OPERATORS = {
    **{name: operator for name, operator in FLOAT_OPERATORS.items() if name != "divide"},
    "floor_divide": lambda a, b: a // b,
    "modulo": lambda a, b: a % b,
    "bit_and": lambda a, b: a & b,
    "bit_or": lambda a, b: a | b,
    "bit_xor": lambda a, b: a ^ b,
    "shift_left": lambda a, b: a << b,
    "shift_right": lambda a, b: a >> b,
}


def same(a, b):
    """Equal in type and in every bit; any NaN equals any other."""
    if type(a) is not type(b):
        return False
    if isinstance(a, F32):
        return bool(np.isnan(a) and np.isnan(b)) or np.float32(a).tobytes() == np.float32(b).tobytes()
    return bool(a == b)


def reference(name, dtype, *numbers):
    """The table's reference on one-element arrays, as a value."""
    with np.errstate(all="ignore"):
        [result] = OPERATIONS[name].reference(*(np.array([number], dtype) for number in numbers))
    return result.item() if result.dtype == bool else (F32 if result.dtype == np.float32 else I32)(result.item())


@pytest.mark.parametrize("name", FLOAT_OPERATORS)
@given(a=floats, b=floats)
def test_f32_operators_are_the_references(name, a, b):
    assert same(FLOAT_OPERATORS[name](F32(a), F32(b)), reference(name, np.float32, a, b))


@pytest.mark.parametrize("name", INT_OPERATORS)
@given(a=ints, b=ints)
def test_i32_operators_are_the_references(name, a, b):
    assert same(INT_OPERATORS[name](I32(a), I32(b)), reference(name, np.int32, a, b))


@given(a=floats, b=floats)
def test_arithmetic_rounds_the_exact_result_once(a, b):
    # A float64 has more than twice the bits of a float32 plus two, so that rounding twice is rounding once.
    with np.errstate(all="ignore"):
        wide_a, wide_b = np.float64(a), np.float64(b)
        assert same(F32(a) + F32(b), F32(wide_a + wide_b))
        assert same(F32(a) - F32(b), F32(wide_a - wide_b))
        assert same(F32(a) * F32(b), F32(wide_a * wide_b))
        assert same(F32(a) / F32(b), F32(wide_a / wide_b))


@given(a=ints, b=ints)
def test_i32_wraps_and_division_floors_as_in_python(a, b):
    assert int(I32(a) + I32(b)) == (a + b + 2**31) % 2**32 - 2**31
    assert int(I32(a) * I32(b)) == (a * b + 2**31) % 2**32 - 2**31
    assert int(I32(a) // I32(b)) == (0 if b == 0 else (a // b + 2**31) % 2**32 - 2**31)
    assert int(I32(a) % I32(b)) == (0 if b == 0 else a % b)
    assert int(I32(a) >> I32(b)) == a >> (b % 32)


@given(value=st.floats() | floats)
def test_f32_is_rounded_to_nearest_even_as_numpy_does(value):
    with np.errstate(all="ignore"):
        expected = np.float32(value)
    assert np.isnan(expected) if np.isnan(value) else np.float32(F32(value)).tobytes() == expected.tobytes()


@given(n=ints)
def test_casts(n):
    assert same(evaluate("f32", I32(n)), F32(np.float32(n)))
    assert same(evaluate("i32", F32(n)), reference("to_i32", np.float32, n))
    assert same(evaluate("bits", evaluate("from_bits", I32(n))), I32(n)) or np.isnan(evaluate("from_bits", I32(n)))


@pytest.mark.parametrize(
    ("value", "expected"), [(np.nan, 0), (1e10, 2**31 - 1), (-np.inf, -(2**31)), (-1.9, -1), (1.9, 1)]
)
def test_f32_to_i32_truncates_and_saturates(value, expected):
    assert same(evaluate("i32", F32(value)), I32(expected))


def test_casts_of_truth_and_of_literals():
    assert same(evaluate("i32", True), I32(1))
    assert same(evaluate("f32", True), F32(1))
    assert same(evaluate("f32", 2), F32(2))
    assert same(evaluate("i32", -2.7), I32(-2))


def test_an_int_literal_takes_the_type_of_the_other_side():
    assert same(F32(0.5) + 1, F32(1.5))
    assert same(1 / F32(4), F32(0.25))
    assert same(I32(7) // 2, I32(3))
    assert same(7 % I32(4), I32(3))
    assert same(evaluate("sqrt", 4), F32(2))
    assert same(evaluate("min", 1, F32(0.5)), F32(0.5))
    assert F32(0.1) == 0.1
    assert I32(3) == 3
    assert I32(3) != 4


@pytest.mark.parametrize(
    "expression",
    [
        lambda: I32(1) + 0.5,
        lambda: I32(1) < 0.5,
        lambda: F32(1) + I32(1),
        lambda: I32(1) - F32(1),
        lambda: F32(1) < I32(1),
        lambda: F32(1) + True,
        lambda: I32(1) & True,
        lambda: I32(1) / I32(2),
        lambda: 1 / I32(2),
        lambda: F32(1) // F32(2),
        lambda: F32(1) % 2,
        lambda: F32(2) ** 2,
        lambda: 2 ** I32(2),
        lambda: divmod(I32(2), 2),
        lambda: F32(1) << 1,
        lambda: F32(1) + "x",
        lambda: Vec3(1) + Vec4(1),
        lambda: Vec3(1) + I32(1),
        lambda: Vec3(1) < Vec3(2),
        lambda: evaluate("dot", Vec3(1), 1),
        lambda: evaluate("select", True, Vec3(1), Vec4(1)),
        lambda: evaluate("select", 1, F32(1), F32(1)),
        lambda: evaluate("any_lane", 1.5),
        lambda: evaluate("f32", Vec3(1)),
        lambda: Vec3(1, 2),
        lambda: Vec3(I32(1)),
        lambda: convert(types.F32, I32(1)),
        lambda: convert(types.I32, 1.0),
        lambda: convert(types.I32, 2**31),
        lambda: convert(types.I32, True),
        lambda: convert(types.BOOL, 1),
        lambda: convert(types.VEC3, (1, 2)),
        lambda: convert(types.VEC3, ((1,), (2, 3))),
        lambda: convert(types.VEC3, "abc"),
        lambda: convert(types.MAT4, np.zeros(16)),
        lambda: convert(types.Tuple((types.F32,)), 1.0),
        lambda: convert(types.Array(types.F32, 2), [1.0, 2.0]),
        lambda: type_of("x"),
    ],
)
def test_what_does_not_fit_is_a_type_error(expression):
    with pytest.raises(TypeError):
        expression()


def test_errors_name_what_is_expected_and_found():
    with pytest.raises(TypeError, match=r"add takes \(f32, f32\) or \(i32, i32\), not \(f32, i32\).*f32\(x\)"):
        F32(1) + I32(2)
    with pytest.raises(TypeError, match=r"item 1: expected f32, found i32 I32\(3\)"):
        convert(types.Tuple((types.F32, types.F32)), (1.0, I32(3)))


def test_vectors():
    v = Vec3(1, 2, 3)
    assert v + 1 == Vec3(2, 3, 4)
    assert 6 / v == Vec3(6, 3, 2)
    assert v * v == Vec3(1, 4, 9)
    assert -v == Vec3(-1, -2, -3)
    assert (v.x, v.z) == (1, 3)
    assert v.zyx == Vec3(3, 2, 1)
    assert v.xyzz == Vec4(1, 2, 3, 3)
    assert Vec4(v, 4).wzy == Vec3(4, 3, 2)
    assert Vec3(2) == Vec3(2, 2, 2)
    assert list(v) == [1, 2, 3]
    assert evaluate("max", v, 2) == Vec3(2, 2, 3)
    assert evaluate("dot", v, v) == 14
    assert evaluate("cross", Vec3(1, 0, 0), Vec3(0, 1, 0)) == Vec3(0, 0, 1)
    np.testing.assert_array_equal(np.asarray(v), np.array([1, 2, 3], np.float32))
    for name in ("w", "xy", "xyzxy", "q", ""):
        with pytest.raises(AttributeError, match="its components are x, y, z"):
            getattr(v, name)


def test_values_never_change():
    for value in (Vec3(1), Vec4(1), Mat4(1)):
        for name in ("x", "_leaves", "other"):
            with pytest.raises(AttributeError, match="never changes"):
                setattr(value, name, 1)
        with pytest.raises(AttributeError):
            del value._leaves
    with pytest.raises(AttributeError):
        F32(1).other = 1


@given(numbers=st.lists(st.floats(-8, 8, width=16), min_size=36, max_size=36))
def test_matrices_multiply_rows_by_columns(numbers):
    a, b = np.array(numbers[:16]).reshape(4, 4), np.array(numbers[16:32]).reshape(4, 4)
    v = np.array(numbers[32:])
    left, right = convert(types.MAT4, a), convert(types.MAT4, b)
    np.testing.assert_allclose(np.asarray(convert(types.VEC4, v) @ left), v @ a, rtol=1e-5, atol=1e-4)
    np.testing.assert_allclose(np.asarray(left @ right), a @ b, rtol=1e-5, atol=1e-4)
    np.testing.assert_array_equal(np.asarray(evaluate("transpose", left)), a.T.astype(np.float32))
    np.testing.assert_array_equal(np.asarray(left.column(1)), a[:, 1].astype(np.float32))
    assert evaluate("mat4", *(left.column(i) for i in range(4))) == left


@given(a=floats, b=floats, c=floats)
def test_fma_rounds_once(a, b, c):
    with np.errstate(all="ignore"):
        [expected] = OPERATIONS["fma"].reference(*(np.array([x], np.float32) for x in (a, b, c)))
    assert same(evaluate("fma", F32(a), F32(b), F32(c)), F32(expected))


def test_select_takes_any_two_equal_types():
    assert evaluate("select", True, Vec3(1), Vec3(2)) == Vec3(1)
    assert evaluate("select", False, (F32(1), True), (F32(2), False)) == (F32(2), False)
    assert same(evaluate("select", True, 1, F32(2)), F32(1))
    assert same(evaluate("select", True, 1, 2), I32(1))
    assert evaluate("select", False, Vec3(1), F32(2)) == Vec3(2)


def test_lane_operations_see_one_lane():
    assert evaluate("any_lane", True) is True
    assert evaluate("all_lanes", False) is False
    assert same(evaluate("count_lanes", True), I32(1))
    assert same(evaluate("count_lanes", False), I32(0))
    assert same(evaluate("same_lanes", F32(2)), F32(2))


def test_more_than_two_arguments_fold_from_the_left():
    # min(a, b) is a if a < b else b: a NaN on the left loses, on the right it wins.
    assert same(evaluate("min", F32(np.nan), F32(1), F32(2)), F32(1))
    assert np.isnan(evaluate("min", F32(1), F32(2), F32(np.nan)))


@given(numbers=st.lists(floats, min_size=16, max_size=16), n=ints, truth=st.booleans())
def test_leaves_and_back(numbers, n, truth):
    value = (Vec3(*numbers[:3]), I32(n), (truth, convert(types.MAT4, np.array(numbers).reshape(4, 4))))
    flat = leaves(value)
    back = from_leaves(type_of(value), flat)
    assert type_of(back) == type_of(value)
    assert len(flat) == len(type_of(value).leaves)
    assert all(map(same, leaves(back), flat))
    assert from_leaves(types.VOID, leaves(None)) is None


def test_updating_a_member_leaves_the_value_as_it_was():
    value = Vec3(1, 2, 3)
    assert updated(value, ("y",), 5) == Vec3(1, 5, 3)
    assert value == Vec3(1, 2, 3)
    assert updated((I32(1), value), ("1", "x"), 0) == (I32(1), Vec3(0, 2, 3))
    with pytest.raises(TypeError):
        updated(value, ("y",), I32(1))
    with pytest.raises(KeyError):
        updated(value, ("w",), 1)


@given(number=floats, n=ints)
def test_values_print_their_type_and_can_be_copied(number, n):
    assert repr(F32(0.1)) == "F32(0.1)"
    assert repr(I32(-3)) == "I32(-3)"
    assert repr(Vec3(0.1, 2, 3)) == "Vec3(0.1, 2.0, 3.0)"
    for value in (F32(number), I32(n), Vec3(number, 1, 2), Mat4(Vec4(1), Vec4(2), Vec4(3), Vec4(4))):
        for other in (copy.copy(value), copy.deepcopy(value), pickle.loads(pickle.dumps(value))):
            assert all(map(same, leaves(other), leaves(value)))
    assert same(F32(float(str(F32(number)))) if not np.isnan(number) else F32(np.nan), F32(number))


@pytest.mark.parametrize("name", [name for name, row in OPERATIONS.items() if row.sort == "composite"])
def test_composites_are_their_expansions_on_numpy_arrays(name):
    # The expansion once more, on arrays of one element, in the way in which a machine uses it.
    from tasuki.ir.expansions import Term

    def apply(primitive, values, _):
        return OPERATIONS[primitive].reference(*values)

    def literal(number, scalar):
        return np.array([number], np.float32 if scalar == "f32" else np.int32)

    generator = np.random.default_rng(7)
    for parameters, result in OPERATIONS[name].signatures:
        values = [from_leaves(t, generator.normal(size=len(t.leaves)).tolist()) for t in parameters]
        terms = [
            [Term(np.array([leaf], np.float32), "f32", apply, literal) for leaf in leaves(value)] for value in values
        ]
        expected = [F32(term.value[0]) for term in OPERATIONS[name].expansion(*terms)]
        found = evaluate(name, *values)
        assert type_of(found) == result
        assert all(map(same, leaves(found), expected))
