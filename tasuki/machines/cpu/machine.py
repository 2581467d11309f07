"""A compiled program on this processor: binding arguments, running threads, stopping, reporting failed accesses."""

from __future__ import annotations

import ctypes
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tasuki.diagnostics import Diagnostic, MachineError, Span
from tasuki.ir.memory import MemoryTable
from tasuki.machines.cpu.checks import AccessSite
from tasuki.machines.cpu.context import ARGUMENTS, CHUNK, COUNTER, ERROR, ERROR_INDEX, ITEMS, PROFILE, STOP
from tasuki.machines.cpu.profile import WORDS
from tasuki.native.buffers import aligned_zeros
from tasuki.native.compile import Library

STORED_DTYPE = {"f32": np.float32, "i32": np.int32, "bool": np.int32}
ROW_BYTES = 16
"""Of the memory: rows are loaded and stored whole."""
POLL_SECONDS = 0.02
Progress = Callable[[float], None]
"""Called now and then with the share of the work that has been taken, 0..1."""


@dataclass(frozen=True)
class Items:
    """An argument with one element for each item: an array for each leaf."""

    leaves: Sequence[np.ndarray]


@dataclass(frozen=True)
class Same:
    """An argument that is the same for all items: one number for each leaf."""

    leaves: Sequence[float | int | bool]


@dataclass(frozen=True)
class Number:
    """The item's own number, 0 .. items - 1."""


Argument = Items | Same | Number | MemoryTable


@dataclass(frozen=True)
class EdgeProfile:
    """What a profiled run counted for the calls of one module by another."""

    caller: str
    callee: str
    calls: int
    lanes: int
    cycles: int


@dataclass
class Shape:
    """What the host must know of compiled code: JSON in the object cache."""

    parameters: list[list[str] | int]
    """The scalars of each parameter's leaves; for a table the rows that one of its records takes."""
    result: list[str]
    tables: dict[str, int]
    """The named tables in the order in which the context holds them, and the rows that one record takes."""
    width: int
    sites: list[AccessSite]
    profiled: list[tuple[str, str]]

    def to_json(self) -> dict:
        places = [[s.span.file, s.span.line, s.span.column] if s.span else None for s in self.sites]
        sites = [[s.table, s.function, place] for s, place in zip(self.sites, places, strict=True)]
        return {**vars(self), "sites": sites}

    @classmethod
    def from_json(cls, data: dict) -> Shape:
        sites = [AccessSite(table, function, Span(*at) if at else None) for table, function, at in data["sites"]]
        profiled = [(caller, callee) for caller, callee in data["profiled"]]
        return cls(**{**data, "sites": sites, "profiled": profiled})


class Executable:
    """Compiled code, loaded. May be run any number of times; one run at a time."""

    def __init__(self, object_code: bytes, shape: Shape) -> None:
        self.shape = shape
        self._library = Library(object_code)
        self._launch = self._library.function("launch", ctypes.c_void_p)
        self.profile: list[EdgeProfile] = []
        """Of the last run, if the program was compiled for profiling."""

    def run(
        self,
        arguments: Sequence[Argument],
        items: int,
        *,
        tables: Mapping[str, MemoryTable] | None = None,
        threads: int = 1,
        chunk: int = 1024,
        progress: Progress | None = None,
    ) -> list[np.ndarray]:
        """Run the entry for `items` items; the leaves of the results, each of shape (items,).

        `tables` binds the program's named tables. `chunk` items at a time are handed to each of `threads` threads.
        On Ctrl-C all threads stop within a chunk and KeyboardInterrupt is raised. Raises MachineError where a checked
        access failed.
        """
        run = _Run(self.shape, arguments, items, tables or {}, chunk)
        if self.shape.profiled:
            threads = 1
        self._run_threads(run, threads, progress)
        self.profile = run.profile()
        run.raise_error()
        return run.results()

    def seconds(self, arguments: Sequence[Argument], items: int, *, repeats: int) -> float:
        """The least time that the compiled code took for `items` items, of `repeats` runs on this thread.

        Binding the arguments and starting threads are left out. For programs without named tables.
        """
        run = _Run(self.shape, arguments, items, {}, max(1, items))
        address = run.context.ctypes.data
        least = float("inf")
        for _ in range(repeats):
            run.context[COUNTER] = 0
            started = time.perf_counter()
            self._launch(address)
            least = min(least, time.perf_counter() - started)
        run.raise_error()
        return least

    def _run_threads(self, run: _Run, threads: int, progress: Progress | None) -> None:
        if run.items <= run.context[CHUNK]:
            # One chunk: no thread could stop within it, and starting one would take longer than a small chunk does.
            self._launch(run.context.ctypes.data)
            return
        ended: list[int] = []
        one_ended = threading.Event()

        def work(number: int) -> None:
            # As long as this frame lives it keeps the memory of `run`, into which compiled code may still write.
            self._launch(run.context.ctypes.data)
            ended.append(number)
            one_ended.set()

        # No Thread.join: interrupted by Ctrl-C, CPython 3.11's takes a thread that still runs for one that has ended.
        begun = 0
        started = time.perf_counter()
        try:
            for number in range(threads):
                threading.Thread(target=work, args=(number,), daemon=True).start()
                begun += 1
            while len(ended) < begun:
                one_ended.wait(POLL_SECONDS)
                one_ended.clear()
                if progress and time.perf_counter() - started > POLL_SECONDS:
                    progress(_share(run.context))
        finally:
            # Whatever interrupts us, no thread may go on writing into tables that are about to be read.
            run.context[STOP] = 1
            while len(ended) < begun:
                one_ended.wait(POLL_SECONDS)
                one_ended.clear()


def _share(context: np.ndarray) -> float:
    items = max(1, int(context[ITEMS]))
    return min(1.0, int(context[COUNTER]) * int(context[CHUNK]) / items)


class _Run:
    """The context of one run, and the buffers that it points to."""

    def __init__(
        self,
        shape: Shape,
        arguments: Sequence[Argument],
        items: int,
        tables: Mapping[str, MemoryTable],
        chunk: int,
    ) -> None:
        self.shape = shape
        self.items = items
        self.padded = -(-max(items, 1) // shape.width) * shape.width
        self.kept: list[np.ndarray] = []
        self.memories: dict[int, int] = {}
        words: list[int] = []
        for scalars, argument in zip(shape.parameters, arguments, strict=True):
            words += self._bind(scalars, argument)
        missing = [f"`{name}`" for name in shape.tables if name not in tables]
        if missing:
            raise MachineError(f"the program needs tables that it was not given: {', '.join(missing)}")
        for name, rows in shape.tables.items():
            words += self._table(tables[name], rows, f"table `{name}`")
        self.outputs = [aligned_zeros(self.padded, STORED_DTYPE[scalar]) for scalar in shape.result]
        words += [output.ctypes.data for output in self.outputs]
        self.context = aligned_zeros(ARGUMENTS + len(words), np.int64)
        self.context[ITEMS] = items
        self.context[CHUNK] = max(1, -(-chunk // shape.width)) * shape.width
        self.context[ARGUMENTS:] = words
        self.counters = aligned_zeros((max(1, len(shape.profiled)), WORDS), np.int64)
        self.context[PROFILE] = self.counters.ctypes.data

    def _bind(self, scalars: list[str] | int, argument: Argument) -> list[int]:
        if isinstance(scalars, int):
            assert isinstance(argument, MemoryTable), "a table parameter takes a table"
            return self._table(argument, scalars, "a table parameter's table")
        if isinstance(argument, Number):
            return []
        assert not isinstance(argument, MemoryTable)
        values = [np.asarray(leaf) for leaf in argument.leaves]
        return [self._buffer(value, scalar) for value, scalar in zip(values, scalars, strict=True)]

    def _buffer(self, value: np.ndarray, scalar: str) -> int:
        """The address of an aligned copy, padded to whole packets; of a single number, where it is one for all."""
        buffer = aligned_zeros(self.padded if value.ndim else 1, STORED_DTYPE[scalar])
        buffer[: value.size] = value.reshape(-1)
        self.kept.append(buffer)
        return buffer.ctypes.data

    def _table(self, table: MemoryTable, rows: int, what: str) -> list[int]:
        end = table.base + table.count * rows
        if table.base < 0 or table.count < 0 or end > len(table.memory):
            raise MachineError(f"{what} takes rows {table.base} to {end} of a memory that has {len(table.memory)}")
        if table.count == 0:
            # Failed accesses read row 0 in the place of theirs: it must exist.
            empty = aligned_zeros((64, 4), np.float32)
            self.kept.append(empty)
            return [empty.ctypes.data, 0]
        if id(table.memory) not in self.memories:
            # Most tables lie in one memory, and NumPy takes its time to say where.
            self.memories[id(table.memory)] = table.memory.ctypes.data
            self.kept.append(table.memory)
        begin = self.memories[id(table.memory)]
        if begin % ROW_BYTES:
            raise MachineError(f"a memory for this machine begins at a multiple of {ROW_BYTES} bytes")
        return [begin + ROW_BYTES * table.base, table.count]

    def results(self) -> list[np.ndarray]:
        pairs = zip(self.outputs, self.shape.result, strict=True)
        return [out[: self.items] != 0 if scalar == "bool" else out[: self.items] for out, scalar in pairs]

    def profile(self) -> list[EdgeProfile]:
        counts = self.counters.tolist()
        return [EdgeProfile(*edge, *counts[i]) for i, edge in enumerate(self.shape.profiled)]

    def raise_error(self) -> None:
        if not self.context[ERROR]:
            return
        site = self.shape.sites[int(self.context[ERROR]) - 1]
        index = int(self.context[ERROR_INDEX])
        message = f"an access outside table `{site.table}` in module `{site.function.rsplit(':', 1)[-1]}`"
        raise MachineError(str(Diagnostic(message, site.span, found=f"index {index}")))
