"""What the tests of the PU compiler share: run a program there and by the interpreter under the PU's arithmetic."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tasuki.ir import nodes as n
from tasuki.ir.interpret import interpret
from tasuki.ir.memory import MemoryTable
from tasuki.ir.verify import verify
from tasuki.machines.pu.lower import ARITHMETIC, Executable
from tests.machines.running import assert_same_bits

SCHEDULES: tuple[Any, ...] = ("macro", "compact")
LIMIT = 1_000_000
"""Steps of an item, which none of these programs needs."""


def agree(
    program: n.Program,
    arguments: Sequence[Any],
    items: int,
    tables: Mapping[str, MemoryTable] | None = None,
    *,
    simulator: Any = "plain",
    checked: bool = False,
) -> None:
    """Under both schedules the PU returns what the interpreter does, and leaves the same memory."""
    verify(program)
    theirs = copied(tables or {})
    expected = interpret(program, arguments, lanes=items, tables=theirs, width=1, arithmetic=ARITHMETIC)
    steps = []
    for schedule in SCHEDULES:
        mine = copied(tables or {})
        executable = Executable(program, schedule, checked=checked)
        found = executable.run(arguments, items, tables=mine, simulator=simulator, limit=LIMIT)
        assert_same_bits(found, expected, f"schedule {schedule}:\n{executable.compiled.source}")
        for name in mine:
            assert_same_bits([mine[name].memory.reshape(-1)], [theirs[name].memory.reshape(-1)], f"table {name}")
        steps.append(executable.steps)
    assert (steps[1] <= steps[0]).all()


def copied(tables: Mapping[str, MemoryTable]) -> dict[str, MemoryTable]:
    """The same tables in memories of their own; those that share a memory still do."""
    memories = {id(table.memory): table.memory.copy() for table in tables.values()}
    return {name: MemoryTable(memories[id(one.memory)], one.base, one.count) for name, one in tables.items()}
