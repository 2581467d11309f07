"""Basic blocks of microcode: stretches that are entered at their first microinstruction only."""

from __future__ import annotations

from dataclasses import dataclass

from tasuki.machines.pu import isa
from tasuki.machines.pu.simulate.instruction import Instruction, instruction

_TO_LITERAL_ADDRESS = ("jump", "call", "loop")


@dataclass(frozen=True)
class Block:
    """The microinstructions from `start` to `end` (exclusive)."""

    start: int
    instructions: tuple[Instruction, ...]

    @property
    def end(self) -> int:
        return self.start + len(self.instructions)


def blocks(program: isa.Program) -> list[Block]:
    """The program, cut at the targets of jumps, after whatever may jump, and at labels.

    Labels are where jumps to addresses in the ALU go, as far as one can know: other such targets inside a block are
    reached step by step.
    """
    code = [instruction(word) for word in program.words]
    starts = {0, *program.labels.values()}
    for address, one in enumerate(code):
        operation = one.name["seq.op"]
        if operation in _TO_LITERAL_ADDRESS:
            starts.add(one.number["seq.to"])
        if one.problems or operation not in ("next", "count", "count_alu", "drop"):
            starts.add(address + 1)
    inside = sorted(start for start in starts if 0 <= start < len(code))
    ends = [*inside[1:], len(code)][: len(inside)]
    return [Block(start, tuple(code[start:end])) for start, end in zip(inside, ends, strict=True)]
