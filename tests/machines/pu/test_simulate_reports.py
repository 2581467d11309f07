"""Counters, traces and value change dumps."""

from __future__ import annotations

import io
import random
import re

import pytest

from tasuki.machines.pu import isa, simulate
from tasuki.machines.pu.simulate.vcd import VcdWriter
from tests.machines.pu.simulating import HALT, Fields, program, random_state, value, word

SQUARES: Fields = {f"{unit}.{field}": what for unit in "xyz" for field, what in (("op", "mul"), ("ra", 1), ("rb", 1))}
NORM: list[Fields] = [
    SQUARES,
    {"x.op": "add", "x.a": "own", "x.b": "y"},
    {"s.op": "add", "s.a": "x", "s.b": "z", "s.w": "result", "s.rd": 2},
    {"tab.op": "sqrt", "tab.in": "s"},
    {"mem.op": "write", "mem.on": "xs", "mem.s": "port", "s.ra": 2, "ag.mode": "base_lit", "lit": 3},
]


def norm_state(code: isa.Program) -> simulate.State:
    """x, y, z = 1, 2, 2 in register 1."""
    state = simulate.start(code)
    for unit, number in zip("xyz", (1.0, 2.0, 2.0), strict=True):
        state.registers[unit][1] = word(number)
    return state


@pytest.mark.parametrize("machine", ["plain", "fast"])
def test_counters(machine: str):
    loop = [
        {"mem.op": "read", "mem.on": "xyz", "ag.mode": "linear", "ag.update": "inc", "x.op": "mul", "x.a": "y"},
        {"x.op": "add", "x.a": "y", "x.b": "y", "y.op": "cmp", "y.a": "s", "alu.op": "test"},
        {"mem.op": "write", "mem.on": "s", "disp.op": "pixel", "tab.op": "sin", "seq.op": "loop", "seq.to": 1},
    ]
    code = program(
        {"seq.op": "count", "lit": 10}, *loop, {"mem.op": "read"}, HALT, labels={"go": 0, "loop": 1, "on": 1}
    )
    outcome = simulate.run(code, machine=machine)
    counters = outcome.counters
    assert counters.steps == outcome.state.steps == 1 + 10 * 3 + 2
    assert counters.busy == {"x": 20, "y": 10, "z": 0, "s": 0, "alu": 10, "tab": 10, "ag": 10, "mem": 20, "disp": 10}
    assert (counters.rows_read, counters.words_read) == (10, 30)
    assert (counters.rows_written, counters.words_written) == (10, 10)
    assert counters.transfers == {("y", "x"): 30, ("s", "y"): 10}
    assert (counters.bus_transfers, counters.pixels) == (40, 10)
    assert counters.busy_share("x") == 20 / 33
    assert {label: part.steps for label, part in outcome.labels.items()} == {"go": 1, "loop": 32}
    assert list(outcome.executions) == [1, 10, 10, 10, 1, 1]
    assert re.search(r"^loop +32 ", outcome.report(), re.MULTILINE)


def test_steps_before_the_first_label_belong_to_none():
    outcome = simulate.run(program({}, {}, HALT, labels={"late": 2}))
    assert {label: part.steps for label, part in outcome.labels.items()} == {"": 2, "late": 1}


def test_the_trace_is_a_table_of_steps():
    code = program(*NORM, HALT, labels={"norm": 0})
    trace = io.StringIO()
    simulate.run(code, state=norm_state(code), trace=trace)
    lines = [re.split(r"  +", line) for line in trace.getvalue().splitlines()]
    squares = [f"mul R1,R1 = {number}" for number in (1, 4, 4)]
    assert lines == [
        ["step", "address", "X", "Y", "Z", "S", "table", "buses", "memory", "writes", "sequencer"],
        ["1", "0 norm", *squares],
        ["2", "1 norm+1", "add own,y = 5", "y->x"],
        ["3", "2 norm+2", "add x,z = 9", "x->s z->s", "S.R2=9"],
        ["4", "3 norm+3", "sqrt s = 3.000305"],
        ["5", "4 norm+4", "write xs 3: 5 9"],
        ["6", "5 norm+5", "halt"],
    ]
    # Cells stand under their heads.
    text = trace.getvalue().splitlines()
    assert text[0].index("S ") == text[3].index("add x,z")


def parse_vcd(text: str) -> tuple[dict[str, tuple[str, str]], dict[int, dict[str, str]]]:
    """(identifier -> (kind and width, path), time -> (path -> value)) of a dump, read strictly."""
    head, _, body = text.partition("$enddefinitions $end\n")
    scopes: list[str] = []
    signals: dict[str, tuple[str, str]] = {}
    for line in head.splitlines():
        parts = line.split()
        assert parts[-1] == "$end"
        if parts[0] == "$scope":
            assert parts[1] == "module"
            scopes.append(parts[2])
        elif parts[0] == "$upscope":
            scopes.pop()
        elif parts[0] == "$var":
            assert parts[3] not in signals
            signals[parts[3]] = (f"{parts[1]} {parts[2]}", ".".join([*scopes, parts[4]]))
    assert scopes == []
    return signals, _changes(signals, body)


def _changes(signals: dict[str, tuple[str, str]], body: str) -> dict[int, dict[str, str]]:
    times: dict[int, dict[str, str]] = {}
    for line in body.splitlines():
        if line.startswith("#"):
            assert not times or int(line[1:]) > max(times)
            times[int(line[1:])] = {}
        elif line not in ("$dumpvars", "$end"):
            found = re.fullmatch(r"(?:b([01]+) |r(\S+) |([01]))(\S+)", line)
            assert found, line
            kind, path = signals[found[4]]
            assert kind.split()[0] == ("real" if found[2] else "wire")
            times[max(times)][path] = found[1] or found[2] or found[3]
    return times


def test_the_dump_is_well_formed_and_says_what_happened():
    code = program(*NORM, HALT)
    dump = io.StringIO()
    simulate.run(code, state=norm_state(code), vcd=dump)
    signals, times = parse_vcd(dump.getvalue())
    assert list(times) == [0, 1, 2, 3, 4, 5, 6]
    assert set(times[0]) == {path for _, path in signals.values()}
    assert {"wire 32", "wire 1", "real 64"} < {kind for kind, _ in signals.values()}
    assert value(int(times[0]["pu.fppy.R1"], 2)) == 2.0
    assert float(times[2]["pu.fppx.output_real"]) == 5.0
    assert value(int(times[3]["pu.fpps.output"], 2)) == 9.0
    assert "pu.fppz.output" not in times[2]
    assert int(times[5]["pu.address_generator.row"], 2) == 3
    assert times[6]["pu.sequencer.halted"] == "1"
    assert [int(times[step]["pu.sequencer.address"], 2) for step in range(6)] == list(range(6))


def test_a_dump_replayed_gives_every_state():
    rng = random.Random(5)
    # Sums and differences that come and go, in a loop.
    steps: list[Fields] = [
        {"seq.op": "count", "lit": 12},
        {
            "x.op": "sub",
            "x.a": "own",
            "x.b": "reg",
            "x.rb": 3,
            "x.w": "own",
            "x.rd": 3,
            "alu.op": "xor",
            "alu.a": "own",
        },
        {
            "s.op": "mul",
            "s.a": "x",
            "s.b": "reg",
            "ag.mode": "linear",
            "ag.update": "raster",
            "mem.op": "read",
            "mem.on": 15,
        },
        {"x.op": "cmp", "x.a": "own", "x.b": "s", "alu.op": "test", "seq.cond": "x.lt", "tab.op": "rcp", "tab.in": "s"},
        {"y.op": "pick", "seq.cond": "special", "alu.w": "result", "seq.op": "loop", "seq.to": 1},
    ]
    code = program(*steps, HALT, memory_rows=64)
    simulator = simulate.Plain(code, random_state(rng, code))
    simulator.state.loop_stack.clear()
    dump = io.StringIO()
    writer = VcdWriter(dump)
    writer.sample(simulator.state)
    states = [simulator.state.copy()]
    while not simulator.state.halted:
        simulator.step()
        writer.sample(simulator.state)
        states.append(simulator.state.copy())
    shown: dict[str, str] = {}
    for state, changes in zip(states, parse_vcd(dump.getvalue())[1].values(), strict=True):
        shown |= changes
        for unit in isa.FPPS:
            scope = f"pu.fpp{unit}"
            assert int(shown[f"{scope}.output"], 2) == state.output[unit]
            assert [int(shown[f"{scope}.R{i}"], 2) for i in range(64)] == state.registers[unit]
            assert {flag: shown[f"{scope}.{flag}"] == "1" for flag in ("lt", "eq", "un")} == state.flags[unit]
            assert int(shown[f"pu.memory.latch_{unit}"], 2) == state.latch[unit]
        assert int(shown["pu.alu.output"], 2) == state.output["alu"]
        assert (shown["pu.table.special"] == "1", int(shown["pu.address_generator.row"], 2)) == (
            state.special,
            state.row,
        )
        assert int(shown["pu.sequencer.loop_count"], 2) == (state.loop_stack or [0])[-1]


def test_infinities_and_nan_are_reals_too():
    code = program(
        {"x.op": "copy", "x.a": "lit", "lit": float("inf")}, {"x.op": "sub", "x.a": "own", "x.b": "own"}, HALT
    )
    dump = io.StringIO()
    simulate.run(code, vcd=dump)
    _, times = parse_vcd(dump.getvalue())
    assert [times[step]["pu.fppx.output_real"] for step in (1, 2)] == ["inf", "nan"]


def test_a_trap_leaves_what_was_written_before():
    trace = io.StringIO()
    with pytest.raises(simulate.Trap):
        simulate.run(program({"x.op": "copy"}, {"seq.op": "return"}), trace=trace)
    assert len(trace.getvalue().splitlines()) == 2
