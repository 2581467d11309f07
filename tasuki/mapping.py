"""Every module is also a function over arrays: `module.map(origins, directions, machine="cpu")`.

An argument of a scalar parameter has shape (n,), of a vec3 (n, 3), of a mat4 (n, 4, 4) (row, column), of a record a
structured array of `Record.numpy_dtype()` or a mapping from field names to arrays; without the first dimension it is
the same for all n items. Imported by `tasuki/__init__`, which installs `Module.map`, and by the renderers.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from typing import Any, Literal

import numpy as np

from tasuki.diagnostics import LinkError, MachineError, TasukiError
from tasuki.ir.memory import MemoryTable
from tasuki.ir.types import MAT4, Matrix, Record, Scalar, Table, Tuple, Type, Vector
from tasuki.language.declare import Case, Module
from tasuki.language.link import reached_sockets
from tasuki.language.tables import record_dtype
from tasuki.machines.cpu.machine import Argument, Items, Same
from tasuki.native.buffers import aligned_zeros
from tasuki.programs import Filler, Options, executable, link_program

Machine = Literal["cpu", "pu", "interpreter", "python"]
MACHINES = ("cpu", "pu", "interpreter", "python")
ArithmeticName = Literal["ieee", "pu"]
ARITHMETICS = ("ieee", "pu")
DTYPES = {"f32": np.dtype(np.float32), "i32": np.dtype(np.int32), "bool": np.dtype(np.bool_)}
MOST_THREADS = 1 << 10
MOST_LANES = 1 << 10
PRECISIONS = (np.dtype(np.float32), np.dtype(np.float64))


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
    arithmetic: ArithmeticName = "ieee",
    **named: Any,
) -> Any:
    """Apply a module to every element of arrays; an array, or a tuple of them, as the module's result is.

    `fill` fills the sockets that it reaches, `tables` binds named tables to structured arrays (which it may change).
    `machine`: "cpu" (SIMD machine code, `threads` threads, packets of `width` lanes), "pu" (microcode on the simulated
    processor unit, item by item), "interpreter" (the definition; also in `precision` float64, and with the processor
    unit's `arithmetic`) or "python" (item by item, in CPython). With no argument that has items there is one.
    Raises TasukiError where arguments do not fit.
    """
    number_format = _checked_options(machine, threads, width, precision, arithmetic)
    call = _Call(module, _in_order(module, arguments, named), tables or {})
    fillers = _checked_fillers(fill or {})
    if machine == "cpu":
        leaves = call.on_cpu(fillers, threads or os.cpu_count() or 1, width or 0, checked)
    elif machine == "pu":
        leaves = call.on_pu(fillers, checked)
    elif machine == "interpreter":
        leaves = call.on_interpreter(fillers, width, number_format, arithmetic)
    else:
        leaves = call.in_python(fillers)
    call.write_back()
    return from_leaves(module.signature.result, leaves)


def _checked_options(machine: str, threads: Any, width: Any, precision: Any, arithmetic: Any) -> np.dtype:
    """The precision as a dtype. TasukiError where one of the options does not exist."""
    if machine not in MACHINES:
        raise TasukiError(f"unknown machine {machine!r}; known: {', '.join(MACHINES)}")
    for name, value, most in (("threads", threads, MOST_THREADS), ("width", width, MOST_LANES)):
        if value is not None and not (isinstance(value, int | np.integer) and 1 <= value <= most):
            raise TasukiError(f"{name}: expected a whole number from 1 to {most}, found {value!r}")
    number_format = next((one for one in PRECISIONS if precision in (one, one.name, one.type)), None)
    if number_format is None:
        raise TasukiError(f"precision: expected float32 or float64, found {precision!r}")
    if number_format != np.float32 and machine != "interpreter":
        raise TasukiError(f"machine {machine!r} computes in float32; machine 'interpreter' also in float64")
    if arithmetic not in ARITHMETICS:
        raise TasukiError(f"arithmetic: expected {' or '.join(ARITHMETICS)}, found {arithmetic!r}")
    if arithmetic != "ieee" and (machine != "interpreter" or number_format != np.float32):
        raise TasukiError("only machine 'interpreter' computes in the arithmetic of another, and in float32")
    return number_format


def _checked_fillers(fill: Mapping[str, Filler]) -> Mapping[str, Filler]:
    """`fill` as it is; fillers of sockets that are not reached do no harm. LinkError where one cannot fill anything."""
    for name, filler in fill.items():
        is_cases = isinstance(filler, list | tuple) and all(isinstance(case, Case) for case in filler)
        if not (is_cases or isinstance(filler, Module)):
            raise LinkError(f"socket `{name}`: expected a module, or a list of cases, found {filler!r}")
    return fill


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
        self.tables = {name: TableArray(name, np.asarray(array)) for name, array in tables.items()}
        self.arguments: list[list[np.ndarray] | TableArray] = []
        for name, type_, value in zip(module.parameters, self.types, arguments, strict=True):
            if isinstance(type_, Table):
                self.arguments.append(TableArray(name, np.asarray(value), type_.record))
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
        return program.run(arguments, self.items, tables=self._named(), threads=min(threads, -(-self.items // 1024)))

    def on_pu(self, fill: Mapping[str, Filler], checked: bool) -> list[np.ndarray]:
        from tasuki.machines.pu.lower import Executable

        executable = Executable(link_program(self.module, fill), checked=checked)
        return executable.run(self._tables_and_leaves(), self.items, tables=self._named())

    def on_interpreter(
        self, fill: Mapping[str, Filler], width: int | None, precision: np.dtype, arithmetic: ArithmeticName
    ) -> list[np.ndarray]:
        from tasuki.ir.arithmetic import IEEE
        from tasuki.ir.interpret import interpret
        from tasuki.machines.pu.lower import ARITHMETIC

        return interpret(
            link_program(self.module, fill),
            self._tables_and_leaves(),
            lanes=self.items,
            tables=self._named(),
            precision=precision,
            width=width,
            arithmetic=ARITHMETIC if arithmetic == "pu" else IEEE,
        )

    def _tables_and_leaves(self) -> list[list[np.ndarray] | MemoryTable]:
        return [a.table if isinstance(a, TableArray) else a for a in self.arguments]

    def _named(self) -> dict[str, MemoryTable]:
        return {name: table.table for name, table in self.tables.items()}

    def in_python(self, fill: Mapping[str, Filler]) -> list[np.ndarray]:
        from tasuki.language.plain import tables as bind

        link_program(self.module, fill)  # what is wrong is told as on the other machines
        with ExitStack() as stack:
            stack.enter_context(bind({name: table.table for name, table in self.tables.items()}))
            for name, socket in reached_sockets(self.module, fill).items():
                stack.enter_context(socket.filled(fill[name]))
            rows = [self._one_in_python(item) for item in range(self.items)]
        scalars = self.module.signature.result.leaves
        return [np.array([row[i] for row in rows], DTYPES[scalar]) for i, scalar in enumerate(scalars)]

    def _one_in_python(self, item: int) -> list[Any]:
        """The leaves of the result for one item."""
        from tasuki.language.values import from_leaves as value_of
        from tasuki.language.values import leaves as leaves_of

        values = []
        for type_, argument in zip(self.types, self.arguments, strict=True):
            if isinstance(argument, TableArray):
                values.append(argument.table)
            else:
                values.append(value_of(type_, [leaf[item] if leaf.ndim else leaf[()] for leaf in argument]))
        result = self.module(*values)
        return [] if result is None else list(leaves_of(result))

    def write_back(self) -> None:
        for table in [*self.tables.values(), *(a for a in self.arguments if isinstance(a, TableArray))]:
            table.write_back()


class TableArray:
    """A structured array given as a table: used in place where its memory allows that, else copied out and back."""

    def __init__(self, name: str, array: np.ndarray, record: Record | None = None) -> None:
        rows, rest = divmod(array.dtype.itemsize, 16)
        if array.dtype.fields is None or rest or array.ndim != 1:
            found = f"an array of {array.dtype}, shape {array.shape}"
            raise TasukiError(f"table `{name}`: expected a one-dimensional array of a record's numpy_dtype(); {found}")
        if record is not None and array.dtype != record_dtype(record):
            raise TasukiError(f"table `{name}`: expected records of {record}.numpy_dtype(), found {array.dtype}")
        self.name = name
        self.array = array
        # What must not be written is copied, since machine code does not ask.
        self.copied = not (array.flags.c_contiguous and array.ctypes.data % 16 == 0 and array.flags.writeable)
        words = len(array) * rows
        if self.copied:
            self.memory = aligned_zeros((words, 4), np.float32)
            self.memory.reshape(-1).view(array.dtype)[:] = array
            self.memory.flags.writeable = array.flags.writeable
        else:
            self.memory = array.view(np.uint8).view(np.float32).reshape(words, 4)
        self._before = None if array.flags.writeable else self.memory.tobytes()

    @property
    def table(self) -> MemoryTable:
        return MemoryTable(self.memory, 0, len(self.array))

    def write_back(self) -> None:
        """Bring what was stored to where the array has it. MachineError where the array may not be written."""
        if self._before is not None:
            if self.memory.tobytes() != self._before:
                raise MachineError(f"a store to table `{self.name}`, whose array is read-only")
        elif self.copied:
            self.array[:] = self.memory.reshape(-1).view(self.array.dtype)


# --- arrays and leaves ------------------------------------------------------------------------------------------------


def to_leaves(type_: Type, value: Any, what: str) -> list[np.ndarray]:
    """The leaves of an argument: arrays of shape (n,), or () where it is the same for all items."""
    if isinstance(type_, Record):
        return _record_leaves(type_, value, what)
    if isinstance(type_, Tuple):
        return [leaf for i, item in enumerate(type_.items) for leaf in to_leaves(item, value[i], what)]
    shape = _shape(type_)
    try:
        array = np.asarray(value)
    except ValueError:
        raise TasukiError(f"{what}: expected {type_}, found rows of different lengths") from None
    if array.dtype.kind not in "bifu":
        raise TasukiError(f"{what}: expected {type_}, found an array of {array.dtype}")
    if array.ndim not in (len(shape), len(shape) + 1) or array.shape[array.ndim - len(shape) :] != shape:
        expected = " or ".join(str(s).replace("'", "") for s in ((*("n",), *shape), shape))
        raise TasukiError(f"{what}: expected shape {expected} for {type_}, found {array.shape}")
    if isinstance(type_, Matrix):
        array = np.swapaxes(array, -1, -2)
    flat = array.reshape(*array.shape[: array.ndim - len(shape)], len(type_.leaves))
    return [_narrow(flat[..., i], scalar, what) for i, scalar in enumerate(type_.leaves)]


def _narrow(array: np.ndarray, scalar: str, what: str) -> np.ndarray:
    # An empty list is an array of float64 to NumPy.
    if scalar != "f32" and array.dtype.kind == "f" and array.size:
        raise TasukiError(f"{what}: expected {scalar}, found an array of {array.dtype}")
    limits = np.iinfo(np.int32)
    if scalar == "i32" and array.size and not (limits.min <= array.min() and array.max() <= limits.max):
        found = array.max() if array.max() > limits.max else array.min()
        raise TasukiError(f"{what}: expected i32, {limits.min} to {limits.max}, found {found}")
    with np.errstate(over="ignore"):  # to infinity: that is what rounding to f32 means
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
    lengths = {len(leaf) for leaf in leaves if leaf.ndim}
    if len(lengths) > 1:
        raise TasukiError(f"{what}: fields of different lengths: {sorted(lengths)}")
    if not lengths:
        return leaves
    [length] = lengths
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
