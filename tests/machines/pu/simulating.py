"""Small programs and states for the simulators' tests, and random ones."""

from __future__ import annotations

import random
import struct
from collections.abc import Mapping

import numpy as np

from tasuki.machines.pu import isa
from tasuki.machines.pu.simulate import Fast, Plain, State, Trap, start

Fields = Mapping[str, int | float | str]

NASTY = [
    0x00000000,
    0x80000000,
    0x00000001,
    0x80000001,
    0x007FFFFF,
    0x00800000,
    0x00200000,
    0x00200001,
    0x80400000,
    0x3F7FFFFF,
    0x3F800000,
    0xBF800000,
    0x3F800001,
    0x3F000000,
    0x40490FDB,
    0x4B400000,
    0x4EFFFFFF,
    0x4F000000,
    0xCF000000,
    0x7E800000,
    0x7F000000,
    0x7F7FFFFF,
    0xFF7FFFFF,
    0x7F800000,
    0xFF800000,
    0x7FC00000,
    0xFFC00000,
    0x7F800001,
    0xFFBFFFFF,
    0x7FFFFFFF,
    0xFFFFFFFF,
]
"""Zeros, subnormals, powers of two, the ends of the ranges, infinities, NaN of every sort; also as integers."""

HALT: Fields = {"seq.op": "halt"}


def program(*steps: Fields, **parts) -> isa.Program:
    """The microinstructions with these fields, as a program with little memory."""
    parts = {"memory_rows": 16, "display_rows": 16, **parts}
    return isa.Program(tuple(isa.encode(fields) for fields in steps), **parts)


def word(value: float) -> int:
    return isa.float_bits(value)


def value(bits: int) -> float:
    return struct.unpack("<f", bits.to_bytes(4, "little"))[0]


def random_word(rng: random.Random) -> int:
    kind = rng.randrange(4)
    if kind == 0:
        return rng.choice(NASTY)
    if kind == 1:
        return rng.randrange(24)
    return rng.getrandbits(32) if kind == 2 else word(rng.uniform(-4, 4))


def random_state(rng: random.Random, of: isa.Program) -> State:
    """A state in which every register, latch, output and memory word is random; the address generator's are small."""
    state = start(of)
    for file, registers in state.registers.items():
        small = file in ("br", "ir", "ar")
        registers[:] = [rng.randrange(6) if small else random_word(rng) for _ in registers]
    for holder in (state.output, state.latch):
        for name in holder:
            holder[name] = random_word(rng)
    for flags in state.flags.values():
        for flag in flags:
            flags[flag] = rng.random() < 0.5
    state.special = rng.random() < 0.3
    state.row = rng.randrange(8)
    for rows in (state.memory, state.display):
        rows[:] = np.array([[random_word(rng) for _ in range(4)] for _ in rows], np.uint32)
    state.loop_stack = [rng.randrange(4) for _ in range(rng.randrange(4))]
    state.call_stack = [rng.randrange(len(of.words) + 1) for _ in range(rng.randrange(4))]
    return state


def run_both(of: isa.Program, state: State, steps: int) -> tuple[State, str]:
    """Make up to `steps` steps on both simulators, and demand that they agree: (the state, the trap's text or "")."""
    plain, fast = Plain(of, state.copy()), Fast(of, state.copy())
    texts = []
    for simulator in (plain, fast):
        try:
            simulator.advance(steps)
            texts.append("")
        except Trap as trap:
            texts.append(f"{trap.kind}: {trap}")
    assert plain.state.differences(fast.state) == []
    assert texts[0] == texts[1]
    assert list(plain.executions) == list(fast.executions)
    return plain.state, texts[0]
