"""What an assembler hands to a simulator: the words of program memory and what memory holds at the start."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from tasuki.diagnostics import Span
from tasuki.machines.pu.isa.encoding import Word

Row = tuple[int, int, int, int]
"""Four words, 0 to 2**32 - 1, for the banks X, Y, Z, S."""


@dataclass(frozen=True)
class Program:
    """Microcode, ready to be loaded. Execution begins at address 0.

    `spans[i]` is the source line of `words[i]` (the macro assembler's line where the microcode came from one).
    `labels` names addresses. `memory` gives the rows that differ from zero at the start; `memory_rows` and
    `display_rows` are the sizes of data memory and display memory in rows.
    """

    words: tuple[Word, ...]
    spans: tuple[Span | None, ...] = ()
    labels: Mapping[str, int] = field(default_factory=dict)
    memory: Mapping[int, Row] = field(default_factory=dict)
    memory_rows: int = 65_536
    display_rows: int = 1_048_576
