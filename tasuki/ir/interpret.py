"""The interpreter: the meaning of the IR, as code. `tasuki/ir/__init__.py` says the same in words.

NumPy over all lanes of a packet, with masks for control flow: slow, plain, and the definition that every machine is
held to, bit for bit. In float64 it is the high-precision oracle for the same program: constants keep their float32
values, and operations whose definition is made for float32 use their `oracle`.

A variable that was never assigned reads as zero here, and so does the result of a lane that left a function without
`Return`; the language lets neither happen, and machines need not agree.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tasuki.diagnostics import Diagnostic, MachineError
from tasuki.ir.arithmetic import IEEE, Arithmetic
from tasuki.ir.binding import Argument, bind_arguments, bind_tables, dtype_of
from tasuki.ir.expansions import Term
from tasuki.ir.memory import Access, BoundTable, MemoryTable, Value
from tasuki.ir.nodes import (
    Assign,
    Atomic,
    Break,
    Call,
    Clear,
    Constant,
    Construct,
    Continue,
    Element,
    Expression,
    Function,
    If,
    Length,
    Load,
    Local,
    Loop,
    Member,
    NamedTable,
    Node,
    Operate,
    Program,
    Return,
    SetElement,
    Statement,
    Store,
)
from tasuki.ir.ops import OPERATIONS, Operation
from tasuki.ir.paths import at_path
from tasuki.ir.types import BOOL, F32, I32, Array, Table, Type, Vector

_SCALARS: dict[str, Type] = {"f32": F32, "i32": I32, "bool": BOOL}


def interpret(
    program: Program,
    arguments: Sequence[Argument],
    *,
    lanes: int,
    tables: Mapping[str, MemoryTable] | None = None,
    precision: Any = np.float32,
    width: int | None = None,
    checked: bool = True,
    max_iterations: int | None = None,
    arithmetic: Arithmetic = IEEE,
) -> Value:
    """The result of the program's entry for `lanes` lanes: its leaves, each an array of shape (lanes,); [] for VOID.

    `arguments`: for each parameter its leaves, each of shape (lanes,), or of shape () where all lanes share it; for a
    table parameter a MemoryTable. `tables`: the named tables. Both may be written to by the program.
    `precision`: float32 (the meaning) or float64 (the oracle). `width`: lanes run in packets of that many, one packet
    after another; None makes one packet of all. `checked`: an index outside a table is an error. `max_iterations`: the
    most passes that one run of a loop may take. `arithmetic`: that of a machine, for
    float32, in the place of the meaning.

    The program is taken to be verified. Raises MachineError: arguments that do not fit, a missing table, an index
    outside a table, lanes that disagree in `same_lanes`, a loop over its limit.
    """
    if lanes < 0 or (width is not None and width < 1):
        raise MachineError(f"{lanes} lanes in packets of {width}: lanes are counted from 0, a packet has at least 1")
    precision = np.dtype(precision)
    entry = program.functions[program.entry]
    bound = bind_tables(program, tables or {})
    inputs = bind_arguments(entry, arguments, lanes, precision)
    step = max(1, lanes if width is None else width)
    results = [np.zeros(lanes, dtype_of(leaf, precision)) for leaf in entry.result.leaves]
    for first in range(0, lanes, step):
        packet = slice(first, min(first + step, lanes))
        interpreter = Interpreter(
            program, bound, packet.stop - first, first, precision, checked, max_iterations, arithmetic
        )
        values = [
            argument if isinstance(argument, BoundTable) else [leaf[packet] for leaf in argument] for argument in inputs
        ]
        with np.errstate(all="ignore"):
            outcome = interpreter.call(entry, values, np.ones(packet.stop - first, bool))
        for result, leaf in zip(results, outcome, strict=True):
            result[packet] = leaf
    return results


@dataclass
class _LoopExits:
    """Lanes that left the innermost loop's body early: for good, or until its step."""

    broken: np.ndarray
    continued: np.ndarray


@dataclass
class _Frame:
    """One call of a function. `values` are parameters and variables; `arrays` hold, per leaf, (length, lanes)."""

    function: Function
    values: dict[str, Value] = field(default_factory=dict)
    arrays: dict[str, list[np.ndarray]] = field(default_factory=dict)
    tables: dict[str, BoundTable] = field(default_factory=dict)
    types: dict[str, Type] = field(default_factory=dict)
    result: Value = field(default_factory=list)
    loops: list[_LoopExits] = field(default_factory=list)


@dataclass
class Interpreter:
    """Runs functions of a program for one packet of `lanes` lanes; `first_lane` is the number of its first one."""

    program: Program
    tables: Mapping[str, BoundTable]
    lanes: int
    first_lane: int
    precision: np.dtype
    checked: bool
    max_iterations: int | None
    arithmetic: Arithmetic

    def call(self, function: Function, arguments: Sequence[Value | BoundTable], active: np.ndarray) -> Value:
        """The result of `function` for the active lanes; zero in the others."""
        frame = _Frame(function, types=dict(function.variables))
        for parameter, argument in zip(function.parameters, arguments, strict=True):
            frame.types[parameter.name] = parameter.type
            if isinstance(argument, BoundTable):
                frame.tables[parameter.name] = argument
            else:
                frame.values[parameter.name] = argument
        for name, variable in function.variables.items():
            if isinstance(variable, Array):
                frame.arrays[name] = [
                    np.zeros((variable.length, self.lanes), self._dtype(leaf)) for leaf in variable.item.leaves
                ]
            else:
                frame.values[name] = self._zeros(variable)
        frame.result = self._zeros(function.result)
        self._block(function.body, frame, active)
        return frame.result

    # --- statements: each takes the active lanes and returns those that go on with the next statement ----------------

    def _block(self, statements: Sequence[Statement], frame: _Frame, active: np.ndarray) -> np.ndarray:
        for statement in statements:
            if not active.any():
                break
            active = self._execute(statement, frame, active)
        return active

    def _execute(self, node: Statement, frame: _Frame, active: np.ndarray) -> np.ndarray:
        match node:
            case If():
                return self._if(node, frame, active)
            case Loop():
                return self._loop(node, frame, active)
            case Break():
                frame.loops[-1].broken |= active
                return np.zeros_like(active)
            case Continue():
                frame.loops[-1].continued |= active
                return np.zeros_like(active)
            case Return():
                if node.value is not None:
                    frame.result = _merge(active, self._evaluate(node.value, frame, active), frame.result)
                return np.zeros_like(active)
            case Assign():
                self._assign(node, frame, active)
            case SetElement():
                self._set_element(node, frame, active)
            case Clear():
                for leaf in frame.arrays[node.array]:
                    leaf[:, active] = 0
            case Store():
                self._store(node, frame, active)
            case Atomic():
                self._atomic(node, frame, active)
            case Call():
                self._call(node, frame, active)
        return active

    def _if(self, node: If, frame: _Frame, active: np.ndarray) -> np.ndarray:
        [test] = self._evaluate(node.test, frame, active)
        after_then = self._block(node.then, frame, active & test)
        after_else = self._block(node.orelse, frame, active & ~test)
        return after_then | after_else

    def _loop(self, node: Loop, frame: _Frame, active: np.ndarray) -> np.ndarray:
        done = np.zeros_like(active)
        passes = 0
        while True:
            active = self._block(node.setup, frame, active)
            if not active.any():
                return done
            [test] = self._evaluate(node.test, frame, active)
            done |= active & ~test
            active = active & test
            if not active.any():
                return done
            passes += 1
            if self.max_iterations is not None and passes > self.max_iterations:
                raise self._error(node, frame, "a loop does not end", f"at most {self.max_iterations} passes")
            exits = _LoopExits(np.zeros_like(active), np.zeros_like(active))
            frame.loops.append(exits)
            active = self._block(node.body, frame, active) | exits.continued
            frame.loops.pop()
            done |= exits.broken
            active = self._block(node.step, frame, active)

    def _assign(self, node: Assign, frame: _Frame, active: np.ndarray) -> None:
        value = self._evaluate(node.value, frame, active)
        _, place = at_path(frame.types[node.target], node.path)
        self._set(frame, node.target, place, value, active)

    def _set(self, frame: _Frame, name: str, place: range, value: Value, active: np.ndarray) -> None:
        # A new list of new arrays: other variables and callers may hold the old ones.
        leaves = list(frame.values[name])
        leaves[place.start : place.stop] = _merge(active, value, leaves[place.start : place.stop])
        frame.values[name] = leaves

    def _set_element(self, node: SetElement, frame: _Frame, active: np.ndarray) -> None:
        array = frame.types[node.array]
        assert isinstance(array, Array)
        [index] = self._evaluate(node.index, frame, active)
        value = self._evaluate(node.value, frame, active)
        _, place = at_path(array.item, node.path)
        rows = np.clip(index, 0, array.length - 1)[active]
        for leaf, part in zip(place, value, strict=True):
            frame.arrays[node.array][leaf][rows, np.flatnonzero(active)] = part[active]

    def _store(self, node: Store, frame: _Frame, active: np.ndarray) -> None:
        table = self._table(node.table, frame)
        [index] = self._evaluate(node.index, frame, active)
        value = self._evaluate(node.value, frame, active)
        _, place = at_path(table.record, node.path)
        table.scatter(index, place, value, self._access(node, frame, active))

    def _atomic(self, node: Atomic, frame: _Frame, active: np.ndarray) -> None:
        table = self._table(node.table, frame)
        [index] = self._evaluate(node.index, frame, active)
        [value] = self._evaluate(node.value, frame, active)
        _, place = at_path(table.record, node.path)
        before = table.update(index, place.start, node.operation, value, self._access(node, frame, active))
        if node.target is not None:
            self._set(frame, node.target, range(1), [before], active)

    def _call(self, node: Call, frame: _Frame, active: np.ndarray) -> None:
        function = self.program.functions.get(node.function)
        if function is None:
            raise self._error(node, frame, f"`{node.function}` is called, but nothing of that name is linked")
        arguments = [
            self._table(argument, frame)
            if isinstance(argument, Local | NamedTable) and isinstance(argument.type, Table)
            else self._evaluate(argument, frame, active)
            for argument in node.arguments
        ]
        result = self.call(function, arguments, active)
        if node.target is not None:
            self._set(frame, node.target, range(len(result)), result, active)

    # --- expressions: the leaves of their value; what inactive lanes hold means nothing ------------------------------

    def _evaluate(self, node: Expression, frame: _Frame, active: np.ndarray) -> Value:
        match node:
            case Constant():
                [leaf] = node.type.leaves
                return [np.full(self.lanes, node.value, self._dtype(leaf))]
            case Local():
                return frame.values[node.name]
            case Operate():
                arguments = [self._evaluate(argument, frame, active) for argument in node.arguments]
                return self._operate(node, arguments, frame, active)
            case Member():
                _, place = at_path(node.base.type, (node.name,))
                return self._evaluate(node.base, frame, active)[place.start : place.stop]
            case Element():
                return self._element(node, frame, active)
            case Construct():
                leaves = [leaf for argument in node.arguments for leaf in self._evaluate(argument, frame, active)]
                return leaves * node.type.size if isinstance(node.type, Vector) and len(leaves) == 1 else leaves
            case Load():
                return self._load(node, frame, active)
            case Length():
                return [np.full(self.lanes, self._table(node.table, frame).view.count, np.int32)]
        raise self._error(node, frame, f"{type(node).__name__} is not an expression with a value")

    def _element(self, node: Element, frame: _Frame, active: np.ndarray) -> Value:
        [index] = self._evaluate(node.index, frame, active)
        array = frame.types[node.array]
        assert isinstance(array, Array)
        rows = np.clip(index, 0, array.length - 1)
        return [leaf[rows, np.arange(self.lanes)] for leaf in frame.arrays[node.array]]

    def _load(self, node: Load, frame: _Frame, active: np.ndarray) -> Value:
        table = self._table(node.table, frame)
        [index] = self._evaluate(node.index, frame, active)
        _, place = at_path(table.record, node.path)
        dtypes = [self._dtype(leaf) for leaf in node.type.leaves]
        return table.gather(index, place, dtypes, self._access(node, frame, active))

    # --- operations -----------------------------------------------------------------------------------------------

    def _operate(self, node: Operate, arguments: list[Value], frame: _Frame, active: np.ndarray) -> Value:
        operation = OPERATIONS[node.operation]
        if operation.sort == "lanes":
            return [self._over_lanes(node, arguments[0][0], frame, active)]
        if operation.sort == "composite":
            return self._composite(operation, arguments, [argument.type for argument in node.arguments])
        # Element by element; a scalar goes with every element.
        leaves = node.type.leaves
        spread = [a * len(leaves) if len(a) == 1 else a for a in arguments]
        return [self._primitive(operation, list(column), leaf) for leaf, *column in zip(leaves, *spread, strict=True)]

    def _primitive(self, operation: Operation, arguments: list[np.ndarray], leaf: str) -> np.ndarray:
        reference = operation.oracle if self._oracular(operation) else operation.reference
        if leaf == "f32":
            reference = self.arithmetic.primitives.get(operation.name, reference)
        assert reference is not None
        return np.asarray(reference(*arguments)).astype(self._dtype(leaf), copy=False)

    def _composite(self, operation: Operation, arguments: list[Value], types: list[Type]) -> Value:
        if self._oracular(operation):
            assert operation.oracle is not None
            return [operation.oracle(*(leaf for argument in arguments for leaf in argument))]
        if operation.name in self.arithmetic.functions:
            return [self.arithmetic.functions[operation.name](*(leaf for argument in arguments for leaf in argument))]
        expansion = self.arithmetic.expansions.get(operation.name, operation.expansion)
        assert expansion is not None
        terms = [
            [Term(leaf, scalar, self._apply, self._literal) for leaf, scalar in zip(value, kind.leaves, strict=True)]
            for value, kind in zip(arguments, types, strict=True)
        ]
        return [term.value for term in expansion(*terms)]

    def _oracular(self, operation: Operation) -> bool:
        return operation.oracle is not None and self.precision == np.float64

    def _apply(self, name: str, values: list[np.ndarray], scalars: list[str]) -> np.ndarray:
        operation = OPERATIONS[name]
        result = operation.result([_SCALARS[scalar] for scalar in scalars])
        assert result is not None, f"{name} of {scalars}"
        return self._primitive(operation, values, str(result))

    def _literal(self, number: float | int, scalar: str) -> np.ndarray:
        # An f32 literal is rounded to float32 in float64 too: it is a constant of the program like any other.
        value = np.float32(number) if scalar == "f32" else number
        return np.full(self.lanes, value, self._dtype(scalar))

    def _over_lanes(self, node: Operate, value: np.ndarray, frame: _Frame, active: np.ndarray) -> np.ndarray:
        match node.operation:
            case "any_lane":
                return np.full(self.lanes, value[active].any())
            case "all_lanes":
                return np.full(self.lanes, value[active].all())
            case "count_lanes":
                return np.full(self.lanes, np.count_nonzero(value[active]), np.int32)
        assert node.operation == "same_lanes"
        if not _all_identical(value[active]):
            found = ", ".join(map(str, np.unique(value[active])[:4]))
            raise self._error(node, frame, "lanes disagree in same_lanes", "one value in all active lanes", found)
        return value

    # --- small things -----------------------------------------------------------------------------------------------

    def _table(self, node: Expression, frame: _Frame) -> BoundTable:
        if isinstance(node, NamedTable):
            return self.tables[node.name]
        assert isinstance(node, Local)
        return frame.tables[node.name]

    def _access(self, node: Node, frame: _Frame, active: np.ndarray) -> Access:
        return Access(frame.function.name, active, self.first_lane, self.checked, node.span)

    def _error(
        self, node: Node, frame: _Frame, message: str, expected: str | None = None, found: str | None = None
    ) -> MachineError:
        return MachineError(str(Diagnostic(f"{message} (in `{frame.function.name}`)", node.span, expected, found)))

    def _dtype(self, leaf: str) -> np.dtype:
        return dtype_of(leaf, self.precision)

    def _zeros(self, kind: Type) -> Value:
        return [np.zeros(self.lanes, self._dtype(leaf)) for leaf in kind.leaves]


def _merge(active: np.ndarray, new: Value, old: Value) -> Value:
    return [np.where(active, a, b) for a, b in zip(new, old, strict=True)]


def _all_identical(values: np.ndarray) -> bool:
    """Whether no operation can tell the values apart: -0.0 is not 0.0, any NaN is any other."""
    if values.dtype.kind != "f":
        return bool(np.all(values == values[0]))
    is_nan = np.isnan(values)
    same_value = (values == values[0]) & (np.signbit(values) == np.signbit(values[0]))
    return bool(is_nan.all() or same_value.all())
