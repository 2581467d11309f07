"""How fast the processor unit's simulators run microcode: `python -m bench.pu`.

Two loops of vector work with memory, the plain simulator and the fast one in turn, from the same initial state; before
they are timed, both must end in the same state. Compiling is left out of the speeds and measured on its own. Writes
`bench/results/pu.json`.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from functools import partial
from statistics import median
from time import perf_counter

import numpy as np

from bench.measure import Report, Table, alternate, ratio, rounds_argument, spread
from tasuki.machines.pu import isa, simulate
from tasuki.machines.pu.simulate.translate import translate
from tasuki.native.compile import compile_object

Fields = Mapping[str, int | float | str]

ROWS = 1024
"""Vectors in memory: three tables of so many rows."""
SECONDS = 0.3
"""About what one measurement takes."""
MACHINES: tuple[simulate.Machine, ...] = ("plain", "fast")
LIMITS = {"plain": 0.02, "fast": 50.0}
"""Million steps a second that are promised."""


def each(units: str, **fields: int | float | str) -> dict[str, int | float | str]:
    """The same fields for several units."""
    return {f"{unit}.{name}": value for unit in units for name, value in fields.items()}


def over_tables(*steps: Fields, passes: int) -> isa.Program:
    """`steps` for each row, `passes` times over. BR0, BR1 and BR2 are the tables p, q and r; IR0 is the row."""
    head: list[Fields] = [
        {"ag.load": "br_lit", "ag.br": 1, "lit": ROWS},
        {"ag.load": "br_lit", "ag.br": 2, "lit": 2 * ROWS},
        {"ag.load": "ar_lit", "lit": 1},
        {"seq.op": "count", "lit": passes},
    ]
    outer = len(head)
    each_pass: list[Fields] = [{"ag.load": "ir_lit", "lit": 0}, {"seq.op": "count", "lit": ROWS}]
    last = {**steps[-1], "ag.update": "inc", "seq.op": "loop", "seq.to": outer + len(each_pass)}
    tail: list[Fields] = [{"seq.op": "loop", "seq.to": outer}, {"seq.op": "halt"}]
    code = [*head, *each_pass, *steps[:-1], last, *tail]
    return isa.Program(tuple(isa.encode(fields) for fields in code), memory_rows=3 * ROWS)


READ_P: Fields = {"mem.op": "read", "mem.on": 15, "ag.mode": "linear"}
READ_Q: Fields = {**READ_P, "ag.br": 1}
WRITE_R: Fields = {"mem.op": "write", "ag.mode": "linear", "ag.br": 2}


def scaled_sums(passes: int) -> isa.Program:
    """r = k * p + q, all four words of every row: 4 steps."""
    return over_tables(
        READ_P,
        {**READ_Q, **each("xyzs", op="mul", a="mem", b="reg", rb=1)},
        each("xyzs", op="add", a="own", b="mem"),
        {**WRITE_R, "mem.on": 15},
        passes=passes,
    )


def inner_products(passes: int) -> isa.Program:
    """r = p . q, of three words into the fourth: 6 steps."""
    return over_tables(
        READ_P,
        {**READ_Q, **each("xyz", op="copy", a="mem")},
        each("xyz", op="mul", a="own", b="mem"),
        {"x.op": "add", "x.a": "own", "x.b": "y"},
        {"s.op": "add", "s.a": "x", "s.b": "z"},
        {**WRITE_R, "mem.on": 1},
        passes=passes,
    )


LOOPS = {"k p + q, 4 steps a row": scaled_sums, "p . q, 6 steps a row": inner_products}


def initial(program: isa.Program) -> simulate.State:
    """Tables of random numbers, and k in register 1 of every bank."""
    memory = np.random.default_rng(1986).uniform(-1.0, 1.0, (program.memory_rows, 4)).astype(np.float32)
    state = simulate.start(program, memory)
    for unit in isa.FPPS:
        state.registers[unit][1] = isa.float_bits(0.75)
    return state


def million_steps_a_second(machine: simulate.Machine, program: isa.Program) -> float:
    state = initial(program)
    started = perf_counter()
    simulate.run(program, state=state, machine=machine)
    return state.steps / (perf_counter() - started) / 1e6


def passes_for(machine: simulate.Machine, loop: Callable[[int], isa.Program]) -> int:
    """How many passes over the tables take about SECONDS. The native code has been compiled when this returns."""
    passes = 1 if machine == "plain" else 1000
    speed = max(million_steps_a_second(machine, loop(passes)) for _ in range(2))
    steps_a_pass = simulate.run(loop(1), state=initial(loop(1))).state.steps
    return max(1, round(SECONDS * speed * 1e6 / steps_a_pass))


def require_agreement(loop: Callable[[int], isa.Program]) -> None:
    program = loop(1)
    ends = [simulate.run(program, state=initial(program), machine=machine) for machine in MACHINES]
    if ends[0].state.differences(ends[1].state) or list(ends[0].executions) != list(ends[1].executions):
        raise SystemExit("the two simulators do not agree")


def measure_speed(report: Report) -> None:
    table = Table("Simulated microinstructions, million a second", ["loop", "plain", "noise", "fast", "noise", "ratio"])
    for name, loop in LOOPS.items():
        require_agreement(loop)
        programs = {machine: loop(passes_for(machine, loop)) for machine in MACHINES}
        samples = alternate(
            {machine: partial(million_steps_a_second, machine, program) for machine, program in programs.items()},
            report.rounds,
        )
        report.samples[name] = samples
        cells = [cell for machine in MACHINES for cell in figures(samples[machine])]
        table.add(name, *cells, f"{ratio(samples['fast'], samples['plain']):.0f}")
    table.add("promised, at least", f"{LIMITS['plain']:g}", "", f"{LIMITS['fast']:g}", "", "")
    report.tables.append(table)


def figures(samples: list[float]) -> tuple[str, str]:
    value = median(samples)
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}", f"{spread(samples):.0%}"


def compile_seconds(program: isa.Program) -> float:
    """From microcode to object code, without the cache."""
    started = perf_counter()
    compile_object(translate(program))
    return perf_counter() - started


def measure_compiling(report: Report) -> None:
    table = Table("From microcode to native code", ["program", "words", "ms", "noise"])
    programs = {name: loop(1) for name, loop in LOOPS.items()}
    programs["the first program, 300 times over"] = isa.Program(scaled_sums(1).words * 300)
    contenders = {name: partial(compile_seconds, program) for name, program in programs.items()}
    samples = alternate(contenders, report.rounds)
    report.samples["compiling"] = samples
    for name, program in programs.items():
        milliseconds = [1e3 * sample for sample in samples[name]]
        table.add(name, len(program.words), *figures(milliseconds))
    report.tables.append(table)


def main() -> None:
    parser = argparse.ArgumentParser(description="The processor unit's simulators.")
    parser.add_argument("--rounds", type=rounds_argument, default=7)
    options = parser.parse_args()
    report = Report("pu", options.rounds)
    measure_speed(report)
    measure_compiling(report)
    report.publish()


if __name__ == "__main__":
    main()
