"""List scheduling inside basic blocks (the terms are those of J. Fisher, "Trace Scheduling: A Technique for Global
Microcode Compaction", 1981; no traces here).

An operation that reads what another wrote comes a step later at least; one that writes what another still reads comes
in the same step at the earliest; two that write one thing come in their order. Of the operations that may come, those
go first from which the longest chain leads to the block's end. The sequencer's operation ends the block.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from tasuki.machines.pu.isa import DEFAULT, Program, Word, encode
from tasuki.machines.pu.isa.rules import conflicts
from tasuki.machines.pu.schedule.operations import Operation, Resource, operations
from tasuki.machines.pu.simulate.blocks import Block, blocks

_IDLE = {one.name: 0 for one in DEFAULT.fields}
_JUMPS = {DEFAULT.by_name["seq.op"].codes[name] for name in ("jump", "call", "loop")}


@dataclass(frozen=True)
class Compacted:
    """A program in fewer microinstructions. `sources[i]`: the addresses, before, of what microinstruction i does."""

    program: Program
    sources: tuple[tuple[int, ...], ...]


def compact(program: Program) -> Compacted:
    """The same program, compacted block by block. It must not compute addresses of its own (`jump_alu`, `call_alu`)."""
    steps: list[list[Operation]] = []
    starts: dict[int, int] = {}
    for block in blocks(program):
        starts[block.start] = len(steps)
        steps += _schedule(block)
    starts[len(program.words)] = len(steps)
    words = tuple(_word(step, starts) for step in steps)
    sources = tuple(tuple(sorted({one.address for one in step})) for step in steps)
    spans = tuple(program.spans[addresses[0]] for addresses in sources) if program.spans else ()
    labels = {name: starts[address] for name, address in program.labels.items()}
    return Compacted(replace(program, words=words, spans=spans, labels=labels), sources)


def _word(step: Sequence[Operation], starts: Mapping[int, int]) -> Word:
    fields = _merged(step)
    if fields.get("seq.op") in _JUMPS:
        fields["seq.to"] = starts[fields["seq.to"]]
    return encode(fields)


def _merged(step: Sequence[Operation]) -> dict[str, int]:
    return {name: number for one in step for name, number in one.fields.items()}


# --- one block --------------------------------------------------------------------------------------------------------


@dataclass(eq=False)
class _Node:
    """An operation with what must come before it, and by how many steps at least."""

    operation: Operation
    before: dict[_Node, int] = field(default_factory=dict)
    after: list[tuple[_Node, int]] = field(default_factory=list)
    height: int = 0
    step: int = -1

    def wait_for(self, other: _Node, steps: int) -> None:
        if other is not self:
            self.before[other] = max(steps, self.before.get(other, 0))


def _schedule(block: Block) -> list[list[Operation]]:
    """The block's operations, step by step. What is greedy is not always shorter: then they stay as they are."""
    before = [operations(block.start + offset, one) for offset, one in enumerate(block.instructions)]
    steps = _listed(block)
    return steps if len(steps) <= len(before) else [step for step in before if step]


def _listed(block: Block) -> list[list[Operation]]:
    """A list schedule."""
    nodes = _graph(block)
    steps: list[list[Operation]] = []
    waiting = nodes
    while waiting:
        step: list[Operation] = []
        placed = True
        while placed:
            # What is placed may let others into the same step: those that write what it reads.
            placed = False
            for node in waiting:
                if node.step < 0 and _may_come(node, len(steps)) and _fits(step, node.operation):
                    node.step, placed = len(steps), True
                    step.append(node.operation)
        waiting = [node for node in waiting if node.step < 0]
        steps.append(step)
    return steps


def _may_come(node: _Node, step: int) -> bool:
    return all(other.step >= 0 and other.step + steps <= step for other, steps in node.before.items())


def _fits(step: Sequence[Operation], operation: Operation) -> bool:
    """Whether the fields agree, and no bus would have two drivers."""
    fields = _merged(step)
    if any(fields.get(name, number) != number for name, number in operation.fields.items()):
        return False
    return not conflicts(_IDLE | fields | operation.fields)


def _inseparable(found: list[Operation]) -> list[Operation]:
    """Operations of one microinstruction, those joined that exchange words: each reads what another of them writes."""
    ahead = [{j for j, other in enumerate(found) if one.reads & other.writes} | {i} for i, one in enumerate(found)]
    for middle in range(len(found)):
        for reached in ahead:
            if middle in reached:
                reached |= ahead[middle]
    groups = {frozenset(j for j in ahead[i] if i in ahead[j]): None for i in range(len(found))}
    return [_joined([found[i] for i in sorted(group)]) for group in groups]


def _joined(group: list[Operation]) -> Operation:
    if len(group) == 1:
        return group[0]
    reads = set().union(*(one.reads for one in group))
    writes = set().union(*(one.writes for one in group))
    return Operation(group[0].address, _merged(group), reads, writes, any(one.control for one in group))


def _graph(block: Block) -> list[_Node]:
    """The operations, those first that begin the longest chains."""
    writer: dict[Resource, _Node] = {}
    readers: dict[Resource, list[_Node]] = {}
    nodes: list[_Node] = []
    for offset, one in enumerate(block.instructions):
        together = [_Node(operation) for operation in _inseparable(operations(block.start + offset, one))]
        for node in together:
            for resource in node.operation.reads:
                if resource in writer:
                    node.wait_for(writer[resource], 1)
                readers.setdefault(resource, []).append(node)
        for node in together:
            for resource in node.operation.writes:
                for reader in readers.pop(resource, ()):
                    node.wait_for(reader, 0)
                if resource in writer:
                    node.wait_for(writer[resource], 1)
        for node in together:
            writer |= dict.fromkeys(node.operation.writes, node)
            if node.operation.control:
                for other in (*nodes, *together):
                    node.wait_for(other, 0)
        nodes += together
    for node in reversed(nodes):
        for other, steps in node.before.items():
            other.height = max(other.height, node.height + steps)
    return sorted(nodes, key=lambda node: -node.height)
