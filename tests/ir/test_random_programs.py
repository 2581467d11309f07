"""Random programs: verified, printed and read back, the same for any regrouping of lanes, and as one lane runs them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tasuki.ir.canonical import canonical_text, digest
from tasuki.ir.interpret import interpret
from tasuki.ir.memory import MemoryTable
from tasuki.ir.parse import parse_program
from tasuki.ir.text import print_program
from tasuki.ir.verify import verify
from tests.ir.one_lane import OneLane
from tests.ir.random_programs import random_arguments, random_programs, random_tables, same_bits

LANES = 6
slowly = settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large]
)


@slowly
@given(random_programs(lane_operations=True, tables=True))
def test_programs_verify_and_survive_print_and_parse(program):
    verify(program)
    text = print_program(program)
    again = parse_program(text)
    verify(again)
    assert print_program(again) == text
    assert digest(again) == digest(program)


@slowly
@given(random_programs(lane_operations=True, tables=True))
def test_canonical_text_is_its_own_canonical_text(program):
    text = canonical_text(program)
    assert canonical_text(parse_program(text)) == text


@slowly
@given(st.data())
def test_results_do_not_depend_on_packets(data):
    program = data.draw(random_programs())
    arguments = data.draw(random_arguments(program, LANES))
    expected = interpret(program, arguments, lanes=LANES)
    for width in (1, 3, 4):
        outcome = interpret(program, arguments, lanes=LANES, width=width)
        assert all(same_bits(a, b) for a, b in zip(expected, outcome, strict=True)), width


@slowly
@given(st.data())
def test_masks_do_what_plain_control_flow_does(data):
    program = data.draw(random_programs())
    arguments = data.draw(random_arguments(program, LANES))
    outcome = interpret(program, arguments, lanes=LANES)
    with np.errstate(all="ignore"):
        for lane in range(LANES):
            alone = OneLane(program).call("main", [[leaf[lane] for leaf in value] for value in arguments])
            for leaf, expected in zip(outcome, alone, strict=True):
                assert same_bits(leaf[lane : lane + 1], np.array([expected])), f"lane {lane}"


@slowly
@given(st.data())
def test_tables_do_not_depend_on_packets(data):
    program = data.draw(random_programs(tables=True))
    arguments = data.draw(random_arguments(program, LANES))
    tables = data.draw(random_tables(LANES))
    runs = []
    for width in (None, 1, 4):
        memory = tables["source"].memory.copy()
        mine = {name: MemoryTable(memory, table.base, table.count) for name, table in tables.items()}
        runs.append([*interpret(program, arguments, lanes=LANES, tables=mine, width=width), memory])
    assert all(same_bits(a, b) for run in runs[1:] for a, b in zip(runs[0], run, strict=True))


@pytest.mark.parametrize("precision", [np.float32, np.float64])
@slowly
@given(data=st.data())
def test_any_precision_keeps_its_types(data, precision):
    program = data.draw(random_programs(lane_operations=True))
    arguments = data.draw(random_arguments(program, LANES))
    outcome = interpret(program, arguments, lanes=LANES, precision=precision)
    wanted = {"f32": precision, "i32": np.int32, "bool": np.bool_}
    assert [leaf.dtype for leaf in outcome] == [wanted[leaf] for leaf in program.functions["main"].result.leaves]
