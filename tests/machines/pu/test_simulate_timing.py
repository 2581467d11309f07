"""The timing rules, one by one, on both simulators: what a step reads stood before it, what it writes follows it."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tasuki.machines.pu import isa, simulate
from tests.machines.pu.simulating import HALT, Fields, program, word

Run = Callable[..., simulate.State]


@pytest.fixture(params=["plain", "fast"])
def run(request: pytest.FixtureRequest) -> Run:
    """Run steps and a halt after them, with these rows of memory."""

    def runner(*steps: Fields, memory: dict[int, isa.Row] | None = None) -> simulate.State:
        code = program(*steps, HALT)
        return simulate.run(code, memory=memory, machine=request.param, limit=1000).state

    return runner


def literal(unit: str, number: float, **more: str | int) -> Fields:
    return {f"{unit}.op": "copy", f"{unit}.a": "lit", "lit": number, **more}


def test_a_result_is_on_the_output_in_the_next_step(run: Run):
    state = run(literal("x", 1.0), literal("x", 2.0, **{"y.op": "copy", "y.a": "x"}))
    assert (state.output["x"], state.output["y"]) == (word(2.0), word(1.0))


def test_an_output_holds_while_its_unit_idles_or_compares(run: Run):
    compare = {"x.op": "cmp", "x.a": "own", "x.b": "lit", "lit": 2.0}
    state = run(literal("x", 1.0), {}, compare, {})
    assert state.output["x"] == word(1.0)
    assert state.flags["x"] == {"lt": True, "eq": False, "un": False}


def test_a_result_may_be_written_in_the_same_step_and_read_in_the_next(run: Run):
    write = literal("x", 3.0, **{"x.w": "result", "x.rd": 5})
    read = {"x.op": "add", "x.a": "reg", "x.ra": 5, "x.b": "own"}
    state = run(write, read)
    assert state.registers["x"][5] == word(3.0)
    assert state.output["x"] == word(6.0)


def test_a_reader_sees_the_old_value_of_a_register_that_is_written(run: Run):
    first = literal("x", 1.0, **{"x.w": "result", "x.rd": 5})
    both = {"x.op": "add", "x.a": "reg", "x.ra": 5, "x.b": "lit", "lit": 1.0, "x.w": "result", "x.rd": 5}
    state = run(first, both, both)
    assert state.registers["x"][5] == word(3.0)


def test_write_result_without_an_operation_writes_the_output_that_holds(run: Run):
    state = run(literal("y", 4.0), {"y.w": "result", "y.rd": 1}, {"y.op": "cmp", "y.w": "result", "y.rd": 2})
    assert state.registers["y"][1:3] == [word(4.0), word(4.0)]


def test_write_own_takes_the_output_from_before_the_step(run: Run):
    state = run(literal("z", 1.0), literal("z", 2.0, **{"z.w": "own", "z.rd": 0}))
    assert state.registers["z"][0] == word(1.0)


def test_write_mem_takes_the_latch_from_before_the_step(run: Run):
    read = {"mem.op": "read", "mem.on": 8, "ag.mode": "base_lit"}
    second = {**read, "lit": 1, "x.w": "mem", "x.rd": 0}
    state = run({**read, "lit": 0}, second, memory={0: (10, 0, 0, 0), 1: (20, 0, 0, 0)})
    assert (state.registers["x"][0], state.latch["x"]) == (10, 20)


def test_a_table_answers_in_the_next_step_and_holds(run: Run):
    access = {"tab.op": "rcp", "tab.in": "s"}
    late = {"s.op": "copy", "s.a": "table"}
    early = run(literal("s", 2.0), {**access, **late})
    assert early.output["s"] == 0
    answer, _ = isa.lookup("rcp", word(2.0))
    state = run(literal("s", 2.0), access, {}, {}, {**late, "s.w": "table", "s.rd": 3})
    assert state.output["s"] == state.registers["s"][3] == state.output["table"] == answer


def test_the_special_flag_holds_until_the_next_access(run: Run):
    zero = {"tab.op": "rcp", "tab.in": "port"}
    test = {"alu.op": "test", "seq.cond": "special"}
    assert run({**zero, **test}).output["alu"] == 0
    assert run(zero, {}, test).output["alu"] == 1
    assert run(zero, literal("s", 1.0), {"tab.op": "rcp", "tab.in": "s"}, test).output["alu"] == 0


def test_words_read_are_latched_for_the_next_step_and_hold(run: Run):
    read = {"mem.op": "read", "mem.on": 12, "ag.mode": "base_lit", "lit": 2}
    memory = {2: (1, 2, 3, 4)}
    copy = {"x.op": "copy", "x.a": "mem", "y.op": "copy", "y.a": "mem", "z.op": "copy", "z.a": "mem"}
    assert run({**read, **copy}, memory=memory).output["x"] == 0
    state = run(read, {}, {}, copy, memory=memory)
    assert [state.output[unit] for unit in "xyz"] == [1, 2, 0]
    assert list(state.latch.values()) == [1, 2, 0, 0]


def test_a_read_sees_what_the_step_before_wrote(run: Run):
    write = {"mem.op": "write", "mem.on": 1, "mem.s": "lit", "ag.mode": "base_lit", "lit": 7}
    state = run(write, {"mem.op": "read", "mem.on": 1})
    assert state.latch["s"] == 7


def test_data_buses_carry_outputs_registers_the_alu_or_the_literal(run: Run):
    prepare = [
        literal("x", 1.0),
        literal("y", 2.0, **{"y.w": "result", "y.rd": 9}),
        literal("y", 3.0),
        {"alu.op": "copy", "alu.a": "lit", "lit": 44},
    ]
    write = {"mem.op": "write", "mem.on": 15, "ag.mode": "base_lit", "lit": 3}
    sources = {"mem.x": "out", "mem.y": "port", "y.ra": 9, "mem.z": "alu", "mem.s": "lit"}
    state = run(*prepare, {**write, **sources})
    assert state.memory[3].tolist() == [word(1.0), word(2.0), 44, 3]


def test_memory_without_a_bank_enabled_is_no_access(run: Run):
    far = {"ag.mode": "base_lit", "lit": 10**9}
    assert run({"mem.op": "write", **far}).row == 10**9


@pytest.mark.parametrize(
    ("mode", "expected"),
    [
        ("hold", 0),
        ("linear", 100 + 5 * 7),
        ("linear_lit", 100 + 5 * 7 + 3),
        ("plane", 100 + 2 * 7 + 5),
        ("plane_lit", 100 + 2 * 7 + 5 + 3),
        ("base_lit", 103),
        ("pointer", 1000),
        ("pointer_lit", 1003),
    ],
)
def test_address_modes(run: Run, mode: str, expected: int):
    # BR4 = 100, IR6 = 5 with the partner IR7 = 2, AR1 = 7.
    loads = [("br_lit", "br", 4, 100), ("ir_lit", "ir", 6, 5), ("ir_lit", "ir", 7, 2), ("ar_lit", "ar", 1, 7)]
    prepare = [{"ag.load": load, f"ag.{file}": number, "lit": value} for load, file, number, value in loads]
    alu = {"alu.op": "copy", "alu.a": "lit", "lit": 1000}
    state = run(*prepare, alu, {"ag.mode": mode, "ag.br": 4, "ag.ir": 6, "ag.ar": 1, "lit": 3})
    assert state.row == expected


def test_the_row_register_holds_the_last_row(run: Run):
    state = run({"ag.mode": "base_lit", "lit": 5}, {"alu.op": "copy", "alu.a": "row", "lit": 9}, {})
    assert (state.row, state.output["alu"]) == (5, 5)
    late = run({"ag.mode": "base_lit", "lit": 5, "alu.op": "copy", "alu.a": "row"})
    assert late.output["alu"] == 0


def test_addresses_wrap(run: Run):
    state = run({"ag.load": "br_lit", "lit": -1}, {"ag.mode": "base_lit", "lit": 3})
    assert state.row == 2


def test_updates_act_after_the_row_is_computed(run: Run):
    one = {"ag.load": "ar_lit", "lit": 1}
    state = run(one, {"ag.mode": "linear", "ag.update": "inc"}, {"ag.mode": "linear", "ag.update": "inc"})
    assert (state.row, state.registers["ir"][0]) == (1, 2)
    assert run({"ag.update": "dec"}).registers["ir"][0] == 2**32 - 1


def test_raster_goes_over_lines(run: Run):
    # IR0 is the column, IR1 the line, AR0 the pitch 4, AR1 the width 3.
    pitch, width = {"ag.load": "ar_lit", "ag.ar": 0, "lit": 4}, {"ag.load": "ar_lit", "ag.ar": 1, "lit": 3}
    seen = []
    for count in range(1, 8):
        state = run(pitch, width, *[{"ag.mode": "plane", "ag.update": "raster"}] * count)
        seen.append((state.row, state.registers["ir"][0], state.registers["ir"][1]))
    assert seen == [(0, 1, 0), (1, 2, 0), (2, 0, 1), (4, 1, 1), (5, 2, 1), (6, 0, 2), (8, 1, 2)]


def test_loads_of_the_address_generator(run: Run):
    alu = {"alu.op": "copy", "alu.a": "lit", "lit": 6}
    state = run(alu, *({"ag.load": f"{file}_alu", f"ag.{file}": 3} for file in ("br", "ir", "ar")))
    assert [state.registers[file][3] for file in ("br", "ir", "ar")] == [6, 6, 6]
    state = run({"ag.mode": "base_lit", "ag.br": 2, "lit": 8, "ag.load": "br_row"})
    assert state.registers["br"][2] == 8


def test_a_jump_sees_flags_from_before_its_step(run: Run):
    compare = {"alu.op": "cmp", "alu.a": "lit", "alu.b": "lit"}
    jump = {"seq.op": "jump", "seq.cond": "alu.eq"}
    mark = {"alu.op": "copy", "alu.a": "lit", "lit": 1}
    # In the same step the comparison comes too late; one step later it counts.
    assert run({**compare, **jump, "seq.to": 2}, mark).output["alu"] == 1
    assert run(compare, {**jump, "seq.to": 3}, mark).output["alu"] == 0


def test_there_is_no_delay_slot(run: Run):
    mark = {"x.op": "copy", "x.a": "lit", "lit": 1}
    assert run({"seq.op": "jump", "seq.to": 2}, mark).output["x"] == 0


def test_calls_return_to_the_step_after_them(run: Run):
    gain = {"alu.op": "add", "alu.a": "own", "alu.b": "lit", "lit": 1}
    state = run(
        {"seq.op": "call", "seq.to": 3},
        {"seq.op": "call", "seq.to": 3},
        {"seq.op": "jump", "seq.to": 5},
        gain,
        {**gain, "seq.op": "return"},
    )
    assert (state.output["alu"], state.call_stack, state.steps) == (4, [], 8)


def test_jumps_and_calls_to_the_alus_output(run: Run):
    alu = {"alu.op": "copy", "alu.a": "lit"}
    # The step that jumps takes the ALU's output from before it, even where it computes a new one.
    state = run({**alu, "lit": 3}, {**alu, "lit": 0, "seq.op": "jump_alu"}, HALT, literal("x", 1.0))
    assert (state.output["x"], state.steps) == (word(1.0), 4)
    state = run({**alu, "lit": 3}, {"seq.op": "call_alu"}, HALT, {"seq.op": "return"})
    assert (state.address, state.call_stack) == (2, [])


def test_conditions_that_fail_touch_no_stack(run: Run):
    never = {"seq.not": "yes"}
    state = run({"seq.op": "call", **never}, {"seq.op": "return", **never}, {"seq.op": "halt", **never})
    assert (state.steps, state.call_stack) == (4, [])


@pytest.mark.parametrize(("count", "rounds"), [(0, 1), (1, 1), (2, 2), (5, 5)])
def test_loops_run_as_often_as_counted(run: Run, count: int, rounds: int):
    gain = {"alu.op": "add", "alu.a": "own", "alu.b": "lit", "lit": 1}
    state = run({"seq.op": "count", "lit": count}, {**gain, "seq.op": "loop", "seq.to": 1})
    assert (state.output["alu"], state.loop_stack) == (rounds, [])


def test_loops_nest_and_can_be_dropped(run: Run):
    gain = {"alu.op": "add", "alu.a": "own", "alu.b": "lit", "lit": 1}
    nested = [
        {"seq.op": "count", "lit": 3},
        {"seq.op": "count", "lit": 4},
        {**gain, "seq.op": "loop", "seq.to": 2},
        {"seq.op": "loop", "seq.to": 1},
    ]
    assert run(*nested).output["alu"] == 12
    assert run({"seq.op": "count", "lit": 3}, {"seq.op": "drop"}).loop_stack == []


def test_more_tells_whether_loop_would_go_back(run: Run):
    test = {"alu.op": "test", "seq.cond": "more"}
    assert run(test).output["alu"] == 0
    assert run({"seq.op": "count", "lit": 1}, test).output["alu"] == 0
    assert run({"seq.op": "count", "lit": 2}, test).output["alu"] == 1
    assert (
        run(literal("x", 0), {"alu.op": "copy", "alu.a": "lit", "lit": 2}, {"seq.op": "count_alu"}, test).output["alu"]
        == 1
    )


def test_halt_stops_after_its_step_and_stays(run: Run):
    state = run(literal("x", 1.0, **{"seq.op": "halt"}))
    assert (state.halted, state.address, state.steps, state.output["x"]) == (True, 0, 1, word(1.0))


def test_the_display_port_takes_the_data_buses(run: Run):
    pixel = {"disp.op": "pixel", "ag.mode": "base_lit", "lit": 9}
    buses = {f"mem.{bank}": "lit" for bank in "xyzs"}
    state = run({**pixel, **buses}, {"disp.op": "frame"}, {"disp.op": "frame"})
    assert state.display[9].tolist() == [9, 9, 9, 9]
    assert (state.display.sum(), state.frames) == (36, 2)


SOURCES = [
    (unit, one.name) for unit in isa.FPPS for one in isa.DEFAULT.by_name[f"{unit}.a"].values if one.name != "table"
]


@pytest.mark.parametrize(("unit", "source"), SOURCES)
def test_every_source_of_an_fpp(run: Run, unit: str, source: str):
    prepare = [literal(each, number, **{f"{each}.w": "result"}) for number, each in enumerate("xyzs", 1)]
    prepare += [literal(each, 10.0 + number) for number, each in enumerate("xyzs", 1)]
    prepare += [{"mem.op": "read", "mem.on": 15}, {"alu.op": "copy", "alu.a": "lit", "lit": 99}]
    number = "xyzs".index(unit) + 1
    expected = {
        "reg": number,
        "port": 4,
        "own": word(10.0 + number),
        "lit": 55,
        "alu": 99,
        "mem": 20 + number,
        **{f"mem{bank}": 21 + column for column, bank in enumerate("xyzs")},
        **{each: word(11.0 + column) for column, each in enumerate("xyzs")},
    }
    fields = {f"{unit}.op": "copy", f"{unit}.a": source, "lit": 55}
    state = run(*prepare, fields, memory={0: (21, 22, 23, 24)})
    assert state.output[unit] == expected[source]
