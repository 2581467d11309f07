"""Which local arrays are cleared: all but those of which every element is seen to be written before it is read."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tasuki.ir import nodes as n
from tasuki.ir.types import BOOL, I32, Array
from tasuki.machines.pu.lower import compile_program
from tests.ir.build import element, function, i, local, op, program
from tests.machines.pu.lowering import agree

STACK = Array(I32, 8)
TOP, X = local("top", I32), local("x", I32)
READ = element("stack", STACK, TOP)


def push(value: Any) -> list[Any]:
    return [n.SetElement("stack", TOP, value), n.Assign("top", op("add", TOP, i(1)))]


def pop() -> list[Any]:
    return [n.Assign("top", op("subtract", TOP, i(1))), n.Assign("sum", op("add", local("sum", I32), READ))]


def while_(test: Any, *body: Any) -> n.Loop:
    return n.Loop(test, tuple(body))


def stacking(*body: Any) -> n.Program:
    """Sums up what it pops. `x` is the item's argument, `left` counts down from 5."""
    start = [n.Clear("stack"), n.Assign("sum", i(0)), n.Assign("left", i(5)), n.Assign("top", i(0))]
    variables = {"stack": STACK, "sum": I32, "left": I32, "top": I32, "busy": BOOL}
    return program(function([*start, *body, n.Return(local("sum", I32))], {"x": I32}, I32, variables))


def push_some() -> n.Loop:
    left = local("left", I32)
    count = n.Assign("left", op("subtract", left, i(1)))
    odd = op("equal", op("bit_and", op("shift_right", X, left), i(1)), i(1))
    return while_(op("greater", left, i(0)), count, n.If(odd, tuple(push(op("add", X, left)))))


EMPTIED = while_(op("greater", TOP, i(0)), *pop())
STACKS = {
    "pushed and popped": [push_some(), EMPTIED],
    "pushed on both ways": [n.If(op("less", X, i(3)), tuple(push(X)), tuple(push(i(7)))), push_some(), EMPTIED],
    "popped behind a truth value": [
        push_some(),
        n.Assign("busy", op("greater", TOP, i(0))),
        n.If(local("busy", BOOL), tuple(pop())),
    ],
    "popped in a loop with a break": [
        push_some(),
        while_(n.Constant(True, BOOL), n.If(op("less_equal", TOP, i(0)), (n.Break(),)), *push(X), *pop(), n.Break()),
    ],
    "begun by number": [n.SetElement("stack", i(0), X), n.Assign("top", i(1)), push_some(), EMPTIED],
    "begun by number afterwards": [n.Assign("top", i(1)), n.SetElement("stack", i(0), X), push_some(), EMPTIED],
    "pushed and popped in turns": [
        while_(
            op("greater", local("left", I32), i(0)),
            n.Assign("left", op("subtract", local("left", I32), i(1))),
            *push(X),
            *push(local("left", I32)),
            n.If(op("bit_and", op("less", X, i(9)), op("less", i(0), TOP)), tuple(pop())),
        ),
    ],
    "written and never read": push(X),
}
OTHERS = {
    "popped below the bottom": [push_some(), *pop()],
    "popped behind a truth value that is old": [
        *push(X),
        n.Assign("busy", op("greater", TOP, i(0))),
        *pop(),
        n.If(local("busy", BOOL), tuple(pop())),
    ],
    "moved up without a push": [push_some(), n.Assign("top", op("add", TOP, i(1))), EMPTIED],
    "pushed on one way": [
        n.If(op("less", X, i(3)), (n.SetElement("stack", TOP, X),)),
        n.Assign("top", op("add", TOP, i(1))),
        EMPTIED,
    ],
    "read where something else says": [push_some(), n.Assign("sum", element("stack", STACK, X))],
    "read before anything": [n.Assign("sum", READ)],
    "set elsewhere": [push_some(), n.Assign("top", op("bit_and", X, i(3))), EMPTIED],
    "cleared again": [push_some(), n.Clear("stack"), EMPTIED],
}
ITEMS = np.array([31, 0, 5, 2, 17, 3, 40, 1], np.int32)


@pytest.mark.parametrize("name", STACKS)
def test_a_stack_is_not_cleared(name):
    made = stacking(*STACKS[name])
    assert "clear" not in compile_program(made).source
    agree(made, [[ITEMS]], len(ITEMS))


@pytest.mark.parametrize("name", OTHERS)
def test_any_other_array_is_cleared(name):
    """Items run one after another: what one has left, the next would read."""
    made = stacking(*OTHERS[name])
    assert "clear" in compile_program(made).source
    agree(made, [[ITEMS]], len(ITEMS))
