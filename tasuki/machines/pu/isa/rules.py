"""What a microinstruction may not say, and what travels over its buses: decided from its fields alone.

Everything that two drivers could fight over in one step is wired so that the fields show it:

- **the S bus** carries one word from SP to X, Y and Z: FPPS's output (`s`) or bank S's read port a (`port`). Units that
  select different ones in one step are two drivers of one bus;
- **an index register** may be loaded (`ag.load`) or go on (`ag.update`), not both: two writers of one register.

A register bank, a memory bank, the display and the literal have one writer by construction. Selectors count only where
the unit's operation reads that operand.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from tasuki.machines.pu.isa.fields import DEFAULT, InstructionSet

FPPS = ("x", "y", "z", "s")
_IR_LOADS = ("ir_alu", "ir_lit")


@dataclass(frozen=True)
class Problem:
    """Why a microinstruction traps. `fields` are the names of the fields that are at fault."""

    message: str
    fields: tuple[str, ...]


def undefined(fields: Mapping[str, int], isa: InstructionSet = DEFAULT) -> list[Problem]:
    """Choice fields whose code has no meaning. `fields` is what `decode` gives."""
    return [
        Problem(f"undefined instruction: {one.name} = {fields[one.name]}", (one.name,))
        for one in isa.fields
        if one.kind == "choice" and fields[one.name] not in one.by_code
    ]


def selected(fields: Mapping[str, int], isa: InstructionSet = DEFAULT) -> Iterator[tuple[str, str, str]]:
    """The operands that FPP operations really read: (unit, "a" or "b", name of the source)."""
    for unit in FPPS:
        operation = isa.by_name[f"{unit}.op"].by_code.get(fields[f"{unit}.op"])
        for operand in operation.reads if operation else "":
            source = isa.by_name[f"{unit}.{operand}"].by_code.get(fields[f"{unit}.{operand}"])
            if source:
                yield unit, operand, source.name


def transfers(fields: Mapping[str, int], isa: InstructionSet = DEFAULT) -> list[tuple[str, str]]:
    """The words on crossed buses in this step: (driving unit, listening unit), once for each operand."""
    found = []
    for unit, operand, source in selected(fields, isa):
        one = isa.by_name[f"{unit}.{operand}"]
        bus = one.by_code[one.codes[source]].bus
        if bus:
            found.append((bus, unit))
    return found


def conflicts(fields: Mapping[str, int], isa: InstructionSet = DEFAULT) -> list[Problem]:
    """Two writers of one bus or register in this step."""
    found = []
    drivers: dict[str, list[str]] = {}
    for unit, operand, source in selected(fields, isa):
        if unit != "s" and source in ("s", "port"):
            drivers.setdefault(source, []).append(f"{unit}.{operand}")
    if len(drivers) > 1:
        message = "write conflict: FPPS's output and bank S's register both drive the S bus"
        found.append(Problem(message, tuple(name for names in drivers.values() for name in names)))
    load = isa.by_name["ag.load"].by_code.get(fields["ag.load"])
    if load and load.name in _IR_LOADS and fields["ag.update"]:
        message = f"write conflict: index register {fields['ag.ir']} is loaded and goes on in one step"
        found.append(Problem(message, ("ag.load", "ag.update")))
    return found
