"""Scheduling: the same work in fewer steps, units working side by side.

The macro assembler expands each macro on its own, as Table 1 counts. `compact` takes the microinstructions apart into
what each unit does (`operations`), finds what must wait for what inside a basic block (`depend`), and puts operations
of different macros into one microinstruction wherever fields, buses, the literal and the address generator allow
(`compact`). What a program computes stays the same, bit for bit, and so does the state at the end of every block.
"""

from tasuki.machines.pu.schedule.compact import Compacted, compact

__all__ = ["Compacted", "compact"]
