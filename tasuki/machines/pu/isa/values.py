"""What each field of the microinstruction can say: codes, mnemonics and meanings, as data.

In every choice field code 0 means "idle", "nothing" or the plainest choice, so that the word 0 is a microinstruction
that does nothing but go to the next one. A code without an entry here is *undefined*, and executing it traps.

The meanings are exact: "a" and "b" are the words that a unit's two selectors deliver. What is common to all operations
(rounding, NaN, timing) stands at the head of the package.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Value:
    """One value of a choice field.

    `reads` names the operands that an operation takes ("", "a" or "ab"): the selectors of the others say nothing.
    `result` is true where the operation gives a new output (elsewhere the output holds).
    `bus` is the unit whose word travels over a crossed bus when a selector has this value ("" where none does).
    """

    name: str
    code: int
    meaning: str
    reads: str = ""
    result: bool = False
    bus: str = ""


def _plain(*rows: tuple[str, str]) -> tuple[Value, ...]:
    """Values numbered from 0 in the order in which they stand."""
    return tuple(Value(name, code, meaning) for code, (name, meaning) in enumerate(rows))


def _operations(*rows: tuple[str, str, str]) -> tuple[Value, ...]:
    """Operations, numbered from 0: (name, operands read, meaning). `nop` and `cmp` leave the output alone."""
    return tuple(
        Value(name, code, meaning, reads, result=name not in ("nop", "cmp"))
        for code, (name, reads, meaning) in enumerate(rows)
    )


def _sources(*rows: tuple[str, str, str]) -> tuple[Value, ...]:
    """Operand sources, numbered from 0: (name, unit whose bus carries the word, meaning)."""
    return tuple(Value(name, code, meaning, bus=bus) for code, (name, bus, meaning) in enumerate(rows))


FPP_OPERATIONS = _operations(
    ("nop", "", "Nothing; the output holds."),
    ("copy", "a", "a, bit for bit (any word, also an integer)."),
    ("add", "ab", "a + b."),
    ("sub", "ab", "a - b."),
    ("mul", "ab", "a * b."),
    ("addg", "ab", "a + b, or a bit for bit where the table's special flag is set (guarded addition)."),
    ("subg", "ab", "a - b, or a bit for bit where the table's special flag is set (guarded subtraction)."),
    ("cmp", "ab", "Sets this unit's flags: lt = a < b, eq = a = b, un = one is NaN. The output holds."),
    ("min", "ab", "a where a < b, else b, bit for bit (b where one is NaN)."),
    ("max", "ab", "a where a > b, else b, bit for bit (b where one is NaN)."),
    ("neg", "a", "-a: the sign bit turned; NaN gives the canonical NaN."),
    ("abs", "a", "|a|: the sign bit cleared; NaN gives the canonical NaN."),
    ("sign", "ab", "|a| with the sign bit of b; where a is NaN, the canonical NaN."),
    ("itof", "a", "The signed integer a as the nearest float (ties to even)."),
    ("ftoi", "a", "The float a as a signed integer, cut towards zero, saturating; NaN gives 0."),
    ("floor", "a", "The greatest whole float not above a; the sign of zero stays."),
    ("sellt", "ab", "a where this unit's flag lt is set, else b, bit for bit."),
    ("selle", "ab", "a where this unit's flag lt or eq is set, else b, bit for bit."),
    ("seleq", "ab", "a where this unit's flag eq is set, else b, bit for bit."),
    ("pick", "ab", "a where the sequencer's condition (seq.cond, seq.not) holds, else b, bit for bit."),
)

_OWN = "The unit's own output."
_REG = "The bank's register at this operand's read port."
_MEM = "The data latch of the unit's memory bank."
_LIT = "The literal."
_PORT = "Bank S's register at read port a, over the S bus."
_S = "FPPS's output, over the S bus."


def _out(unit: str) -> tuple[str, str, str]:
    return unit, unit, f"FPP{unit.upper()}'s output, over the crossed bus."


_COMMON = (("mem", "", _MEM), ("lit", "", _LIT))
_SHARED = (("s", "s", _S), ("port", "s", _PORT), *_COMMON)
X_SOURCES = _sources(("reg", "", _REG), ("own", "", _OWN), _out("y"), _out("z"), *_SHARED)
Y_SOURCES = _sources(("reg", "", _REG), ("own", "", _OWN), _out("x"), _out("z"), *_SHARED)
Z_SOURCES = _sources(("reg", "", _REG), ("own", "", _OWN), _out("x"), _out("y"), *_SHARED)
S_SOURCES = _sources(
    ("reg", "", _REG),
    ("own", "", _OWN),
    _out("x"),
    _out("y"),
    _out("z"),
    ("table", "", "The table's output."),
    *_COMMON,
    ("alu", "", "The ALU's output."),
    ("memx", "", "The data latch of memory bank X."),
    ("memy", "", "The data latch of memory bank Y."),
    ("memz", "", "The data latch of memory bank Z."),
)
SOURCES = {"x": X_SOURCES, "y": Y_SOURCES, "z": Z_SOURCES, "s": S_SOURCES}

_WRITES = (
    ("none", "No register is written."),
    ("result", "The result of this step's operation (nop and cmp: the output as it holds)."),
    ("mem", "The data latch of the unit's memory bank, as it stood before this step."),
)
VECTOR_WRITES = _plain(*_WRITES, ("own", "The unit's output as it stood before this step."))
S_WRITES = _plain(*_WRITES, ("table", "The table's output as it stood before this step."))

TABLE_FUNCTIONS = _plain(
    ("none", "No access; output and special flag hold."),
    ("rcp", "First approximation of 1/x."),
    ("point", "The point z near x for which `rcp` gives 1/z, almost rounded (rcp(x) = rcp(z)); see the tables."),
    ("sqrt", "First approximation of the square root of x."),
    ("sin", "Sine of the i-th 1024th of a full turn, i being the low ten bits of x."),
    ("cos", "Cosine of the i-th 1024th of a full turn, i being the low ten bits of x."),
)
TABLE_INPUTS = _plain(
    ("port", "Bank S's register at read port a."),
    ("s", "FPPS's output."),
    ("table", "The table's own output."),
    ("x", "FPPX's output."),
    ("y", "FPPY's output."),
    ("z", "FPPZ's output."),
    ("mem", "The data latch of memory bank S."),
    ("alu", "The ALU's output."),
)

ALU_OPERATIONS = _operations(
    ("nop", "", "Nothing; the output holds."),
    ("copy", "a", "a."),
    ("add", "ab", "a + b, modulo 2**32."),
    ("sub", "ab", "a - b, modulo 2**32."),
    ("mul", "ab", "The low 32 bits of a * b."),
    ("and", "ab", "Bits set in both."),
    ("or", "ab", "Bits set in either."),
    ("xor", "ab", "Bits that differ."),
    ("shl", "ab", "a shifted left by b mod 32."),
    ("shr", "ab", "a shifted right by b mod 32, zeros shifted in."),
    ("sar", "ab", "a shifted right by b mod 32, the sign shifted in."),
    ("cmp", "ab", "Sets the ALU's flags: eq = a = b, lt = a < b signed, ult = a < b unsigned. The output holds."),
    ("min", "ab", "The smaller, signed."),
    ("max", "ab", "The greater, signed."),
    ("pick", "ab", "a where the sequencer's condition (seq.cond, seq.not) holds, else b."),
    ("test", "", "1 where the sequencer's condition (seq.cond, seq.not) holds, else 0."),
)
ALU_SOURCES = _plain(
    ("reg", "The ALU's register at this operand's read port."),
    ("own", "The ALU's own output."),
    ("lit", "The literal."),
    ("x", "FPPX's output."),
    ("y", "FPPY's output."),
    ("z", "FPPZ's output."),
    ("s", "FPPS's output."),
    ("port", "Bank S's register at read port a."),
    ("memx", "The data latch of memory bank X."),
    ("memy", "The data latch of memory bank Y."),
    ("memz", "The data latch of memory bank Z."),
    ("mems", "The data latch of memory bank S."),
    ("row", "The address generator's row register, as it stood before this step."),
    ("br", "The base register that ag.br names."),
    ("ir", "The index register that ag.ir names."),
    ("ar", "The attribute register that ag.ar names."),
)
ALU_WRITES = _plain(
    ("none", "No register is written."),
    ("result", "The result of this step's operation (nop and cmp: the output as it holds)."),
)

MEMORY_OPERATIONS = _plain(
    ("none", "No access; the data latches hold."),
    ("read", "The row's words go to the data latches of the enabled banks; the others hold."),
    ("write", "The data buses' words go to the row, in the enabled banks."),
)
MEMORY_DATA = _plain(
    ("out", "The output of the bank's FPP."),
    ("port", "The bank's register at read port a."),
    ("alu", "The ALU's output."),
    ("lit", "The literal."),
)

ADDRESS_MODES = _plain(
    ("hold", "The calculator idles: the row is the row register."),
    ("linear", "BR + IR * AR."),
    ("linear_lit", "BR + IR * AR + literal."),
    ("plane", "Two-dimensional: BR + IR' * AR + IR. IR is the column, its partner IR' the line, AR the pitch."),
    ("plane_lit", "Two-dimensional with offset: BR + IR' * AR + IR + literal."),
    ("base_lit", "BR + literal."),
    ("pointer", "The ALU's output."),
    ("pointer_lit", "The ALU's output + literal."),
)
ADDRESS_UPDATES = _plain(
    ("hold", "IR stays."),
    ("inc", "IR + 1, after the row is computed."),
    ("dec", "IR - 1, after the row is computed."),
    ("raster", "IR + 1 after the row is computed; where that equals AR', IR becomes 0 and its partner IR' gains 1."),
)
ADDRESS_LOADS = _plain(
    ("none", "Nothing is loaded."),
    ("br_alu", "BR takes the ALU's output."),
    ("ir_alu", "IR takes the ALU's output."),
    ("ar_alu", "AR takes the ALU's output."),
    ("br_lit", "BR takes the literal."),
    ("ir_lit", "IR takes the literal."),
    ("ar_lit", "AR takes the literal."),
    ("br_row", "BR takes the row that this step computes."),
)

DISPLAY_OPERATIONS = _plain(
    ("none", "Nothing."),
    ("pixel", "The data buses' four words go to the display memory, at this step's row."),
    ("frame", "The picture is complete: the frame counter gains 1."),
)

SEQUENCER_OPERATIONS = _plain(
    ("next", "To the next microinstruction."),
    ("jump", "Where the condition holds to seq.to, else to the next."),
    ("call", "Where the condition holds the next address goes on the call stack and control to seq.to."),
    ("return", "Where the condition holds to the address on top of the call stack, which is taken off."),
    ("jump_alu", "Where the condition holds to the address in the ALU's output."),
    ("call_alu", "As `call`, to the address in the ALU's output."),
    ("count", "The literal goes on the loop stack (whatever the condition); to the next."),
    ("count_alu", "The ALU's output goes on the loop stack (whatever the condition); to the next."),
    (
        "loop",
        "Where the loop stack's top is above 1 (unsigned) it loses 1, to seq.to; else it is taken off, to the next.",
    ),
    ("drop", "The top of the loop stack is taken off (whatever the condition); to the next."),
    ("halt", "Where the condition holds the machine stops after this step, the address staying; else to the next."),
)


def _conditions() -> tuple[Value, ...]:
    rows = [("true", "Always.")]
    for unit in "xyzs":
        rows += [
            (f"{unit}.lt", f"FPP{unit.upper()} compared a < b."),
            (f"{unit}.le", f"FPP{unit.upper()} compared a <= b."),
            (f"{unit}.eq", f"FPP{unit.upper()} compared a = b."),
            (f"{unit}.un", f"FPP{unit.upper()} compared with NaN (unordered)."),
        ]
    rows += [
        ("alu.eq", "The ALU compared a = b."),
        ("alu.lt", "The ALU compared a < b, signed."),
        ("alu.le", "The ALU compared a <= b, signed."),
        ("alu.ult", "The ALU compared a < b, unsigned."),
        ("alu.ule", "The ALU compared a <= b, unsigned."),
        ("special", "The table's special flag is set."),
        ("more", "The top of the loop stack is above 1: `loop` would go back. (False where the stack is empty.)"),
    ]
    return _plain(*rows)


CONDITIONS = _conditions()
POLARITY = _plain(("no", "The condition as it is."), ("yes", "The condition turned round."))
