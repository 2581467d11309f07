"""Every trap: its kind, its text, the place, and a state that the step has not changed. On both simulators."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tasuki.diagnostics import MachineError, Span
from tasuki.machines.pu import isa, simulate
from tests.machines.pu.simulating import HALT, Fields, program

Trapped = Callable[[isa.Program], simulate.Trap]
NOTHING: Fields = {}
CALL_ITSELF: Fields = {"seq.op": "call", "seq.to": 0}


@pytest.fixture(params=["plain", "fast"])
def trapped(request: pytest.FixtureRequest) -> Trapped:
    """Run a program that traps."""

    def runner(code: isa.Program) -> simulate.Trap:
        with pytest.raises(simulate.Trap) as caught:
            simulate.run(code, machine=request.param, limit=1000)
        assert isinstance(caught.value, MachineError)
        return caught.value

    return runner


def undefined(*fields: str) -> isa.Program:
    """A program whose second microinstruction has an undefined code in these fields."""
    word = sum(isa.DEFAULT.by_name[name].mask << isa.DEFAULT.by_name[name].place for name in fields)
    return isa.Program((0, word))


OUTSIDE = {"ag.mode": "base_lit", "lit": 16}
CASES = [
    ("undefined", undefined("x.op"), "undefined instruction: x.op = 31"),
    ("undefined", undefined("tab.op", "seq.op"), "undefined instruction: tab.op = 7; undefined instruction: seq.op"),
    ("undefined", undefined("y.op", "seq.cond"), "seq.cond = 31"),
    (
        "conflict",
        program(NOTHING, {"x.op": "copy", "x.a": "s", "y.op": "copy", "y.a": "port"}),
        "FPPS's output and bank S's register both drive the S bus",
    ),
    (
        "conflict",
        program(NOTHING, {"z.op": "add", "z.a": "s", "z.b": "port"}),
        "FPPS's output and bank S's register both drive the S bus",
    ),
    (
        "conflict",
        program(NOTHING, {"ag.load": "ir_lit", "ag.ir": 3, "ag.update": "inc"}),
        "index register 3 is loaded and goes on in one step",
    ),
    ("memory", program(NOTHING, {"mem.op": "read", "mem.on": 8, **OUTSIDE}), "an address outside data memory"),
    ("memory", program(NOTHING, {"mem.op": "write", "mem.on": 1, **OUTSIDE}), "expected: a row from 0 to 15"),
    ("memory", program(NOTHING, {"mem.op": "write", "mem.on": 1, **OUTSIDE, "lit": -1}), "found: row 4294967295"),
    ("display", program(NOTHING, {"disp.op": "pixel", **OUTSIDE}), "an address outside display memory"),
    ("call stack", program(NOTHING, {"seq.op": "call", "seq.to": 1}), "call stack overflow"),
    ("call stack", program(NOTHING, {"seq.op": "return"}), "return with an empty call stack"),
    ("loop stack", program(*[{"seq.op": "count"}] * 9), "loop stack overflow"),
    ("loop stack", program(NOTHING, {"seq.op": "loop"}), "loop with an empty loop stack"),
    ("loop stack", program(NOTHING, {"seq.op": "drop"}), "drop with an empty loop stack"),
    ("end", program(NOTHING), "the program runs on past its end"),
    ("end", program(NOTHING, {"seq.op": "jump", "seq.to": 77}), "found: address 77"),
    ("end", program({"alu.op": "copy", "alu.a": "lit", "lit": -5}, {"seq.op": "jump_alu"}), "address 4294967291"),
    ("end", program(), "expected: a program that is not empty"),
    ("limit", program({"seq.op": "jump", "seq.to": 0}), "no halt within 1000 steps"),
]


@pytest.mark.parametrize(("kind", "code", "text"), CASES)
def test_traps(trapped: Trapped, kind: str, code: isa.Program, text: str):
    trap = trapped(code)
    assert trap.kind == kind
    assert text in str(trap)


def test_traps_name_file_line_step_label_and_state(trapped: Trapped, tmp_path):
    source = tmp_path / "far.meta"
    source.write_text("start: alu.op=copy\n       mem.op=read  ; too far\n")
    seven = {"alu.op": "copy", "alu.a": "lit", "alu.w": "result", "alu.rd": 3, "lit": 7}
    code = program(seven, {"mem.op": "read", "mem.on": 15, **OUTSIDE})
    spans = (Span(str(source), 1, 7), Span(str(source), 2, 7))
    trap = trapped(replace(code, spans=spans, labels={"start": 0}))
    text = str(trap)
    assert text.startswith(f"{source}:2:8: error: an address outside data memory")
    assert "mem.op=read" in text
    assert re.search(r"^ +\| {8}\^$", text, re.MULTILINE)
    assert "note: at step 2, address 1 (start+1)" in text
    assert "control came from address 0 (start)" in text
    assert "alu   output 00000007" in text
    assert "registers (hexadecimal; the others are 0): I3=7" in text
    assert trap.span == spans[1]


def test_the_trap_comes_before_the_step_changes_anything(trapped: Trapped):
    everything = {
        "x.op": "copy",
        "x.a": "lit",
        "x.w": "result",
        "alu.op": "test",
        "tab.op": "rcp",
        "mem.op": "write",
        "mem.on": 15,
        "ag.mode": "base_lit",
        "ag.update": "inc",
        "disp.op": "pixel",
        "seq.op": "count",
        "lit": 16,
    }
    trap = trapped(program(everything, HALT))
    assert trap.state.differences(simulate.start(program(everything, HALT))) == []


def test_running_past_the_end_shows_where_control_came_from(trapped: Trapped, tmp_path):
    source = tmp_path / "end.meta"
    source.write_text("jump to nowhere\n")
    code = replace(program({"seq.op": "jump", "seq.to": 9}), spans=(Span(str(source), 1),))
    text = str(trapped(code))
    assert f"{source}:1:1: note: control came from address 0" in text
    assert "jump to nowhere" in text


def test_a_selector_that_no_operation_reads_drives_no_bus():
    idle = {"x.op": "copy", "x.a": "s", "x.b": "port", "y.a": "port"}
    assert simulate.run(program(idle, HALT)).state.steps == 2


@pytest.mark.parametrize("machine", ["plain", "fast"])
def test_the_limit_is_exact(machine: str):
    code = program(NOTHING, NOTHING, NOTHING, HALT)
    assert simulate.run(code, machine=machine, limit=4).state.steps == 4
    with pytest.raises(simulate.Trap) as caught:
        simulate.run(code, machine=machine, limit=3)
    assert (caught.value.state.steps, caught.value.state.address) == (3, 3)


@pytest.mark.parametrize(
    "memory",
    [
        {16: (0, 0, 0, 0)},
        {-1: (0, 0, 0, 0)},
        np.zeros((17, 4), np.float32),
        np.zeros((4, 3), np.float32),
        np.zeros((4, 4)),
    ],
)
def test_initial_memory_must_fit(memory):
    with pytest.raises(MachineError, match="initial"):
        simulate.run(program(HALT), memory=memory)


def test_a_state_of_another_size_is_refused():
    with pytest.raises(MachineError, match="16 rows"):
        simulate.run(program(HALT), state=simulate.start(program(HALT, memory_rows=4)))
