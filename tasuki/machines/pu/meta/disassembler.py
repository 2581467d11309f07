"""Words back to meta-assembler source, derived from the description of the fields.

The source assembles to the same words, whatever they are: words that the assembler would refuse (undefined codes, two
drivers of a bus) are written as ``.word``.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping

from tasuki.machines.pu.isa import (
    DEFAULT,
    InstructionSet,
    Program,
    Word,
    conflicts,
    decode,
    float_bits,
    mnemonics,
    selected,
    undefined,
)
from tasuki.machines.pu.meta.symbols import REGISTER_KINDS

_JUMPS = ("jump", "call", "loop")
_MOVES = ("copy", "itof", "pick", "sellt", "selle", "seleq")


def disassemble(program: Program, isa: InstructionSet = DEFAULT) -> str:
    """Meta-assembler source for a program: its labels, words, sizes and data."""
    labels = _labels(program, isa)
    lines = [f".memory {program.memory_rows}\n", f".display {program.display_rows}\n"]
    for row, words in sorted(program.memory.items()):
        lines.append(f".data {row}: {', '.join(f'{word:#x}' for word in words)}\n")
    for address, word in enumerate(program.words):
        lines += [f"{name}:\n" for name in labels.get(address, ())]
        lines.append(f"    {instruction(word, labels, isa)}\n")
    lines += [f"{name}:\n" for name in labels.get(len(program.words), ())]
    return "".join(lines)


def _labels(program: Program, isa: InstructionSet) -> dict[int, list[str]]:
    """Names by address: the program's own, and `L` with the address for other targets of jumps."""
    labels: dict[int, list[str]] = {}
    for name, address in program.labels.items():
        labels.setdefault(address, []).append(name)
    for word in program.words:
        fields = decode(word, isa)
        operation = isa.by_name["seq.op"].by_code.get(fields["seq.op"])
        target = fields["seq.to"]
        jumps = operation is not None and operation.name in _JUMPS
        if jumps and target <= len(program.words) and target not in labels:
            name = f"L{target:05d}"
            if name not in program.labels:
                labels[target] = [name]
    return labels


def instruction(word: Word, labels: Mapping[int, list[str]] | None = None, isa: InstructionSet = DEFAULT) -> str:
    """One microinstruction as a source line; `labels` gives names to addresses. An idle word is `nop`."""
    fields = decode(word, isa)
    if undefined(fields, isa) or conflicts(fields, isa):
        return f".word {word:#x}"
    parts = []
    for name, value in mnemonics(word, isa).items():
        kind, code = isa.by_name[name].kind, fields[name]
        if kind == "register":
            value = f"{REGISTER_KINDS[isa.by_name[name].file]}{code}"
        elif kind == "literal":
            value = _literal(code, fields, isa)
        elif kind == "address" and labels and code in labels and mnemonics(word, isa).get("seq.op") in _JUMPS:
            value = labels[code][0]
        parts.append(f"{name}={value}")
    return " ".join(parts) or "nop"


def _literal(bits: int, fields: Mapping[str, int], isa: InstructionSet) -> str:
    """A float where a float operation reads the literal, else a small number, else hex."""
    for unit, _, source in selected(fields, isa):
        operation = isa.by_name[f"{unit}.op"].by_code[fields[f"{unit}.op"]]
        if source == "lit" and operation.name not in _MOVES:
            return _float(bits)
    signed = bits - (1 << 32) if bits >> 31 else bits
    return str(signed) if abs(signed) < 1 << 20 else f"{bits:#x}"


def _float(bits: int) -> str:
    """The shortest decimal that means these bits; hex where none does (infinity, NaN)."""
    (value,) = struct.unpack(">f", bits.to_bytes(4))
    for digits in range(1, 10) if math.isfinite(value) else ():
        shorter = float(f"{value:.{digits}g}")
        if float_bits(shorter) == bits:
            return repr(shorter)
    return f"{bits:#x}"
