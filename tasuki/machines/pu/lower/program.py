"""A program of the IR as macro assembler text: subroutines, tables, and the loop over items around the entry.

**Inlined or called.** A function is lowered where it is called, unless its copies (all but one) would have more than
`INLINED` nodes of the IR: then it becomes a subroutine, one for each set of tables that it is given. There is no
recursion, so that every subroutine has registers and rows of memory of its own, and only registers that a caller needs
after the call keep out of the way (`allocate`).

**Memory.** Rows from 0 on: a descriptor for each table (base row and count, put there by whoever runs the program),
local arrays, the arguments of an item, its results, spilled registers. Tables lie behind, where their descriptors say.

**Items.** The program sets its tables up and halts. Whoever goes on at the label `item` has it read the arguments of
an item, run the entry, and store its results; then it halts again.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from tasuki.diagnostics import Diagnostic, SourceError
from tasuki.ir import nodes as ir
from tasuki.ir.canonical import callees, reachable
from tasuki.ir.types import VOID, Array, Record, Table, Tuple, Type
from tasuki.machines.pu.isa import CALL_DEPTH, DEFAULT
from tasuki.machines.pu.lower.allocate import Allocated, allocate
from tasuki.machines.pu.lower.code import Code, Operand, Origin, Place, Register, Word
from tasuki.machines.pu.lower.function import BodyLowering, Bound, element_record
from tasuki.machines.pu.lower.memory import MemoryAccess, RecordText, Slot
from tasuki.machines.pu.lower.parts import banks_of, parts
from tasuki.machines.pu.lower.values import Arithmetic, Value
from tasuki.machines.pu.lower.written import RESERVED, Written, registers
from tasuki.machines.pu.macro.operands import register
from tasuki.machines.pu.meta.symbols import PREDEFINED

INLINED = 400
"""Nodes of the IR that copies of one function's body may have in all."""
ARGUMENTS, RESULTS = "arguments", "results"
"""The tables of items: a record for each, of the entry's parameters and of its result."""


@dataclass(frozen=True)
class AccessSite:
    """A checked access: the label where control goes if it fails, the table, and where it stands."""

    label: str
    table: str
    origin: Origin


@dataclass
class Lowered:
    """A program before it is written down: code with registers, and what its text declares."""

    entry: Allocated
    routines: list[Allocated]
    slots: list[Slot]
    tables: list[str]
    """The tables that have a descriptor, in the order of their rows."""
    frame_rows: int
    sites: list[AccessSite]
    written: dict[str, tuple[str, Written]]
    """Label -> the module and its body, of the subroutines that are written by hand."""


@dataclass
class _Routine:
    label: str
    parameters: dict[str, Bound]
    results: list[Place]
    allocated: Allocated
    depth: int


@dataclass
class ProgramLowering:
    """Lowers a verified program; `lower` is the way in."""

    program: ir.Program
    checked: bool = False
    written: Mapping[str, Written] = field(default_factory=dict)
    """Modules that are written by hand, by their qualified names."""
    sites: list[AccessSite] = field(default_factory=list)
    slots: dict[str, Slot] = field(default_factory=dict)
    records: dict[Record, RecordText] = field(default_factory=dict)
    routines: dict[tuple[str, tuple[str, ...]], _Routine] = field(default_factory=dict)
    described: list[str] = field(default_factory=list)
    frame_rows: int = 0

    def __post_init__(self) -> None:
        self._labels: Counter[str] = Counter()
        self._words = {*RESERVED, *(name for one in self.written.values() for name in one.names)}
        self._open: list[int] = []
        functions = reachable(self.program)
        self._assigned = {function.name: _assigned(function.body) for function in functions}
        self._inlined_names = _worth_inlining(self.program)

    def lower(self) -> Lowered:
        """The whole program. Raises SourceError with what the machine cannot do."""
        entry = self.program.functions[self.program.entry]
        # What brings arguments and takes results counts for no module.
        code = Code(origin=Origin("", None))
        memory = self._memory(code)
        arguments = [(p.name, p.type) for p in entry.parameters if not isinstance(p.type, Table)]
        given = Record(ARGUMENTS, tuple(arguments)) if arguments else None
        made = Record(RESULTS, (("value", entry.result),)) if entry.result != VOID else None
        self._open.append(0)
        bound = self._bound_arguments(entry, given, memory)
        results = [memory.arithmetic.fresh(banks_of(part)) for part in parts(entry.result)]
        body = BodyLowering(self, code, entry, bound, results, memory)
        if entry.name in self.written:
            call = ir.Call(None, entry.name, (), span=entry.span)
            body.set(results, self._called(body, entry, list(bound.values()), call))
        else:
            body.lower()
        if made:
            memory.put(self._described(RESULTS, made), range(len(made.leaves)), made.members[0][1], results)
        for name, record in ((ARGUMENTS, given), (RESULTS, made)):
            if record:
                code.effect("next", Word(self.slots[name].name, "table"))
        code.effect("halt")
        code.jump("item")
        code.items[:0] = self._prologue().items
        allocated = self._allocate("start", code, {}, [])
        routines = [routine.allocated for routine in self.routines.values()]
        slots = list(self.slots.values())
        # What only a stand-in's own definition would have called is not there.
        called = [(name, body) for name, body in self.written.items() if (name, ()) in self.routines]
        written = {self.routines[name, ()].label: (name, body) for name, body in called}
        return Lowered(allocated, routines, slots, self.described, self.frame_rows, self.sites, written)

    def _prologue(self) -> Code:
        """Sets up the registers of tables and arrays."""
        code = Code(origin=Origin("", None))
        for number, name in enumerate(self.described):
            code.effect("place", Word(self.slots[name].name, "table"), number)
        for slot in self.slots.values():
            if slot.is_array:
                code.effect("open", Word(slot.name, "table"))
        code.effect("halt")
        code.label("item")
        return code

    def _bound_arguments(self, entry: ir.Function, record: Record | None, memory: MemoryAccess) -> dict[str, Bound]:
        """The entry's parameters: its tables, and the record of the item's values."""
        bound: dict[str, Bound] = {}
        for parameter in entry.parameters:
            if isinstance(parameter.type, Table):
                bound[parameter.name] = self._described(f"parameter {parameter.name}", parameter.type.record)
        if record:
            values = Tuple(tuple(type_ for _, type_ in record.fields))
            value = memory.take(self._described(ARGUMENTS, record), range(len(record.leaves)), values)
            for name, type_ in record.fields:
                count = len(parts(type_))
                bound[name], value = value[:count], value[count:]
        return bound

    # --- calls --------------------------------------------------------------------------------------------------------

    def call(self, caller: BodyLowering, node: ir.Call, arguments: Sequence[Bound]) -> Value:
        """The value of a call, inlined or not."""
        function = self.program.functions[node.function]
        if function.name in self._inlined_names and function.name not in self.written:
            return self._inlined(caller, function, arguments)
        return self._called(caller, function, arguments, node)

    def _inlined(self, caller: BodyLowering, function: ir.Function, arguments: Sequence[Bound]) -> Value:
        arithmetic, bound = caller.arithmetic, {}
        for parameter, argument in zip(function.parameters, arguments, strict=True):
            if not isinstance(argument, Slot) and parameter.name in self._assigned[function.name]:
                own = [arithmetic.fresh(banks_of(part)) for part in parts(parameter.type)]
                caller.set(own, argument)
                argument = list(own)
            bound[parameter.name] = argument
        results = [arithmetic.fresh(banks_of(part)) for part in parts(function.result)]
        BodyLowering(self, caller.code, function, bound, results, caller.memory).lower()
        return list(results)

    def _called(self, caller: BodyLowering, function: ir.Function, arguments: Sequence[Bound], node: ir.Call) -> Value:
        tables = tuple(one.name for one in arguments if isinstance(one, Slot))
        key = (function.name, tables)
        if key not in self.routines:
            written = self.written.get(function.name)
            self.routines[key] = (
                self._written(function, written) if written else self._routine(function, arguments, node)
            )
        routine = self.routines[key]
        self._open[-1] = max(self._open[-1], routine.depth + 1)
        given: list[Operand] = []
        for parameter, argument in zip(function.parameters, arguments, strict=True):
            if not isinstance(argument, Slot):
                assert isinstance(parameter.type, Type)
                given += argument
        results = [caller.arithmetic.fresh(place.banks) for place in routine.results]
        caller.code.call(routine.label, given, results)
        caller.memory.forget()
        return list(results)

    def _routine(self, function: ir.Function, arguments: Sequence[Bound], node: ir.Call) -> _Routine:
        code = Code(origin=Origin(function.name, function.span))
        memory = self._memory(code)
        arithmetic = memory.arithmetic
        bound: dict[str, Bound] = {}
        for parameter, argument in zip(function.parameters, arguments, strict=True):
            if isinstance(argument, Slot):
                bound[parameter.name] = argument
            else:
                bound[parameter.name] = [arithmetic.fresh(banks_of(part)) for part in parts(parameter.type)]
        label = self.fresh_label(self.label_of(function.name))
        results = [arithmetic.fresh(banks_of(part)) for part in parts(function.result)]
        self._open.append(0)
        BodyLowering(self, code, function, bound, results, memory).lower()
        depth = self._open.pop()
        if depth + 1 >= CALL_DEPTH:
            message = f"calls are nested too deeply for the processor unit (in `{function.name}`)"
            raise SourceError([Diagnostic(message, node.span, f"at most {CALL_DEPTH} levels of subroutines")])
        return _Routine(label, bound, results, self._allocate(label, code, bound, results), depth)

    def _written(self, function: ir.Function, written: Written) -> _Routine:
        """A subroutine by hand: its registers are what the convention and its words say."""
        label = self.fresh_label(self.label_of(function.name))
        types = [one.type for one in function.parameters if isinstance(one.type, Type)]
        given, made = registers(types), registers([function.result])
        taken = set(written.changed).union(*(place.cells for place in (*given, *made)))
        results = [Register(place.banks).place for place in made]
        return _Routine(label, {}, results, Allocated(label, [], [*given], [*made], taken, self.frame_rows), 0)

    def _allocate(self, label: str, code: Code, bound: dict[str, Bound], results: list[Place]) -> Allocated:
        parameters = [one for value in bound.values() if not isinstance(value, Slot) for one in value]
        callees_ = {routine.label: routine.allocated for routine in self.routines.values()}
        places = [one for one in parameters if isinstance(one, Place)]
        allocated = allocate(label, code.items, places, results, callees_, self.frame_rows)
        self.frame_rows = allocated.frame_end
        return allocated

    # --- tables, arrays, lengths --------------------------------------------------------------------------------------

    def table(self, name: str) -> Slot:
        return self._described(name, self.program.tables[name])

    def array(self, function: str, name: str, type_: Array) -> Slot:
        """The rows of a local array. One for all lowerings of its function, which never run inside each other."""
        shown = f"{self.label_of(function)}_{name}"
        return self._slot(f"{function} {name}", shown, element_record(type_), type_.length)

    def _memory(self, code: Code) -> MemoryAccess:
        return MemoryAccess(Arithmetic(code), self._fault if self.checked else None)

    def _fault(self, slot: Slot, origin: Origin) -> tuple[int, str]:
        label = self.fresh_label("fault")
        self.sites.append(AccessSite(label, slot.key.removeprefix("parameter "), origin))
        return self.described.index(slot.key), label

    def length(self, caller: BodyLowering, slot: Slot, into: Place | None) -> Operand:
        """The count in a table's descriptor."""
        caller.code.effect("fetch", self.described.index(slot.key))
        return caller.code.emit("take_y", into or caller.arithmetic.fresh("i"))

    def _described(self, key: str, record: Record) -> Slot:
        if key not in self.described:
            self.described.append(key)
        return self._slot(key, key.rsplit(" ", 1)[-1], record)

    def _slot(self, key: str, name: str, record: Record, length: int | None = None) -> Slot:
        if key not in self.slots:
            if len(self.slots) >= DEFAULT.register_counts["br"] - 1:
                limit = f"at most {DEFAULT.register_counts['br'] - 1} tables and local arrays"
                raise SourceError([Diagnostic("too many tables for the address generator", None, limit, found=name)])
            self.slots[key] = Slot(key, self._word(name), record, self._record(record), length)
        return self.slots[key]

    def _record(self, record: Record) -> RecordText:
        if record not in self.records:
            self.records[record] = RecordText.of(self._word(f"{record.name}_record"), record)
        return self.records[record]

    # --- names --------------------------------------------------------------------------------------------------------

    def label_of(self, function: str) -> str:
        """The short name of a function: that of its module."""
        return function.replace(".", ":").rsplit(":", 1)[-1]

    def fresh_label(self, name: str) -> str:
        """A label that no other place has."""
        self._labels[name] += 1
        return self._word(f"{name}_{self._labels[name]}")

    def _word(self, name: str) -> str:
        while name in self._words or name in PREDEFINED or register(name):
            name += "_"
        self._words.add(name)
        return name


def _worth_inlining(program: ir.Program) -> set[str]:
    """The functions whose bodies are copied to where they are called, callers before what they call."""
    bodies: Counter[str] = Counter({program.entry: 1})
    found: set[str] = set()
    for function in _callers_first(program):
        copies = bodies[function.name]
        if _size(function.body) * (copies - 1) <= INLINED:
            found.add(function.name)
        else:
            copies = 1
        for callee in callees(function.body):
            bodies[callee] += copies
    return found


def _callers_first(program: ir.Program) -> list[ir.Function]:
    """The entry and what it reaches, every function behind all that call it."""
    ended: dict[str, ir.Function] = {}

    def visit(function: ir.Function) -> None:
        if function.name not in ended:
            for callee in callees(function.body):
                visit(program.functions[callee])
            ended[function.name] = function

    visit(program.functions[program.entry])
    return list(ended.values())[::-1]


def _assigned(node: object) -> set[str]:
    """The variables that statements assign to."""
    if isinstance(node, tuple):
        return set().union(*map(_assigned, node))
    if isinstance(node, ir.If | ir.Loop):
        return set().union(*(_assigned(part) for part in vars(node).values()))
    target = getattr(node, "target", None)
    return {target} if isinstance(target, str) else set()


def _size(node: object) -> int:
    if isinstance(node, tuple):
        return sum(map(_size, node))
    return 1 + sum(map(_size, vars(node).values())) if isinstance(node, ir.Node) else 0
