"""The processor unit's instruction set: the one description from which everything else follows.

The machine
===========
A processor unit has four floating-point units, **FPPX, FPPY, FPPZ** (the vector unit) and **FPPS**, which with the
integer **ALU** and the function **tables** makes the scalar unit SP. Each FPP has a bank of 64 registers with two
read ports (a, b) and one write port, and a bank of data memory. The ALU has 32 registers of its own, so that integer
work goes on beside float work. The **address generator** has 32 base registers (BR), 32 index registers (IR), 32
attribute registers (AR) and one calculator. A **sequencer** with a call stack (16 deep) and a loop stack (8 deep)
steps through up to 16,384 microinstructions of 256 bits. One word is 32 bits: a binary32 number or an integer, as its
reader takes it.

`fields` has every field, `values` every value and its meaning, `rules` what a microinstruction may not say, `tables`
the function tables, `encoding` the way to bits and back, `program` what a simulator is given.

Timing
======
One microinstruction is one step. **Everything that a step reads, it reads as it stood before the step; everything
that it writes can be read from the next step on.** There are no delay slots and nothing takes longer. In particular:

- An FPP's or the ALU's result is on its output, and on the crossed buses, in the next step, and holds until its next
  operation that gives a result. The same result may be written to a register in the same step (`w=result`).
- A table's output and its special flag appear in the next step and hold until the next access (`tab.op`).
- Memory: the row that the address generator computes is used in the same step. Words read are in the data latches
  (`mem`) in the next step and hold until the next read that enables their bank; words written are in memory after the
  step. `mem.on` chooses banks. A step reads or writes one row.
- The row register keeps the last row that was computed. `ag.mode=hold` uses it again; otherwise this step's row is
  used, and kept.
- `ag.update` and `ag.load` act after the row is computed; `ag.load=br_row` takes this step's row.
- `cmp` sets all flags of its unit for the next step on; nothing else changes them. A conditional jump therefore
  stands at least one step after its comparison. A jump goes to its target in the next step.
- A write to a register in the step in which it is read leaves the old value to the reader.

Arithmetic
==========
**Floats.** IEEE 754 binary32: `add sub mul addg subg itof` round once, to nearest even; gradual underflow; overflow
gives infinity; no traps. Every NaN that `add sub mul addg subg neg abs sign floor` give is the one **canonical NaN
0x7FC00000**. `copy min max sellt selle seleq pick`, a guarded operation whose guard is set, registers, memory and
buses move words bit for bit, NaN or not. Comparisons take -0 = +0, and are false with NaN, which sets `un` alone. An
anachronism: a machine of 1986 would hardly have had gradual underflow.

**Integers.** Two's complement, 32 bits, wrapping. Addresses are computed modulo 2**32 and are unsigned.

**Flags** of an FPP: lt, eq, un (le is lt or eq); of the ALU: lt and eq (signed; le is lt or eq), ult (ule is ult or
eq).

Addressing
==========
BR, IR, AR below are the registers that `ag.br`, `ag.ir`, `ag.ar` name; a *partner* (IR', AR') is the register whose
number differs in the lowest bit: 6 and 7 are partners. A table of records is BR (base), IR (index) and AR (rows for
each record), a field of the record the literal: `linear_lit`. A picture is BR (base), IR (column), IR' (line) and AR
(pitch); `raster` walks over it, AR' being the width.

The start
=========
Every register, output, latch, flag, stack and memory word is 0 (memory: but for the program's data); execution begins
at address 0.

Traps
=====
The machine stops *before* the step changes anything, with file, line, step and state, on: an undefined code in any
choice field (`rules.undefined`); two writers of a bus or register (`rules.conflicts`); a row outside data memory
(`mem.op` other than none with at least one bank enabled) or outside display memory (`disp.op=pixel`); a call with a
full call stack, a return with an empty one; `count` with a full loop stack, `loop` or `drop` with an empty one; an
address of a next microinstruction beyond the program's end (the trap comes when that microinstruction would run,
naming where control came from). A conditional call or return whose condition fails touches no stack.
"""

from tasuki.machines.pu.isa.encoding import EncodingError, Word, decode, encode, float_bits, mnemonics, number
from tasuki.machines.pu.isa.fields import DEFAULT, Field, InstructionSet, Widths
from tasuki.machines.pu.isa.program import Program, Row
from tasuki.machines.pu.isa.rules import FPPS, Problem, conflicts, selected, transfers, undefined
from tasuki.machines.pu.isa.tables import CANONICAL_NAN, TABLES, contents, lookup
from tasuki.machines.pu.isa.values import Value

CALL_DEPTH = 16
"""Return addresses that the call stack holds."""
LOOP_DEPTH = 8
"""Counts that the loop stack holds."""

__all__ = [
    "CALL_DEPTH",
    "CANONICAL_NAN",
    "DEFAULT",
    "FPPS",
    "LOOP_DEPTH",
    "TABLES",
    "EncodingError",
    "Field",
    "InstructionSet",
    "Problem",
    "Program",
    "Row",
    "Value",
    "Widths",
    "Word",
    "conflicts",
    "contents",
    "decode",
    "encode",
    "float_bits",
    "lookup",
    "mnemonics",
    "number",
    "selected",
    "transfers",
    "undefined",
]
