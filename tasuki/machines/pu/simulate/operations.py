"""The operations of FPPs and ALU in LLVM: what `arithmetic` computes, as instructions.

No fast-math flag is ever set, so that LLVM rounds every operation once, to binary32.
"""

from __future__ import annotations

from collections.abc import Callable

from tasuki.machines.pu.simulate.arithmetic import SIGN
from tasuki.machines.pu.simulate.emit import Emitter, Value, constant

Operation = Callable[[Emitter, Value, Value], Value]

CANONICAL_NAN = Value("float", "0x7FF8000000000000")
"""As LLVM writes it: by the bits of a double. The word is 0x7FC00000."""
DECLARATIONS = """declare float @llvm.floor.f32(float)
declare i32 @llvm.fptosi.sat.i32.f32(float)
"""


def _canonical(e: Emitter, result: Value) -> Value:
    """`result`, but the canonical NaN where it is any NaN."""
    number = e.floating(result)
    is_nan = e.value("i1", f"fcmp uno {number}, {number.text}")
    return e.select(is_nan, CANONICAL_NAN, number)


def _rounded(instruction: str) -> Operation:
    def operation(e: Emitter, a: Value, b: Value) -> Value:
        return _canonical(e, e.value("float", f"{instruction} {e.floating(a)}, {e.floating(b).text}"))

    return operation


def _float_choice(test: str) -> Operation:
    """a where fcmp `test` holds, else b."""

    def operation(e: Emitter, a: Value, b: Value) -> Value:
        chosen = e.value("i1", f"fcmp {test} {e.floating(a)}, {e.floating(b).text}")
        return e.select(chosen, e.floating(a), e.floating(b))

    return operation


def _neg(e: Emitter, a: Value, b: Value) -> Value:
    return _canonical(e, e.value("i32", f"xor {e.integer(a)}, {SIGN}"))


def _magnitude(e: Emitter, a: Value) -> Value:
    return e.value("i32", f"and {e.integer(a)}, {SIGN - 1}")


def _sign(e: Emitter, a: Value, b: Value) -> Value:
    sign = e.value("i32", f"and {e.integer(b)}, {SIGN}")
    return _canonical(e, e.value("i32", f"or {_magnitude(e, a)}, {sign.text}"))


FLOAT: dict[str, Operation] = {
    "copy": lambda e, a, b: a,
    "add": _rounded("fadd"),
    "sub": _rounded("fsub"),
    "mul": _rounded("fmul"),
    "min": _float_choice("olt"),
    "max": _float_choice("ogt"),
    "neg": _neg,
    "abs": lambda e, a, b: _canonical(e, _magnitude(e, a)),
    "sign": _sign,
    "itof": lambda e, a, b: e.value("float", f"sitofp {e.integer(a)} to float"),
    "ftoi": lambda e, a, b: e.value("i32", f"call i32 @llvm.fptosi.sat.i32.f32({e.floating(a)})"),
    "floor": lambda e, a, b: _canonical(e, e.value("float", f"call float @llvm.floor.f32({e.floating(a)})")),
}


def _integer(instruction: str) -> Operation:
    return lambda e, a, b: e.value("i32", f"{instruction} {e.integer(a)}, {e.integer(b).text}")


def _shift(instruction: str) -> Operation:
    def operation(e: Emitter, a: Value, b: Value) -> Value:
        count = e.value("i32", f"and {e.integer(b)}, 31")
        return e.value("i32", f"{instruction} {e.integer(a)}, {count.text}")

    return operation


def _integer_choice(test: str) -> Operation:
    def operation(e: Emitter, a: Value, b: Value) -> Value:
        return e.select(integer_test(e, test, a, b), e.integer(a), e.integer(b))

    return operation


INTEGER: dict[str, Operation] = {
    "copy": lambda e, a, b: a,
    **{name: _integer(name) for name in ("add", "sub", "mul", "and", "or", "xor")},
    "shl": _shift("shl"),
    "shr": _shift("lshr"),
    "sar": _shift("ashr"),
    "min": _integer_choice("slt"),
    "max": _integer_choice("sgt"),
}

FLOAT_FLAGS = {"lt": "olt", "eq": "oeq", "un": "uno"}
INTEGER_FLAGS = {"lt": "slt", "eq": "eq", "ult": "ult"}


def integer_test(e: Emitter, test: str, a: Value, b: Value | int) -> Value:
    other = b if isinstance(b, Value) else constant(b)
    return e.value("i1", f"icmp {test} {e.integer(a)}, {e.integer(other).text}")


def compare(e: Emitter, unit: str, a: Value, b: Value) -> dict[str, Value]:
    """Flag -> value, for `cmp` of a unit."""
    if unit == "alu":
        return {flag: integer_test(e, test, a, b) for flag, test in INTEGER_FLAGS.items()}
    x, y = e.floating(a), e.floating(b)
    return {flag: e.value("i1", f"fcmp {test} {x}, {y.text}") for flag, test in FLOAT_FLAGS.items()}
