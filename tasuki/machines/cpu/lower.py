"""IR -> LLVM text: each specialisation of a module becomes one LLVM function over a packet of lanes.

Read `lower_program` first. A lowered function receives the context, the mask of active lanes, the leaves of its
arguments,
and the tables that it and its callees name; LLVM inlines them all into the entry, or (for a profile) none.

Masks follow a small vocabulary. A *scope* is a region whose lanes may differ from those around it: the function itself,
a branch on a varying condition, a loop that lanes leave one by one. Each scope has a mask in a stack slot and a label
at
its end. A jump that only some lanes take clears them from every scope that it leaves; as soon as a scope is empty
control
goes to its end, so that nothing is ever executed with no lane active.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from tasuki.ir import expansions
from tasuki.ir import nodes as ir
from tasuki.ir.ops import OPERATIONS
from tasuki.ir.types import Array, Record, Table
from tasuki.machines.cpu import memory
from tasuki.machines.cpu.context import STOP
from tasuki.machines.cpu.emit import Declarations, Emitter, Leaf
from tasuki.machines.cpu.memory import AccessSite, ArrayValue, Checker, TableValue
from tasuki.machines.cpu.primitives import lower_primitive
from tasuki.machines.cpu.profile import ProfileCounters
from tasuki.machines.cpu.variance import (
    BlockPath,
    Pattern,
    Variance,
    VarianceAnalysis,
    leaf_span,
    variable_type,
)


@dataclass
class Lowered:
    """LLVM functions for a program, and what the host must know about them."""

    entry: str
    result_varying: tuple[bool, ...]
    functions: list[str]
    declarations: Declarations
    sites: list[AccessSite]
    profiled: list[tuple[str, str]]
    """For each profile counter (caller, callee), by module name; empty without a profile."""


def lower_program(program: ir.Program, pattern: Pattern, width: int, *, checked: bool, profile: bool) -> Lowered:
    """Lower the entry of a (verified) program for arguments whose leaves vary as `pattern` says, and all that it
    calls.
    """
    module = ModuleLowering(program, width, Checker(checked), ProfileCounters(profile))
    entry = module.function(program.entry, pattern)
    variance = module.analysis.analyse(program.entry, pattern)
    varying = tuple(reason is not None for reason in variance.result)
    return Lowered(entry, varying, module.texts, module.declarations, module.checker.sites, module.counters.edges)


class ModuleLowering:
    """All LLVM functions of one program; each specialisation is lowered once."""

    def __init__(self, program: ir.Program, width: int, checker: Checker, counters: ProfileCounters) -> None:
        self.program = program
        self.width = width
        self.checker = checker
        self.counters = counters
        self.analysis = VarianceAnalysis(program)
        self.declarations = Declarations()
        self.texts: list[str] = []
        self.names: dict[tuple[str, Pattern], str] = {}
        self.tables_of = named_tables(program)

    def function(self, name: str, pattern: Pattern) -> str:
        """The LLVM name of a specialisation, lowering it if this is its first use."""
        key = (name, pattern)
        if key not in self.names:
            self.names[key] = f"m{len(self.names)}"
            variance = self.analysis.analyse(name, pattern)
            self.texts.append(FunctionLowering(self, variance, pattern).lower(self.names[key]))
        return self.names[key]


@dataclass
class Scope:
    """A region whose set of active lanes is its own. `mask` is the slot that holds it, `end` the label where it
    closes.
    """

    mask: str
    end: str
    parent: Scope | None


@dataclass
class LoopFrame:
    """A loop being lowered. `scope` and `body` are its mask scopes where its lanes may part; None in a uniform loop."""

    step: str
    exit: str
    scope: Scope | None = None
    body: Scope | None = None


@dataclass
class Place:
    """Where a variable lives: a slot for each leaf."""

    slots: tuple[str, ...]
    scalars: tuple[str, ...]
    varying: tuple[bool, ...] = field(default=())


class FunctionLowering:
    """Lowers one specialisation of one function."""

    def __init__(self, module: ModuleLowering, variance: Variance, pattern: Pattern) -> None:
        self.module = module
        self.variance = variance
        self.function = variance.function
        self.pattern = pattern
        self.e = Emitter(module.width, module.declarations)
        self.places: dict[str, Place] = {}
        self.arrays: dict[str, ArrayValue] = {}
        self.tables: dict[str, TableValue] = {}
        self.loops: list[LoopFrame] = []
        self.scope = Scope(self.e.slot(self.e.mask_type), "leave", None)
        result = self.function.result.leaves
        self.result = self.make_place(result, tuple(reason is not None for reason in variance.result))

    # --- the function -------------------------------------------------------------------------------------------------

    def lower(self, name: str) -> str:
        e = self.e
        parameters = self.declare_parameters()
        e.line(f"store {e.mask_type} %mask, ptr {self.scope.mask}")
        for variable, type_ in self.function.variables.items():
            varying = tuple(r is not None for r in self.variance.variables[variable])
            if isinstance(type_, Array):
                self.arrays[variable] = memory.declare_array(e, type_, varying)
            else:
                self.places[variable] = self.make_place(type_.leaves, varying)
        self.block(self.function.body, ())
        e.label("leave")
        returned = [self.load_slot(self.result, i) for i in range(len(self.result.slots))]
        result_type = self.finish(returned)
        attributes = self.module.counters.attributes
        head = f"define internal {result_type} @{name}({', '.join(parameters)}) {attributes} {{ ; {self.function.name}"
        return "\n".join([head, "entry:", *e.slots, *e.body, "}", ""])

    def declare_parameters(self) -> list[str]:
        """The LLVM parameters; leaves are stored into the slots of the variables that they begin."""
        e = self.e
        parameters = ["ptr %context", f"{e.mask_type} %mask"]
        for position, parameter in enumerate(self.function.parameters):
            if isinstance(parameter.type, Table):
                base, count = f"%base.p{position}", f"%count.p{position}"
                parameters += [f"ptr {base}", f"i32 {count}"]
                self.tables[parameter.name] = TableValue(parameter.name, parameter.type.record, base, count)
                continue
            given = self.pattern[position]
            varying = tuple(r is not None for r in self.variance.variables[parameter.name])
            place = self.make_place(parameter.type.leaves, varying)
            self.places[parameter.name] = place
            for i, scalar in enumerate(parameter.type.leaves):
                register = f"%a{position}.{i}"
                parameters.append(f"{e.type_of(scalar, given[i])} {register}")
                self.store_slot(place, i, Leaf(scalar, given[i], register))
        for table, record in self.module.tables_of[self.function.name].items():
            base, count = f"%base.{table}", f"%count.{table}"
            parameters += [f"ptr {base}", f"i32 {count}"]
            self.tables["table " + table] = TableValue(table, record, base, count)
        return parameters

    def finish(self, returned: Sequence[Leaf]) -> str:
        """Emit the return; the LLVM type of the result."""
        e = self.e
        if not returned:
            e.line("ret void")
            return "void"
        type_ = result_type(e, [(leaf.scalar, leaf.varying) for leaf in returned])
        aggregate = "poison"
        for i, leaf in enumerate(returned):
            aggregate = e.value(f"insertvalue {type_} {aggregate}, {e.typed(leaf)}, {i}")
        e.line(f"ret {type_} {aggregate}")
        return type_

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

    # --- statements ---------------------------------------------------------------------------------------------------

    def block(self, statements: Sequence[ir.Statement], path: BlockPath) -> None:
        for index, statement in enumerate(statements):
            if not self.e.open:
                return
            self.statement(statement, path, index)

    def statement(self, statement: ir.Statement, path: BlockPath, index: int) -> None:
        match statement:
            case ir.Assign(target, value, member_path):
                at = leaf_span(variable_type(self.function, target), member_path)
                self.assign(self.places[target], at, self.expression(value), self.parted(target, path))
            case ir.SetElement(array, at_index, value, member_path):
                self.set_element(array, at_index, value, member_path, path)
            case ir.Clear(array):
                memory.clear_array(self.e, self.arrays[array], self.mask() if self.parted(array, path) else None)
            case ir.Store(table, at_index, value, member_path):
                self.store(statement, table, at_index, value, member_path)
            case ir.Atomic():
                self.atomic(statement, path)
            case ir.Call():
                self.call(statement, path)
            case ir.If(test):
                reason = self.variance.parted.get((path, index))
                condition = self.expression(test)[0]
                if reason is None:
                    self.uniform_if(statement, condition, path, index)
                else:
                    self.varying_if(statement, condition, path, index)
            case ir.Loop():
                self.loop(statement, path, index)
            case ir.Break():
                self.leave_loop(self.loops[-1].exit, self.loops[-1].scope)
            case ir.Continue():
                self.leave_loop(self.loops[-1].step, self.loops[-1].body)
            case ir.Return(value):
                self.returned(value, path)

    def set_element(
        self, array: str, index: ir.Expression, value: ir.Expression, member_path: tuple[str, ...], path: BlockPath
    ) -> None:
        target = self.arrays[array]
        at = leaf_span(target.type.item, member_path)
        index_leaf, leaves = self.expression(index)[0], self.expression(value)
        memory.store_array(self.e, target, index_leaf, at, leaves, self.mask(), self.parted(array, path))

    def store(
        self,
        statement: ir.Store,
        table: ir.Local | ir.NamedTable,
        index: ir.Expression,
        value: ir.Expression,
        member_path: tuple[str, ...],
    ) -> None:
        target = self.table(table)
        at = leaf_span(target.record, member_path)
        leaves = self.expression(value)
        checked = self.checked_index(statement, target, index)
        memory.store_table(self.e, target, checked, at, leaves, self.mask())

    def checked_index(
        self, node: ir.Store | ir.Load | ir.Atomic, table: TableValue, index: ir.Expression
    ) -> Leaf:
        leaf = self.expression(index)[0]
        return self.module.checker.check(self.e, leaf, table, self.mask(), self.function.name, node.span)

    def atomic(self, statement: ir.Atomic, path: BlockPath) -> None:
        table = self.table(statement.table)
        leaf = leaf_span(table.record, statement.path)[0]
        index = self.checked_index(statement, table, statement.index)
        value = self.expression(statement.value)[0]
        old = self.atomic_lanes(statement.operation, table, leaf, index, value)
        if statement.target:
            self.assign(self.places[statement.target], [0], [old], self.parted(statement.target, path))

    def atomic_lanes(self, operation: str, table: TableValue, leaf: int, index: Leaf, value: Leaf) -> Leaf:
        """The active lanes one after another; gives each lane the word from before."""
        e = self.e
        code = {"add": "add", "minimum": "min", "maximum": "max"}[operation]
        pointers = memory.word_pointers(e, table, index, leaf)
        values = e.broadcast(value)
        olds, left = e.slot(e.type_of("i32", True)), e.slot(e.mask_type)
        e.line(f"store {e.type_of('i32', True)} zeroinitializer, ptr {olds}")
        e.line(f"store {e.mask_type} {self.mask()}, ptr {left}")
        head, body, done = e.fresh("atomic"), e.fresh("atomic"), e.fresh("atomic")
        e.label(head)
        mask = e.value(f"load {e.mask_type}, ptr {left}")
        e.branch(e.any_lane(mask), body, done)
        e.label(body)
        lane = memory.first_lane(e, mask)
        e.line(f"store {e.mask_type} {e.value(f'insertelement {e.mask_type} {mask}, i1 false, i32 {lane}')}, ptr {left}")
        pointer = e.value(f"extractelement <{e.width} x ptr> {pointers}, i32 {lane}")
        old = e.value(f"atomicrmw {code} ptr {pointer}, i32 {memory.extract(e, values, lane)} seq_cst")
        so_far = e.value(f"load {e.type_of('i32', True)}, ptr {olds}")
        updated = e.value(f"insertelement {e.type_of('i32', True)} {so_far}, i32 {old}, i32 {lane}")
        e.line(f"store {e.type_of('i32', True)} {updated}, ptr {olds}")
        e.jump(head)
        e.label(done)
        return Leaf("i32", True, e.value(f"load {e.type_of('i32', True)}, ptr {olds}"))

    # --- calls --------------------------------------------------------------------------------------------------------

    def call(self, call: ir.Call, path: BlockPath) -> None:
        e = self.e
        pattern: list[tuple[bool, ...]] = []
        arguments = ["ptr %context", f"{e.mask_type} {self.mask()}"]
        for argument in call.arguments:
            if isinstance(argument.type, Table):
                assert isinstance(argument, ir.Local | ir.NamedTable)
                table = self.table(argument)
                arguments += [f"ptr {table.base}", f"i32 {table.count}"]
                pattern.append(())
                continue
            leaves = self.expression(argument)
            arguments += [e.typed(leaf) for leaf in leaves]
            pattern.append(tuple(leaf.varying for leaf in leaves))
        for table_name in self.module.tables_of[call.function]:
            arguments += [f"ptr %base.{table_name}", f"i32 %count.{table_name}"]
        key = tuple(pattern)
        name = self.module.function(call.function, key)
        callee = self.module.analysis.analyse(call.function, key)
        shape = [(s, r is not None) for s, r in zip(callee.function.result.leaves, callee.result, strict=True)]
        counter = self.module.counters.begin(e, self.function.name, call.function, self.mask)
        returned = self.emit_call(name, shape, arguments)
        self.module.counters.end(e, counter)
        if call.target is not None:
            place = self.places[call.target]
            self.assign(place, range(len(place.slots)), returned, self.parted(call.target, path))

    def emit_call(self, name: str, shape: Sequence[tuple[str, bool]], arguments: Sequence[str]) -> list[Leaf]:
        e = self.e
        if not shape:
            e.line(f"call void @{name}({', '.join(arguments)})")
            return []
        type_ = result_type(e, shape)
        result = e.value(f"call {type_} @{name}({', '.join(arguments)})")
        return [Leaf(s, v, e.value(f"extractvalue {type_} {result}, {i}")) for i, (s, v) in enumerate(shape)]

    # --- branches -----------------------------------------------------------------------------------------------------

    def uniform_if(self, statement: ir.If, condition: Leaf, path: BlockPath, index: int) -> None:
        e = self.e
        then, otherwise, end = e.fresh("then"), e.fresh("else"), e.fresh("end")
        e.branch(condition.text, then, otherwise if statement.orelse else end)
        e.label(then)
        self.block(statement.then, (*path, (index, "then")))
        e.jump(end)
        if statement.orelse:
            e.label(otherwise)
            self.block(statement.orelse, (*path, (index, "else")))
        e.label(end)

    def varying_if(self, statement: ir.If, condition: Leaf, path: BlockPath, index: int) -> None:
        e = self.e
        outer = self.mask()
        wanted = e.broadcast(condition).text
        then_mask = e.value(f"and {e.mask_type} {outer}, {wanted}")
        # Before the first branch is lowered: it may turn condition and mask over.
        refused = e.value(f"xor {e.mask_type} {wanted}, splat (i1 true)")
        else_mask = e.value(f"and {e.mask_type} {outer}, {refused}") if statement.orelse else ""
        self.masked_block(then_mask, statement.then, (*path, (index, "then")))
        if statement.orelse:
            self.masked_block(else_mask, statement.orelse, (*path, (index, "else")))
        if has_jump(statement):
            self.go_on_if_any()

    def masked_block(self, mask: str, statements: Sequence[ir.Statement], path: BlockPath) -> None:
        """A block for the lanes in `mask`, skipped when there are none."""
        e = self.e
        begin, end = e.fresh("lanes"), e.fresh("rejoin")
        e.branch(e.any_lane(mask), begin, end)
        e.label(begin)
        self.scope = Scope(self.new_mask(mask), end, self.scope)
        self.block(statements, path)
        e.label(end)
        assert self.scope.parent is not None
        self.scope = self.scope.parent

    def new_mask(self, mask: str) -> str:
        slot = self.e.slot(self.e.mask_type)
        self.e.line(f"store {self.e.mask_type} {mask}, ptr {slot}")
        return slot

    def go_on_if_any(self) -> None:
        """After lanes may have left: go on with the rest, or straight to the end of the scope if there is none."""
        go_on = self.e.fresh("rest")
        self.e.branch(self.e.any_lane(self.mask()), go_on, self.scope.end)
        self.e.label(go_on)

    # --- loops --------------------------------------------------------------------------------------------------------

    def loop(self, loop: ir.Loop, path: BlockPath, index: int) -> None:
        e = self.e
        inside: BlockPath = (*path, (index, "loop"))
        head, step, exit_ = e.fresh("head"), e.fresh("step"), e.fresh("exit")
        frame = LoopFrame(step, exit_)
        outer = self.scope
        if (path, index) in self.variance.parted:
            frame.scope = self.scope = Scope(self.new_mask(self.mask()), exit_, outer)
        self.loops.append(frame)
        e.label(head)
        self.poll_stop(exit_)
        self.block(loop.setup, inside)
        self.loop_test(loop, frame)
        if frame.scope is not None:
            frame.body = self.scope = Scope(self.new_mask(self.mask()), step, frame.scope)
        self.block(loop.body, (*inside, (0, "body")))
        e.label(step)
        if frame.scope is not None:
            self.scope = frame.scope
            if any(map(has_jump, loop.body)):
                self.go_on_if_any()
        self.block(loop.step, inside)
        e.jump(head)
        e.label(exit_)
        self.loops.pop()
        self.scope = outer
        if has_return(loop):
            self.go_on_if_any()

    def loop_test(self, loop: ir.Loop, frame: LoopFrame) -> None:
        e = self.e
        test = self.expression(loop.test)[0]
        body = e.fresh("body")
        if frame.scope is None:
            e.branch(test.text, body, frame.exit)
        else:
            mask = e.value(f"and {e.mask_type} {self.mask()}, {e.broadcast(test).text}")
            e.line(f"store {e.mask_type} {mask}, ptr {frame.scope.mask}")
            e.branch(e.any_lane(mask), body, frame.exit)
        e.label(body)

    def poll_stop(self, exit_: str) -> None:
        """In checked programs every loop ends when the run is to stop, so that no module can hang it."""
        if not self.module.checker.enabled:
            return
        e = self.e
        flag = e.value(f"getelementptr i64, ptr %context, i64 {STOP}")
        stop = e.value(f"load volatile i64, ptr {flag}, align 8")
        go_on = e.fresh("run")
        e.branch(e.value(f"icmp eq i64 {stop}, 0"), go_on, exit_)
        e.label(go_on)

    def leave_loop(self, label: str, last: Scope | None) -> None:
        """`break` or `continue`: to `label`; the active lanes are cleared from every scope up to and with `last`."""
        if last is None:
            self.e.jump(label)
            return
        self.clear_active(last)
        self.e.jump(self.scope.end)

    def returned(self, value: ir.Expression | None, path: BlockPath) -> None:
        leaves = self.expression(value) if value is not None else []
        self.assign(self.result, range(len(leaves)), leaves, self.variance.parting_returns)
        if self.scope.parent is None:
            self.e.jump("leave")
            return
        self.clear_active(None)
        self.e.jump(self.scope.end)

    def clear_active(self, last: Scope | None) -> None:
        """Take the active lanes out of this scope and those around it, up to and with `last` (None: all)."""
        e = self.e
        gone = e.value(f"xor {e.mask_type} {self.mask()}, splat (i1 true)")
        scope: Scope | None = self.scope
        while scope is not None:
            old = e.value(f"load {e.mask_type}, ptr {scope.mask}")
            e.line(f"store {e.mask_type} {e.value(f'and {e.mask_type} {old}, {gone}')}, ptr {scope.mask}")
            if scope is last:
                return
            scope = scope.parent

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
                value = self.arrays[array]
                at = range(len(value.type.item.leaves))
                return memory.load_array(e, value, self.expression(index)[0], at, self.mask())
            case ir.Construct(arguments, type_):
                leaves = [leaf for argument in arguments for leaf in self.expression(argument)]
                return leaves if len(leaves) == len(type_.leaves) else leaves * len(type_.leaves)
            case ir.Load(table, index, path):
                source = self.table(table)
                checked = self.checked_index(expression, source, index)
                return memory.load_table(e, source, checked, leaf_span(source.record, path), self.mask())
            case ir.Length(table):
                return [Leaf("i32", False, self.table(table).count)]
        raise TypeError(f"no value: {expression!r}")

    def member(self, base: ir.Expression, path: tuple[str, ...]) -> list[Leaf]:
        """A member of a value; of a variable only the leaves that are wanted are read."""
        if isinstance(base, ir.Member):
            return self.member(base.base, (base.name, *path))
        at = leaf_span(base.type, path)
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


def result_type(e: Emitter, shape: Sequence[tuple[str, bool]]) -> str:
    return "{" + ", ".join(e.type_of(scalar, varying) for scalar, varying in shape) + "}"


def has_jump(statement: ir.Statement) -> bool:
    """Whether lanes may leave the block around a statement from inside it. A loop keeps its own jumps to itself."""
    match statement:
        case ir.Break() | ir.Continue() | ir.Return():
            return True
        case ir.If(_, then, orelse):
            return any(map(has_jump, (*then, *orelse)))
        case ir.Loop():
            return has_return(statement)
    return False


def has_return(statement: ir.Statement) -> bool:
    match statement:
        case ir.Return():
            return True
        case ir.If(_, then, orelse):
            return any(map(has_return, (*then, *orelse)))
        case ir.Loop(_, body, setup, step):
            return any(map(has_return, (*body, *setup, *step)))
    return False


def named_tables(program: ir.Program) -> dict[str, dict[str, Record]]:
    """For every function the named tables that it or a callee touches, in a fixed order."""
    found: dict[str, dict[str, Record]] = {}

    def visit(name: str) -> dict[str, Record]:
        if name not in found:
            direct, callees = direct_uses(program.functions[name])
            names = set(direct).union(*(visit(callee) for callee in callees))
            found[name] = {table: program.tables[table] for table in sorted(names)}
        return found[name]

    for name in program.functions:
        visit(name)
    return found


def direct_uses(function: ir.Function) -> tuple[set[str], set[str]]:
    """Named tables and functions that a function itself mentions."""
    tables: set[str] = set()
    callees: set[str] = set()

    def walk(node: object) -> None:
        if isinstance(node, ir.NamedTable):
            tables.add(node.name)
        elif isinstance(node, ir.Call):
            callees.add(node.function)
        if isinstance(node, ir.Node):
            for value in vars(node).values():
                walk(value)
        elif isinstance(node, tuple):
            for item in node:
                walk(item)

    walk(function.body)
    return tables, callees
