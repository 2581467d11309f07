"""The second pass of the macro assembler: calls and labels to lines of meta-assembler source.

A call is replaced by its macro's statements until only microinstructions are left. Labels inside a macro belong to one
expansion: they become `name__1`, `name__2`, ...; labels that are arguments keep their name.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from tasuki.diagnostics import Note, Span
from tasuki.machines.pu.isa import DEFAULT, Field, number
from tasuki.machines.pu.macro import operands
from tasuki.machines.pu.macro.operands import FILES, Label, Operand, Word, attribute, kind_of
from tasuki.machines.pu.macro.reader import Macro, Reader, Statement, number_or_register, split
from tasuki.machines.pu.meta.expressions import Register, Value, ValueFault, evaluate, extent
from tasuki.machines.pu.meta.source import Token, TooManyErrors
from tasuki.machines.pu.meta.symbols import REGISTER_KINDS, close_match

MAX_NESTING = 64
"""Macros that call macros."""
MAX_CALLS = 200_000
"""Calls that one program may expand to: many times what fills program memory."""
_BANKS = re.compile("[xyzs]{1,4}")
"""Banks by their letters, as a mask."""


@dataclass(frozen=True)
class Line:
    """One line of meta-assembler source. `origin` is the place in the program that it comes from."""

    text: str
    origin: Token | None = None

    @property
    def span(self) -> Span | None:
        """Where that is."""
        return self.origin.span if self.origin else None


@dataclass(frozen=True)
class _Scope:
    """Where a statement stands: the parameters and labels of its macro, and the calls that led there."""

    parameters: dict[str, Operand] = field(default_factory=dict)
    labels: dict[str, str] = field(default_factory=dict)
    calls: tuple[tuple[Macro, Token], ...] = ()

    @property
    def in_library(self) -> bool:
        return bool(self.calls) and self.calls[-1][0].library

    def notes(self) -> list[Note]:
        """Where the statement is called from, for a message about it."""
        return [Note(f"in the expansion of '{macro.name.text}'", token.span) for macro, token in reversed(self.calls)]

    def outside_library(self) -> tuple[Token, list[Note]] | None:
        """For a statement of the library: the program's call that led to it, and what led to that."""
        if not self.in_library:
            return None
        own = next(i for i, (macro, _) in enumerate(self.calls) if macro.library)
        return self.calls[own][1], _Scope(calls=self.calls[:own]).notes()


class Expansion:
    """The expansion of what a reader found. `lines` is the result."""

    def __init__(self, reader: Reader) -> None:
        self.reader, self.errors = reader, reader.errors
        self.lines: list[Line] = []
        self.words = 0
        self._calls = 0
        self._unique = 0

    def run(self) -> None:
        """Expands the program's statements."""
        self._statements(self.reader.statements, _Scope())

    def _statements(self, statements: Sequence[Statement], scope: _Scope) -> None:
        for one in statements:
            origin = scope.calls[0][1] if scope.calls else one.tokens[0]
            if one.sort == "label":
                name = scope.labels.get(one.tokens[0].text, one.tokens[0].text)
                self.lines.append(Line(f"{name}:", origin))
            elif one.sort == "distinct":
                self._distinct(one.tokens, scope)
            elif one.sort == "call":
                self._call(one.tokens, scope)
            else:
                self._microinstruction(one.tokens, scope, origin)

    # --- calls --------------------------------------------------------------------------------------------------------

    def _call(self, tokens: list[Token], scope: _Scope) -> None:
        name = tokens[0]
        candidates = self._candidates(name.text, scope)
        if not candidates:
            near = close_match(name.text, {**self.reader.library, **self.reader.macros}) or "an instruction, or a macro"
            self.errors.add(f"there is no instruction '{name.text}'", name, expected=near, notes=scope.notes())
            return
        arguments = self._arguments(split(tokens[1:]), name, scope)
        if arguments is None:
            return
        macro = self._choose(candidates, arguments, tokens, scope)
        if macro is None or self._endless(macro, name, scope):
            return
        self._calls += 1
        if self._calls > MAX_CALLS:
            origin = scope.calls[0][1] if scope.calls else name
            self.errors.add("the program expands to too many calls", origin, expected=f"at most {MAX_CALLS}")
            raise TooManyErrors
        shown = ", ".join(map(operands.shown, arguments))
        self.lines.append(Line(f"{'  ' * len(scope.calls)}; {name.text} {shown}".rstrip()))
        parameters = {parameter.text: one for (parameter, _), one in zip(macro.parameters, arguments, strict=True)}
        labels = self._local_labels(macro)
        self._statements(macro.body, _Scope(parameters, labels, (*scope.calls, (macro, name))))

    def _candidates(self, name: str, scope: _Scope) -> list[Macro]:
        own = [] if scope.in_library else self.reader.macros.get(name, [])
        return [*own, *self.reader.library.get(name, [])]

    def _arguments(self, parts: list[list[Token]], name: Token, scope: _Scope) -> list[Operand] | None:
        found: list[Operand] = []
        for part in parts:
            try:
                if not part:
                    raise ValueFault("an argument is missing", [name])
                found.append(self._operand(part, scope))
            except ValueFault as fault:
                self._report(fault, name, scope)
        return found if len(found) == len(parts) else None

    def _choose(
        self, candidates: list[Macro], arguments: list[Operand], tokens: list[Token], scope: _Scope
    ) -> Macro | None:
        """The first macro of that name whose parameters take the arguments."""
        for macro in candidates:
            kinds = [kind for _, kind in macro.parameters]
            if len(kinds) == len(arguments) and all(map(operands.fits, arguments, kinds)):
                return macro
        expected = " or ".join(map(str, candidates))
        given = ", ".join(f"{operands.shown(one)} ({kind_of(one)})" for one in arguments) or "nothing"
        message = f"'{tokens[0].text}' does not take these arguments"
        self.errors.add(message, tokens, expected=expected, found=given, notes=scope.notes())
        return None

    def _endless(self, macro: Macro, name: Token, scope: _Scope) -> bool:
        if any(macro is one for one, _ in scope.calls):
            chain = " -> ".join(one.name.text for one, _ in (*scope.calls, (macro, name)))
            self.errors.add(f"the macro '{macro.name.text}' calls itself without end", name, found=chain)
            return True
        if len(scope.calls) >= MAX_NESTING:
            self.errors.add("macros are nested too deeply", name, expected=f"at most {MAX_NESTING} levels")
            return True
        return False

    def _local_labels(self, macro: Macro) -> dict[str, str]:
        names = [one.tokens[0].text for one in macro.body if one.sort == "label"]
        if not names:
            return {}
        self._unique += 1
        while any(f"{name}__{self._unique}" in self.reader.labels for name in names):
            self._unique += 1
        return {name: f"{name}__{self._unique}" for name in names}

    def _distinct(self, tokens: list[Token], scope: _Scope) -> None:
        """`.distinct a, b`: the two parameters must not share a register."""
        try:
            one, other = (self._operand([tokens[i]], scope) for i in (1, 3))
        except ValueFault as fault:
            self._report(fault, tokens[0], scope)
            return
        if operands.span_of_registers(one) & operands.span_of_registers(other):
            call = scope.calls[-1][1]
            message = f"'{call.text}' needs two different operands here"
            found = f"{tokens[1].text} = {operands.shown(one)}, {tokens[3].text} = {operands.shown(other)}"
            self.errors.add(message, call, found=found, notes=scope.notes()[1:])

    def _report(self, fault: ValueFault, fallback: Token, scope: _Scope) -> None:
        """A fault; one inside the library is told at the call that caused it."""
        outside = scope.outside_library()
        if outside:
            fault = ValueFault(f"'{outside[0].text}': {fault.message}", [outside[0]], fault.expected)
        self.reader.report(fault, fallback, outside[1] if outside else scope.notes())

    # --- operands -----------------------------------------------------------------------------------------------------

    def _operand(self, tokens: list[Token], scope: _Scope) -> Operand:
        """What an argument or a value stands for. Raises ValueFault."""
        if len(tokens) == 1 and tokens[0].kind == "name":
            return self._resolve(tokens[0], scope)
        value = evaluate(tokens, lambda token: self._value(token, scope))
        fault = operands.register_fault(value) if isinstance(value, Register) else None
        if fault:
            raise ValueFault(f"there is no register {value}", tokens, fault.removeprefix("expected "))
        return value

    def _value(self, token: Token, scope: _Scope) -> Value:
        return number_or_register(self._resolve(token, scope), token)

    def _resolve(self, token: Token, scope: _Scope) -> Operand:
        """What a name stands for: parameters first, then labels of the macro, then what the program defines."""
        text = token.text
        head, _, last = text.partition(".")
        if head in scope.parameters:
            one = scope.parameters[head]
            value = attribute(one, last) if last else one
            if value is None:
                raise ValueFault(operands.attribute_fault(one, last), [token])
            return value
        if text in scope.labels:
            return Label(scope.labels[text])
        if text in self.reader.labels:
            return Label(text)
        if text in DEFAULT.by_name["seq.cond"].codes:
            return Word(text)
        return self.reader.resolve(token)

    # --- microinstructions --------------------------------------------------------------------------------------------

    def _microinstruction(self, tokens: list[Token], scope: _Scope, origin: Token) -> None:
        if self.words == DEFAULT.program_words:
            self.errors.add("the program is too long", origin, expected=f"at most {DEFAULT.program_words} words")
            raise TooManyErrors
        self.words += 1
        given: dict[str, Token] = {}
        texts: list[str] = []
        at = 0
        while at < len(tokens):
            head = tokens[at]
            if head.kind != "name" or at + 1 == len(tokens) or tokens[at + 1].text != "=":
                self.errors.add(f"unexpected '{head.text}'", head, expected="field=value", notes=scope.notes())
                return
            end = extent(tokens, at + 2)
            for one in self._fields(head, scope):
                if one.name in given:
                    notes = [Note("first given here", given[one.name].span), *scope.notes()]
                    self.errors.add(f"the field {one.name} is given twice", head, notes=notes)
                    continue
                given[one.name] = head
                try:
                    texts.append(f"{one.name}={self._field_value(one, head, tokens[at + 2 : end], scope)}")
                except ValueFault as fault:
                    self._report(fault, head, scope)
            at = end
        self.lines.append(Line("    " + " ".join(texts), origin))

    def _fields(self, head: Token, scope: _Scope) -> list[Field]:
        """The fields that a name stands for: one, or the same of several units (`xyzs.op`)."""
        units, _, last = head.text.partition(".")
        several = len(units) > 1 and len(set(units)) == len(units) and set(units) <= set("xyzs")
        names = [f"{unit}.{last}" for unit in units] if several else [head.text]
        if any(name not in DEFAULT.by_name for name in names):
            near = close_match(head.text, DEFAULT.by_name)
            self.errors.add(f"there is no field '{head.text}'", head, expected=near, notes=scope.notes())
            return []
        return [DEFAULT.by_name[name] for name in names]

    def _field_value(self, one: Field, head: Token, tokens: list[Token], scope: _Scope) -> str:
        """The value of one field as the meta-assembler writes it. Raises ValueFault."""
        if not tokens:
            raise ValueFault(f"{head.text} has no value", [head], f"{head.text}=value")
        if len(tokens) == 1 and tokens[0].text in one.codes and tokens[0].text not in scope.parameters:
            return tokens[0].text
        if one.kind == "mask" and len(tokens) == 1 and _BANKS.fullmatch(tokens[0].text):
            return tokens[0].text
        try:
            value = self._operand(tokens, scope)
        except ValueFault:
            known = tokens[0].text.partition(".")[0] in scope.parameters
            if one.kind == "choice" and len(tokens) == 1 and tokens[0].kind == "name" and not known:
                near = close_match(tokens[0].text, one.codes) or ", ".join(one.codes)
                raise ValueFault(f"'{tokens[0].text}' is not a value of {one.name}", tokens, near) from None
            raise
        return _written(one, value, tokens)


def _written(one: Field, value: Operand, tokens: list[Token]) -> str:
    """An operand as the value of a field. Raises ValueFault where the field does not take it."""
    if isinstance(value, Register) and one.kind == "register" and one.file in FILES[value.kind]:
        return f"{REGISTER_KINDS[one.file]}{value.number}"
    if isinstance(value, Label) and one.kind in ("address", "literal"):
        return value.name
    if isinstance(value, Word) and value.text in one.codes:
        return value.text
    if isinstance(value, operands.Table) and one.kind == "literal":
        return str(value.base)
    if isinstance(value, int | float) and one.kind != "register":
        try:
            number(one, value)
        except ValueError as error:
            raise ValueFault(str(error), tokens) from None
        return _number(value)
    wanted = f"a register of {one.file.upper()}" if one.kind == "register" else None
    kinds = {"address": "a label or an address", "mask": "a number", "literal": "a number"}
    expected = wanted or kinds.get(one.kind) or ", ".join(one.codes)
    raise ValueFault(f"{one.name} does not take {operands.shown(value)}", tokens, expected)


def _number(value: int | float) -> str:
    """A number that the meta-assembler reads back exactly."""
    if isinstance(value, float) and (value != value or value in (float("inf"), float("-inf"))):
        return "nan" if value != value else "inf" if value > 0 else "-inf"
    return repr(value)
