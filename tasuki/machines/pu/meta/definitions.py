"""The definition phase: mnemonics for combinations of fields, with parameters, and their expansion.

``.define add_to(unit, rd, source) = unit.op=add unit.a=own unit.b=source unit.w=result unit.rd=rd`` makes
``add_to(x, R1, y)`` stand for five fields. Parameters are replaced in values, and in front of a dot, so that a
parameter may name a unit. A definition may use others, in any order, but not itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from tasuki.diagnostics import Note
from tasuki.machines.pu.meta.expressions import extent
from tasuki.machines.pu.meta.source import Errors, Token
from tasuki.machines.pu.meta.symbols import close_match

MAX_NESTING = 64
"""Definitions that stand on definitions."""
MAX_TOKENS = 10_000
"""Tokens that the definitions used in one line may make."""


@dataclass(frozen=True)
class Definition:
    """A mnemonic: the tokens that it stands for."""

    name: Token
    parameters: tuple[Token, ...]
    body: tuple[Token, ...]


class Setting(NamedTuple):
    """``field=value`` after expansion. `uses` are the mnemonics through which it came, the outermost first."""

    field: Token
    value: list[Token]
    uses: tuple[Token, ...]

    def notes(self) -> list[Note]:
        """Where the setting came from, for a message about it."""
        return [Note(f"in the expansion of '{use.text}'", use.span) for use in reversed(self.uses)]


@dataclass
class Definitions:
    """All definitions of a source."""

    errors: Errors
    known: dict[str, Definition] = field(default_factory=dict)

    def add(self, definition: Definition) -> None:
        """One more definition; an error where the name is taken or a parameter stands twice."""
        name = definition.name
        if name.text in self.known:
            notes = [Note("first defined here", self.known[name.text].name.span)]
            self.errors.add(f"'{name.text}' is defined twice", name, notes=notes)
            return
        seen: set[str] = set()
        for parameter in definition.parameters:
            if parameter.text in seen:
                self.errors.add(f"the parameter '{parameter.text}' stands twice", parameter)
            seen.add(parameter.text)
        self.known[name.text] = definition

    def expand(self, tokens: list[Token]) -> list[Setting]:
        """The fields that an instruction line sets, in the order in which they are written."""
        return list(_Expansion(self).run(tokens, ()))


class _Expansion:
    """The expansion of one line, which knows how much it has made."""

    def __init__(self, definitions: Definitions) -> None:
        self.known, self.errors, self.made = definitions.known, definitions.errors, 0

    def run(self, tokens: list[Token], uses: tuple[Token, ...]) -> Iterator[Setting]:
        at = 0
        while at < len(tokens):
            token = tokens[at]
            following = tokens[at + 1].text if at + 1 < len(tokens) else ""
            if token.kind != "name":
                if token.text != ",":
                    self.report(f"unexpected '{token.text}'", token, uses, "field=value, or a mnemonic")
                    return
                at += 1
            elif following == "=":
                end = extent(tokens, at + 2)
                if end == at + 2:
                    self.report(f"{token.text} has no value", tokens[at : at + 2], uses, f"{token.text}=value")
                yield Setting(token, tokens[at + 2 : end], uses)
                at = end
            else:
                arguments, at = self.arguments(tokens, at, uses)
                if arguments is not None:
                    yield from self.use(token, arguments, uses)

    def arguments(self, tokens: list[Token], at: int, uses: tuple[Token, ...]) -> tuple[list[list[Token]] | None, int]:
        """The arguments of the mnemonic at `at` (None where they do not end), and where the text goes on."""
        if at + 1 >= len(tokens) or tokens[at + 1].text != "(":
            return [], at + 1
        arguments: list[list[Token]] = [[]]
        depth, end = 1, at + 2
        while end < len(tokens):
            token = tokens[end]
            end += 1
            depth += (token.text == "(") - (token.text == ")")
            if depth == 0:
                return ([] if arguments == [[]] else arguments), end
            if token.text == "," and depth == 1:
                arguments.append([])
            else:
                arguments[-1].append(token)
        self.report("this parenthesis is not closed", tokens[at + 1], uses)
        return None, end

    def use(self, name: Token, arguments: list[list[Token]], uses: tuple[Token, ...]) -> Iterator[Setting]:
        definition = self.known.get(name.text)
        if definition is None:
            near = close_match(name.text, self.known) or "field=value, or a defined mnemonic"
            self.report(f"'{name.text}' is not defined", name, uses, near)
        elif len(arguments) != len(definition.parameters):
            wanted = ", ".join(parameter.text for parameter in definition.parameters)
            message = f"'{name.text}' takes {_arguments(len(definition.parameters))}"
            self.report(message, name, uses, f"{name.text}({wanted})", _arguments(len(arguments)))
        elif any(name.text == use.text for use in uses):
            self.report(f"'{name.text}' is defined by itself", name, uses)
        elif len(uses) >= MAX_NESTING:
            self.report("definitions stand on definitions too deeply", name, uses, f"at most {MAX_NESTING} levels")
        else:
            bound = dict(zip((parameter.text for parameter in definition.parameters), arguments, strict=True))
            body = self.substitute(definition.body, bound)
            if self.made > MAX_TOKENS:
                self.report("the expansion is too long", name, uses, f"at most {MAX_TOKENS} tokens in one line")
                return
            yield from self.run(body, (*uses, name))

    def substitute(self, body: tuple[Token, ...], bound: Mapping[str, list[Token]]) -> list[Token]:
        """The body with arguments in the place of parameters; several tokens keep together in parentheses."""
        made: list[Token] = []
        for token in body:
            argument = bound.get(token.text) if token.kind == "name" else None
            if argument is None:
                made.append(_rename(token, bound))
            elif len(argument) == 1:
                made += argument
            else:
                made += [token._replace(kind="mark", text="("), *argument, token._replace(kind="mark", text=")")]
            if self.made + len(made) > MAX_TOKENS:
                break
        self.made += len(made)
        return made

    def report(
        self,
        message: str,
        where: Token | list[Token],
        uses: tuple[Token, ...],
        expected: str | None = None,
        found: str | None = None,
    ) -> None:
        notes = [Note(f"in the expansion of '{use.text}'", use.span) for use in reversed(uses[-8:])]
        self.errors.add(message, where, expected=expected, found=found, notes=notes)


def _arguments(count: int) -> str:
    return f"{count} argument{'' if count == 1 else 's'}"


def _rename(token: Token, bound: Mapping[str, list[Token]]) -> Token:
    """`unit.op` with the parameter `unit` bound to `x` is `x.op`: the part before the first dot is looked at."""
    if token.kind != "name":
        return token
    unit, dot, rest = token.text.partition(".")
    argument = bound.get(unit, [])
    if not dot or len(argument) != 1 or argument[0].kind != "name":
        return token
    return token._replace(text=f"{argument[0].text}.{rest}")
