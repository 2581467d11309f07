"""IR -> LLVM text: each specialisation of a module becomes one LLVM function over a packet of lanes.

Read `lower_program` first. A lowered function receives the context, the mask of active lanes, the leaves of its
arguments, and the tables that it and its callees name; LLVM inlines them all into the entry, or (for a profile) none.

Masks follow a small vocabulary. A *scope* is a region whose lanes may differ from those around it: the function itself,
a branch on a varying condition, a loop that lanes leave one by one. Each scope has a mask in a stack slot and a label
at its end. A jump that only some lanes take clears them from every scope that it leaves; as soon as a scope is empty
control goes to its end, so that nothing is ever executed with no lane active.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tasuki.ir import nodes as ir
from tasuki.ir.paths import at_path
from tasuki.ir.types import Array, Table
from tasuki.machines.cpu.arrays import clear_array, declare_array, store_array
from tasuki.machines.cpu.checks import AccessSite, Checker, TableValue
from tasuki.machines.cpu.context import STOP
from tasuki.machines.cpu.emit import Declarations, Emitter, Leaf, result_type
from tasuki.machines.cpu.expressions import ExpressionLowering, Scope
from tasuki.machines.cpu.lanes import extract, first_lane
from tasuki.machines.cpu.memory import store_table, word_pointers
from tasuki.machines.cpu.profile import ProfileCounters
from tasuki.machines.cpu.structure import has_jump, has_return, named_tables
from tasuki.machines.cpu.variance import BlockPath, Pattern, Variance, VarianceAnalysis, variable_type


@dataclass
class Lowered:
    """LLVM functions for a program, and what the host must know about them.

    Every function stands before those that it calls: so LLVM's inliner, which takes them in this order, copies each
    instruction once to where it ends up, and not again for each level of calls.
    """

    entry: str
    result_varying: tuple[bool, ...]
    functions: list[str]
    declarations: Declarations
    sites: list[AccessSite]
    profiled: list[tuple[str, str]]
    """For each profile counter (caller, callee), by module name; empty without a profile."""


def lower_program(program: ir.Program, pattern: Pattern, width: int, *, checked: bool, profile: bool) -> Lowered:
    """Lower the entry of a (verified) program for arguments whose leaves vary as `pattern` says, and all that it calls.
    """
    module = ModuleLowering(program, width, Checker(checked), ProfileCounters(profile, timed=width > 1))
    entry = module.function(program.entry, pattern)
    variance = module.analysis.analyse(program.entry, pattern)
    varying = tuple(reason is not None for reason in variance.result)
    return Lowered(entry, varying, module.texts[::-1], module.declarations, module.checker.sites, module.counters.edges)


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
class LoopFrame:
    """A loop being lowered. `scope` and `body` are its mask scopes where its lanes may part; None in a uniform loop."""

    step: str
    exit: str
    scope: Scope | None = None
    body: Scope | None = None


class FunctionLowering(ExpressionLowering):
    """Lowers one specialisation of one function."""

    def __init__(self, module: ModuleLowering, variance: Variance, pattern: Pattern) -> None:
        super().__init__(Emitter(module.width, module.declarations), module.checker, variance)
        self.module = module
        self.pattern = pattern
        self.loops: list[LoopFrame] = []
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
                self.arrays[variable] = declare_array(e, type_, varying)
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

    # --- statements ---------------------------------------------------------------------------------------------------

    def block(self, statements: Sequence[ir.Statement], path: BlockPath) -> None:
        for index, statement in enumerate(statements):
            if not self.e.open:
                return
            self.statement(statement, path, index)

    def statement(self, statement: ir.Statement, path: BlockPath, index: int) -> None:
        match statement:
            case ir.Assign(target, value, member_path):
                at = at_path(variable_type(self.function, target), member_path)[1]
                self.assign(self.places[target], at, self.expression(value), self.parted(target, path))
            case ir.SetElement(array, at_index, value, member_path):
                self.set_element(array, at_index, value, member_path, path)
            case ir.Clear(array):
                clear_array(self.e, self.arrays[array], self.mask() if self.parted(array, path) else None)
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
        at = at_path(target.type.item, member_path)[1]
        index_leaf, leaves = self.expression(index)[0], self.expression(value)
        store_array(self.e, target, index_leaf, at, leaves, self.mask(), self.parted(array, path))

    def store(
        self,
        statement: ir.Store,
        table: ir.Local | ir.NamedTable,
        index: ir.Expression,
        value: ir.Expression,
        member_path: tuple[str, ...],
    ) -> None:
        target = self.table(table)
        at = at_path(target.record, member_path)[1]
        leaves = self.expression(value)
        checked = self.checked_index(statement, target, index)
        store_table(self.e, target, checked, at, leaves, self.mask())

    def atomic(self, statement: ir.Atomic, path: BlockPath) -> None:
        table = self.table(statement.table)
        leaf = at_path(table.record, statement.path)[1][0]
        index = self.checked_index(statement, table, statement.index)
        value = self.expression(statement.value)[0]
        old = self.atomic_lanes(statement.operation, table, leaf, index, value)
        if statement.target:
            self.assign(self.places[statement.target], [0], [old], self.parted(statement.target, path))

    def atomic_lanes(self, operation: str, table: TableValue, leaf: int, index: Leaf, value: Leaf) -> Leaf:
        """The active lanes one after another; gives each lane the word from before."""
        e = self.e
        code = {"add": "add", "minimum": "min", "maximum": "max"}[operation]
        pointers = word_pointers(e, table, index, leaf)
        values = e.broadcast(value)
        olds, left = e.slot(e.type_of("i32", True)), e.slot(e.mask_type)
        e.line(f"store {e.type_of('i32', True)} zeroinitializer, ptr {olds}")
        e.line(f"store {e.mask_type} {self.mask()}, ptr {left}")
        head, body, done = e.fresh("atomic"), e.fresh("atomic"), e.fresh("atomic")
        e.label(head)
        mask = e.value(f"load {e.mask_type}, ptr {left}")
        e.branch(e.any_lane(mask), body, done)
        e.label(body)
        lane = first_lane(e, mask)
        rest = e.value(f"insertelement {e.mask_type} {mask}, i1 false, i32 {lane}")
        e.line(f"store {e.mask_type} {rest}, ptr {left}")
        pointer = e.value(f"extractelement <{e.width} x ptr> {pointers}, i32 {lane}")
        old = e.value(f"atomicrmw {code} ptr {pointer}, i32 {extract(e, values, lane)} seq_cst")
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
        if not self.checker.enabled:
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

