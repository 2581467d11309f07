"""Every module is also a function over arrays: `module.map(origins, directions, machine="cpu")`.

An argument of a scalar parameter has shape (n,), of a vec3 (n, 3), of a mat4 (n, 4, 4) (row, column), of a record a
structured array of `Record.numpy_dtype()` or a mapping from field names to arrays; without the first dimension it is
the same for all n items. Imported by `tasuki/__init__`, which installs `Module.map`, and by the renderers.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

from tasuki.diagnostics import MachineError, TasukiError
from tasuki.ir.memory import MemoryTable
from tasuki.ir.types import MAT4, Matrix, Record, Scalar, Table, Tuple, Type, Vector
from tasuki.language.declare import Module
from tasuki.machines.cpu.machine import Argument, Items, Same
from tasuki.native.buffers import aligned_zeros
from tasuki.programs import Filler, Options, executable, link_program

Machine = Literal["cpu", "interpreter", "python"]
DTYPES = {"f32": np.dtype(np.float32), "i32": np.dtype(np.int32), "bool": np.dtype(np.bool_)}


def map_module(
    module: Module,
    /,
    *arguments: Any,
    machine: Machine = "cpu",
    fill: Mapping[str, Filler] | None = None,
    tables: Mapping[str, np.ndarray] | None = None,
    threads: int | None = None,
    width: int | None = None,
    checked: bool = True,
    precision: Any = np.float32,
    **named: Any,
) -> Any:
    """Apply a module to every element of arrays; an array, or a tuple of them, as the module's result is.

    `fill` fills the sockets that it reaches, `tables` binds named tables to structured arrays (which it may change).
    `machine`: "cpu" (SIMD machine code, `threads` threads, packets of `width` lanes), "interpreter" (the definition;
    also in `precision` float64) or "python" (item by item, in CPython). Raises TasukiError where arguments do not fit.
    """
    call = _Call(module, _in_order(module, arguments, named), tables or {})
    if machine == "cpu":
        leaves = call.on_cpu(fill or {}, threads or os.cpu_count() or 1, width or 0, checked)
    elif machine == "interpreter":
        leaves = call.on_interpreter(fill or {}, width, np.dtype(precision))
    elif machine == "python":
        leaves = call.in_python()
    else:
        raise TasukiError(f"unknown machine {machine!r}; known: cpu, interpreter, python")
    call.write_back()
    return from_leaves(module.signature.result, leaves)


def _in_order(module: Module, arguments: Sequence[Any], named: Mapping[str, Any]) -> list[Any]:
    names = module.parameters
    given = dict(zip(names, arguments, strict=False)) | dict(named)
    if len(arguments) > len(names) or set(given) != set(names) or len(given) != len(arguments) + len(named):
        raise TasukiError(f"`{module.name}` takes ({', '.join(names)}), each once")
    return [given[name] for name in names]


class _Call:
    """The arguments of one call, as leaves."""

    def __init__(self, module: Module, arguments: Sequence[Any], tables: Mapping[str, np.ndarray]) -> None:
        self.module = module
        self.types = module.signature.parameters
        self.tables = {name: TableArray(name, array) for name, array in tables.items()}
        self.arguments: list[list[np.ndarray] | TableArray] = []
        for name, type_, value in zip(module.parameters, self.types, arguments, strict=True):
            if isinstance(type_, Table):
                self.arguments.append(TableArray(name, np.asarray(value)))
            else:
                self.arguments.append(to_leaves(type_, value, f"argument `{name}` of `{module.name}`"))
        self.items = self._count()

    def _count(self) -> int:
        lengths = {
            name: len(leaves[0])
            for name, leaves in zip(self.module.parameters, self.arguments, strict=True)
            if isinstance(leaves, list) and leaves[0].ndim
        }
        if len(set(lengths.values())) > 1:
            raise TasukiError(f"`{self.module.name}`: arguments of different lengths: {lengths}")
        return next(iter(lengths.values()), 1)

    def on_cpu(self, fill: Mapping[str, Filler], threads: int, width: int, checked: bool) -> list[np.ndarray]:
        bindings = tuple("items" if isinstance(a, list) and a[0].ndim else "same" for a in self.arguments)
        program = executable(self.module, Options(bindings, width, checked), fill)  # type: ignore[arg-type]
        arguments: list[Argument] = []
        for argument in self.arguments:
            if isinstance(argument, TableArray):
                arguments.append(argument.table)
            else:
                arguments.append(Items(argument) if argument[0].ndim else Same([leaf.item() for leaf in argument]))
        named = {name: table.table for name, table in self.tables.items()}
        return program.run(arguments, self.items, tables=named, threads=min(threads, -(-self.items // 1024)))

    def on_interpreter(self, fill: Mapping[str, Filler], width: int | None, precision: np.dtype) -> list[np.ndarray]:
        from tasuki.ir.interpret import interpret

        program = link_program(self.module, fill)
        arguments = [a.table if isinstance(a, TableArray) else a for a in self.arguments]
        named = {name: table.table for name, table in self.tables.items()}
        return interpret(program, arguments, lanes=self.items, tables=named, precision=precision, width=width)

    def in_python(self) -> list[np.ndarray]:
        from tasuki.language.plain import tables as bind
        from tasuki.language.values import from_leaves as value_of
        from tasuki.language.values import leaves as leaves_of

        rows: list[list[Any]] = []
        result = self.module.signature.result
        with bind({name: table.table for name, table in self.tables.items()}):
            for item in range(self.items):
                values = []
                for type_, argument in zip(self.types, self.arguments, strict=True):
                    if isinstance(argument, TableArray):
                        raise MachineError("a table parameter cannot be mapped in plain Python; bind a named table")
                    values.append(value_of(type_, [leaf[item] if leaf.ndim else leaf[()] for leaf in argument]))
                rows.append(list(leaves_of(self.module(*values))) if result.leaves else [])
        columns = zip(*rows, strict=True)
        return [np.array(column, DTYPES[s]) for column, s in zip(columns, result.leaves, strict=True)]

    def write_back(self) -> None:
        for table in [*self.tables.values(), *(a for a in self.arguments if isinstance(a, TableArray))]:
            table.write_back()


class TableArray:
    """A structured array given as a table: used in place where its memory allows that, else copied out and back."""

    def __init__(self, name: str, array: np.ndarray) -> None:
        rows, rest = divmod(array.dtype.itemsize, 16)
        if array.dtype.fields is None or rest or array.ndim != 1:
            raise TasukiError(f"table `{name}`: expected a one-dimensional array of a record's numpy_dtype()")
        self.array = array
        fits = array.flags.c_contiguous and array.ctypes.data % 16 == 0
        words = len(array) * rows
        if fits:
            self.memory = array.view(np.uint8).view(np.float32).reshape(words, 4)
        else:
            self.memory = aligned_zeros((words, 4), np.float32)
            self.memory.reshape(-1).view(array.dtype)[:] = array
        self.copied = not fits

    @property
    def table(self) -> MemoryTable:
        return MemoryTable(self.memory, 0, len(self.array))

    def write_back(self) -> None:
        if self.copied and self.array.flags.writeable:
            self.array[:] = self.memory.reshape(-1).view(self.array.dtype)


# --- arrays and leaves ------------------------------------------------------------------------------------------------


def to_leaves(type_: Type, value: Any, what: str) -> list[np.ndarray]:
    """The leaves of an argument: arrays of shape (n,), or () where it is the same for all items."""
    if isinstance(type_, Record):
        return _record_leaves(type_, value, what)
    if isinstance(type_, Tuple):
        return [leaf for i, item in enumerate(type_.items) for leaf in to_leaves(item, value[i], what)]
    shape = _shape(type_)
    array = np.asarray(value)
    if array.dtype.kind not in "bifu":
        raise TasukiError(f"{what}: expected {type_}, found an array of {array.dtype}")
    if array.ndim not in (len(shape), len(shape) + 1) or array.shape[array.ndim - len(shape) :] != shape:
        expected = " or ".join(str(s).replace("'", "") for s in ((*("n",), *shape), shape))
        raise TasukiError(f"{what}: expected shape {expected} for {type_}, found {array.shape}")
    if isinstance(type_, Matrix):
        array = np.swapaxes(array, -1, -2)
    flat = array.reshape(*array.shape[: array.ndim - len(shape)], -1)
    return [_narrow(flat[..., i], scalar, what) for i, scalar in enumerate(type_.leaves)]


def _narrow(array: np.ndarray, scalar: str, what: str) -> np.ndarray:
    if scalar != "f32" and array.dtype.kind == "f":
        raise TasukiError(f"{what}: expected {scalar}, found an array of {array.dtype}")
    return np.ascontiguousarray(array.astype(DTYPES[scalar])).reshape(array.shape)


def _record_leaves(type_: Record, value: Any, what: str) -> list[np.ndarray]:
    def field(name: str) -> Any:
        try:
            if isinstance(value, Mapping) or (isinstance(value, np.ndarray | np.void) and value.dtype.fields):
                return value[name]
            return _plain(getattr(value, name))
        except (KeyError, ValueError, AttributeError):
            raise TasukiError(f"{what}: expected a record {type_} with a field `{name}`") from None

    columns = [(member, to_leaves(member, field(name), f"{what}, field `{name}`")) for name, member in type_.fields]
    leaves = [leaf for _, column in columns for leaf in column]
    length = max((len(leaf) for leaf in leaves if leaf.ndim), default=None)
    if length is None:
        return leaves
    return [leaf if leaf.ndim else np.full(length, leaf) for leaf in leaves]


def _plain(value: Any) -> Any:
    """A value of `tasuki.language.values` as something that NumPy understands."""
    from tasuki.language.values import leaves

    try:
        flat = [np.asarray(leaf).item() for leaf in leaves(value)]
    except TypeError:
        return value
    return flat[0] if len(flat) == 1 else flat


def from_leaves(type_: Type, leaves: Sequence[np.ndarray]) -> Any:
    """The arrays of a result: as `to_leaves` takes them."""
    if isinstance(type_, Scalar):
        return leaves[0]
    if isinstance(type_, Vector):
        return np.stack(leaves, axis=-1)
    if isinstance(type_, Matrix):
        return np.swapaxes(np.stack(leaves, axis=-1).reshape(-1, 4, 4), -1, -2)
    parts = {name: from_leaves(member, [leaves[i] for i in type_.leaf_range(name)]) for name, member in type_.members}
    if isinstance(type_, Tuple):
        return tuple(parts.values()) if parts else None
    formats = [(name, part.dtype, part.shape[1:]) for name, part in parts.items()]
    record = np.zeros(len(leaves[0]), formats)
    for name, part in parts.items():
        record[name] = part
    return record


def _shape(type_: Type) -> tuple[int, ...]:
    if isinstance(type_, Vector):
        return (type_.size,)
    return (4, 4) if type_ == MAT4 else ()
