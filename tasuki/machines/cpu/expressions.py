"""Lowering expressions, and the variables that they read: what a function's statements are lowered on top of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tasuki.ir import expansions
from tasuki.ir import nodes as ir
from tasuki.ir.ops import OPERATIONS
from tasuki.ir.paths import at_path
from tasuki.machines.cpu.arrays import ArrayValue, load_array
from tasuki.machines.cpu.checks import Checker, TableValue
from tasuki.machines.cpu.emit import Emitter, Leaf
from tasuki.machines.cpu.memory import load_table
from tasuki.machines.cpu.primitives import lower_primitive
from tasuki.machines.cpu.variance import BlockPath, Variance


@dataclass
class Place:
    """Where a variable lives: a slot for each leaf."""

    slots: tuple[str, ...]
    scalars: tuple[str, ...]
    varying: tuple[bool, ...] 


@dataclass
class Scope:
    """A region whose set of active lanes is its own. `mask` is the slot that holds it, `end` the label where it closes.
    """

    mask: str
    end: str
    parent: Scope | None


class ExpressionLowering:
    """The part of a function's lowering that knows its variables, tables and current mask, and no control flow."""

    def __init__(self, emitter: Emitter, checker: Checker, variance: Variance) -> None:
        self.e = emitter
        self.checker = checker
        self.variance = variance
        self.function = variance.function
        self.places: dict[str, Place] = {}
        self.arrays: dict[str, ArrayValue] = {}
        self.tables: dict[str, TableValue] = {}
        self.scope = Scope(emitter.slot(emitter.mask_type), "leave", None)

    # --- variables ----------------------------------------------------------------------------------------------------

    def make_place(self, scalars: Sequence[str], varying: Sequence[bool]) -> Place:
        e = self.e
        slots = tuple(e.slot(e.type_of(s, v), 64 if v else 4) for s, v in zip(scalars, varying, strict=True))
        return Place(slots, tuple(scalars), tuple(varying))

    def load_slot(self, place: Place, i: int) -> Leaf:
        scalar, varying = place.scalars[i], place.varying[i]
        return Leaf(scalar, varying, self.e.value(f"load {self.e.type_of(scalar, varying)}, ptr {place.slots[i]}"))

    def store_slot(self, place: Place, i: int, leaf: Leaf) -> None:
        if place.varying[i]:
            leaf = self.e.broadcast(leaf)
        assert leaf.varying == place.varying[i], f"a varying value for a uniform leaf in {self.function.name}"
        self.e.line(f"store {self.e.typed(leaf)}, ptr {place.slots[i]}")

    def assign(self, place: Place, at: Sequence[int], leaves: Sequence[Leaf], blend: bool) -> None:
        """Leaves `at` of a place become `leaves`; with `blend` in the active lanes only."""
        for i, leaf in zip(at, leaves, strict=True):
            if blend and place.varying[i]:
                leaf = self.e.blend(self.mask(), self.e.broadcast(leaf), self.load_slot(place, i))
            self.store_slot(place, i, leaf)

    def parted(self, variable: str, path: BlockPath) -> bool:
        return self.variance.parts(self.variance.homes[variable], path) is not None

    def mask(self) -> str:
        return self.e.value(f"load {self.e.mask_type}, ptr {self.scope.mask}")

    # --- expressions --------------------------------------------------------------------------------------------------

    def expression(self, expression: ir.Expression) -> list[Leaf]:
        """The leaves of a value."""
        e = self.e
        match expression:
            case ir.Constant(value, type_):
                return [e.constant(value, str(type_))]
            case ir.Local(name):
                place = self.places[name]
                return [self.load_slot(place, i) for i in range(len(place.slots))]
            case ir.Operate():
                return self.operate(expression)
            case ir.Member(base, name):
                return self.member(base, (name,))
            case ir.Element(array, index):
                source = self.arrays[array]
                at = range(len(source.type.item.leaves))
                return load_array(e, source, self.expression(index)[0], at, self.mask())
            case ir.Construct(arguments, type_):
                leaves = [leaf for argument in arguments for leaf in self.expression(argument)]
                return leaves if len(leaves) == len(type_.leaves) else leaves * len(type_.leaves)
            case ir.Load(table, index, path):
                rows = self.table(table)
                checked = self.checked_index(expression, rows, index)
                return load_table(e, rows, checked, at_path(rows.record, path)[1], self.mask())
            case ir.Length(table):
                return [Leaf("i32", False, self.table(table).count)]
        raise TypeError(f"no value: {expression!r}")

    def member(self, base: ir.Expression, path: tuple[str, ...]) -> list[Leaf]:
        """A member of a value; of a variable only the leaves that are wanted are read."""
        if isinstance(base, ir.Member):
            return self.member(base.base, (base.name, *path))
        at = at_path(base.type, path)[1]
        if isinstance(base, ir.Local):
            return [self.load_slot(self.places[base.name], i) for i in at]
        leaves = self.expression(base)
        return [leaves[i] for i in at]

    def operate(self, expression: ir.Operate) -> list[Leaf]:
        arguments = [self.expression(a) for a in expression.arguments]
        operation = OPERATIONS[expression.operation]
        if operation.sort == "lanes":
            return self.lane_operation(operation.name, arguments[0])
        if operation.sort == "composite":
            assert operation.expansion is not None
            terms = [[self.term(leaf) for leaf in leaves] for leaves in arguments]
            return [term.value for term in operation.expansion(*terms)]
        count = len(expression.type.leaves)
        columns = zip(*(leaves if len(leaves) == count else leaves * count for leaves in arguments), strict=True)
        return [lower_primitive(self.e, operation.name, list(column)) for column in columns]

    def term(self, leaf: Leaf) -> expansions.Term:
        def apply(name: str, values: list[Leaf], scalars: list[str]) -> Leaf:
            return lower_primitive(self.e, name, values)

        return expansions.Term(leaf, leaf.scalar, apply, self.e.constant)

    def lane_operation(self, name: str, leaves: list[Leaf]) -> list[Leaf]:
        e = self.e
        leaf = leaves[0]
        if name == "same_lanes":
            return leaves
        if name != "count_lanes" and not leaf.varying:
            return [leaf]
        holds = e.value(f"and {e.mask_type} {self.mask()}, {e.broadcast(leaf).text}")
        if name == "count_lanes":
            return [Leaf("i32", False, e.count_lanes(holds))]
        if name == "any_lane":
            return [Leaf("bool", False, e.any_lane(holds))]
        refused = e.value(f"xor {e.mask_type} {holds}, {self.mask()}")
        return [Leaf("bool", False, e.value(f"xor i1 {e.any_lane(refused)}, true"))]

    def table(self, expression: ir.Local | ir.NamedTable) -> TableValue:
        key = expression.name if isinstance(expression, ir.Local) else "table " + expression.name
        return self.tables[key]

    def checked_index(
        self, node: ir.Store | ir.Load | ir.Atomic, table: TableValue, index: ir.Expression
    ) -> Leaf:
        leaf = self.expression(index)[0]
        return self.checker.check(self.e, leaf, table, self.mask(), self.function.name, node.span)
