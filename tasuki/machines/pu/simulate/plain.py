"""The plain simulator: one `step()`, one clock. It is the definition of what microcode does; `fast` must agree.

Known inaccuracies, against a machine of 1986 that somebody would have built:

- every operation, table access and memory access takes one step, however long the signals' way; there is no pipeline,
  no refresh of dynamic memory, and the display port is always ready;
- floats are IEEE 754 binary32 with gradual underflow and one canonical NaN; a machine of 1986 would hardly have had it;
- memory, registers and outputs begin as 0, not as whatever they were when the power came;
- a trap stops the machine before the step, as if all checks were made in no time; real hardware would go on with
  whatever two drivers make of a bus.

What is simulated exactly: the bits of the microinstruction, what is read before and written after a step, every word
that arithmetic gives, and the number of steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tasuki.machines.pu import isa
from tasuki.machines.pu.simulate.arithmetic import FLOAT, INTEGER, WORD, float_flags, integer_flags
from tasuki.machines.pu.simulate.instruction import BANKS, CONDITION_FLAGS, FPP, SELECT_FLAGS, Instruction, instruction
from tasuki.machines.pu.simulate.state import State, start
from tasuki.machines.pu.simulate.traps import Trap

_LATCHES = ("memx", "memy", "memz", "mems")


@dataclass(frozen=True)
class Step:
    """What one step did, for traces.

    `results` has the new words of outputs, `flags` the flags that comparisons set, `written` the registers: (file,
    number) -> word; `row` is the row that was computed or held.
    """

    number: int
    address: int
    instruction: Instruction
    row: int
    results: dict[str, int]
    flags: dict[str, dict[str, bool]]
    written: dict[tuple[str, int], int]


class Plain:
    """A processor unit with a program. `step()` until `state.halted`; `executions[i]` counts the runs of word i."""

    def __init__(self, program: isa.Program, state: State | None = None) -> None:
        self.program = program
        self.state = start(program) if state is None else state
        self.executions = [0] * len(program.words)

    def repeat(self, address: int, times: int, limit: int, home: int) -> npt.NDArray[np.int64]:
        """Go on at `address` until the halt at `home`, so many times; the steps of each.

        After one that halts elsewhere, or that has not halted within `limit` steps, nothing more is run. Raises Trap
        where a step cannot be made.
        """
        steps = np.zeros(times, np.int64)
        for turn in range(times):
            before = self.state.steps
            self.state.halted, self.state.address = False, address
            self.advance(limit)
            steps[turn] = self.state.steps - before
            if not self.state.halted or self.state.address != home:
                break
        return steps

    def advance(self, steps: int) -> None:
        """Make `steps` steps, or fewer where the machine halts. Raises Trap where it cannot go on."""
        last = self.state.steps + steps
        while not self.state.halted and self.state.steps < last:
            self.step()

    def step(self) -> Step:
        """Make one step. Raises Trap, with the state unchanged, where the machine cannot.

        Everything is read first, into local names; then everything is written.
        """
        state = self.state
        one = self._fetch()
        condition = self._condition(one)
        row = self._row(one)
        self._check(one, row, condition)

        results, flags = self._arithmetic(one, condition)
        special = state.special
        if one.name["tab.op"] != "none":
            results["table"], special = isa.lookup(one.name["tab.op"], self._table_input(one))
        written = self._register_writes(one, results) | self._address_registers(one, row)
        bus = [self._data_bus(one, bank) for bank in BANKS]
        after = self._sequence(one, condition)

        self._access(one, row, bus)
        state.output.update(results)
        state.flags.update(flags)
        state.special = special
        for (file, number), word in written.items():
            state.registers[file][number] = word
        state.row = row
        self._go_on(after)
        return Step(state.steps, state.came_from or 0, one, row, results, flags, written)

    # --- before anything changes --------------------------------------------------------------------------------------

    def _fetch(self) -> Instruction:
        state, words = self.state, self.program.words
        if state.address >= len(words):
            expected = f"an address from 0 to {len(words) - 1}, or a halt" if words else "a program that is not empty"
            found = f"address {state.address}"
            message = "the program runs on past its end"
            raise Trap("end", message, self.program, state, expected=expected, found=found)
        one = instruction(words[state.address])
        if one.problems:
            kind = "undefined" if one.problems[0].message.startswith("undefined") else "conflict"
            raise Trap(kind, "; ".join(problem.message for problem in one.problems), self.program, state)
        return one

    def _check(self, one: Instruction, row: int, condition: bool) -> None:
        """Traps that depend on the state: rows outside memory, stacks that are full or empty."""
        state = self.state
        if one.accesses_memory and row >= len(state.memory):
            raise self._outside("memory", "data memory", row, len(state.memory))
        if one.accesses_display and row >= len(state.display):
            raise self._outside("display", "display memory", row, len(state.display))
        operation = one.name["seq.op"]
        if operation in ("call", "call_alu") and condition and len(state.call_stack) >= isa.CALL_DEPTH:
            message = f"call stack overflow: it holds {isa.CALL_DEPTH} return addresses"
            raise Trap("call stack", message, self.program, state)
        if operation == "return" and condition and not state.call_stack:
            raise Trap("call stack", "return with an empty call stack", self.program, state)
        if operation in ("count", "count_alu") and len(state.loop_stack) >= isa.LOOP_DEPTH:
            message = f"loop stack overflow: it holds {isa.LOOP_DEPTH} counts"
            raise Trap("loop stack", message, self.program, state)
        if operation in ("loop", "drop") and not state.loop_stack:
            raise Trap("loop stack", f"{operation} with an empty loop stack", self.program, state)

    def _outside(self, kind: str, name: str, row: int, rows: int) -> Trap:
        expected = f"a row from 0 to {rows - 1}" if rows else "no access: it has no rows"
        return Trap(kind, f"an address outside {name}", self.program, self.state, expected=expected, found=f"row {row}")

    # --- what is read -------------------------------------------------------------------------------------------------

    def _register(self, one: Instruction, field: str) -> int:
        """The register that a field such as "x.ra" or "ag.br" names."""
        unit, name = field.split(".")
        return self.state.registers[name if unit == "ag" else unit][one.number[field]]

    def _condition(self, one: Instruction) -> bool:
        name = one.name["seq.cond"]
        return self._flag(name) != (one.name["seq.not"] == "yes")

    def _flag(self, name: str) -> bool:
        """A condition before its polarity."""
        state = self.state
        if name == "true":
            return True
        if name == "special":
            return state.special
        if name == "more":
            return bool(state.loop_stack) and state.loop_stack[-1] > 1
        unit, test = name.split(".")
        flags = state.flags[unit]
        return any(flags[each] for each in CONDITION_FLAGS.get(test, (test,)))

    def _source(self, one: Instruction, unit: str, operand: str) -> int:
        """The word that a selector delivers: operand "a" or "b" of an FPP or of the ALU."""
        state = self.state
        source = one.name[f"{unit}.{operand}"]
        if source == "reg":
            return self._register(one, f"{unit}.r{operand}")
        if source == "own":
            return state.output[unit]
        if source in state.output:
            return state.output[source]
        if source == "lit":
            return one.number["lit"]
        if source == "port":
            return self._register(one, "s.ra")
        if source == "mem":
            return state.latch[unit]
        if source in _LATCHES:
            return state.latch[source[-1]]
        return state.row if source == "row" else self._register(one, f"ag.{source}")

    def _table_input(self, one: Instruction) -> int:
        source = one.name["tab.in"]
        if source == "port":
            return self._register(one, "s.ra")
        return self.state.latch["s"] if source == "mem" else self.state.output[source]

    def _data_bus(self, one: Instruction, bank: str) -> int:
        """The word on a bank's data bus: for memory writes and the display."""
        source = one.name[f"mem.{bank}"]
        if source == "out":
            return self.state.output[bank]
        if source == "port":
            return self._register(one, f"{bank}.ra")
        return self.state.output["alu"] if source == "alu" else one.number["lit"]

    # --- arithmetic ---------------------------------------------------------------------------------------------------

    def _arithmetic(self, one: Instruction, condition: bool) -> tuple[dict[str, int], dict[str, dict[str, bool]]]:
        """New outputs of the FPPs and of the ALU, and the flags that comparisons set."""
        results: dict[str, int] = {}
        flags: dict[str, dict[str, bool]] = {}
        for unit in (*FPP, "alu"):
            operation = one.name[f"{unit}.op"]
            if operation == "nop":
                continue
            a, b = self._source(one, unit, "a"), self._source(one, unit, "b")
            if operation == "cmp":
                flags[unit] = integer_flags(a, b) if unit == "alu" else float_flags(a, b)
            elif operation == "pick":
                results[unit] = a if condition else b
            elif unit == "alu":
                results[unit] = int(condition) if operation == "test" else INTEGER[operation](a, b)
            else:
                results[unit] = self._float(unit, operation, a, b)
        return results, flags

    def _float(self, unit: str, operation: str, a: int, b: int) -> int:
        if operation in SELECT_FLAGS:
            chosen = any(self.state.flags[unit][flag] for flag in SELECT_FLAGS[operation])
            return a if chosen else b
        if operation in ("addg", "subg"):
            return a if self.state.special else FLOAT[operation[:3]](a, b)
        return FLOAT[operation](a, b)

    # --- the address generator ----------------------------------------------------------------------------------------

    def _partner(self, one: Instruction, file: str) -> int:
        return self.state.registers[file][one.number[f"ag.{file}"] ^ 1]

    def _row(self, one: Instruction) -> int:
        """This step's row, modulo 2**32."""
        mode, literal = one.name["ag.mode"], one.number["lit"]
        base, index, pitch = (self._register(one, f"ag.{file}") for file in ("br", "ir", "ar"))
        if mode in ("", "hold"):
            return self.state.row
        offset = literal if mode.endswith("_lit") else 0
        if mode.startswith("linear"):
            row = base + index * pitch
        elif mode.startswith("plane"):
            row = base + self._partner(one, "ir") * pitch + index
        else:
            row = base if mode == "base_lit" else self.state.output["alu"]
        return row + offset & WORD

    def _address_registers(self, one: Instruction, row: int) -> dict[tuple[str, int], int]:
        """What `ag.update` and `ag.load` write."""
        written: dict[tuple[str, int], int] = {}
        update, load = one.name["ag.update"], one.name["ag.load"]
        if update != "hold":
            number = one.number["ag.ir"]
            word = self._register(one, "ag.ir") + (-1 if update == "dec" else 1) & WORD
            if update == "raster" and word == self._partner(one, "ar"):
                word = 0
                written["ir", number ^ 1] = self._partner(one, "ir") + 1 & WORD
            written["ir", number] = word
        if load != "none":
            file, source = load.split("_")
            words = {"alu": self.state.output["alu"], "lit": one.number["lit"], "row": row}
            written[file, one.number[f"ag.{file}"]] = words[source]
        return written

    # --- what is written ----------------------------------------------------------------------------------------------

    def _register_writes(self, one: Instruction, results: dict[str, int]) -> dict[tuple[str, int], int]:
        """What the write ports of the register banks and of the ALU's registers write."""
        state = self.state
        written = {}
        for unit in (*FPP, "alu"):
            write = one.name[f"{unit}.w"]
            if write == "none":
                continue
            if write == "result":
                word = results.get(unit, state.output[unit])
            elif write == "mem":
                word = state.latch[unit]
            else:
                word = state.output["table" if write == "table" else unit]
            written[unit, one.number[f"{unit}.rd"]] = word
        return written

    def _access(self, one: Instruction, row: int, bus: list[int]) -> None:
        """Data memory and display port."""
        state = self.state
        for column, bank in enumerate(BANKS):
            if bank in one.banks and one.name["mem.op"] == "read":
                state.latch[bank] = int(state.memory[row, column])
            elif bank in one.banks and one.name["mem.op"] == "write":
                state.memory[row, column] = bus[column]
        if one.accesses_display:
            state.display[row] = bus
        elif one.name["disp.op"] == "frame":
            state.frames = state.frames + 1 & WORD

    # --- the sequencer ------------------------------------------------------------------------------------------------

    def _sequence(self, one: Instruction, condition: bool) -> int:
        """The address of the next microinstruction; the stacks change, and the machine may halt."""
        state = self.state
        operation, target, after = one.name["seq.op"], one.number["seq.to"], state.address + 1
        if operation in ("count", "count_alu"):
            state.loop_stack.append(one.number["lit"] if operation == "count" else state.output["alu"])
        elif operation == "drop":
            state.loop_stack.pop()
        elif operation == "loop":
            if state.loop_stack[-1] > 1:
                state.loop_stack[-1] -= 1
                return target
            state.loop_stack.pop()
        elif condition and operation != "next":
            return self._leave(operation, target, after)
        return after

    def _leave(self, operation: str, target: int, after: int) -> int:
        """Where a jump, call, return or halt goes whose condition holds."""
        state = self.state
        if operation == "halt":
            state.halted = True
            return state.address
        if operation == "return":
            return state.call_stack.pop()
        if operation.startswith("call"):
            state.call_stack.append(after)
        return state.output["alu"] if operation.endswith("_alu") else target

    def _go_on(self, after: int) -> None:
        state = self.state
        self.executions[state.address] += 1
        state.came_from = state.address
        state.address = after
        state.steps += 1
