"""Microcode to LLVM: each basic block of microinstructions becomes straight code.

The function is `run(state, memory, display, control, executions)`: the words of `layout`, the rows of data and display
memory, three 64-bit numbers (`BUDGET`, `PART_START`, `PART_STEPS`) and a 64-bit counter for each block. It runs whole
blocks as long as the budget of steps lasts, and returns

- at the halt;
- *before* a step that would trap, whatever the trap: the plain simulator makes that step, and says what is wrong;
- before a block that the budget does not reach through, and at an address where no block begins: the plain simulator
  makes these steps too.

Within a block registers, outputs and flags are LLVM's values; between blocks they stand in the state's words. (With
variables of LLVM's own in their place loops ran half as fast again, but the time to compile grew with the square of the
program.) `executions` counts blocks that ran to their end; PART_START and PART_STEPS say which block was left before
its end, and after how many steps.
"""

from __future__ import annotations

from tasuki.machines.pu import isa
from tasuki.machines.pu.simulate import operations
from tasuki.machines.pu.simulate.blocks import Block, blocks
from tasuki.machines.pu.simulate.emit import TRUE, Emitter, Value, constant
from tasuki.machines.pu.simulate.instruction import BANKS, CONDITION_FLAGS, FPP, SELECT_FLAGS, Instruction
from tasuki.machines.pu.simulate.layout import CALL_STACK, LOOP_STACK, register_slot
from tasuki.machines.pu.simulate.native_tables import table_functions

BUDGET, PART_START, PART_STEPS = range(3)
CONTROL_WORDS = 3


def translate(program: isa.Program) -> str:
    """The LLVM text of a program."""
    return _Translator(program).text()


class _Translator:
    def __init__(self, program: isa.Program) -> None:
        self.program = program
        self.blocks = blocks(program)
        self.starts = {block.start for block in self.blocks}
        self.outside: dict[int, None] = {}
        self.uses_tables = False
        self.e = Emitter()
        self.labels = 0

    def text(self) -> str:
        self.e.block("entry")
        self.e.line("br label %dispatch")
        self.dispatch()
        for index, block in enumerate(self.blocks):
            self.block(index, block)
        for address in self.outside:
            self.e.block(f"outside{address}")
            self.stop_at(address)
        self.leave()
        head = "define void @run(ptr noalias %state, ptr noalias %memory, ptr noalias %display, "
        head += "ptr noalias %control, ptr noalias %executions) {"
        tables = table_functions() if self.uses_tables else ""
        return "\n".join([operations.DECLARATIONS, tables, head, *self.e.lines, "}", ""])

    # --- the frame of the function ------------------------------------------------------------------------------------

    def dispatch(self) -> None:
        """To the block that begins at the address of a return or of a jump to the ALU's output."""
        self.e.block("dispatch")
        address = self.e.read("address")
        cases = " ".join(f"i32 {block.start}, label %block{block.start}" for block in self.blocks)
        self.e.line(f"switch {address}, label %leave [ {cases} ]")

    def leave(self) -> None:
        """Back to the host."""
        self.e.block("leave")
        self.e.line("ret void")

    def label(self, name: str) -> str:
        self.labels += 1
        return f"{name}.{self.labels}"

    def stop_at(self, address: int) -> None:
        """Return to the host; `address` is next."""
        self.e.store("address", constant(address))
        self.e.line("br label %leave")

    def target(self, address: int) -> str:
        """The label of the block at an address, or one that returns to the host."""
        if address in self.starts:
            return f"block{address}"
        self.outside[address] = None
        return f"outside{address}"

    def spend(self, steps: int) -> None:
        left = self.e.value("i64", "load i64, ptr %control")
        self.e.line(f"store {self.e.value('i64', f'sub {left}, {steps}')}, ptr %control")

    # --- a block ------------------------------------------------------------------------------------------------------

    def block(self, index: int, block: Block) -> None:
        e = self.e
        e.block(f"block{block.start}")
        left = e.value("i64", "load i64, ptr %control")
        enough = e.value("i1", f"icmp uge {left}, {len(block.instructions)}")
        short, steps = self.label("short"), self.label("steps")
        e.line(f"br {enough}, label %{steps}, label %{short}")
        e.block(short)
        self.stop_at(block.start)
        e.block(steps)
        for offset, one in enumerate(block.instructions):
            if one.problems:
                # The machine traps here whatever the state: the rest of the block is never reached.
                self.stop_within(block, offset)
                return
            _Step(self, block, offset, one).emit(index)

    def stop_within(self, block: Block, offset: int) -> None:
        """Return to the host before the step at `offset`."""
        e = self.e
        e.flush()
        self.spend(offset)
        for word, number in ((PART_START, block.start), (PART_STEPS, offset)):
            e.line(f"store i64 {number}, ptr {e.value('ptr', f'getelementptr i64, ptr %control, i32 {word}').text}")
        if offset:
            e.store("came_from", constant(block.start + offset - 1))
        self.stop_at(block.start + offset)


class _Step:
    """One microinstruction. Everything is read and computed first; `e.write` comes after."""

    def __init__(self, translator: _Translator, block: Block, offset: int, one: Instruction) -> None:
        self.t = translator
        self.e = translator.e
        self.block = block
        self.offset = offset
        self.address = block.start + offset
        self.one = one
        self.name = one.name
        self.number = one.number

    def emit(self, index: int) -> None:
        e, name = self.e, self.name
        condition = self.condition()
        row = self.row()
        alu = e.read("alu.output")
        self.guard(row, condition)
        results, flags = self.arithmetic(condition)
        special = e.read("special") if name["tab.op"] != "none" else None
        if special is not None:
            results["table"], special = self.table()
        written = self.register_writes(results) | self.address_registers(row, alu)
        bus = {bank: self.data_bus(bank) for bank in BANKS}

        self.access(row, bus)
        for unit, value in results.items():
            e.write(f"{unit}.output", value)
        for slot, value in (flags | written).items():
            e.write(slot, value)
        if special is not None:
            e.write("special", special)
        if name["ag.mode"] != "hold":
            e.write("row", row)
        if name["disp.op"] == "frame":
            e.write("frames", e.value("i32", f"add {e.read('frames')}, 1"))
        self.stacks(alu)
        if self.address + 1 == self.block.end:
            self.end(index, condition, alu)

    # --- what is read -------------------------------------------------------------------------------------------------

    def register(self, field: str) -> Value:
        unit, name = field.split(".")
        return self.e.read(register_slot(name if unit == "ag" else unit, self.number[field]))

    def literal(self) -> Value:
        return constant(self.number["lit"])

    def condition(self) -> Value:
        """Whether the sequencer's condition holds, polarity and all."""
        holds = self.flag(self.name["seq.cond"])
        return self.e.not_(holds) if self.name["seq.not"] == "yes" else holds

    def flag(self, name: str) -> Value:
        e = self.e
        if name == "true":
            return TRUE
        if name == "special":
            return e.read("special")
        if name == "more":
            some = operations.integer_test(e, "ne", e.read("loops"), 0)
            above = operations.integer_test(e, "ugt", self.loop_top()[1], 1)
            return e.value("i1", f"and {some}, {above.text}")
        unit, test = name.split(".")
        flags = [e.read(f"{unit}.{each}") for each in CONDITION_FLAGS.get(test, (test,))]
        return flags[0] if len(flags) == 1 else e.either(*flags)

    def source(self, unit: str, operand: str) -> Value:
        """The word that a selector delivers."""
        e, source = self.e, self.name[f"{unit}.{operand}"]
        if source == "reg":
            return self.register(f"{unit}.r{operand}")
        if source == "own":
            return e.read(f"{unit}.output")
        if source in (*FPP, "table", "alu"):
            return e.read(f"{source}.output")
        if source == "lit":
            return self.literal()
        if source == "port":
            return self.register("s.ra")
        if source == "mem":
            return e.read(f"{unit}.latch")
        if source.startswith("mem"):
            return e.read(f"{source[-1]}.latch")
        return e.read("row") if source == "row" else self.register(f"ag.{source}")

    def data_bus(self, bank: str) -> Value:
        source = self.name[f"mem.{bank}"]
        if source == "out":
            return self.e.read(f"{bank}.output")
        if source == "port":
            return self.register(f"{bank}.ra")
        return self.e.read("alu.output") if source == "alu" else self.literal()

    # --- traps --------------------------------------------------------------------------------------------------------

    def guard(self, row: Value, condition: Value) -> None:
        """Leave before this step if it would trap."""
        e = self.e
        reasons = []
        if self.one.accesses_memory:
            reasons.append(operations.integer_test(e, "uge", row, self.t.program.memory_rows))
        if self.one.accesses_display:
            reasons.append(operations.integer_test(e, "uge", row, self.t.program.display_rows))
        reasons += self.stack_faults(condition)
        if not reasons:
            return
        any_reason = reasons[0]
        for reason in reasons[1:]:
            any_reason = e.either(any_reason, reason)
        trap, fine = self.t.label("trap"), self.t.label("fine")
        e.line(f"br {any_reason}, label %{trap}, label %{fine}")
        # Both labels keep what has been read: their only predecessor is the code above.
        e.lines.append(f"{trap}:")
        self.t.stop_within(self.block, self.offset)
        e.lines.append(f"{fine}:")

    def stack_faults(self, condition: Value) -> list[Value]:
        e, operation = self.e, self.name["seq.op"]
        if operation in ("call", "call_alu"):
            full = operations.integer_test(e, "uge", e.read("calls"), isa.CALL_DEPTH)
            return [e.value("i1", f"and {full}, {condition.text}")]
        if operation == "return":
            empty = operations.integer_test(e, "eq", e.read("calls"), 0)
            return [e.value("i1", f"and {empty}, {condition.text}")]
        if operation in ("count", "count_alu"):
            return [operations.integer_test(e, "uge", e.read("loops"), isa.LOOP_DEPTH)]
        if operation in ("loop", "drop"):
            return [operations.integer_test(e, "eq", e.read("loops"), 0)]
        return []

    # --- arithmetic ---------------------------------------------------------------------------------------------------

    def arithmetic(self, condition: Value) -> tuple[dict[str, Value], dict[str, Value]]:
        """New outputs, by unit, and new flags, by slot."""
        results: dict[str, Value] = {}
        flags: dict[str, Value] = {}
        for unit in (*FPP, "alu"):
            operation = self.name[f"{unit}.op"]
            if operation == "nop":
                continue
            reads = isa.DEFAULT.by_name[f"{unit}.op"].by_code[self.number[f"{unit}.op"]].reads
            a = self.source(unit, "a") if "a" in reads else constant(0)
            b = self.source(unit, "b") if "b" in reads else constant(0)
            if operation == "cmp":
                found = operations.compare(self.e, unit, a, b)
                flags |= {f"{unit}.{flag}": value for flag, value in found.items()}
            else:
                results[unit] = self.operation(unit, operation, a, b, condition)
        return results, flags

    def operation(self, unit: str, operation: str, a: Value, b: Value, condition: Value) -> Value:
        e = self.e
        if operation == "pick":
            return e.select(condition, e.integer(a), e.integer(b))
        if operation == "test":
            return e.value("i32", f"zext {condition} to i32")
        if unit == "alu":
            return operations.INTEGER[operation](e, a, b)
        if operation in SELECT_FLAGS:
            flags = [e.read(f"{unit}.{flag}") for flag in SELECT_FLAGS[operation]]
            chosen = flags[0] if len(flags) == 1 else e.either(*flags)
            return e.select(chosen, e.floating(a), e.floating(b))
        if operation in ("addg", "subg"):
            result = operations.FLOAT[operation[:3]](e, a, b)
            return e.select(e.read("special"), e.floating(a), result)
        return operations.FLOAT[operation](e, a, b)

    def table(self) -> tuple[Value, Value]:
        """The word that the table gives, and its special flag."""
        e, source = self.e, self.name["tab.in"]
        self.t.uses_tables = True
        if source == "port":
            argument = self.register("s.ra")
        else:
            argument = e.read("s.latch" if source == "mem" else f"{source}.output")
        pair = e.value("", f"call {{ i32, i1 }} @lookup_{self.name['tab.op']}({e.integer(argument)})").text
        word = e.value("i32", f"extractvalue {{ i32, i1 }} {pair}, 0")
        return word, e.value("i1", f"extractvalue {{ i32, i1 }} {pair}, 1")

    # --- addresses and memory -----------------------------------------------------------------------------------------

    def row(self) -> Value:
        e, mode = self.e, self.name["ag.mode"]
        if mode == "hold":
            return e.read("row")
        if mode.startswith("pointer"):
            row = e.read("alu.output")
        else:
            row = self.register("ag.br")
        if mode.startswith(("linear", "plane")):
            factor = self.register("ag.ir") if mode.startswith("linear") else self.partner("ir")
            product = e.value("i32", f"mul {factor}, {self.register('ag.ar').text}")
            row = e.value("i32", f"add {row}, {product.text}")
        if mode.startswith("plane"):
            row = e.value("i32", f"add {row}, {self.register('ag.ir').text}")
        return e.value("i32", f"add {row}, {self.literal().text}") if mode.endswith("_lit") else row

    def partner(self, file: str) -> Value:
        return self.e.read(register_slot(file, self.number[f"ag.{file}"] ^ 1))

    def address_registers(self, row: Value, alu: Value) -> dict[str, Value]:
        """What `ag.update` and `ag.load` write: slot -> value."""
        e, update, load = self.e, self.name["ag.update"], self.name["ag.load"]
        written: dict[str, Value] = {}
        if update != "hold":
            number = self.number["ag.ir"]
            word = e.value("i32", f"add {self.register('ag.ir')}, {-1 if update == 'dec' else 1}")
            if update == "raster":
                at_end = operations.integer_test(e, "eq", word, self.partner("ar"))
                line = self.partner("ir")
                following = e.value("i32", f"add {line}, 1")
                written[register_slot("ir", number ^ 1)] = e.select(at_end, following, line)
                word = e.select(at_end, constant(0), word)
            written[register_slot("ir", number)] = word
        if load != "none":
            file, source = load.split("_")
            words = {"alu": alu, "lit": self.literal(), "row": row}
            written[register_slot(file, self.number[f"ag.{file}"])] = words[source]
        return written

    def register_writes(self, results: dict[str, Value]) -> dict[str, Value]:
        e = self.e
        written = {}
        for unit in (*FPP, "alu"):
            write = self.name[f"{unit}.w"]
            if write == "none":
                continue
            if write == "result" and unit in results:
                word = results[unit]
            elif write == "mem":
                word = e.read(f"{unit}.latch")
            else:
                word = e.read("table.output" if write == "table" else f"{unit}.output")
            written[register_slot(unit, self.number[f"{unit}.rd"])] = word
        return written

    def access(self, row: Value, bus: dict[str, Value]) -> None:
        e, operation = self.e, self.name["mem.op"]
        if self.one.accesses_memory:
            at = e.value("i64", f"zext {row} to i64").text
            for bank in self.one.banks:
                place = e.value("ptr", f"getelementptr [4 x i32], ptr %memory, i64 {at}, i64 {BANKS.index(bank)}")
                if operation == "read":
                    e.write(f"{bank}.latch", e.value("float", f"load float, {place}"))
                else:
                    e.line(f"store {bus[bank]}, {place}")
        if self.one.accesses_display:
            at = e.value("i64", f"zext {row} to i64").text
            for column, bank in enumerate(BANKS):
                place = e.value("ptr", f"getelementptr [4 x i32], ptr %display, i64 {at}, i64 {column}")
                e.line(f"store {bus[bank]}, {place}")

    # --- the sequencer ------------------------------------------------------------------------------------------------

    def stack_place(self, stack: int, depth: Value) -> Value:
        """The word of the state that stands at `depth` on a stack."""
        index = self.e.value("i32", f"add {depth}, {stack}")
        return self.e.value("ptr", f"getelementptr i32, ptr %state, {index}")

    def loop_top(self) -> tuple[Value, Value]:
        """(place, count) of the loop stack's top; where it is empty, some other word of the state."""
        place = self.stack_place(LOOP_STACK - 1, self.e.read("loops"))
        return place, self.e.value("i32", f"load i32, {place}")

    def stacks(self, alu: Value) -> None:
        """Effects on the loop stack that no condition decides."""
        e, operation = self.e, self.name["seq.op"]
        if operation in ("count", "count_alu"):
            depth = e.read("loops")
            e.line(f"store {self.literal() if operation == 'count' else alu}, {self.stack_place(LOOP_STACK, depth)}")
            e.write("loops", e.value("i32", f"add {depth}, 1"))
        elif operation == "drop":
            e.write("loops", e.value("i32", f"sub {e.read('loops')}, 1"))

    def end(self, index: int, condition: Value, alu: Value) -> None:
        """The block ends: count it, and go where the sequencer says."""
        e = self.e
        place = e.value("ptr", f"getelementptr i64, ptr %executions, i32 {index}")
        before = e.value("i64", f"load i64, {place}")
        e.line(f"store {e.value('i64', f'add {before}, 1')}, {place}")
        self.t.spend(len(self.block.instructions))
        e.write("came_from", constant(self.address))
        operation = self.name["seq.op"]
        following = self.t.target(self.block.end)
        if operation == "loop":
            self.loop(following)
            return
        e.flush()
        if operation in ("next", "count", "count_alu", "drop"):
            e.line(f"br label %{following}")
            return
        taken = self.t.label("taken")
        e.line(f"br {condition}, label %{taken}, label %{following}")
        e.block(taken)
        self.taken(operation, alu)

    def loop(self, following: str) -> None:
        e = self.e
        place, top = self.loop_top()
        again = operations.integer_test(e, "ugt", top, 1)
        # Where the count is taken off, nobody reads its word any more.
        e.line(f"store {e.value('i32', f'sub {top}, 1')}, {place}")
        depth = e.read("loops")
        e.write("loops", e.select(again, depth, e.value("i32", f"sub {depth}, 1")))
        e.flush()
        e.line(f"br {again}, label %{self.t.target(self.number['seq.to'])}, label %{following}")

    def taken(self, operation: str, alu: Value) -> None:
        """A jump, call, return or halt whose condition holds. `alu` is the ALU's output before the step."""
        e = self.e
        if operation == "halt":
            e.store("halted", TRUE)
            self.t.stop_at(self.address)
            return
        if operation.startswith("call"):
            depth = e.read("calls")
            e.line(f"store i32 {self.block.end}, {self.stack_place(CALL_STACK, depth)}")
            e.write("calls", e.value("i32", f"add {depth}, 1"))
        if operation == "return":
            depth = e.value("i32", f"sub {e.read('calls')}, 1")
            e.write("calls", depth)
            e.write("address", e.value("i32", f"load i32, {self.stack_place(CALL_STACK, depth)}"))
        elif operation.endswith("_alu"):
            e.write("address", alu)
        e.flush()
        dynamic = operation == "return" or operation.endswith("_alu")
        e.line(f"br label %{'dispatch' if dynamic else self.t.target(self.number['seq.to'])}")
