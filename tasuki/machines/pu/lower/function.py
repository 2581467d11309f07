"""A function of the IR as macro calls: statements and expressions, for one lane.

`BodyLowering` lowers one body, in place (inlined) or as a subroutine; it knows where the parameters are and where the
result goes. Control flow becomes labels and branches. With one lane `any_lane` and its kin are their argument.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tasuki.diagnostics import Diagnostic, SourceError, Span
from tasuki.ir import nodes as ir
from tasuki.ir.ops import OPERATIONS
from tasuki.ir.paths import at_path
from tasuki.ir.types import BOOL, F32, Array, Record, Table, Type, Vector
from tasuki.machines.pu.lower.banks import ANYWHERE, banks_of_variables
from tasuki.machines.pu.lower.code import Code, Operand, Origin, Place, Word
from tasuki.machines.pu.lower.memory import MemoryAccess, Slot
from tasuki.machines.pu.lower.parts import banks_of, parts, select
from tasuki.machines.pu.lower.stacks import needs_no_clearing
from tasuki.machines.pu.lower.values import COMPARISONS, OVER_ONE_LANE, Value

if TYPE_CHECKING:
    from tasuki.machines.pu.lower.program import ProgramLowering

Bound = list[Operand] | Slot
"""What a parameter is: the parts of a value, or a table."""


@dataclass
class _Loop:
    """Where `continue` and `break` go."""

    step: str
    exit: str


class BodyLowering:
    """Lowers one body. `arguments` are the values of the parameters; what is returned goes to `results`.

    A parameter that the body assigns to must come in registers of its own.
    """

    def __init__(
        self,
        program: ProgramLowering,
        code: Code,
        function: ir.Function,
        arguments: Mapping[str, Bound],
        results: Sequence[Place],
        memory: MemoryAccess,
    ) -> None:
        self.program, self.code, self.function = program, code, function
        self.results = list(results)
        self.arithmetic, self.memory = memory.arithmetic, memory
        self.tables = {name: one for name, one in arguments.items() if isinstance(one, Slot)}
        self.values = {name: one for name, one in arguments.items() if not isinstance(one, Slot)}
        self.types: dict[str, Type] = {p.name: p.type for p in function.parameters} | dict(function.variables)
        self.arrays: dict[str, Slot] = {}
        self.loops: list[_Loop] = []
        self.name = program.label_of(function.name)
        self.end = self.label("end")
        self.tail = _only_return(function.body)
        self.returned = False
        scalars = {name: value[0] for name, value in self.values.items() if self.types[name] == F32}
        given = {name: one.banks if isinstance(one, Place) else ANYWHERE for name, one in scalars.items()}
        banks = banks_of_variables(function, given)
        for name, type_ in function.variables.items():
            if isinstance(type_, Array):
                self.arrays[name] = program.array(function.name, name, type_)
            elif name in banks:
                self.values[name] = [self.arithmetic.fresh(banks[name])]
            else:
                self.values[name] = [self.arithmetic.fresh(banks_of(part)) for part in parts(type_)]

    def lower(self) -> None:
        """The whole body; control goes on behind it."""
        before = self.code.origin
        self.code.origin = Origin(self.function.name, self.function.span)
        self.block(self.function.body)
        if self.returned:
            self.here(self.end)
        self.code.origin = before

    # --- labels -------------------------------------------------------------------------------------------------------

    def label(self, what: str) -> str:
        return self.program.fresh_label(f"{self.name}_{what}")

    def here(self, label: str) -> None:
        self.code.label(label)
        self.memory.forget()

    # --- statements: each says whether control goes on behind it ------------------------------------------------------

    def block(self, statements: Sequence[ir.Statement]) -> bool:
        return all(self.statement(statement) for statement in statements)

    def statement(self, node: ir.Statement) -> bool:
        self.come_from(node)
        match node:
            case ir.Assign():
                self.assign(node)
            case ir.SetElement():
                self.set_element(node)
            case ir.Clear(array):
                if not needs_no_clearing(self.function, array):
                    self.memory.clear(self.arrays[array])
            case ir.Store():
                self.store(node)
            case ir.Atomic():
                self.atomic(node)
            case ir.Call():
                self.call(node)
            case ir.If():
                return self.branch(node)
            case ir.Loop():
                self.loop(node)
            case ir.Break():
                self.code.jump(self.loops[-1].exit)
                return False
            case ir.Continue():
                self.code.jump(self.loops[-1].step)
                return False
            case ir.Return(value):
                if value is not None:
                    self.set(self.results, self.value(value, self.single(self.results)))
                if node is self.tail:
                    return True
                self.returned = True
                self.code.jump(self.end)
                return False
        return True

    def come_from(self, node: ir.Node) -> None:
        """What is emitted next comes from this node's place in the source."""
        if node.span:
            self.code.origin = Origin(self.function.name, node.span)

    def assign(self, node: ir.Assign) -> None:
        targets = self.targets(node.target, node.path)
        self.set(targets, self.value(node.value, self.single(targets)))

    def targets(self, name: str, path: Sequence[str]) -> list[Place]:
        """The places of a variable's member."""
        chosen = select(self.types[name], path)
        places = [place for place in self.values[name][chosen.start : chosen.stop] if isinstance(place, Place)]
        return [places[0].bank(chosen.bank)] if chosen.bank else places

    def single(self, targets: Sequence[Place]) -> Place | None:
        """Where a value may be made at once: in the only place that is assigned, of which nothing is read later."""
        return targets[0] if len(targets) == 1 else None

    def set(self, targets: Sequence[Place], value: Sequence[Operand]) -> None:
        """The targets become the value, all at once."""
        changed = {target.register for target in targets}
        copied = [
            self.arithmetic.move(self.arithmetic.fresh(one.banks), one)
            if len(targets) > 1 and isinstance(one, Place) and one.register in changed and one != target
            else one
            for target, one in zip(targets, value, strict=True)
        ]
        for target, one in zip(targets, copied, strict=True):
            self.arithmetic.move(target, one)
            self.memory.written(target)

    def set_element(self, node: ir.SetElement) -> None:
        slot = self.arrays[node.array]
        index, value = self.scalar(node.index), self.value(node.value)
        type_, leaves = self.element_place(node.array, node.path)
        self.memory.store(slot, index, leaves, type_, value)

    def element_place(self, array: str, path: Sequence[str]) -> tuple[Type, range]:
        type_ = self.types[array]
        assert isinstance(type_, Array)
        return at_path(type_.item, path)

    def store(self, node: ir.Store) -> None:
        slot = self.table(node.table)
        index, value = self.scalar(node.index), self.value(node.value)
        type_, leaves = at_path(slot.record, node.path)
        self.memory.store(slot, index, leaves, type_, value)

    def atomic(self, node: ir.Atomic) -> None:
        """One unit, one lane: a load, an operation, a store."""
        slot = self.table(node.table)
        index, value = self.scalar(node.index), self.scalar(node.value)
        type_, leaves = at_path(slot.record, node.path)
        [before] = self.memory.load(slot, index, leaves, type_, None)
        after = self.arithmetic.primitive(node.operation, type_, [before, value], None)
        self.memory.store(slot, index, leaves, type_, [after])
        if node.target is not None:
            self.set(self.targets(node.target, ()), [before])

    def call(self, node: ir.Call) -> None:
        arguments: list[Bound] = []
        for argument in node.arguments:
            if isinstance(argument.type, Table):
                assert isinstance(argument, ir.Local | ir.NamedTable)
                arguments.append(self.table(argument))
            else:
                arguments.append(self.value(argument))
        value = self.program.call(self, node, arguments)
        if node.target is not None:
            self.set(self.targets(node.target, ()), value)

    # --- branches and loops -------------------------------------------------------------------------------------------

    def branch(self, node: ir.If) -> bool:
        otherwise, end = self.label("else"), self.label("end_if")
        self.go_unless(node.test, otherwise if node.orelse else end)
        goes_on = self.block(node.then)
        if node.orelse:
            if goes_on:
                self.code.jump(end)
            self.here(otherwise)
            goes_on = self.block(node.orelse) or goes_on
        else:
            goes_on = True
        self.here(end)
        return goes_on

    def loop(self, node: ir.Loop) -> None:
        """Without a setup the test stands twice, before the loop and at its end: a round needs no jump back to it."""
        head, loop = self.label("loop"), _Loop(self.label("next"), self.label("end_loop"))
        if not node.setup:
            self.go_unless(node.test, loop.exit)
        self.here(head)
        if node.setup:
            self.block(node.setup)
            self.come_from(node)
            self.go_unless(node.test, loop.exit)
        self.loops.append(loop)
        self.block(node.body)
        self.loops.pop()
        self.here(loop.step)
        if self.block(node.step):
            self.come_from(node)
            if node.setup:
                self.code.jump(head)
            else:
                self.go(node.test, head, wanted=True)
        self.here(loop.exit)

    def go_unless(self, test: ir.Expression, label: str) -> None:
        """To the label where the test fails. `and`, `or`, `not` take no value of their own."""
        self.go(test, label, wanted=False)

    def go(self, test: ir.Expression, label: str, *, wanted: bool) -> None:
        """To the label where the test is `wanted`."""
        match test:
            case ir.Operate("bit_not", (inner,), type_) if type_ == BOOL:
                return self.go(inner, label, wanted=not wanted)
            case ir.Operate("bit_and" | "bit_or" as name, (first, second), type_) if type_ == BOOL:
                if (name == "bit_or") == wanted:
                    self.go(first, label, wanted=wanted)
                    return self.go(second, label, wanted=wanted)
                past = self.label("past")
                self.go(first, past, wanted=not wanted)
                self.go(second, label, wanted=wanted)
                return self.here(past)
            case ir.Operate(name, (inner,)) if name in OVER_ONE_LANE:
                return self.go(inner, label, wanted=wanted)
            case ir.Constant(value):
                if value == wanted:
                    self.code.jump(label)
                return None
        word, positive = self.condition(test)
        self.code.effect("branch" if positive == wanted else "branch_not", word, Word(label, "label"), target=label)
        return None

    def condition(self, test: ir.Expression) -> tuple[Word, bool]:
        """Sets flags; the condition in which the test shows, and whether it must hold."""
        if isinstance(test, ir.Operate) and test.operation in COMPARISONS:
            a, b = (self.scalar(argument) for argument in test.arguments)
            return self.arithmetic.compare(test.operation, a, b)
        return self.arithmetic.holds(self.scalar(test))

    # --- expressions --------------------------------------------------------------------------------------------------

    def scalar(self, node: ir.Expression) -> Operand:
        [operand] = self.value(node)
        return operand

    def value(self, node: ir.Expression, into: Place | None = None) -> Value:
        """The parts of an expression's value; a single part is made in `into` where that is convenient."""
        match node:
            case ir.Constant(number, type_):
                return [float(number) if str(type_) == "f32" else int(number)]
            case ir.Local(name):
                return list(self.values[name])
            case ir.Operate():
                return self.operate(node, into)
            case ir.Member():
                return self.member(node)
            case ir.Element(array, index):
                slot = self.arrays[array]
                type_, leaves = self.element_place(array, ())
                return self.memory.load(slot, self.scalar(index), leaves, type_, into)
            case ir.Construct():
                return self.construct(node, into)
            case ir.Load():
                slot, at = self.table(node.table), self.scalar(node.index)
                type_, leaves = at_path(slot.record, node.path)
                self.come_from(node)
                return self.memory.load(slot, at, leaves, type_, into)
            case ir.Length():
                return [self.program.length(self, self.table(node.table), into)]
        raise self.refusal(f"{type(node).__name__} is not an expression with a value", node.span)

    def member(self, node: ir.Member) -> Value:
        base = node.base
        if isinstance(base, ir.Element | ir.Load):
            return self.member_in_memory(node)
        chosen = select(base.type, (node.name,))
        value = self.value(base)
        if chosen.bank:
            return [self.arithmetic.component(value[chosen.start], chosen.bank)]
        return value[chosen.start : chosen.stop]

    def member_in_memory(self, node: ir.Member) -> Value:
        """A member of what stands in memory: only that is loaded."""
        base = node.base
        if isinstance(base, ir.Load):
            return self.value(ir.Load(base.table, base.index, (*base.path, node.name), node.type, span=node.span))
        assert isinstance(base, ir.Element)
        type_, leaves = self.element_place(base.array, (node.name,))
        return self.memory.load(self.arrays[base.array], self.scalar(base.index), leaves, type_, None)

    def construct(self, node: ir.Construct, into: Place | None) -> Value:
        values = [operand for argument in node.arguments for operand in self.value(argument)]
        if not isinstance(node.type, Vector):
            return values
        if len(values) == 1:
            return [self.arithmetic.as_row(values[0], node.type)]
        if all(isinstance(one, float) and repr(one) == repr(values[0]) for one in values):
            return values[:1]
        components = [component for one in values for component in self.components(one)]
        return [self.arithmetic.composed(node.type, components, into)]

    def components(self, operand: Operand) -> list[Operand]:
        if isinstance(operand, Place) and len(operand.banks) > 1:
            return [operand.bank(bank) for bank in operand.banks]
        return [operand]

    def operate(self, node: ir.Operate, into: Place | None) -> Value:
        operation = OPERATIONS[node.operation]
        if node.operation in OVER_ONE_LANE:
            return self.value(node.arguments[0], into)
        if node.operation == "select":
            return self.choose(node, into)
        if node.operation in COMPARISONS:
            return [self.arithmetic.truth(self.condition(node), into)]
        arguments = [self.value(argument) for argument in node.arguments]
        if operation.sort == "composite":
            return self.arithmetic.composite(
                node.operation, [argument.type for argument in node.arguments], arguments, into
            )
        return [
            self.arithmetic.primitive(
                node.operation, part, [one[i] if len(one) > 1 else one[0] for one in arguments], into
            )
            for i, part in enumerate(parts(node.type))
        ]

    def choose(self, node: ir.Operate, into: Place | None) -> Value:
        test, *others = node.arguments
        a, b = (self.value(argument) for argument in others)
        condition = self.condition(test)
        return [
            self.arithmetic.pick(part, condition, one, other, into)
            for part, one, other in zip(parts(node.type), a, b, strict=True)
        ]

    # --- small things -------------------------------------------------------------------------------------------------

    def table(self, node: ir.Local | ir.NamedTable) -> Slot:
        return self.tables[node.name] if isinstance(node, ir.Local) else self.program.table(node.name)

    def refusal(self, message: str, span: Span | None) -> SourceError:
        return SourceError([Diagnostic(f"{message} (in `{self.function.name}`)", span or self.function.span)])


def _only_return(body: Sequence[ir.Statement]) -> ir.Statement | None:
    """The last statement, if it is the body's only `Return`: control goes on behind it by itself."""
    last = body[-1] if body else None
    return last if isinstance(last, ir.Return) and sum(map(_returns, body)) == 1 else None


def _returns(node: ir.Statement) -> int:
    """How often `Return` stands in a statement."""
    match node:
        case ir.Return():
            return 1
        case ir.If(_, then, orelse):
            return sum(map(_returns, (*then, *orelse)))
        case ir.Loop(_, body, setup, step):
            return sum(map(_returns, (*setup, *body, *step)))
    return 0


def element_record(array: Array) -> Record:
    """The record in which an element of a local array lies in memory."""
    return array.item if isinstance(array.item, Record) else Record("element", (("value", array.item),))
