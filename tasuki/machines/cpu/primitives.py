"""Every primitive operation of `ir.ops`, as LLVM instructions: one function each, looked up by the operation's name.

Arguments arrive as leaves of equal variance (all scalars or all vectors) except in `select`. No fast-math flag, ever:
the bits are the interpreter's. Every instruction is safe in inactive lanes too, whatever they hold.
"""

from __future__ import annotations

from collections.abc import Callable

from tasuki.machines.cpu.emit import Emitter, Leaf

Lowering = Callable[..., Leaf]


def lower_primitive(emitter: Emitter, name: str, arguments: list[Leaf]) -> Leaf:
    """Emit primitive `name` on leaves."""
    if name == "select":
        return emitter.select(*arguments)
    return LOWERINGS[name](emitter, *emitter.together(*arguments))


def _binary(by_scalar: dict[str, str]) -> Lowering:
    def lower(e: Emitter, a: Leaf, b: Leaf) -> Leaf:
        return Leaf(a.scalar, a.varying, e.value(f"{by_scalar[a.scalar]} {e.typed(a)}, {b.text}"))

    return lower


def _compare(float_code: str, int_code: str) -> Lowering:
    def lower(e: Emitter, a: Leaf, b: Leaf) -> Leaf:
        code = f"fcmp {float_code}" if a.scalar == "f32" else f"icmp {int_code}"
        return Leaf("bool", a.varying, e.value(f"{code} {e.typed(a)}, {b.text}"))

    return lower


def _float_intrinsic(name: str) -> Lowering:
    def lower(e: Emitter, *arguments: Leaf) -> Leaf:
        first = arguments[0]
        type_ = e.type_of("f32", first.varying)
        text = e.intrinsic(f"llvm.{name}.{e.suffix(first)}", type_, [(type_, a.text) for a in arguments])
        return Leaf("f32", first.varying, text)

    return lower


def _convert(instruction: str, target: str) -> Lowering:
    def lower(e: Emitter, a: Leaf) -> Leaf:
        return Leaf(target, a.varying, e.value(f"{instruction} {e.typed(a)} to {e.type_of(target, a.varying)}"))

    return lower


def _extreme(comparison: str) -> Lowering:
    compare = _compare(*comparison.split())

    def lower(e: Emitter, a: Leaf, b: Leaf) -> Leaf:
        return e.select(compare(e, a, b), a, b)

    return lower


def _negate(e: Emitter, a: Leaf) -> Leaf:
    if a.scalar == "f32":
        return Leaf("f32", a.varying, e.value(f"fneg {e.typed(a)}"))
    return Leaf("i32", a.varying, e.value(f"sub {e.type_of('i32', a.varying)} {_zero(a)}, {a.text}"))


def _absolute(e: Emitter, a: Leaf) -> Leaf:
    if a.scalar == "f32":
        return _float_intrinsic("fabs")(e, a)
    type_ = e.type_of("i32", a.varying)
    return Leaf("i32", a.varying, e.intrinsic(f"llvm.abs.{e.suffix(a)}", type_, [(type_, a.text), ("i1", "false")]))


def _bit_not(e: Emitter, a: Leaf) -> Leaf:
    ones = _same(e, a, True if a.scalar == "bool" else -1)
    return Leaf(a.scalar, a.varying, e.value(f"xor {e.typed(a)}, {ones.text}"))


def _shift(instruction: str) -> Lowering:
    def lower(e: Emitter, a: Leaf, b: Leaf) -> Leaf:
        count = e.value(f"and {e.typed(b)}, {_same(e, b, 31).text}")
        return Leaf("i32", a.varying, e.value(f"{instruction} {e.typed(a)}, {count}"))

    return lower


def _to_f32(e: Emitter, a: Leaf) -> Leaf:
    return _convert("uitofp" if a.scalar == "bool" else "sitofp", "f32")(e, a)


def _to_i32(e: Emitter, a: Leaf) -> Leaf:
    """Truncated and saturated, NaN 0. Not `llvm.fptosi.sat`, which x86 code takes lane by lane."""
    lowest, beyond, zero = (_same(e, a, number) for number in (-(2**31), 2**31, 0))
    over = _compare("oge", "sge")(e, a, beyond)
    under = _compare("olt", "slt")(e, a, lowest)
    ordered = _compare("oeq", "eq")(e, a, a)
    fits = e.select(ordered, e.select(over, zero, e.select(under, lowest, a)), zero)
    result = e.type_of("i32", a.varying)
    whole = Leaf("i32", a.varying, e.value(f"fptosi {e.typed(fits)} to {result}"))
    largest = e.constant(2**31 - 1, "i32")
    return e.select(over, e.broadcast(largest) if a.varying else largest, whole)


def _division(wants_quotient: bool) -> Lowering:
    def lower(e: Emitter, a: Leaf, b: Leaf) -> Leaf:
        return _floor_division(e, a, b, wants_quotient)

    return lower


def _floor_division(e: Emitter, a: Leaf, b: Leaf, wants_quotient: bool) -> Leaf:
    """a // b or a % b. LLVM leaves division by zero, and of the least i32 by -1, undefined: both divide by 1 instead.
    """
    type_ = e.type_of("i32", a.varying)
    zero, one, minus_one = (_same(e, a, n) for n in (0, 1, -1))
    by_zero = _compare("oeq", "eq")(e, b, zero)
    by_minus_one = _compare("oeq", "eq")(e, b, minus_one)
    unsafe = _binary({"bool": "or"})(e, by_zero, by_minus_one)
    divisor = e.select(unsafe, one, b)
    remainder = Leaf("i32", a.varying, e.value(f"srem {type_} {a.text}, {divisor.text}"))
    signs = e.value(f"xor {type_} {remainder.text}, {divisor.text}")
    opposite = _compare("olt", "slt")(e, Leaf("i32", a.varying, signs), zero)
    inexact = _compare("une", "ne")(e, remainder, zero)
    adjust = _binary({"bool": "and"})(e, opposite, inexact)
    if wants_quotient:
        quotient = Leaf("i32", a.varying, e.value(f"sdiv {type_} {a.text}, {divisor.text}"))
        lower = Leaf("i32", a.varying, e.value(f"sub {type_} {quotient.text}, {one.text}"))
        result = e.select(by_minus_one, _negate(e, a), e.select(adjust, lower, quotient))
    else:
        upper = Leaf("i32", a.varying, e.value(f"add {type_} {remainder.text}, {divisor.text}"))
        result = e.select(by_minus_one, zero, e.select(adjust, upper, remainder))
    return e.select(by_zero, zero, result)


def _same(e: Emitter, like: Leaf, value: int | bool) -> Leaf:
    """A constant of the type and variance of `like`."""
    constant = e.constant(value, like.scalar)
    return e.broadcast(constant) if like.varying else constant


def _zero(like: Leaf) -> str:
    return "zeroinitializer" if like.varying else "0"


LOWERINGS: dict[str, Lowering] = {
    "add": _binary({"f32": "fadd", "i32": "add"}),
    "subtract": _binary({"f32": "fsub", "i32": "sub"}),
    "multiply": _binary({"f32": "fmul", "i32": "mul"}),
    "divide": _binary({"f32": "fdiv"}),
    "negate": _negate,
    "floor_divide": _division(wants_quotient=True),
    "modulo": _division(wants_quotient=False),
    "absolute": _absolute,
    # A select over an ordered comparison: one vminps / vmaxps, with exactly the stated choice for NaN and zeros.
    "minimum": _extreme("olt slt"),
    "maximum": _extreme("ogt sgt"),
    "sqrt": _float_intrinsic("sqrt"),
    "floor": _float_intrinsic("floor"),
    "fma": _float_intrinsic("fma"),
    "copysign": _float_intrinsic("copysign"),
    "less": _compare("olt", "slt"),
    "less_equal": _compare("ole", "sle"),
    "greater": _compare("ogt", "sgt"),
    "greater_equal": _compare("oge", "sge"),
    "equal": _compare("oeq", "eq"),
    "not_equal": _compare("une", "ne"),
    "bit_and": _binary({"i32": "and", "bool": "and"}),
    "bit_or": _binary({"i32": "or", "bool": "or"}),
    "bit_xor": _binary({"i32": "xor", "bool": "xor"}),
    "bit_not": _bit_not,
    "shift_left": _shift("shl"),
    "shift_right": _shift("ashr"),
    "to_f32": _to_f32,
    "to_i32": _to_i32,
    "bool_to_i32": _convert("zext", "i32"),
    "bits": _convert("bitcast", "i32"),
    "from_bits": _convert("bitcast", "f32"),
}
