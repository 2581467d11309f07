"""Steps by module: what is counted, and for whom."""

from __future__ import annotations

import numpy as np
import pytest

from tasuki.ir import nodes as n
from tasuki.ir.types import F32, I32, VEC3
from tasuki.machines.pu.lower import Executable
from tasuki.machines.pu.lower import program as lowering
from tasuki.machines.pu.lower.costs import module_cost
from tests.ir.build import function, i, local, op, program
from tests.machines.test_conformance import random_leaves

PUBLISHED = {"dot": 3, "norm": 12, "normalize": 18, "reciprocal": 5, "sqrt": 9, "divide": 6, "sin": 15, "add": 1}
"""Steps of Table 1."""


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_module_of_one_operation_costs_what_table_1_says(name):
    kinds = {"dot": [VEC3, VEC3], "norm": [VEC3], "normalize": [VEC3], "divide": [F32, F32], "add": [F32, F32]}
    types = kinds.get(name, [F32])
    parameters = {f"p{at}": kind for at, kind in enumerate(types)}
    value = op(name, *(local(one, kind) for one, kind in parameters.items()))
    made = program(function([n.Return(value)], parameters, value.type))
    values = [random_leaves(kind, 5 + at, 20) for at, kind in enumerate(types)]
    cost = module_cost(made, values, 20)
    assert (cost.least, cost.typical, cost.most, cost.words) == (PUBLISHED[name],) * 4


def counting() -> n.Program:
    """Calls `inner` as often as it is told."""
    x, turns = local("x", F32), local("turns", I32)
    inner = function([n.Return(op("sqrt", local("y", F32)))], {"y": F32}, F32, name="examples.py:inner")
    step = (n.Assign("at", op("add", local("at", I32), i(1))),)
    loop = n.Loop(op("less", local("at", I32), turns), (n.Call("x", "examples.py:inner", (x,)),), step=step)
    body = [n.Assign("at", i(0)), loop, n.Return(x)]
    main = function(body, {"x": F32, "turns": I32}, F32, {"at": I32}, name="examples.py:outer")
    return program(main, inner)


@pytest.mark.parametrize("inlined", [-1, lowering.INLINED])
@pytest.mark.parametrize("schedule", ["macro", "compact"])
def test_steps_count_for_the_module_whose_source_they_come_from(schedule, inlined, monkeypatch):
    monkeypatch.setattr(lowering, "INLINED", inlined)
    executable = Executable(counting(), schedule)
    turns = np.array([0, 1, 5, 100], np.int32)
    executable.run([[np.ones(4, np.float32)], [turns]], 4)
    steps = executable.steps_by_module()
    assert sum(steps.values()) == sum(executable.executions)
    assert steps["examples.py:inner"] >= 9 * turns.sum()
    # Each turn costs the same.
    assert executable.steps[3] - executable.steps[2] == 95 * (executable.steps[1] - executable.steps[0])


def test_the_least_the_typical_and_the_most():
    turns = np.array([3, 0, 3, 9, 3], np.int32)
    cost = module_cost(counting(), [[np.ones(5, np.float32)], [turns]], 5)
    assert cost.least < cost.typical < cost.most
    assert (cost.most - cost.typical) == 2 * (cost.typical - cost.least)
