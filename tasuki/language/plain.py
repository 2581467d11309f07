"""Modules as plain Python: one lane, on the value types of `tasuki.language.values`, with the user's own lines.

`call_plain` runs a module's source in CPython, slightly rewritten (`tasuki.language.rewrite`), under its original file
name and line numbers: a breakpoint in the file works, and the locals that a debugger shows are values of the language.
Tables are read and written where `tables` has bound them to memory. The results are those of the interpreter, bit for
bit; which NaN an operation returns is not defined there either.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from types import FunctionType, MappingProxyType
from typing import Any

import numpy as np

from tasuki.diagnostics import MachineError
from tasuki.ir.memory import Access, BoundTable, MemoryTable
from tasuki.ir.nodes import AtomicOperation
from tasuki.ir.paths import at_path
from tasuki.ir.types import BANKS, Array, Record, Type
from tasuki.ir.types import I32 as I32_TYPE
from tasuki.ir.types import Table as TableType
from tasuki.language.conversion import convert, updated
from tasuki.language.declare import Module
from tasuki.language.rewrite import plain_function
from tasuki.language.tables import Table
from tasuki.language.values import F32, I32, evaluate, from_leaves, leaves

_DTYPES = {"f32": np.dtype(np.float32), "i32": np.dtype(np.int32), "bool": np.dtype(np.bool_)}
_ONE_LANE = np.ones(1, bool)

_tables: ContextVar[Mapping[str, MemoryTable]] = ContextVar("tables", default=MappingProxyType({}))
_running: ContextVar[str] = ContextVar("running module", default="plain Python")


def call_plain(module: Module, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
    """Runs `module` on one lane.

    Arguments are converted to its parameters' types, the result to its result's. Raises SourceError where the module
    does not check, TypeError where an argument does not fit, MachineError for an access outside a table.
    """
    function = _function(module)
    values = _bind(module, args, kwargs)
    running = _running.set(module.name)
    try:
        result = function(*values)
    finally:
        _running.reset(running)
    return convert(module.signature.result, result)


def _function(module: Module) -> FunctionType:
    """The function that runs as `module`: rewritten once for as long as the module's checking holds."""
    checked = module.check()
    if module.plain is None or module.plain[0] is not checked:
        module.plain = checked, plain_function(module, checked.function, Runtime(checked.function.variables))
    return module.plain[1]


def _bind(module: Module, args: Sequence[Any], kwargs: Mapping[str, Any]) -> list[Any]:
    """The arguments in the order of the parameters, each a value of its type."""
    given = dict(zip(module.parameters, args, strict=False))
    takes = f"{module.name} takes ({', '.join(module.parameters)})"
    if len(args) > len(module.parameters):
        raise TypeError(f"{takes}; found {len(args)} arguments")
    for name in kwargs:
        if name in given or name not in module.parameters:
            raise TypeError(f"{takes}; {name} is {'given twice' if name in given else 'not among them'}")
    given |= kwargs
    values = []
    for name, type_ in zip(module.parameters, module.signature.parameters, strict=True):
        if name not in given:
            raise TypeError(f"{takes}; {name} is missing")
        try:
            values.append(_argument(name, type_, given[name]))
        except TypeError as error:
            raise TypeError(f"{module.name}, argument {name}: {error}") from None
    return values


def _argument(name: str, type_: Type, value: Any) -> Any:
    if not isinstance(type_, TableType):
        return convert(type_, value)
    if isinstance(value, Table):
        value = bound(value)
    elif isinstance(value, MemoryTable):
        value = PlainTable(BoundTable(name, type_.record, value))
    if not isinstance(value, PlainTable) or value.record != type_.record:
        raise TypeError(f"expected {type_}, found {value!r}")
    return value


# --- tables ---------------------------------------------------------------------------------------------------------


@contextmanager
def tables(memory: Mapping[str, MemoryTable]) -> Iterator[None]:
    """While the context lasts, the named tables stand in `memory`; tables that it does not name stay as they were."""
    before = _tables.set({**_tables.get(), **memory})
    try:
        yield
    finally:
        _tables.reset(before)


def bound(table: Table) -> PlainTable:
    """The named table where it stands now. MachineError where `tables` has not bound it."""
    memory = _tables.get().get(table.name or "")
    if memory is None:
        raise MachineError(f"table `{table.name}` stands in no memory: run within `with tables({{...}}):`")
    return PlainTable(BoundTable(table.name or "", table.record.ir, memory))


def memory_table(records: Sequence[Any]) -> MemoryTable:
    """A table of its own memory that holds these records, values of one type; at least one."""
    record = type(records[0]).ir
    table = MemoryTable(np.zeros((len(records) * record.rows, BANKS), np.float32), 0, len(records))
    plain = PlainTable(BoundTable(record.name, record, table))
    for index, value in enumerate(records):
        plain[index] = value
    return table


class PlainTable:
    """A table in memory, as plain Python reads and writes it: records are values, indices are checked."""

    def __init__(self, table: BoundTable) -> None:
        self._table = table

    @property
    def record(self) -> Record:
        return self._table.record

    def __len__(self) -> int:
        return self._table.view.count

    def __iter__(self) -> Iterator[Any]:
        return (self.load(index) for index in range(len(self)))

    def __getitem__(self, index: Any) -> Any:
        return self.load(index)

    def __setitem__(self, index: Any, value: Any) -> None:
        self.store(index, (), value)

    def load(self, index: Any, path: Sequence[str] = ()) -> Any:
        """The record at `index`, or the member of it at `path`."""
        member, place = at_path(self.record, path)
        dtypes = [_DTYPES[leaf] for leaf in member.leaves]
        words = self._table.gather(_lane(index), place, dtypes, _access())
        return from_leaves(member, [word[0].item() for word in words])

    def store(self, index: Any, path: Sequence[str], value: Any) -> None:
        """The record at `index`, or the member of it at `path`, becomes `value`."""
        member, place = at_path(self.record, path)
        flat = zip(leaves(convert(member, value)), member.leaves, strict=True)
        self._table.scatter(_lane(index), place, [np.array([v], _DTYPES[leaf]) for v, leaf in flat], _access())

    def atomic(self, operation: AtomicOperation, index: Any, path: Sequence[str], value: Any) -> I32:
        """The i32 at `path` becomes operation(it, value); gives what it was."""
        _, place = at_path(self.record, path)
        [before] = self._table.update(_lane(index), place.start, operation, _lane(value), _access())
        return I32(before)

    def __repr__(self) -> str:
        return f"<table {self._table.name} of {len(self)} {self.record}>"


def _lane(number: Any) -> np.ndarray:
    return np.array([convert(I32_TYPE, number)], np.int32)


def _access() -> Access:
    return Access(_running.get(), _ONE_LANE, first_lane=0, checked=True, span=None)


# --- what rewritten functions call ----------------------------------------------------------------------------------


class LocalArray:
    """A local array: zero when its life begins, indices clamped to it."""

    def __init__(self, type_: Array) -> None:
        self._type = type_
        self._items = [from_leaves(type_.item, [0] * len(type_.item.leaves))] * type_.length

    def _clamped(self, index: Any) -> int:
        return min(max(int(index), 0), self._type.length - 1)

    def __len__(self) -> int:
        return self._type.length

    def __getitem__(self, index: Any) -> Any:
        return self.load(index)

    def load(self, index: Any, path: Sequence[str] = ()) -> Any:
        value = self._items[self._clamped(index)]
        for name in path:
            value = getattr(value, name)
        return value

    def store(self, index: Any, path: Sequence[str], value: Any) -> None:
        position = self._clamped(index)
        self._items[position] = updated(self._items[position], path, value) if path else convert(self._type.item, value)

    def __repr__(self) -> str:
        return f"<{self._type} {self._items}>"


@dataclass
class Place:
    """An element of a local array or a record of a table, or a member of it."""

    container: LocalArray | PlainTable
    index: Any
    path: tuple[str, ...]

    @property
    def value(self) -> Any:
        return self.container.load(self.index, self.path)

    @value.setter
    def value(self, value: Any) -> None:
        self.container.store(self.index, self.path, value)


class Runtime:
    """What a rewritten function calls, under the name `rewrite.RUNTIME`. `variables` are the types of its variables."""

    def __init__(self, variables: Mapping[str, Type]) -> None:
        self._variables = variables

    f32 = F32
    i32 = I32
    updated = staticmethod(updated)
    operate = staticmethod(evaluate)

    def array(self, name: str) -> LocalArray:
        """The local array `name`, at the beginning of its life."""
        type_ = self._variables[name]
        assert isinstance(type_, Array)
        return LocalArray(type_)

    @staticmethod
    def len(table: Any) -> I32:
        return I32(len(table))

    @staticmethod
    def range(*bounds: Any) -> Iterator[I32]:
        """As the language counts: the bounds are taken once, and the sum with the step wraps."""
        first, last, step = {1: (0, *bounds, 1), 2: (*bounds, 1), 3: bounds}[len(bounds)]
        index, last = I32(first), I32(last)
        while index < last if step > 0 else index > last:
            yield index
            index = index + step

    @staticmethod
    def place(container: Any, index: Any, path: tuple[str, ...]) -> Place:
        return Place(bound(container) if isinstance(container, Table) else container, index, path)

    @staticmethod
    def atomic(operation: AtomicOperation, place: Place, value: Any) -> I32:
        assert isinstance(place.container, PlainTable)
        return place.container.atomic(operation, place.index, place.path, value)
