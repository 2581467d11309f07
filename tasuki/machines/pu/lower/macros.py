"""Macros that compiled code brings along: the same few operations on operands of whatever banks.

The library has its macros for whole vectors and for scalars of bank S. Compiled code also computes with single
components where they lie, and with vectors of three components, whose rows have a scalar of its own in bank S. These
macros follow one rule, stated in `scalar_steps`, so that they are written here, for those kinds of operands that a
program uses, and stand at the head of its text.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from tasuki.machines.pu.lower.code import SCALAR_BANKS

NUMBERS = ("float", "integer")
Steps = list[str]
Kinds = Sequence[str]

BINARY = {"add": "add", "sub": "sub", "mul": "mul", "min": "min", "max": "max", "sign": "sign"}
UNARY = {"neg": "neg", "abs": "abs", "floor": "floor", "move": "copy"}
"""Name of a macro -> operation of an FPP."""
INTEGER = {"iadd": "add", "isub": "sub", "imul": "mul", "iand": "and", "ior": "or", "ixor": "xor"}
INTEGER |= {"ishl": "shl", "ishr": "shr", "isar": "sar", "imin": "min", "imax": "max"}
"""Name of a macro -> operation of the ALU."""
COMMUTATIVE = ("add", "mul")


def definition(name: str, kinds: Kinds) -> Steps | None:
    """The steps of macro `name` for operands of these kinds, named d, a, b, c; None for a macro of the library."""
    for table in (_SCALAR, _INTEGER, _VECTOR, _MEMORY):
        if name in table:
            return table[name](kinds)
    return None


# --- scalars ----------------------------------------------------------------------------------------------------------


def unit_of(result: str | None, kinds: Kinds) -> str:
    """The FPP that computes with scalars of these kinds, for a result in bank `result` (None: a comparison).

    That of the result, where all operands reach it in one step: its own bank, a number, one scalar of bank S. Else the
    one in whose bank all operands lie; else that of the result, and operands of other banks are put on their units'
    outputs first.
    """
    registers = [kind for kind in kinds if kind in SCALAR_BANKS]
    unit = result or "s"
    if registers.count("s") <= 1 and set(registers) <= {unit, "s"} and (result or "s" in registers):
        return unit
    return registers[0] if len(set(registers)) == 1 else unit


def scalar_steps(operation: str, result: str | None, operands: Sequence[tuple[str, str]], extra: str = "") -> Steps:
    """The steps of an operation on scalars (name, kind); its result goes to d in bank `result`."""
    unit = unit_of(result, [kind for _, kind in operands])
    brought: list[str] = []
    fields = [f"{unit}.op={operation}"]
    for port, (name, kind) in zip("ab", operands, strict=False):
        if kind in NUMBERS:
            fields.append(f"{unit}.{port}=lit lit={name}")
        elif kind == unit:
            fields.append(f"{unit}.r{port}={name}")
        elif kind == "s":
            fields.append(f"{unit}.{port}=port s.ra={name}")
        else:
            brought.append(f"{kind}.op=copy {kind}.ra={name}")
            fields.append(f"{unit}.{port}={kind}")
    steps = [" ".join(brought)] if brought else []
    if result == unit:
        fields.append(f"{unit}.rd=d {unit}.w=result")
    steps.append(" ".join([*fields, extra]).rstrip())
    if result and result != unit:
        steps.append(f"{result}.op=copy {result}.a={unit} {result}.rd=d {result}.w=result")
    return steps


def _binary(operation: str) -> Callable[[Kinds], Steps]:
    return lambda kinds: scalar_steps(operation, kinds[0], [("a", kinds[1]), ("b", kinds[2])])


def _unary(operation: str) -> Callable[[Kinds], Steps]:
    def steps(kinds: Kinds) -> Steps:
        if operation == "copy" and "i" in kinds[:2]:
            return _integer_move(kinds)
        return scalar_steps(operation, kinds[0], [("a", kinds[1])])

    return steps


def _integer_move(kinds: Kinds) -> Steps:
    """A word between the ALU's registers and elsewhere."""
    result, source = kinds[:2]
    if result != "i":
        # Only FPPS and the ALU itself see the ALU's output.
        passed = [] if result == "s" else [f"{result}.op=copy {result}.a=s {result}.rd=d {result}.w=result"]
        kept = " s.rd=d s.w=result" if result == "s" else ""
        return ["alu.op=copy alu.ra=a", f"s.op=copy s.a=alu{kept}", *passed]
    if source in NUMBERS:
        return ["alu.op=copy alu.a=lit lit=a alu.rd=d alu.w=result"]
    if source in "xyz":
        return [f"{source}.op=copy {source}.ra=a", f"alu.op=copy alu.a={source} alu.rd=d alu.w=result"]
    port = "alu.ra=a" if source == "i" else "alu.a=port s.ra=a"
    return [f"alu.op=copy {port} alu.rd=d alu.w=result"]


def _compare(kinds: Kinds) -> Steps:
    """Sets the flags of the unit that `unit_of(None, kinds)` names, or the ALU's."""
    if "i" in kinds:
        return [f"alu.op=cmp {_integer_operands(kinds, 'ab')}"]
    return scalar_steps("cmp", None, [("a", kinds[0]), ("b", kinds[1])])


def _pick(kinds: Kinds) -> Steps:
    """a where condition c holds, else b."""
    if kinds[0] == "i":
        return [f"alu.op=pick {_integer_operands(kinds[1:3], 'ab')} seq.cond=c alu.rd=d alu.w=result"]
    return scalar_steps("pick", kinds[0], [("a", kinds[1]), ("b", kinds[2])], "seq.cond=c")


def _to_integer(kinds: Kinds) -> Steps:
    unit = kinds[1]
    return [f"{unit}.op=ftoi {unit}.ra=a", f"alu.op=copy alu.a={unit} alu.rd=d alu.w=result"]


def _inner_product(kinds: Kinds) -> Steps:
    """Products, and their sum x + y + z in this order, which X begins and the result's unit ends."""
    products = "xyz.op=mul xyz.ra=a xyz.rb=b"
    unit = kinds[0]
    first, second, last = ("x", "y", "z") if unit != "y" else ("y", "x", "z")
    if unit == "z":
        return [products, "x.op=add x.a=own x.b=y", "z.op=add z.a=x z.b=own z.rd=d z.w=result"]
    begin = f"{first}.op=add {first}.a=own {first}.b={second}"
    source = "own" if unit == first else first
    return [products, begin, f"{unit}.op=add {unit}.a={source} {unit}.b={last} {unit}.rd=d {unit}.w=result"]


_SCALAR: dict[str, Callable[[Kinds], Steps]] = {
    **{name: _binary(operation) for name, operation in BINARY.items()},
    **{name: _unary(operation) for name, operation in UNARY.items()},
    "compare": _compare,
    "pick": _pick,
    "ftoi": _to_integer,
    "dot3": _inner_product,
}


# --- integers ---------------------------------------------------------------------------------------------------------


def _integer_operands(kinds: Kinds, names: str) -> str:
    fields = []
    for port, name, kind in zip("ab", names, kinds, strict=False):
        fields.append(f"alu.{port}=lit lit={name}" if kind in NUMBERS else f"alu.r{port}={name}")
    return " ".join(fields)


def _integer(operation: str) -> Callable[[Kinds], Steps]:
    return lambda kinds: [f"alu.op={operation} {_integer_operands(kinds[1:3], 'ab')} alu.rd=d alu.w=result"]


_INTEGER: dict[str, Callable[[Kinds], Steps]] = {
    **{name: _integer(operation) for name, operation in INTEGER.items()},
    "test": lambda kinds: ["alu.op=test seq.cond=a alu.rd=d alu.w=result"],
    "test_not": lambda kinds: ["alu.op=test seq.cond=a seq.not=yes alu.rd=d alu.w=result"],
}


# --- vectors ----------------------------------------------------------------------------------------------------------


def _vector_operand(units: str, port: str, name: str, kind: str) -> str:
    if kind in NUMBERS:
        return f"{units}.{port}=lit lit={name}"
    if kind == "v":
        return f"{units}.r{port}={name}"
    # A scalar of bank S goes to the others over the S bus; FPPS has it at its own port.
    own = f" s.{port}=reg" if "s" in units else ""
    return f"xyz.{port}=port s.ra={name}{own}"


def _vector(units: str, operation: str) -> Callable[[Kinds], Steps]:
    def steps(kinds: Kinds) -> Steps:
        if "s" in units and "s" in kinds[1:3]:
            return _row_and_scalar(operation, kinds)
        operands = [_vector_operand(units, port, port, kind) for port, kind in zip("ab", kinds[1:3], strict=False)]
        return [f"{units}.op={operation} {' '.join(operands)} {units}.rd=d {units}.w=result"]

    return steps


def _row_and_scalar(operation: str, kinds: Kinds) -> Steps:
    """A scalar and whole rows: FPPS reads the scalar at its port a, whichever operand it is."""
    row, scalar = ("a", "b") if kinds[1] == "v" else ("b", "a")
    if len(kinds) == 2:
        return [f"xyz.op={operation} xyz.a=port s.op={operation} s.ra=a xyzs.rd=d xyzs.w=result"]
    mine = f"s.op={operation} s.ra={scalar} s.rb={row}"
    return [f"xyz.op={operation} xyz.r{row}={row} xyz.{scalar}=port {mine} xyzs.rd=d xyzs.w=result"]


def _vector_pick(units: str) -> Callable[[Kinds], Steps]:
    def steps(kinds: Kinds) -> Steps:
        operands = [_vector_operand(units, port, port, kind) for port, kind in zip("ab", kinds[1:3], strict=True)]
        return [f"{units}.op=pick {' '.join(operands)} seq.cond=c {units}.rd=d {units}.w=result"]

    return steps


_VECTOR: dict[str, Callable[[Kinds], Steps]] = {
    f"{name}{len(units)}": _vector(units, operation)
    for units in ("xyz", "xyzs")
    for name, operation in {**BINARY, **UNARY}.items()
}
_VECTOR |= {f"pick{len(units)}": _vector_pick(units) for units in ("xyz", "xyzs")}


# --- memory -----------------------------------------------------------------------------------------------------------

_FIELD_ROW = "ag.mode=linear_lit ag.br={0}.br ag.ir={0}.ir ag.ar={0}.ar lit={0}.row"
_FIXED_ROW = "ag.mode=base_lit ag.br=BR31 lit={0}"
"""BR31 is 0 in compiled code: rows of its own memory have numbers that the assembler knows."""


def _row(kind: str, name: str) -> str:
    return (_FIELD_ROW if kind == "field" else _FIXED_ROW).format(name)


def _take(bank: str) -> Callable[[Kinds], Steps]:
    """The word of one memory bank that was fetched, to a register of any kind."""

    def steps(kinds: Kinds) -> Steps:
        unit = kinds[0]
        if unit == "i":
            return [f"alu.op=copy alu.a=mem{bank} alu.rd=d alu.w=result"]
        if unit == bank:
            return [f"{unit}.rd=d {unit}.w=mem"]
        if unit == "s":
            return [f"s.op=copy s.a=mem{bank} s.rd=d s.w=result"]
        return [f"{bank}.op=copy {bank}.a=mem", f"{unit}.op=copy {unit}.a={bank} {unit}.rd=d {unit}.w=result"]

    return steps


def _put(bank: str) -> Callable[[Kinds], Steps]:
    """A word to one memory bank of a row."""

    def steps(kinds: Kinds) -> Steps:
        kind = kinds[1]
        write = f"mem.op=write mem.on={bank} {_row(kinds[0], 'd')}"
        if kind == bank:
            return [f"{write} mem.{bank}=port {bank}.ra=a"]
        if kind == "i" or kind in NUMBERS:
            return [f"alu.op=copy {_integer_operands([kind], 'a')}", f"{write} mem.{bank}=alu"]
        if kind == "s":
            return [f"{bank}.op=copy {bank}.a=port s.ra=a", write]
        return [f"{kind}.op=copy {kind}.ra=a", f"{bank}.op=copy {bank}.a={kind}", write]

    return steps


def _put_row(units: str) -> Callable[[Kinds], Steps]:
    ports = " ".join(f"mem.{unit}=port" for unit in units)
    return lambda kinds: [f"mem.op=write mem.on={units} {ports} {units}.ra=a {_row(kinds[0], 'd')}"]


def _seek_within(kinds: Kinds) -> Steps:
    """To record a of table d, the index clamped to 0 .. b."""
    clamped = ["alu.op=max alu.ra=a alu.b=lit lit=0", "alu.op=min alu.a=own alu.b=lit lit=b"]
    return [*clamped, "ag.load=ir_alu ag.ir=d.ir"]


_MEMORY: dict[str, Callable[[Kinds], Steps]] = {
    "fetch": lambda kinds: [f"mem.op=read mem.on=xyzs {_row(kinds[0], 'd')}"],
    "take3": lambda kinds: ["xyz.rd=d xyz.w=mem"],
    "take4": lambda kinds: ["xyzs.rd=d xyzs.w=mem"],
    **{f"take_{bank}": _take(bank) for bank in SCALAR_BANKS},
    **{f"put_{bank}": _put(bank) for bank in SCALAR_BANKS},
    "put3": _put_row("xyz"),
    "put4": _put_row("xyzs"),
    "seek_within": _seek_within,
}
