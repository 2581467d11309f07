"""Names in meta-assembler source: registers, constants, labels, and mnemonics that the source adds to fields.

Registers, constants and labels share one name space. Constants are computed when they are first needed, so that they
may use labels and constants that stand further down.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field

from tasuki.diagnostics import Note
from tasuki.machines.pu.isa import Field, InstructionSet, float_bits, number
from tasuki.machines.pu.meta.expressions import MAX_DEPTH, Register, Value, ValueFault, evaluate
from tasuki.machines.pu.meta.source import Errors, Token

REGISTER_KINDS = {"x": "R", "y": "R", "z": "R", "s": "R", "alu": "I", "br": "BR", "ir": "IR", "ar": "AR"}
"""Register file -> the letters of its registers' names: R5 in the banks X, Y, Z, S, I5 in the ALU."""
PREDEFINED: dict[str, float] = {"pi": math.pi, "inf": math.inf, "nan": math.nan}
_REGISTER = re.compile(r"(R|I|BR|IR|AR)(\d{1,4})")


@dataclass
class Constant:
    """A constant as written, and its value once it is known. `busy` while it is being computed."""

    name: Token
    tokens: list[Token]
    value: Value | None = None
    busy: bool = False


@dataclass
class Symbols:
    """Everything that a source gives names to, apart from its definitions."""

    isa: InstructionSet
    errors: Errors
    constants: dict[str, Constant] = field(default_factory=dict)
    labels: dict[str, tuple[Token, int]] = field(default_factory=dict)
    mnemonics: dict[str, dict[str, Constant]] = field(default_factory=dict)
    depth: int = 0

    def declare(self, name: Token) -> bool:
        """Whether `name` is free for a constant, a register or a label; where it is not, an error is added."""
        if name.text in PREDEFINED or _REGISTER.fullmatch(name.text):
            self.errors.add(f"'{name.text}' is predefined", name, hint="choose another name")
        elif name.text in self.isa.by_name:
            self.errors.add(f"'{name.text}' is the name of a field", name, hint="choose another name")
        elif name.text in self.labels or name.text in self.constants:
            earlier = self.labels[name.text][0] if name.text in self.labels else self.constants[name.text].name
            notes = [Note("first defined here", earlier.span)]
            self.errors.add(f"'{name.text}' is defined twice", name, notes=notes)
        else:
            return True
        return False

    def define_constant(self, name: Token, tokens: list[Token]) -> None:
        """`.const` and `.reg`."""
        if self.declare(name):
            self.constants[name.text] = Constant(name, tokens)

    def define_label(self, name: Token, address: int) -> None:
        """A label at an address of program memory."""
        if self.declare(name):
            self.labels[name.text] = (name, address)

    def define_mnemonic(self, one: Field, name: Token, tokens: list[Token]) -> None:
        """`.value`: a new mnemonic of a field."""
        own = self.mnemonics.setdefault(one.name, {})
        if name.text in one.codes or name.text in own:
            notes = [Note("first defined here", own[name.text].name.span)] if name.text in own else []
            self.errors.add(f"'{name.text}' is already a value of {one.name}", name, notes=notes)
        else:
            own[name.text] = Constant(name, tokens)

    def resolve(self, token: Token) -> Value:
        """The value of a name. Raises ValueFault where it has none."""
        text = token.text
        if text in self.constants:
            return self._constant(self.constants[text], token)
        if text in self.labels:
            return self.labels[text][1]
        if text in PREDEFINED:
            return PREDEFINED[text]
        register = _REGISTER.fullmatch(text)
        if register:
            return Register(register[1], int(register[2]))
        near = close_match(text, [*self.constants, *self.labels, *PREDEFINED])
        raise ValueFault(f"'{text}' is not defined", [token], near)

    def _constant(self, constant: Constant, where: Token) -> Value:
        if constant.value is None:
            if constant.busy:
                raise ValueFault(f"the constant '{constant.name.text}' is defined by itself", [where])
            if self.depth > MAX_DEPTH:
                raise ValueFault("constants stand on constants too deeply", [where], f"at most {MAX_DEPTH} levels")
            constant.busy, self.depth = True, self.depth + 1
            try:
                constant.value = evaluate(constant.tokens, self.resolve)
            finally:
                constant.busy, self.depth = False, self.depth - 1
        return constant.value

    def field_bits(self, one: Field, tokens: list[Token]) -> int:
        """The bits of a field for a value as written. Raises ValueFault."""
        if len(tokens) == 1 and tokens[0].kind == "name":
            own = self.mnemonics.get(one.name, {})
            if tokens[0].text in own:
                return self._fit(one, self._constant(own[tokens[0].text], tokens[0]), tokens)
            try:
                return number(one, tokens[0].text)
            except ValueError:
                self._must_be_defined(one, tokens[0], own)
        return self._fit(one, evaluate(tokens, self.resolve), tokens)

    def _must_be_defined(self, one: Field, token: Token, own: Iterable[str]) -> None:
        """Raises ValueFault, with the field's values, where a choice field is given a name that means nothing."""
        known = token.text in self.constants or token.text in self.labels or token.text in PREDEFINED
        if one.kind in ("choice", "mask") and not known and not _REGISTER.fullmatch(token.text):
            choices = ", ".join([*one.codes, *own]) or "letters of xyzs, or a number"
            raise ValueFault(f"'{token.text}' is not a value of {one.name}", [token], choices)

    def _fit(self, one: Field, value: Value, tokens: list[Token]) -> int:
        """The bits of a computed value in a field, checked against its kind and width."""
        kind = REGISTER_KINDS.get(one.file, "")
        if isinstance(value, Register):
            if value.kind != kind:
                expected = f"{kind}0 to {kind}{one.mask}" if kind else None
                raise ValueFault(f"the register {value} does not belong in {one.name}", tokens, expected)
            if not 0 <= value.number <= one.mask:
                raise ValueFault(f"there is no register {value}", tokens, f"{kind}0 to {kind}{one.mask}")
            return value.number
        if isinstance(value, float) and one.kind == "literal":
            return literal_bits(value, tokens)
        try:
            return number(one, value)
        except ValueError as error:
            message, _, expected = str(error).partition(": expected ")
            raise ValueFault(message, tokens, expected or None) from None

    def word(self, tokens: list[Token]) -> int:
        """A 32-bit word of data: a float as binary32, or a whole number. Raises ValueFault."""
        return self._fit(self.isa.by_name["lit"], evaluate(tokens, self.resolve), tokens)

    def count(self, tokens: list[Token], low: int, high: int) -> int:
        """A whole number from `low` to `high`. Raises ValueFault."""
        value = evaluate(tokens, self.resolve)
        if not isinstance(value, int) or not low <= value <= high:
            raise ValueFault(f"{value} is out of range", tokens, f"a whole number from {low} to {high}")
        return value


def literal_bits(value: float, tokens: list[Token]) -> int:
    """The binary32 word of a float. Raises ValueFault where a finite value is beyond binary32."""
    bits = float_bits(value)
    if math.isfinite(value) and bits & 0x7F800000 == 0x7F800000:
        raise ValueFault(f"{value} is beyond binary32", tokens, "at most 3.4028235e38; infinity is written inf")
    return bits


def close_match(text: str, names: Iterable[str]) -> str | None:
    """The name that was probably meant, for the `expected` line of a message."""
    near = difflib.get_close_matches(text, names, 1)
    return f"perhaps {near[0]}" if near else None
