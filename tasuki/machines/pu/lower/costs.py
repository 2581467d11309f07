"""What a module costs on the processor unit: its steps over a set of inputs, and its length."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tasuki.ir.memory import MemoryTable
from tasuki.ir.nodes import Program
from tasuki.machines.pu.lower.machine import Argument, Executable, Schedule


@dataclass(frozen=True)
class Cost:
    """Steps of one item: the least, the median, and the most over the inputs; `words` is the microcode's length.

    What brings arguments from memory, and results there, is left out of both.
    """

    least: int
    typical: int
    most: int
    words: int


def module_cost(
    program: Program,
    arguments: Sequence[Argument],
    items: int,
    *,
    tables: Mapping[str, MemoryTable] | None = None,
    schedule: Schedule = "macro",
) -> Cost:
    """The cost of a verified program's entry, with all that it calls, for the given inputs. Raises as `Executable`."""
    executable = Executable(program, schedule)
    executable.run(arguments, items, tables=tables)
    modules = executable.compiled.modules
    item = executable.compiled.words.labels["item"]
    # Every item brings and takes the same.
    pairs = zip(modules[item:], executable.executions[item:], strict=True)
    transfer = sum(times for module, times in pairs if not module)
    own = executable.steps - transfer // items
    return Cost(int(own.min()), int(np.median(own)), int(own.max()), sum(1 for module in modules if module))
