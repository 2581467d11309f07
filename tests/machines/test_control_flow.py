"""Random programs on the CPU and by the interpreter, bit for bit: masks, calls, loops, local arrays, tables.

The usual run takes a few programs, always the same. `TASUKI_FUZZ=500 pytest tests/machines/test_control_flow.py` takes
500 for each test, every time others.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, note, settings
from hypothesis import strategies as st

from tasuki.ir import nodes as n
from tasuki.ir.interpret import interpret
from tasuki.ir.memory import MemoryTable
from tasuki.ir.text import print_program
from tasuki.machines.cpu.launch import Binding
from tests.ir.random_programs import random_arguments, random_programs, random_tables
from tests.machines.running import WIDTHS, assert_same_bits, compile_program, run_compiled, spread

EXAMPLES = int(os.environ.get("TASUKI_FUZZ", "0"))
some = settings(
    max_examples=EXAMPLES or 12,
    deadline=None,
    # Repeatable where everyone waits for it, searching where one asks for it. Shrinking a program takes minutes, and
    # its text, which is printed, is readable as it stands.
    derandomize=not EXAMPLES,
    database=None,
    phases=[Phase.generate],
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example],
)
item_counts = st.sampled_from([1, 2, 5, 16, 21, 35])


@st.composite
def random_bindings(draw: Any, program: n.Program) -> list[Binding]:
    """Most parameters vary from item to item; some are the same for all. `lane` is the item's number in any case."""
    parameters = program.functions[program.entry].parameters
    ways = st.sampled_from(["items", "items", "same"])
    numbers = st.sampled_from(["items", "number"])
    return [draw(numbers if parameter.name == "lane" else ways) for parameter in parameters]


def draw_program(data: Any, **options: bool) -> n.Program:
    program = data.draw(random_programs(**options), label="program")
    note(print_program(program))
    return program


def check(
    program: n.Program, bindings: Sequence[Binding], values: Sequence[Any], items: int, width: int, **options: Any
) -> None:
    executable = compile_program(program, bindings, width, checked=options.pop("checked", True))
    found = run_compiled(executable, bindings, values, items, **options)
    expected = interpret(program, spread(bindings, values, items), lanes=items, width=width)
    assert_same_bits(found, expected, f"width {width}")


@pytest.mark.parametrize("width", WIDTHS)
@some
@given(data=st.data())
def test_programs_agree(width, data):
    program = draw_program(data, lane_operations=True)
    items = data.draw(item_counts)
    values = data.draw(random_arguments(program, items))
    bindings = data.draw(random_bindings(program))
    check(program, bindings, values, items, width, checked=data.draw(st.booleans()))


@pytest.mark.parametrize("width", WIDTHS)
@some
@given(data=st.data())
def test_regrouped_lanes_agree(width, data):
    program = draw_program(data)
    items = data.draw(item_counts)
    values = data.draw(random_arguments(program, items))
    bindings: list[Binding] = ["items"] * len(values)
    order = np.array(data.draw(st.permutations(range(items))))
    executable = compile_program(program, bindings, width)
    found = run_compiled(executable, bindings, [[leaf[order] for leaf in value] for value in values], items)
    expected = interpret(program, spread(bindings, values, items), lanes=items)
    assert_same_bits(found, [leaf[order] for leaf in expected])


@pytest.mark.parametrize("width", WIDTHS)
@some
@given(data=st.data())
def test_memory_agrees(width, data):
    program = draw_program(data, lane_operations=True, tables=True)
    items = data.draw(item_counts)
    values = data.draw(random_arguments(program, items))
    bindings = data.draw(random_bindings(program))
    given_tables = data.draw(random_tables(items))
    images = []
    for machine in ("cpu", "interpreter"):
        memory = given_tables["source"].memory.copy()
        tables = {name: MemoryTable(memory, table.base, table.count) for name, table in given_tables.items()}
        if machine == "cpu":
            executable = compile_program(program, bindings, width, checked=data.draw(st.booleans()))
            leaves = run_compiled(executable, bindings, values, items, tables=tables)
        else:
            leaves = interpret(program, spread(bindings, values, items), lanes=items, tables=tables, width=width)
        images.append([*leaves, memory.reshape(-1)])
    assert_same_bits(*images)


@some
@given(data=st.data())
def test_threads_agree(data):
    # 30 packets' worth of items in chunks of one packet, so that threads take turns.
    program = draw_program(data, lane_operations=True)
    items = 16 * 30 - 5
    values = [[np.resize(leaf, items) for leaf in value] for value in data.draw(random_arguments(program, 37))]
    bindings: list[Binding] = ["items"] * len(values)
    check(program, bindings, values, items, 16, threads=4, chunk=16)
