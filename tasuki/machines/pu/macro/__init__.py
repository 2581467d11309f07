"""The macro assembler: vector, matrix, scalar and function instructions, ordinary instructions, tables and records.

`assemble_file` and `assemble` translate source to meta-assembler source and to words. Everything that an instruction
does stands in the files of `library/`; the assembler itself knows names, numbers, memory and macros, and no
instruction. The language is described in docs/pu-tutorial.md.
"""

from tasuki.machines.pu.macro.assembler import LIBRARY, MacroAssembly, assemble, assemble_file

__all__ = ["LIBRARY", "MacroAssembly", "assemble", "assemble_file"]
