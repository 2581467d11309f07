"""Every operation of every unit on nasty words, on both simulators, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from tasuki.machines.pu import isa, simulate
from tests.machines.pu.simulating import HALT, NASTY, Fields, program

Words = np.ndarray
RNG = np.random.default_rng(1986)
WORDS = np.concatenate([np.array(NASTY, np.uint32), RNG.integers(0, 2**32, 12, dtype=np.uint32)])
A, B = (grid.ravel() for grid in np.meshgrid(WORDS, WORDS))
CANONICAL_NAN = np.uint32(0x7FC00000)
SIGN = np.uint32(0x80000000)

OPERANDS = {"x": ("own", "y"), "y": ("x", "own"), "z": ("x", "y"), "s": ("x", "y")}
"""Where each FPP finds the output of X as operand a and that of Y as operand b."""


def over_rows(steps: list[Fields], a: Words, b: Words, machine: str) -> simulate.State:
    """Run `steps` once for each row (a, b, 0, 0): X's output is then a and Y's is b, and so are their latches."""
    loop = [
        {"mem.op": "read", "mem.on": 15, "ag.mode": "linear"},
        {"x.op": "copy", "x.a": "mem", "y.op": "copy", "y.a": "mem"},
        *steps,
    ]
    head = [{"ag.load": "ar_lit", "lit": 1}, {"seq.op": "count", "lit": len(a)}]
    tail = {"mem.op": "write", "ag.mode": "linear", "ag.update": "inc", "seq.op": "loop", "seq.to": len(head)}
    code = program(*head, *loop[:-1], {**loop[-1], **tail}, HALT, memory_rows=len(a))
    memory = np.zeros((len(a), 4), np.uint32)
    memory[:, 0], memory[:, 1] = a, b
    return simulate.run(code, memory=memory, machine=machine).state


def computed(unit: str, fields: Fields, machine: str, a: Words = A, b: Words = B, before: tuple = ()) -> Words:
    """What one step with these fields makes of every pair: an FPP's output goes through Z to memory."""
    if unit == "alu":
        return over_rows([*before, fields, {"mem.on": 2, "mem.z": "alu"}], a, b, machine).memory[:, 2]
    collect = {"z.op": "copy", "z.a": "own" if unit == "z" else unit}
    return over_rows([*before, fields, collect, {"mem.on": 2}], a, b, machine).memory[:, 2]


def floating(unit: str, operation: str, **more: str) -> Fields:
    a, b = OPERANDS[unit]
    return {f"{unit}.op": operation, f"{unit}.a": a, f"{unit}.b": b, **more}


def f(words: Words) -> Words:
    return words.view(np.float32)


def canonical(values: Words) -> Words:
    return np.where(np.isnan(values), CANONICAL_NAN, values.astype(np.float32).view(np.uint32))


def truncated(a: Words) -> Words:
    whole = np.trunc(np.nan_to_num(f(a).astype(np.float64), nan=0.0))
    return np.clip(whole, -(2.0**31), 2.0**31 - 1).astype(np.int64).astype(np.uint32)


FLOAT = {
    "copy": lambda a, b: a,
    "add": lambda a, b: canonical(f(a) + f(b)),
    "sub": lambda a, b: canonical(f(a) - f(b)),
    "mul": lambda a, b: canonical(f(a) * f(b)),
    "addg": lambda a, b: canonical(f(a) + f(b)),
    "subg": lambda a, b: canonical(f(a) - f(b)),
    "min": lambda a, b: np.where(f(a) < f(b), a, b),
    "max": lambda a, b: np.where(f(a) > f(b), a, b),
    "neg": lambda a, b: canonical(f(a ^ SIGN)),
    "abs": lambda a, b: canonical(f(a & ~SIGN)),
    "sign": lambda a, b: canonical(f(a & ~SIGN | b & SIGN)),
    "itof": lambda a, b: canonical(a.view(np.int32).astype(np.float32)),
    "ftoi": lambda a, b: truncated(a),
    "floor": lambda a, b: canonical(np.floor(f(a))),
}


def wrapped(values: Words) -> Words:
    return (values.astype(np.int64) & 0xFFFFFFFF).astype(np.uint32)


def i(words: Words) -> Words:
    return words.view(np.int32)


INTEGER = {
    "copy": lambda a, b: a,
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "and": lambda a, b: a & b,
    "or": lambda a, b: a | b,
    "xor": lambda a, b: a ^ b,
    "shl": lambda a, b: a << (b % 32),
    "shr": lambda a, b: a >> (b % 32),
    "sar": lambda a, b: wrapped(i(a) >> i(b % 32)),
    "min": lambda a, b: wrapped(np.minimum(i(a), i(b))),
    "max": lambda a, b: wrapped(np.maximum(i(a), i(b))),
}

machines = pytest.mark.parametrize("machine", ["plain", "fast"])


def check(found: Words, expected: Words) -> None:
    wrong = np.nonzero(found != expected)[0]
    lines = [f"{A[k]:08x}, {B[k]:08x}: {found[k]:08x}, expected {expected[k]:08x}" for k in wrong[:5].tolist()]
    assert not lines, "\n".join([f"{len(wrong)} wrong", *lines])


@machines
@pytest.mark.parametrize("operation", FLOAT)
def test_float_operations(operation: str, machine: str):
    with np.errstate(all="ignore"):
        expected = FLOAT[operation](A, B)
    for unit in isa.FPPS if machine == "fast" else "s":
        check(computed(unit, floating(unit, operation), machine), expected)


@machines
@pytest.mark.parametrize("operation", INTEGER)
def test_integer_operations(operation: str, machine: str):
    fields = {"alu.op": operation, "alu.a": "memx", "alu.b": "memy"}
    with np.errstate(all="ignore"):
        check(computed("alu", fields, machine), INTEGER[operation](A, B))


def test_no_operation_was_forgotten():
    conditional = {"nop", "cmp", "sellt", "selle", "seleq", "pick", "test"}
    assert set(isa.DEFAULT.by_name["x.op"].codes) - conditional == set(FLOAT)
    assert set(isa.DEFAULT.by_name["alu.op"].codes) - conditional == set(INTEGER)


@machines
@pytest.mark.parametrize("operation", ["addg", "subg"])
def test_guarded_operations_give_a_where_special_is_set(operation: str, machine: str):
    # The reciprocal of 0, from a register that holds 0, sets the flag.
    set_special = {"tab.op": "rcp", "tab.in": "port"}
    found = computed("x", floating("x", operation), machine, before=(set_special,))
    check(found, A)


CONDITIONS = {
    "lt": lambda a, b: f(a) < f(b),
    "le": lambda a, b: f(a) <= f(b),
    "eq": lambda a, b: f(a) == f(b),
    "un": lambda a, b: np.isnan(f(a)) | np.isnan(f(b)),
}
ALU_CONDITIONS = {
    "eq": lambda a, b: a == b,
    "lt": lambda a, b: i(a) < i(b),
    "le": lambda a, b: i(a) <= i(b),
    "ult": lambda a, b: a < b,
    "ule": lambda a, b: a <= b,
}


@machines
@pytest.mark.parametrize("condition", CONDITIONS)
@pytest.mark.parametrize("unit", isa.FPPS)
def test_float_flags(unit: str, condition: str, machine: str):
    test = {"alu.op": "test", "seq.cond": f"{unit}.{condition}"}
    found = computed("alu", test, machine, before=(floating(unit, "cmp"),))
    check(found, CONDITIONS[condition](A, B).astype(np.uint32))
    if machine == "fast":
        turned = computed("alu", {**test, "seq.not": "yes"}, machine, before=(floating(unit, "cmp"),))
        check(turned, 1 - found)


@machines
@pytest.mark.parametrize("condition", ALU_CONDITIONS)
def test_integer_flags(condition: str, machine: str):
    compare = {"alu.op": "cmp", "alu.a": "memx", "alu.b": "memy"}
    pick = {"alu.op": "pick", "alu.a": "memx", "alu.b": "memy", "seq.cond": f"alu.{condition}"}
    found = computed("alu", pick, machine, before=(compare,))
    check(found, np.where(ALU_CONDITIONS[condition](A, B), A, B))


@machines
@pytest.mark.parametrize(("operation", "condition"), [("sellt", "lt"), ("selle", "le"), ("seleq", "eq")])
def test_selections_by_a_units_own_flags(operation: str, condition: str, machine: str):
    for unit in isa.FPPS:
        found = computed(unit, floating(unit, operation), machine, before=(floating(unit, "cmp"),))
        check(found, np.where(CONDITIONS[condition](A, B), A, B))


@machines
def test_pick_takes_words_as_they_are(machine: str):
    pick = floating("z", "pick", **{"seq.cond": "y.lt"})
    found = computed("z", pick, machine, before=(floating("y", "cmp"),))
    check(found, np.where(f(A) < f(B), A, B))


@machines
@pytest.mark.parametrize("table", isa.TABLES)
def test_tables(table: str, machine: str):
    rows = 20_000 if machine == "fast" else 500
    words = np.concatenate([WORDS, RNG.integers(0, 2**32, rows, dtype=np.uint32)])
    # Subnormals, and what lies near them, have wiring of their own.
    words[-rows // 4 :] &= 0x81FFFFFF
    steps = [
        {"s.op": "copy", "s.a": "x"},
        {"tab.op": table, "tab.in": "s"},
        {"s.op": "copy", "s.a": "table", "alu.op": "test", "seq.cond": "special"},
        {"mem.on": 3, "mem.z": "alu"},
    ]
    memory = over_rows(steps, words, words, machine).memory
    expected = np.array([isa.lookup(table, word) for word in words.tolist()], np.uint32)
    np.testing.assert_array_equal(memory[:, 3], expected[:, 0])
    np.testing.assert_array_equal(memory[:, 2], expected[:, 1])
