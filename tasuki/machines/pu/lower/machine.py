"""A compiled program on a processor unit: binding arguments, running item after item, counting steps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tasuki.diagnostics import Diagnostic, MachineError
from tasuki.ir.memory import MemoryTable
from tasuki.ir.nodes import Program
from tasuki.ir.types import BANKS, Record, Table
from tasuki.machines.pu import isa, simulate
from tasuki.machines.pu.lower.program import ARGUMENTS, RESULTS, AccessSite, Lowered, ProgramLowering
from tasuki.machines.pu.lower.text import own_rows, write
from tasuki.machines.pu.lower.written import read_written
from tasuki.machines.pu.macro import assemble
from tasuki.machines.pu.schedule import compact

Argument = Sequence[Any] | MemoryTable
"""The leaves of a value, each of shape (items,) or, where it is the same for all items, (); or a table."""
Schedule = Literal["macro", "compact"]
LEAST_ROWS = isa.Program.memory_rows
"""Data memory has this many rows, or a power of two times as many: a program is translated once for each size."""


@dataclass(frozen=True)
class PUProgram:
    """A program for the processor unit.

    `source` is macro assembler source, `words` what it assembles to. `modules[i]` is the module for which word i
    counts. `tables` are those that have a descriptor, in the order of their rows: named tables by their name, table
    parameters of the entry as "parameter NAME", and the tables of items. `bases` are their base registers.
    """

    source: str
    words: isa.Program
    modules: tuple[str, ...]
    tables: tuple[str, ...]
    records: Mapping[str, Record]
    bases: Mapping[str, int]
    own_rows: int
    entry: str
    sites: tuple[AccessSite, ...]
    home: int
    """Where the machine halts when an item is done."""


def compile_program(
    program: Program,
    schedule: Schedule = "macro",
    *,
    checked: bool = False,
    written: Mapping[str, Path] | None = None,
) -> PUProgram:
    """Compile a verified program. Raises SourceError, with the place, where the machine cannot do what it asks for.

    `schedule`: "macro" leaves each macro as it is, "compact" lets macros overlap. `checked`: an index outside a table
    ends the run with an error; else it reaches whatever memory holds there. `written`: files of macro assembler text
    that stand in for modules, by the modules' qualified names (docs/pu-compiler.md has their convention).
    """
    lowered = ProgramLowering(program, checked, read_written(program, written or {})).lower()
    text = write(lowered)
    name = f"{lowered.entry.label} of {program.entry}"
    assembly = assemble("".join(f"{line}\n" for line in text.lines), name)
    spans = assembly.program.spans
    modules = tuple(text.modules[span.line - 1] if span else "" for span in spans)
    words = assembly.program
    if schedule == "compact":
        compacted = compact(words)
        words, modules = compacted.program, tuple(_most(modules, group) for group in compacted.sources)
    records = {key: _record(lowered, key) for key in lowered.tables}
    # The macro assembler gives base registers to tables in the order of their declaration.
    bases = {slot.key: number for number, slot in enumerate(lowered.slots) if slot.key in records}
    tables, sites = tuple(lowered.tables), tuple(lowered.sites)
    rows = own_rows(lowered)
    return PUProgram(assembly.source, words, modules, tables, records, bases, rows, program.entry, sites, _home(words))


def _home(program: isa.Program) -> int:
    """The first halt behind the label `item`."""
    halt = isa.DEFAULT.by_name["seq.op"].codes["halt"]
    places = range(program.labels["item"], len(program.words))
    return next(address for address in places if isa.decode(program.words[address])["seq.op"] == halt)


def _most(modules: Sequence[str], addresses: Sequence[int]) -> str:
    """The module from which most of a compacted microinstruction comes."""
    return Counter(modules[address] for address in addresses).most_common(1)[0][0]


def _record(lowered: Lowered, key: str) -> Record:
    return next(slot.record for slot in lowered.slots if slot.key == key)


class Executable:
    """A compiled program on one processor unit. May be run any number of times."""

    def __init__(
        self,
        program: Program,
        schedule: Schedule = "macro",
        *,
        checked: bool = False,
        written: Mapping[str, Path] | None = None,
    ) -> None:
        self.compiled = compile_program(program, schedule, checked=checked, written=written)
        self.function = program.functions[program.entry]
        self.steps = np.zeros(0, np.int64)
        """Of the last run: the steps of each item."""
        self.executions: Sequence[int] = ()
        """Of the last run: how often each microinstruction ran."""

    def run(
        self,
        arguments: Sequence[Argument],
        items: int,
        *,
        tables: Mapping[str, MemoryTable] | None = None,
        simulator: simulate.Machine = "fast",
        limit: int | None = None,
    ) -> list[np.ndarray]:
        """Run the entry for `items` items, one after another; the leaves of the results, each of shape (items,).

        `arguments` has an entry for each parameter; `tables` binds the program's named tables, which may be changed.
        Raises MachineError: a table that is missing, an access outside memory, an item of more than `limit` steps.
        """
        image = _Image(self.compiled, self._tables(arguments, items, tables or {}))
        self.steps = self._run_items(image, items, simulator, limit)
        image.write_back()
        return self._results(image, items)

    def steps_by_module(self) -> dict[str, int]:
        """The steps of the last run, all items together, by the module whose source they come from.

        "" has what reads arguments, stores results, and goes from item to item. A compacted microinstruction counts for
        the module from which most of it comes.
        """
        sums: Counter[str] = Counter()
        for module, times in zip(self.compiled.modules, self.executions, strict=True):
            sums[module] += times
        return dict(sums.most_common())

    def _tables(
        self, arguments: Sequence[Argument], items: int, tables: Mapping[str, MemoryTable]
    ) -> dict[str, MemoryTable]:
        """The table behind each descriptor."""
        bound = dict(tables)
        values: list[Any] = []
        for parameter, argument in zip(self.function.parameters, arguments, strict=True):
            if isinstance(parameter.type, Table):
                assert isinstance(argument, MemoryTable), "a table parameter takes a table"
                bound[f"parameter {parameter.name}"] = argument
            else:
                assert not isinstance(argument, MemoryTable)
                values += argument
        records = self.compiled.records
        if ARGUMENTS in records:
            bound[ARGUMENTS] = _filled(records[ARGUMENTS], values, items)
        if RESULTS in records:
            bound[RESULTS] = _filled(records[RESULTS], [], items)
        missing = [f"`{name}`" for name in self.compiled.tables if name not in bound]
        if missing:
            raise MachineError(f"the program needs tables that it was not given: {', '.join(missing)}")
        return {name: bound[name] for name in self.compiled.tables}

    def _run_items(self, image: _Image, items: int, simulator: simulate.Machine, limit: int | None) -> np.ndarray:
        program = replace(self.compiled.words, memory_rows=len(image.rows), display_rows=1)
        state = simulate.start(program)
        state.memory[:] = image.rows
        image.rows = state.memory
        machine = simulate.Fast(program, state) if simulator == "fast" else simulate.Plain(program, state)
        most = simulate.ENDLESS if limit is None else limit
        machine.advance(most)
        steps = machine.repeat(program.labels["item"], items, most, self.compiled.home)
        if not state.halted:
            item = int(np.argmax(steps == most))
            raise simulate.Trap("limit", f"item {item}: no halt within {limit} steps", program, state)
        if items and state.address != self.compiled.home:
            raise self._fault(state)
        self.executions = machine.executions
        return steps

    def _fault(self, state: simulate.State) -> MachineError:
        """What a failed access says: FPPS's output is its number, the ALU's the index."""
        site = self.compiled.sites[state.output["s"]]
        index = np.uint32(state.output["alu"]).view(np.int32)
        module = site.origin.module.rsplit(":", 1)[-1]
        message = f"an access outside table `{site.table}` in module `{module}`"
        return MachineError(str(Diagnostic(message, site.origin.span, found=f"index {index}")))

    def _results(self, image: _Image, items: int) -> list[np.ndarray]:
        leaves = self.function.result.leaves
        if not leaves:
            return []
        record, first = self.compiled.records[RESULTS], image.first_row[RESULTS]
        rows = image.rows[first : first + items * record.rows].reshape(items, record.rows * BANKS)
        dtypes = {"f32": np.float32, "i32": np.int32, "bool": np.int32}
        found = []
        for leaf, (row, bank) in zip(leaves, record.layout, strict=True):
            words = np.ascontiguousarray(rows[:, row * BANKS + bank]).view(dtypes[leaf])
            found.append(words != 0 if leaf == "bool" else words)
        return found


class _Image:
    """Data memory: descriptors, the program's own rows, then every memory that holds a table, each once."""

    def __init__(self, compiled: PUProgram, tables: Mapping[str, MemoryTable]) -> None:
        self.memories = {table.memory.ctypes.data: table.memory for table in tables.values() if table.memory.size}
        self.starts: dict[int, int] = {}
        end = compiled.own_rows
        for address, memory in self.memories.items():
            self.starts[address] = end
            end += len(memory)
        size = LEAST_ROWS
        while size < end:
            size *= 2
        self.rows = np.zeros((size, BANKS), np.uint32)
        for address, memory in self.memories.items():
            start = self.starts[address]
            self.rows[start : start + len(memory)] = memory.view(np.uint32)
        self.first_row: dict[str, int] = {}
        for number, (name, table) in enumerate(tables.items()):
            _check_extent(name, table, compiled.records[name].rows)
            first = self.starts.get(table.memory.ctypes.data, 0) + table.base
            self.first_row[name] = first
            self.rows[number] = (first, table.count, 0, 0)

    def write_back(self) -> None:
        """What the program stored goes to the memories that the tables came from."""
        for address, memory in self.memories.items():
            start = self.starts[address]
            now = self.rows[start : start + len(memory)]
            if not np.array_equal(memory.view(np.uint32), now):
                if not memory.flags.writeable:
                    raise MachineError("a store to a table whose memory is read-only")
                memory.view(np.uint32)[:] = now


def _check_extent(name: str, table: MemoryTable, rows: int) -> None:
    end = table.base + table.count * rows
    if table.base < 0 or table.count < 0 or end > len(table.memory):
        raise MachineError(f"{name} takes rows {table.base} to {end} of a memory that has {len(table.memory)}")


def _filled(record: Record, leaves: Sequence[Any], items: int) -> MemoryTable:
    """A table of `items` records with these leaves; zero where there are none."""
    memory = np.zeros((items * record.rows, BANKS), np.float32)
    words = memory.view(np.int32).reshape(items, record.rows * BANKS)
    for (row, bank), leaf in zip(record.layout, leaves, strict=False):
        values = np.asarray(leaf)
        bits = values.astype(np.float32).view(np.int32) if values.dtype.kind == "f" else values.astype(np.int32)
        words[:, row * BANKS + bank] = bits
    return MemoryTable(memory, 0, items)
