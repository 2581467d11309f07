"""Random well-typed programs that end, for hypothesis: what every machine is held to the interpreter with.

    @given(st.data())
    def test(data):
        program = data.draw(random_programs(lane_operations=True))
        arguments = data.draw(random_arguments(program, lanes=8))

The programs have parameters of every scalar and vector type, calls, branches, bounded loops with break, continue and
early return, local arrays and records; expressions use every operation of the table. What the IR leaves undefined does
not show: which NaN it is (the sign or bits of a NaN are never looked at), and what a variable holds unassigned.
`lane_operations` adds any_lane, all_lanes and count_lanes (results then depend on the packets), and same_lanes where it
holds. `tables` adds loads from the table "source" at indices within it, and stores to the lane's own row of "sink".
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from hypothesis import strategies as st

from tasuki.ir import nodes as n
from tasuki.ir.memory import MemoryTable
from tasuki.ir.ops import OPERATIONS
from tasuki.ir.types import BOOL, F32, I32, MAT4, VEC3, VEC4, Array, Record, Table, Tuple, Type
from tests.ir.build import b, construct, element, f, function, i, load, local, member, op, program

HIT = Record("Hit", (("t", F32), ("row", I32), ("normal", VEC3), ("inside", BOOL)))
KINDS = (F32, I32, BOOL, VEC3, VEC4, MAT4, HIT)
RESULT = Tuple((F32, I32, BOOL, VEC3, HIT))
SOURCE = n.NamedTable("source", Table(HIT))
SINK = n.NamedTable("sink", Table(HIT))
SOURCE_COUNT = 5

NASTY_F32 = [
    0.0, -0.0, 1.0, -1.0, 0.5, 1.5, 2.0, 3.0, -7.25, 0.1, 1e-7, 1e7, 16777217.0,
    2147483648.0, -2147483648.0, 3e9, 8191.5,
    1.1754943508222875e-38, 1.401298464324817e-45, -1e-40, 3.4028234663852886e38, -3.4028234663852886e38,
    float("inf"), float("-inf"), float("nan"),
]  # fmt: skip
NASTY_I32 = [
    0,
    1,
    -1,
    2,
    3,
    4,
    7,
    -8,
    31,
    32,
    33,
    255,
    2**24 + 1,
    2**31 - 1,
    -(2**31),
    0x7F800000,
    0x7FC00001,
    0x00000001,
]

f32_values = st.sampled_from(NASTY_F32) | st.floats(width=32)
i32_values = st.sampled_from(NASTY_I32) | st.integers(-(2**31), 2**31 - 1)


@st.composite
def random_programs(
    draw: Callable[..., Any], *, lane_operations: bool = False, tables: bool = False, size: int = 4
) -> n.Program:
    """A program whose entry `main` takes a `lane: i32` (the lane's number), then values, and returns RESULT.

    `size` bounds the statements of a block.
    """
    helpers: list[n.Function] = []
    for position in range(draw(st.integers(0, 2))):
        maker = _Maker(draw, helpers[:], lane_operations, False, size)
        helpers.append(maker.function(f"helper{position}", draw(st.sampled_from(KINDS))))
    main = _Maker(draw, helpers, lane_operations, tables, size).function("main", RESULT, is_entry=True)
    return program(main, *helpers, tables={"source": HIT, "sink": HIT} if tables else {})


def random_arguments(of: n.Program, lanes: int) -> st.SearchStrategy[tuple[list[np.ndarray], ...]]:
    """Leaves of shape (lanes,) for each parameter of the entry; `lane` counts from 0."""
    return st.tuples(
        *(
            st.just([np.arange(lanes, dtype=np.int32)]) if parameter.name == "lane" else _leaves(parameter.type, lanes)
            for parameter in of.functions[of.entry].parameters
        )
    )


@st.composite
def random_tables(draw: Callable[..., Any], lanes: int) -> dict[str, MemoryTable]:
    """Memory for the tables "source" (any values) and "sink" (a record for each lane, zero), in one image."""
    source_rows = SOURCE_COUNT * HIT.rows
    memory = np.zeros((source_rows + lanes * HIT.rows, 4), np.float32)
    words = draw(st.lists(i32_values, min_size=source_rows * 4, max_size=source_rows * 4))
    memory.view(np.int32)[:source_rows] = np.array(words, np.int64).astype(np.int32).reshape(-1, 4)
    return {"source": MemoryTable(memory, 0, SOURCE_COUNT), "sink": MemoryTable(memory, source_rows, lanes)}


def same_bits(one: np.ndarray, other: np.ndarray) -> bool:
    """Equal bit for bit; any NaN equals any NaN."""
    if one.dtype != other.dtype or one.shape != other.shape:
        return False
    if one.dtype != np.float32:
        return bool(np.array_equal(one, other))
    either = (one.view(np.int32) == other.view(np.int32)) | (np.isnan(one) & np.isnan(other))
    return bool(either.all())


@st.composite
def _leaves(draw: Callable[..., Any], kind: Type, lanes: int) -> list[np.ndarray]:
    values = {"f32": f32_values, "i32": i32_values, "bool": st.booleans()}
    dtypes = {"f32": np.float32, "i32": np.int32, "bool": np.bool_}
    return [
        np.array(draw(st.lists(values[leaf], min_size=lanes, max_size=lanes)), dtypes[leaf]) for leaf in kind.leaves
    ]


def _producers(lane_operations: bool) -> dict[Type, list[tuple[str, tuple[Type, ...]]]]:
    """For each type the operations, with the types of their arguments, that give it: straight from the table."""
    found: dict[Type, list[tuple[str, tuple[Type, ...]]]] = {kind: [] for kind in KINDS}
    for name, operation in OPERATIONS.items():
        if operation.sort == "lanes" and not lane_operations:
            continue
        for parameters, result in operation.signatures:
            found[result].append((name, parameters))
            if operation.sort == "primitive" and set(parameters) == {F32} and result == F32:
                # Element by element: every operand a vector, or only the first.
                found[VEC3].append((name, (VEC3,) * len(parameters)))
                found[VEC4].append((name, (VEC4, *parameters[1:])))
    for kind in (VEC3, VEC4, MAT4, HIT):
        found[kind].append(("select", (BOOL, kind, kind)))
    found[MAT4].append(("multiply", (MAT4, F32)))
    return found


class _Maker:
    """Makes one function. Every variable is assigned at its head; loop counters are never assigned elsewhere."""

    def __init__(
        self, draw: Callable[..., Any], callees: list[n.Function], lane_operations: bool, tables: bool, size: int
    ) -> None:
        self.draw = draw
        self.callees = callees
        self.tables = tables
        self.size = size
        self.producers = _producers(lane_operations)
        self.lane_operations = lane_operations
        self.readable: dict[str, Type] = {}
        self.assignable: dict[str, Type] = {}
        self.arrays: dict[str, Array] = {}
        self.result: Type = F32
        self.loops = 0

    def function(self, name: str, result: Type, is_entry: bool = False) -> n.Function:
        kinds = [draw_kind for draw_kind in KINDS if self.draw(st.booleans())] or [F32]
        parameters: dict[str, Type] = {"lane": I32} if is_entry else {}
        parameters |= {f"p{position}": kind for position, kind in enumerate(kinds)}
        self.result = result
        self.readable = dict(parameters)
        head: list[Any] = []
        for position, kind in enumerate((*RESULT.items, self.pick(KINDS))):
            head.append(n.Assign(f"v{position}", self.expression(kind, 1)))
            self.readable[f"v{position}"] = self.assignable[f"v{position}"] = kind
        self.arrays = {"a0": Array(self.pick((F32, I32, BOOL)), 3), "a1": Array(self.pick((VEC3, HIT)), 2)}
        head += [n.Clear(name) for name in self.arrays]
        body = self.block(3, False, least=3) if is_entry else self.block(2, False)
        # Counters may be read after a branch that holds their loop.
        head += [n.Assign(f"n{k}", i(0)) for k in range(self.loops)]
        # The entry shows what its variables have become.
        value = construct(RESULT, *(local(f"v{k}", kind) for k, kind in enumerate(RESULT.items))) if is_entry else None
        last = n.Return(value or self.expression(result, 2))
        variables = {name: kind for name, kind in self.readable.items() if name not in parameters}
        return function([*head, *body, last], parameters, result, {**variables, **self.arrays}, name)

    def pick(self, choices: Any) -> Any:
        return self.draw(st.sampled_from(list(choices)))

    # --- statements

    def block(self, depth: int, in_loop: bool, least: int = 1) -> list[Any]:
        count = self.draw(st.integers(least, max(least, self.size)))
        return [statement for _ in range(count) for statement in self.statement(depth, in_loop)]

    def statement(self, depth: int, in_loop: bool) -> list[Any]:
        makers = [self.assign, self.assign, self.assign_member, self.set_element, self.call]
        if self.tables:
            makers.append(self.store)
        if in_loop:
            makers += [lambda: self.leave(in_loop)] * 2
        if depth > 0:
            makers += [lambda: self.branch(depth, in_loop), lambda: self.loop(depth), lambda: self.leave(in_loop)] * 2
        return self.pick(makers)()

    def assign(self) -> list[Any]:
        name = self.pick(self.assignable)
        return [n.Assign(name, self.expression(self.assignable[name], 3))]

    def assign_member(self) -> list[Any]:
        name = self.pick([name for name, kind in self.assignable.items() if kind.members])
        path, kind = self.path(self.assignable[name])
        return [n.Assign(name, self.expression(kind, 2), path)]

    def path(self, kind: Type) -> tuple[tuple[str, ...], Type]:
        """A path of at least one step into a value of type `kind`."""
        name, inner = self.pick(kind.members)
        if inner.members and self.draw(st.booleans()):
            path, innermost = self.path(inner)
            return (name, *path), innermost
        return (name,), inner

    def set_element(self) -> list[Any]:
        name = self.pick(self.arrays)
        if self.draw(st.integers(0, 7)) == 0:
            return [n.Clear(name)]
        path, kind = (), self.arrays[name].item
        if kind.members and self.draw(st.booleans()):
            path, kind = self.path(kind)
        return [n.SetElement(name, self.expression(I32, 1), self.expression(kind, 2), path)]

    def call(self) -> list[Any]:
        if not self.callees:
            return self.assign()
        callee = self.pick(self.callees)
        targets = [name for name, kind in self.assignable.items() if kind == callee.result]
        target = self.pick([None, *targets, *targets])
        return [n.Call(target, callee.name, tuple(self.expression(p.type, 2) for p in callee.parameters))]

    def store(self) -> list[Any]:
        path, kind = self.path(HIT) if self.draw(st.booleans()) else ((), HIT)
        return [n.Store(SINK, local("lane", I32), self.expression(kind, 2), path)]

    def branch(self, depth: int, in_loop: bool) -> list[Any]:
        orelse = self.block(depth - 1, in_loop) if self.draw(st.booleans()) else []
        return [n.If(self.condition(), tuple(self.block(depth - 1, in_loop)), tuple(orelse))]

    def leave(self, in_loop: bool) -> list[Any]:
        ways: list[Any] = [n.Break(), n.Continue()] if in_loop else []
        way = self.pick([*ways, n.Return(self.expression(self.result, 1))])
        return [n.If(self.condition(), (way,))]

    def loop(self, depth: int) -> list[Any]:
        counter = local(f"n{self.loops}", I32)
        self.loops += 1
        # At most three passes; how many may vary over lanes.
        bound = op("bit_and", self.place(I32), i(3)) if self.draw(st.booleans()) else i(3)
        start = n.Assign(counter.name, i(0))
        self.readable[counter.name] = I32
        test = op("less", counter, bound)
        if self.draw(st.booleans()):
            test = op("bit_and", test, self.condition())
        setup = self.assign() if self.draw(st.booleans()) else []
        step = n.Assign(counter.name, op("add", counter, i(1)))
        return [start, n.Loop(test, tuple(self.block(depth - 1, True)), tuple(setup), (step,))]

    # --- expressions

    def condition(self) -> Any:
        """A bool that is likely to vary over lanes: what is compared stands in variables."""
        if self.draw(st.integers(0, 2)) == 0:
            return self.expression(BOOL, 2)
        kind = self.pick((F32, I32))
        comparison = self.pick(("less", "less_equal", "greater", "not_equal"))
        return op(comparison, self.place(kind), self.expression(kind, 1))

    def expression(self, kind: Type, depth: int) -> Any:
        if isinstance(kind, Tuple):
            return construct(kind, *(self.expression(item, depth) for item in kind.items))
        ways = ["constant", "place", "place"]
        if depth > 0:
            ways += ["operation"] * 4 + ["construct"] * bool(kind.members)
        way = self.pick(ways)
        if way == "constant":
            return self.constant(kind)
        if way == "place":
            return self.place(kind)
        if way == "construct":
            return construct(kind, *(self.expression(inner, depth - 1) for _, inner in kind.members))
        name, parameters = self.pick(self.producers[kind])
        return self.operation(name, [self.expression(parameter, depth - 1) for parameter in parameters])

    def operation(self, name: str, arguments: list[Any]) -> Any:
        if name in ("bits", "copysign"):
            # The bits and the sign of a NaN are not defined: look at another number in its place.
            last = arguments[-1]
            arguments[-1] = _without_nan(last)
        if name == "same_lanes":
            # True of what has been decided for all lanes.
            shared = op("any_lane", op("not_equal", arguments[0], arguments[0]))
            chosen = {BOOL: shared, I32: op("bool_to_i32", shared), F32: op("to_f32", shared)}
            arguments = [chosen[arguments[0].type]]
        return op(name, *arguments)

    def constant(self, kind: Type) -> Any:
        if kind == F32:
            return f(self.draw(f32_values))
        if kind == I32:
            return i(self.draw(i32_values))
        if kind == BOOL:
            return b(self.draw(st.booleans()))
        if kind in (VEC3, VEC4) and self.draw(st.booleans()):
            return construct(kind, f(self.draw(f32_values)))
        return construct(kind, *(self.constant(inner) for _, inner in kind.members))

    def place(self, kind: Type) -> Any:
        """A local of this type or a member of one, an element of an array, a field of a table; or else a constant."""
        found: list[Any] = [local(name, held) for name, held in self.readable.items() if held == kind]
        for name, held in self.readable.items():
            found += [member(local(name, held), inner) for inner, part in held.members if part == kind]
        for name, array in self.arrays.items():
            if array.item == kind:
                found.append(element(name, array, self.index()))
            found += [
                member(element(name, array, self.index()), inner) for inner, part in array.item.members if part == kind
            ]
        if self.tables:
            inside = op("minimum", op("maximum", self.index(), i(0)), i(SOURCE_COUNT - 1))
            found += [load(SOURCE, inside)] if kind == HIT else []
            found += [load(SOURCE, inside, inner) for inner, part in HIT.members if part == kind]
            found += [n.Length(SOURCE, I32)] if kind == I32 else []
        return self.pick(found) if found else self.constant(kind)

    def index(self) -> Any:
        choices = [local(name, kind) for name, kind in self.readable.items() if kind == I32]
        return self.pick([*choices, i(1)])


def _without_nan(value: Any) -> Any:
    if value.type == F32:
        return op("select", op("equal", value, value), value, f(1.0))
    return construct(value.type, *(_without_nan(member(value, name)) for name, _ in value.type.members))
