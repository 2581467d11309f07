"""The fast simulator agrees with the plain one in every word, flag, counter and trap, on random programs."""

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasuki.machines.pu import isa
from tests.machines.pu.simulating import random_state, random_word, run_both

ROWS = 40
SEQUENCER = [one.name for one in isa.DEFAULT.by_name["seq.op"].values]


def random_fields(rng: random.Random, length: int, rare: float) -> dict[str, int | float | str]:
    """A microinstruction: any choices and registers; what would trap or leave the program at once is rare."""
    fields: dict[str, int | float | str] = {}
    for one in isa.DEFAULT.fields:
        if one.kind == "choice" and rng.random() < 0.6:
            fields[one.name] = rng.choice(one.values).name
        elif one.kind == "register":
            # Few registers, so that what is written is read again.
            fields[one.name] = rng.randrange(4) if rng.random() < 0.8 else rng.randrange(one.mask + 1)
        elif one.kind == "mask":
            fields[one.name] = rng.randrange(16)
    fields["seq.op"] = "next" if rng.random() < 0.6 else rng.choice(SEQUENCER)
    fields["seq.to"] = rng.randrange(length) if rng.random() > rare else rng.randrange(isa.DEFAULT.program_words)
    fields["lit"] = rng.randrange(8) if rng.random() < 0.5 else random_word(rng)
    if rng.random() > rare:
        keep_inside(fields, rng)
    return fields


def keep_inside(fields: dict[str, int | float | str], rng: random.Random) -> None:
    """Keep rows, jumps and index registers within their bounds, mostly."""
    load, mode = str(fields.get("ag.load", "none")), str(fields.get("ag.mode", "hold"))
    fields["ag.load"] = load.replace("alu", "lit").replace("br_row", "br_lit")
    fields["ag.mode"] = mode.replace("pointer_lit", "base_lit").replace("pointer", "linear")
    if load != "none" or mode.endswith("_lit"):
        fields["lit"] = rng.randrange(4)
    if load.startswith("ir"):
        fields["ag.update"] = "hold"
    elif fields.get("ag.update") == "dec":
        fields["ag.update"] = "raster"
    if str(fields["seq.op"]).endswith("_alu"):
        fields["seq.op"] = "loop"


def random_word_of_code(rng: random.Random, length: int, rare: float) -> int:
    """A microinstruction without a conflict, but for a few, and a few without any sense."""
    while True:
        word = isa.encode(random_fields(rng, length, rare))
        if not isa.conflicts(isa.decode(word)) or rng.random() < rare:
            break
    return rng.getrandbits(256) if rng.random() < rare / 4 else word


def random_program(rng: random.Random) -> isa.Program:
    length = rng.randrange(1, 24)
    rare = rng.choice([0.0, 0.02, 0.1])
    words = [random_word_of_code(rng, length, rare) for _ in range(length)]
    words.append(isa.encode({"seq.op": "jump", "seq.to": rng.randrange(length)}))
    labels = {f"l{i}": rng.randrange(length) for i in range(rng.randrange(4))}
    return isa.Program(tuple(words), labels=labels, memory_rows=ROWS, display_rows=ROWS)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**64))
def test_fast_and_plain_agree_on_random_programs(seed: int):
    rng = random.Random(seed)
    program = random_program(rng)
    run_both(program, random_state(rng, program), steps=rng.choice([1, 7, 150]))


@pytest.mark.parametrize("unit", [*isa.FPPS, "alu", "tab", "mem", "ag", "disp", "seq"])
def test_fast_and_plain_agree_on_every_value_of_every_field(unit: str):
    """A microinstruction for each value of each field of the unit, the others random; each begins in a random state."""
    rng = random.Random(unit)
    for one in isa.DEFAULT.fields:
        if one.unit != unit or one.kind != "choice":
            continue
        words = [isa.encode(random_fields(rng, 1, 0.0) | {one.name: value.name}) for value in one.values]
        # With a label each of them is a block, so that native code can begin there.
        labels = {str(address): address for address in range(len(words))}
        program = isa.Program(tuple(words), labels=labels, memory_rows=ROWS, display_rows=ROWS)
        for address in range(len(words)):
            for _ in range(3):
                state = random_state(rng, program)
                state.address = address
                run_both(program, state, steps=1)


def test_random_programs_reach_far():
    """The generator is worth something: most programs run for many steps, and traps of every kind occur."""
    rng = random.Random(7)
    steps, kinds = 0, set()
    for _ in range(150):
        program = random_program(rng)
        state, trap = run_both(program, random_state(rng, program), steps=60)
        steps += state.steps
        kinds.add(trap.partition(":")[0])
    assert steps > 150 * 10
    assert kinds >= {"", "undefined", "conflict", "memory", "display", "call stack", "loop stack", "end"}
