"""The meta-assembler and its reverse.

`assemble_file` and `assemble` take source in which a line is one microinstruction; `to_binary`, `to_hex` and `listing`
write the result; `disassemble` makes source of words. The language is described in docs/pu-manual.md.
"""

from tasuki.machines.pu.meta.assembler import Assembly, assemble, assemble_file
from tasuki.machines.pu.meta.disassembler import disassemble, instruction
from tasuki.machines.pu.meta.output import from_binary, from_hex, listing, to_binary, to_hex

__all__ = [
    "Assembly",
    "assemble",
    "assemble_file",
    "disassemble",
    "from_binary",
    "from_hex",
    "instruction",
    "listing",
    "to_binary",
    "to_hex",
]
