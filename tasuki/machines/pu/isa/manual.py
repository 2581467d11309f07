"""The manual's tables, made from the description of the fields.

A page holds them between ``<!-- generated: NAME -->`` and ``<!-- end -->``. ``python -m tasuki.machines.pu.isa.manual
FILE`` renews them; a test holds that they are up to date.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from tasuki.machines.pu.isa.fields import DEFAULT, InstructionSet
from tasuki.machines.pu.isa.values import Value

_SECTION = re.compile(r"(<!-- generated: ([\w .]+) -->\n).*?(<!-- end -->)", re.DOTALL)
_UNITS = {
    "x": "FPPX",
    "y": "FPPY",
    "z": "FPPZ",
    "s": "FPPS",
    "tab": "tables",
    "alu": "ALU",
    "mem": "memory",
    "ag": "address generator",
    "disp": "display port",
    "seq": "sequencer",
    "lit": "literal",
}


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table. Bars in cells are escaped."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines)


def _values(values: Iterable[Value]) -> str:
    return _table(("code", "name", "meaning"), ((str(one.code), f"`{one.name}`", one.meaning) for one in values))


def _operations(values: Iterable[Value]) -> str:
    rows = ((str(one.code), f"`{one.name}`", ", ".join(one.reads) or "-", one.meaning) for one in values)
    return _table(("code", "name", "reads", "meaning"), rows)


def _word(isa: InstructionSet) -> str:
    """Every field with its bits."""
    rows = []
    for one in isa.fields:
        top = one.place + one.width - 1
        bits = f"{top}" if one.width == 1 else f"{top}:{one.place}"
        rows.append((_UNITS[one.unit], f"`{one.name}`", bits, str(one.width), one.meaning))
    rows.append(("", "**all**", f"{isa.bits - 1}:0", f"**{isa.bits}**", ""))
    return _table(("unit", "field", "bits", "width", "meaning"), rows)


def _budget(isa: InstructionSet) -> str:
    """Bits for each unit."""
    bits: dict[str, int] = {}
    for one in isa.fields:
        bits[one.unit] = bits.get(one.unit, 0) + one.width
    rows = [(_UNITS[unit], str(count)) for unit, count in bits.items()]
    return _table(("unit", "bits"), [*rows, ("**all**", f"**{isa.bits}**")])


def _sources(isa: InstructionSet) -> str:
    """What each FPP's selectors reach: one row for each source, the codes in the units' columns."""
    units = "xyzs"
    found: dict[str, dict[str, Value]] = {}
    for unit in units:
        for value in isa.by_name[f"{unit}.a"].values:
            found.setdefault(value.name, {})[unit] = value
    rows = []
    for name, by_unit in found.items():
        codes = [str(by_unit[unit].code) if unit in by_unit else "" for unit in units]
        rows.append((f"`{name}`", *codes, next(iter(by_unit.values())).meaning))
    return _table(("source", "X", "Y", "Z", "S", "meaning"), rows)


def _writes(isa: InstructionSet) -> str:
    vector, scalar = isa.by_name["x.w"].values, isa.by_name["s.w"].values
    common = [("X, Y, Z, S", one) for one in vector if one in scalar]
    own = [("X, Y, Z", one) for one in vector if one not in scalar]
    own += [("S", one) for one in scalar if one not in vector]
    rows = ((str(one.code), f"`{one.name}`", units, one.meaning) for units, one in [*common, *own])
    return _table(("code", "name", "units", "meaning"), rows)


def _registers(isa: InstructionSet) -> str:
    names = {
        "x": ("bank X", "R"),
        "y": ("bank Y", "R"),
        "z": ("bank Z", "R"),
        "s": ("bank S", "R"),
        "alu": ("ALU", "I"),
        "br": ("base", "BR"),
        "ir": ("index", "IR"),
        "ar": ("attribute", "AR"),
    }
    counts = isa.register_counts
    rows = ((names[file][0], f"`{names[file][1]}0` - `{names[file][1]}{counts[file] - 1}`") for file in counts)
    return _table(("file", "registers"), rows)


SECTIONS: dict[str, Callable[[InstructionSet], str]] = {
    "word": _word,
    "budget": _budget,
    "registers": _registers,
    "fpp operations": lambda isa: _operations(isa.by_name["x.op"].values),
    "fpp sources": _sources,
    "fpp writes": _writes,
    "alu operations": lambda isa: _operations(isa.by_name["alu.op"].values),
    "alu sources": lambda isa: _values(isa.by_name["alu.a"].values),
    "alu writes": lambda isa: _values(isa.by_name["alu.w"].values),
    "tables": lambda isa: _values(isa.by_name["tab.op"].values),
    "table inputs": lambda isa: _values(isa.by_name["tab.in"].values),
    "memory operations": lambda isa: _values(isa.by_name["mem.op"].values),
    "memory data": lambda isa: _values(isa.by_name["mem.x"].values),
    "address modes": lambda isa: _values(isa.by_name["ag.mode"].values),
    "address updates": lambda isa: _values(isa.by_name["ag.update"].values),
    "address loads": lambda isa: _values(isa.by_name["ag.load"].values),
    "display": lambda isa: _values(isa.by_name["disp.op"].values),
    "sequencer": lambda isa: _values(isa.by_name["seq.op"].values),
    "conditions": lambda isa: _values(isa.by_name["seq.cond"].values),
    "polarity": lambda isa: _values(isa.by_name["seq.not"].values),
}


def renewed(page: str, isa: InstructionSet = DEFAULT) -> str:
    """The page with every generated section renewed. Raises KeyError for a section that nothing makes."""
    return _SECTION.sub(lambda match: f"{match[1]}{SECTIONS[match[2]](isa)}{match[3]}", page)


def sections(page: str) -> list[str]:
    """The names of the generated sections of a page."""
    return [match[2] for match in _SECTION.finditer(page)]


if __name__ == "__main__":
    for file in map(Path, sys.argv[1:]):
        file.write_text(renewed(file.read_text()))
