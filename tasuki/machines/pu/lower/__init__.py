"""From the IR to microcode: `compile_program` makes macro assembler source of a program, and that is assembled.

The steps, each its own module, with what the next may rely on:

1. `program` lowers the entry and everything that it calls (`function`: statements and expressions; `values`: the
   operations; `memory`: tables and local arrays) to macro calls on virtual registers (`code`). It decides on inlining.
2. `allocate` gives every virtual register a register of the machine or a row of memory, and takes away what nobody
   wants (`liveness`); `rewrite` puts the registers in.
3. `text` writes it down, with the macros that it brings along (`macros`), in the language of the macro assembler.
4. The package's own assemblers make words of the text: there is no other way to bits.

`machine` runs the result on the simulators, item by item.

Division, square root, reciprocal, sine and cosine are microcode that starts from tables: `arithmetic` states them for
the interpreter, which under it agrees with the machine bit for bit.
"""

from tasuki.machines.pu.lower.arithmetic import ARITHMETIC
from tasuki.machines.pu.lower.machine import Executable, PUProgram, compile_program

__all__ = ["ARITHMETIC", "Executable", "PUProgram", "compile_program"]
