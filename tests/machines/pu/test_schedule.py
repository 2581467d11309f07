"""Compaction: the same state at the end, in no more steps; and what it can and cannot put together."""

from __future__ import annotations

import random
from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tasuki.machines.pu import isa, macro, meta
from tasuki.machines.pu.schedule import compact
from tasuki.machines.pu.simulate import Plain, State, Trap, run
from tests.machines.pu.simulating import random_state
from tests.machines.pu.test_simulate_random import random_fields

ROWS = 200


def straight(rng: random.Random, length: int) -> isa.Program:
    """Random microinstructions without a conflict, one after another, then a halt."""
    words: list[int] = []
    while len(words) < length:
        fields = random_fields(rng, length, 0.0)
        fields["seq.op"] = rng.choice(["next", "next", "next", "count", "drop"])
        word = isa.encode(fields)
        if not isa.conflicts(isa.decode(word)):
            words.append(word)
    words.append(isa.encode({"seq.op": "halt"}))
    return isa.Program(tuple(words), memory_rows=ROWS, display_rows=ROWS)


def outcome(of: isa.Program, state: State) -> State:
    """The state at the halt, but for what counts steps and addresses."""
    Plain(of, state).advance(1000)
    assert state.halted
    state.steps, state.address, state.came_from = 0, 0, None
    return state


@settings(max_examples=200, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_the_state_at_the_end_is_the_same(seed):
    rng = random.Random(seed)
    made = straight(rng, rng.randrange(1, 25))
    state = random_state(rng, made)
    try:
        expected = outcome(made, state.copy())
    except Trap:
        assume(False)
    compacted = compact(made).program
    assert len(compacted.words) <= len(made.words)
    assert outcome(compacted, state.copy()).differences(expected) == []


def compacted(text: str) -> tuple[isa.Program, isa.Program]:
    before = macro.assemble(text).program
    return before, compact(before).program


def states(text: str) -> tuple[State, State]:
    return tuple(run(one, machine="plain").state for one in compacted(text))  # type: ignore[return-value]


def test_units_work_side_by_side():
    """Four sums in four units, one of integers, and a row of memory: one step, and the halt with it."""
    text = """
        x.op=add x.ra=R1 x.rb=R2 x.rd=R3 x.w=result
        y.op=add y.ra=R1 y.rb=R2 y.rd=R3 y.w=result
        z.op=add z.ra=R1 z.rb=R2 z.rd=R3 z.w=result
        s.op=add s.ra=R1 s.rb=R2 s.rd=R3 s.w=result
        alu.op=add alu.ra=I1 alu.rb=I2 alu.rd=I3 alu.w=result
        mem.op=read mem.on=xyzs ag.mode=linear ag.br=BR1 ag.ir=IR1 ag.ar=AR1
        halt
    """
    before, after = compacted(text)
    assert (len(before.words), len(after.words)) == (7, 1)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("s.op=add s.ra=R1 s.rb=R2 s.rd=R3 s.w=result", "x.op=copy x.a=s x.rd=R1 x.w=result"),
        ("x.op=copy x.a=lit lit=1.0", "y.op=copy y.a=lit lit=2.0"),
        ("x.op=copy x.a=s", "y.op=copy y.a=port s.ra=R1"),
        ("s.op=mul s.ra=R1 s.rb=R1", "alu.op=copy alu.a=port s.ra=R2"),
        ("x.op=cmp x.ra=R1 x.rb=R2", "alu.op=test seq.cond=x.lt alu.rd=I1 alu.w=result"),
        ("alu.op=test seq.cond=x.lt", "s.op=pick s.ra=R1 s.rb=R2 seq.cond=y.lt"),
        ("mem.op=read mem.on=x ag.mode=base_lit lit=1", "x.rd=R1 x.w=mem"),
        ("ag.load=ir_lit ag.ir=IR1 lit=5", "mem.op=read mem.on=x ag.mode=linear ag.ir=IR1"),
    ],
)
def test_what_cannot_be_in_one_step(first, second):
    """A result that is not there yet, the literal, the S bus, a read port, flags, the condition, latches, an index."""
    before, after = compacted(f"    {first}\n    {second}\n")
    assert (len(before.words), len(after.words)) == (2, 2)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("x.op=copy x.ra=R1", "x.rd=R1 x.w=mem"),
        ("s.op=copy s.a=x", "x.op=add x.ra=R1 x.rb=R2"),
        ("alu.op=copy alu.a=ir ag.ir=IR1", "ag.ir=IR1 ag.update=inc"),
        ("x.rd=R1 x.w=mem", "mem.op=read mem.on=x ag.mode=base_lit lit=1"),
        ("x.op=mul x.ra=R1 x.b=lit lit=2.0", "y.op=mul y.ra=R1 y.b=lit lit=2.0"),
    ],
)
def test_who_reads_does_not_wait_for_who_writes(first, second):
    """A step reads what stood there before it; one number serves every unit."""
    before, after = compacted(f"    {first}\n    {second}\n")
    assert (len(before.words), len(after.words)) == (2, 1)


def test_words_that_are_exchanged_stay_in_one_step():
    text = "    move v1, 1.0, 2.0, 3.0, 4.0\n    x.op=copy x.ra=R1 y.op=copy y.ra=R1\n"
    text += "    x.op=copy x.a=y y.op=copy y.a=x\n    x.rd=R2 x.w=own y.rd=R2 y.w=own\n    halt\n"
    before, after = states(text)
    assert after.registers == before.registers
    assert [after.output["x"], after.output["y"]] == [isa.float_bits(2.0), isa.float_bits(1.0)]


def test_loops_and_calls_keep_their_ways():
    text = """
        move i1, 0
        move s1, 1.0
        count 5
again:  iadd i1, i1, 3
        call twice
        loop again
        compare i1, 15
        branch_not alu.eq, wrong
        halt
wrong:  move s1, -1.0
        halt
twice:  add s1, s1, s1
        iadd i1, i1, 0
        return
    """
    before, after = states(text)
    assert after.registers["s"][1] == before.registers["s"][1] == isa.float_bits(32.0)
    assert after.steps < before.steps


def test_a_compacted_program_is_a_program_like_any_other():
    """It has its labels and lines, and comes back from its disassembly."""
    _, after = compacted("start:\n    move s1, 2.0\n    sqrt s2, s1\nlast:\n    vscale v3, v3, s2\n    halt\n")
    assert set(after.labels) == {"start", "last"}
    assert len(after.spans) == len(after.words)
    again: Any = meta.assemble(meta.disassemble(after), "again").program
    assert again.words == after.words
