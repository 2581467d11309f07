"""A microinstruction taken apart: what each unit does in it, with the fields that say so.

An operation is a set of fields with their numbers. Two operations fit into one microinstruction where no field would
have two numbers (a shared read port, the literal, the condition) and no bus two drivers. What an operation reads and
writes are *resources*: registers ("x", 3), outputs ("out", "x"), flags, latches, the row register, memory, stacks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from tasuki.machines.pu.isa import DEFAULT, FPPS
from tasuki.machines.pu.simulate.instruction import SELECT_FLAGS, Instruction

Resource = tuple[str, str | int]
TABLE: Resource = ("out", "table")
"""The table's output, and the special flag with it."""
ROW: Resource = ("row", "")
MEMORY: Resource = ("memory", "")
DISPLAY: Resource = ("display", "")
LOOPS: Resource = ("loops", "")
CALLS: Resource = ("calls", "")
CONTROL = ("jump", "call", "return", "jump_alu", "call_alu", "loop", "halt")
"""Operations of the sequencer after which a block ends."""


@dataclass(eq=False)
class Operation:
    """What one unit does. `address` is that of its microinstruction; `control`: the block ends with it."""

    address: int
    fields: dict[str, int] = field(default_factory=dict)
    reads: set[Resource] = field(default_factory=set)
    writes: set[Resource] = field(default_factory=set)
    control: bool = False


def operations(address: int, one: Instruction) -> list[Operation]:
    """What the units do in a microinstruction without problems; nothing for an idle one."""
    return list(_Parts(address, one).all())


class _Parts:
    def __init__(self, address: int, one: Instruction) -> None:
        self.address, self.one = address, one

    def all(self) -> Iterator[Operation]:
        for unit in FPPS:
            yield from self.unit(unit)
        if self.one.name["tab.op"] != "none":
            yield self.table()
        yield from self.unit("alu")
        yield from self.addresses()
        if self.one.name["seq.op"] != "next":
            yield self.sequencer()

    # --- small things -------------------------------------------------------------------------------------------------

    def start(self, *names: str) -> Operation:
        return Operation(self.address, {name: self.one.number[name] for name in names})

    def use(self, operation: Operation, *names: str) -> None:
        """The operation needs these fields as they are."""
        operation.fields.update((name, self.one.number[name]) for name in names)

    def register(self, operation: Operation, name: str) -> Resource:
        """The register that a field such as "x.ra" or "ag.br" names, which the operation needs."""
        self.use(operation, name)
        unit, last = name.split(".")
        return (last if unit == "ag" else unit, self.one.number[name])

    def condition(self, operation: Operation) -> None:
        self.use(operation, "seq.cond", "seq.not")
        name = self.one.name["seq.cond"]
        if name == "special":
            operation.reads.add(TABLE)
        elif name == "more":
            operation.reads.add(LOOPS)
        elif name != "true":
            operation.reads.add(("flags", name.split(".")[0]))

    def source(self, operation: Operation, unit: str, port: str, source: str) -> None:
        """What a selector delivers."""
        if source == "reg":
            operation.reads.add(self.register(operation, f"{unit}.r{port}"))
        elif source == "port":
            operation.reads.add(self.register(operation, "s.ra"))
        elif source == "lit":
            self.use(operation, "lit")
        elif source == "row":
            operation.reads.add(ROW)
        elif source in ("br", "ir", "ar"):
            operation.reads.add(self.register(operation, f"ag.{source}"))
        elif source.startswith("mem"):
            operation.reads.add(("latch", source[3:] or ("s" if unit == "tab" else unit)))
        else:
            operation.reads.add(("out", unit if source == "own" else source))

    # --- FPPs, ALU, tables --------------------------------------------------------------------------------------------

    def unit(self, unit: str) -> Iterator[Operation]:
        """An FPP or the ALU: its operation, and a register that is written with something else."""
        value = DEFAULT.by_name[f"{unit}.op"].by_code[self.one.number[f"{unit}.op"]]
        write = self.one.name[f"{unit}.w"]
        if value.name != "nop":
            operation = self.start(f"{unit}.op")
            for port in value.reads:
                self.use(operation, f"{unit}.{port}")
                self.source(operation, unit, port, self.one.name[f"{unit}.{port}"])
            self.conditions_of(operation, unit, value.name)
            operation.writes.add(("out" if value.result else "flags", unit))
            if write == "result":
                self.use(operation, f"{unit}.w")
                operation.writes.add(self.register(operation, f"{unit}.rd"))
                if not value.result:
                    # A comparison leaves the output as it is, and that is what is written.
                    operation.reads.add(("out", unit))
            yield operation
        if write not in ("none", "result") or (write == "result" and value.name == "nop"):
            yield self.kept(unit, write)

    def conditions_of(self, operation: Operation, unit: str, name: str) -> None:
        if name in ("pick", "test"):
            self.condition(operation)
        elif name in SELECT_FLAGS:
            operation.reads.add(("flags", unit))
        elif name in ("addg", "subg"):
            operation.reads.add(TABLE)

    def kept(self, unit: str, write: str) -> Operation:
        """A register takes a latch, the table's output, or the unit's own as it holds."""
        operation = self.start(f"{unit}.w")
        operation.writes.add(self.register(operation, f"{unit}.rd"))
        if write == "mem":
            operation.reads.add(("latch", unit))
        elif write == "table":
            operation.reads.add(TABLE)
        else:
            operation.reads.add(("out", unit))
        if write == "result":
            # The output as it holds: no other operation of this unit may give a result in this step.
            self.use(operation, f"{unit}.op")
        return operation

    def table(self) -> Operation:
        operation = self.start("tab.op", "tab.in")
        self.source(operation, "tab", "", self.one.name["tab.in"])
        operation.writes.add(TABLE)
        return operation

    # --- memory, address generator, display -------------------------------------------------------------------------

    def addresses(self) -> Iterator[Operation]:
        name = self.one.name
        takes_row = name["ag.load"] == "br_row"
        if name["ag.mode"] != "hold" or name["mem.op"] != "none" or name["disp.op"] == "pixel" or takes_row:
            yield self.access(takes_row)
        if name["disp.op"] == "frame":
            operation = self.start("disp.op")
            operation.writes.add(DISPLAY)
            yield operation
        if name["ag.update"] != "hold":
            yield self.update()
        if name["ag.load"] != "none" and not takes_row:
            yield self.load()

    def access(self, takes_row: bool) -> Operation:
        """A row is computed, and used."""
        name = self.one.name
        operation = self.start("ag.mode")
        self.row(operation, name["ag.mode"])
        if name["mem.op"] != "none":
            self.use(operation, "mem.op", "mem.on")
        if name["mem.op"] == "read":
            operation.reads.add(MEMORY)
            operation.writes |= {("latch", bank) for bank in self.one.banks}
        elif name["mem.op"] == "write":
            operation.writes.add(MEMORY)
        shown = name["disp.op"] == "pixel"
        if shown:
            self.use(operation, "disp.op")
            operation.writes.add(DISPLAY)
        for bank in FPPS if shown else self.one.banks if name["mem.op"] == "write" else ():
            self.data(operation, bank)
        if takes_row:
            self.use(operation, "ag.load")
            operation.writes.add(self.register(operation, "ag.br"))
        return operation

    def row(self, operation: Operation, mode: str) -> None:
        """What the calculator reads in a mode."""
        if mode == "hold":
            operation.reads.add(ROW)
            return
        operation.writes.add(ROW)
        if mode.endswith("_lit"):
            self.use(operation, "lit")
        if mode.startswith("pointer"):
            operation.reads.add(("out", "alu"))
            return
        files = ("br",) if mode == "base_lit" else ("br", "ir", "ar")
        operation.reads |= {self.register(operation, f"ag.{file}") for file in files}
        if mode.startswith("plane"):
            operation.reads.add(("ir", self.one.number["ag.ir"] ^ 1))

    def data(self, operation: Operation, bank: str) -> None:
        """What a data bus carries."""
        self.use(operation, f"mem.{bank}")
        source = self.one.name[f"mem.{bank}"]
        if source == "port":
            operation.reads.add(self.register(operation, f"{bank}.ra"))
        elif source == "lit":
            self.use(operation, "lit")
        else:
            operation.reads.add(("out", bank if source == "out" else "alu"))

    def update(self) -> Operation:
        operation = self.start("ag.update")
        index = self.register(operation, "ag.ir")
        operation.reads.add(index)
        operation.writes.add(index)
        if self.one.name["ag.update"] == "raster":
            partner = ("ir", self.one.number["ag.ir"] ^ 1)
            self.use(operation, "ag.ar")
            operation.reads |= {partner, ("ar", self.one.number["ag.ar"] ^ 1)}
            operation.writes.add(partner)
        return operation

    def load(self) -> Operation:
        file, source = self.one.name["ag.load"].split("_")
        operation = self.start("ag.load")
        operation.writes.add(self.register(operation, f"ag.{file}"))
        self.source(operation, "ag", "", source)
        return operation

    # --- the sequencer ------------------------------------------------------------------------------------------------

    def sequencer(self) -> Operation:
        name = self.one.name["seq.op"]
        operation = self.start("seq.op")
        operation.control = name in CONTROL
        if name in ("jump", "call", "loop"):
            self.use(operation, "seq.to")
        if name in ("count", "count_alu", "drop", "loop"):
            operation.reads.add(LOOPS)
            operation.writes.add(LOOPS)
        else:
            self.condition(operation)
        if name in ("call", "call_alu", "return"):
            operation.writes.add(CALLS)
        if name == "count":
            self.use(operation, "lit")
        if name.endswith("_alu"):
            operation.reads.add(("out", "alu"))
        return operation
