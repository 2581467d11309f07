"""Between fields and bits: `encode`, `decode`, and `mnemonics`, all derived from the description in `fields`."""

from __future__ import annotations

import struct
from collections.abc import Mapping

from tasuki.diagnostics import TasukiError
from tasuki.machines.pu.isa.fields import DEFAULT, Field, InstructionSet

Word = int
"""One microinstruction as a number, its first field in the most significant bits."""

BANK_MASKS = {"".join(bank for i, bank in enumerate("xyzs") if mask >> (3 - i) & 1): mask for mask in range(1, 16)}
"""The names of bank masks: `x` is 8, `yz` is 6, `xyzs` is 15."""
_BANKS = {mask: name for name, mask in BANK_MASKS.items()}


class EncodingError(TasukiError):
    """Fields that no microinstruction can hold. `problems` lists (field name, what is wrong)."""

    def __init__(self, problems: list[tuple[str, str]]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(f"{name}: {problem}" for name, problem in problems))


def float_bits(value: float) -> int:
    """The binary32 nearest to `value`, as a word; beyond the largest, infinity; NaN is the canonical one."""
    if value != value:
        return 0x7FC00000
    try:
        return int.from_bytes(struct.pack(">f", value))
    except OverflowError:
        return 0x7F800000 if value > 0 else 0xFF800000


def number(one: Field, value: int | float | str) -> int:
    """The bits of one field for a number or a mnemonic. Raises ValueError with a message fit for a user.

    A literal takes floats (as binary32) and integers from -2**31 to 2**32 - 1; the other fields take 0 to 2**width - 1.
    """
    if isinstance(value, str):
        return _named(one, value)
    if isinstance(value, float):
        if one.kind != "literal":
            raise ValueError(f"{one.name} takes whole numbers, not {value}")
        return float_bits(value)
    low = -(1 << 31) if one.kind == "literal" else 0
    if not low <= value <= one.mask:
        raise ValueError(f"{value} does not fit {one.name}: expected {low} to {one.mask} ({one.width} bits)")
    if one.kind == "choice" and value not in one.by_code:
        raise ValueError(f"{value} has no meaning in {one.name}: expected one of {', '.join(one.codes)}")
    return value & one.mask


def _named(one: Field, name: str) -> int:
    """The bits for a mnemonic: of a choice, or the banks of a mask (`xyz`)."""
    if name in one.codes:
        return one.codes[name]
    if one.kind == "mask" and name in BANK_MASKS:
        return BANK_MASKS[name]
    choices = ", ".join(one.codes) or ("banks, such as xyz" if one.kind == "mask" else "a number")
    raise ValueError(f"'{name}' is not a value of {one.name}: expected {choices}")


def encode(fields: Mapping[str, int | float | str], isa: InstructionSet = DEFAULT) -> Word:
    """The microinstruction with these fields; a field that is not named is 0. Raises EncodingError with all faults."""
    word, problems = 0, []
    for name, value in fields.items():
        one = isa.by_name.get(name)
        if one is None:
            problems.append((name, "there is no such field"))
            continue
        try:
            word |= number(one, value) << one.place
        except ValueError as error:
            problems.append((name, str(error)))
    if problems:
        raise EncodingError(problems)
    return word


def decode(word: Word, isa: InstructionSet = DEFAULT) -> dict[str, int]:
    """Field name -> number, for every field, in the order in which they stand in the word."""
    return {one.name: word >> one.place & one.mask for one in isa.fields}


def mnemonics(word: Word, isa: InstructionSet = DEFAULT) -> dict[str, int | str]:
    """The fields that are not 0, choices by their mnemonics. An undefined choice stays a number."""
    shown: dict[str, int | str] = {}
    for name, code in decode(word, isa).items():
        if code:
            one = isa.by_name[name]
            value = one.by_code.get(code)
            shown[name] = _BANKS[code] if one.kind == "mask" else value.name if value else code
    return shown
