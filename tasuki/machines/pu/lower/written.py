"""Modules written by hand: macro assembler text that stands in for what the compiler would make of a module.

The text is the body of a subroutine under the convention of `registers`: part n of the arguments arrives in register n
of the bank that its type lives in, part n of the result leaves in register n, and control returns behind the last line,
or by `return`. Which registers a caller must keep its values out of is read from the words that the text assembles to.
It has no memory: the address registers and the rows belong to the program around it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tasuki.diagnostics import Diagnostic, SourceError, Span
from tasuki.ir import nodes as ir
from tasuki.ir.canonical import reachable
from tasuki.ir.types import Table, Type
from tasuki.machines.pu import isa
from tasuki.machines.pu.lower.parts import banks_of, parts
from tasuki.machines.pu.lower.places import INTEGERS, ROWS, Cell, Fixed
from tasuki.machines.pu.macro import assemble
from tasuki.machines.pu.meta.source import read_source

KEPT: Mapping[str, tuple[str, ...]] = {
    "seq.op": ("next", "jump", "count", "loop", "drop", "return"),
    "mem.op": ("none",),
    "ag.update": ("hold",),
    "ag.load": ("none",),
    "disp.op": ("none",),
}
"""Field -> what a stand-in may have there: it calls nothing, never halts, and leaves memory and picture alone."""
RESERVED = ("start", "item", "frame")
"""Names of the program around it."""


@dataclass(frozen=True)
class Written:
    """A stand-in: its lines and the return behind them, the names in it, its labels, the registers that it changes."""

    lines: tuple[str, ...]
    names: frozenset[str]
    labels: frozenset[str]
    changed: frozenset[Cell]


def read_written(program: ir.Program, files: Mapping[str, Path]) -> dict[str, Written]:
    """The stand-ins for modules, by their qualified name. Raises SourceError with file and line."""
    functions = {function.name: function for function in reachable(program)}
    found: dict[str, Written] = {}
    for name, path in files.items():
        if name not in functions:
            known = ", ".join(sorted(functions))
            raise _refusal("a stand-in for a module that the program does not have", Span(str(path), 1), known, name)
        _check_signature(functions[name], path)
        one = _read(path)
        for label in sorted(one.labels & {*RESERVED, *(label for other in found.values() for label in other.labels)}):
            line = next(i for i, text in enumerate(one.lines, 1) if re.match(rf"\s*{label}\s*:", text))
            raise _refusal(f"label `{label}` stands elsewhere in the program", Span(str(path), line), "another name")
        found[name] = one
    return found


def registers(types: Iterable[Type]) -> list[Fixed]:
    """Where values of these types are when control passes: part n in register n of its bank or banks."""
    flat = (part for type_ in types for part in parts(type_))
    return [Fixed(banks_of(part), number) for number, part in enumerate(flat)]


def _check_signature(function: ir.Function, path: Path) -> None:
    types = [parameter.type for parameter in function.parameters]
    if any(isinstance(type_, Table) for type_ in types):
        raise _refusal(f"`{function.name}` takes a table", Span(str(path), 1), "a module of values alone")
    values = [type_ for type_ in types if isinstance(type_, Type)]
    for places in (registers(values), registers([function.result])):
        if any(place.number >= (INTEGERS if place.banks == "i" else ROWS) for place in places):
            message = f"`{function.name}` has more values than there are registers"
            raise _refusal(message, Span(str(path), 1), f"at most {INTEGERS}")


def _read(path: Path) -> Written:
    source = read_source(path)
    for number, line in enumerate(source.lines, 1):
        if re.match(r"\s*\.", line):
            raise _refusal("a stand-in has no directives", Span(str(path), number), "instructions and labels")
    lines = (*source.lines, "        return")
    program = assemble("\n".join(lines), str(path)).program
    changed: set[Cell] = set()
    for word, span in zip(program.words, program.spans, strict=True):
        fields = isa.decode(word)
        _check_word(fields, span)
        changed |= _changed(fields)
    names = frozenset(re.findall(r"[^\W\d]\w*", source.text))
    return Written(lines, names, frozenset(program.labels), frozenset(changed))


def _check_word(fields: Mapping[str, int], span: Span | None) -> None:
    for name, allowed in KEPT.items():
        codes = isa.DEFAULT.by_name[name].codes
        found = next(word for word, code in codes.items() if code == fields[name])
        if found not in allowed:
            message = "a stand-in calls nothing, does not halt, and has no memory"
            raise _refusal(message, span, " or ".join(f"{name}={word}" for word in allowed), f"{name}={found}")


def _changed(fields: Mapping[str, int]) -> set[Cell]:
    """The registers that a microinstruction writes."""
    units: Sequence[tuple[str, str]] = [*((bank, bank) for bank in "xyzs"), ("alu", "i")]
    return {(bank, fields[f"{unit}.rd"]) for unit, bank in units if fields[f"{unit}.w"]}


def _refusal(message: str, span: Span | None, expected: str, found: str | None = None) -> SourceError:
    return SourceError([Diagnostic(message, span, expected, found)])
