"""Local arrays that need not be cleared: of which no element is read before it was written.

An array is zero when its life begins; to make it so costs a step for each row, for every ray that is traced. Most
arrays are stacks: written at `a[top]` before `top` goes up, read at `a[top]` after it came down, and never below 0.
That can be seen in the statements, by following what is known of `top` and of the array through them (an abstract
interpretation after P. and R. Cousot, 1977). What cannot be seen is cleared.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from tasuki.ir import nodes as ir
from tasuki.ir.types import I32

PATIENCE = 4
"""Rounds through a loop after which what still changes is given up."""
_COMPARISONS = {"greater": (False, 1), "greater_equal": (False, 0), "less": (True, 1), "less_equal": (True, 0)}
"""Comparison -> whether `top` is its second operand, and what it says beyond the constant: top >= constant + this."""


def needs_no_clearing(function: ir.Function, array: str) -> bool:
    """Whether every read of the array is seen to come after a write of the same element."""
    tops = {name for index in _read_indices(function.body, array) for name in [_local(index)]}
    if len(tops) != 1 or None in tops:
        return not tops
    return _Walk(array, str(tops.pop())).holds(function.body)


@dataclass(frozen=True)
class _Known:
    """At one place: elements 0 to top + `written` - 1 were written (None: nothing is known); top >= `low`.

    `value` is top's value where that is known, `prefix` the number of elements from 0 on that were written by number,
    `facts` the truth values that imply top >= 1.
    """

    written: int | None = None
    low: int | None = None
    value: int | None = None
    prefix: int = 0
    facts: frozenset[str] = frozenset()

    def meet(self, other: _Known) -> _Known:
        """What is known on both ways."""
        return _Known(
            _least(self.written, other.written),
            _least(self.low, other.low),
            self.value if self.value == other.value else None,
            min(self.prefix, other.prefix),
            self.facts & other.facts,
        )

    def moved(self, by: int) -> _Known:
        """After top += by. What goes below 0 may wrap round one day: then nothing is known of the array."""
        low = None if self.low is None else self.low + by
        falls = by < 0 and (low is None or low < 0)
        written = None if self.written is None or falls else self.written - by
        return replace(self, written=written, low=low, value=_moved(self.value, by), facts=frozenset())

    def at_least(self, low: int) -> _Known:
        return replace(self, low=low if self.low is None else max(low, self.low))

    def pushed(self) -> _Known:
        """After a write at top."""
        reaches = self.written is not None and self.written >= 0
        return replace(self, written=max(self.written or 0, 1)) if reaches else self

    def written_at(self, number: int) -> _Known:
        """After a write at a constant index."""
        prefix = self.prefix + 1 if number == self.prefix else self.prefix
        known = replace(self, prefix=prefix)
        if self.value is None:
            return known
        reach = prefix - self.value
        return replace(known, written=reach if self.written is None else max(self.written, reach))


State = _Known | None
"""None where control never comes."""


def _moved(one: int | None, by: int) -> int | None:
    return None if one is None else one + by


def _least(one: int | None, other: int | None) -> int | None:
    return None if one is None or other is None else min(one, other)


def _join(*states: State) -> State:
    joined: State = None
    for state in states:
        if state is not None:
            joined = state if joined is None else joined.meet(state)
    return joined


class _Walk:
    """Follows control through statements. `sound` turns false at a read of what may not have been written."""

    def __init__(self, array: str, top: str) -> None:
        self.array, self.top, self.sound = array, top, True
        self.loops: list[tuple[list[State], list[State]]] = []
        """For each loop around: the states at its `Break`s, and at its `Continue`s."""

    def holds(self, body: Sequence[ir.Statement]) -> bool:
        self.block(body, _Known())
        return self.sound

    def block(self, statements: Sequence[ir.Statement], state: State) -> State:
        for statement in statements:
            state = self.statement(statement, state) if state is not None else None
        return state

    def statement(self, node: ir.Statement, state: _Known) -> State:
        if not isinstance(node, ir.If | ir.Loop):
            self.read(node, state)
        match node:
            case ir.Assign(target, value):
                return self.assign(target, value, state)
            case ir.Call(target) | ir.Atomic(target):
                return self.unknown(target, state) if target is not None else state
            case ir.SetElement(array, index, _, path) if array == self.array and not path:
                return self.element(index, state)
            case ir.Clear(array) if array == self.array:
                return replace(state, written=None, prefix=0)
            case ir.If():
                self.read(node.test, state)
                then = self.block(node.then, self.refined(node.test, state))
                return _join(then, self.block(node.orelse, state))
            case ir.Loop():
                return self.loop(node, state)
            case ir.Break():
                self.loops[-1][0].append(state)
                return None
            case ir.Continue():
                self.loops[-1][1].append(state)
                return None
            case ir.Return():
                return None
        return state

    def loop(self, node: ir.Loop, entered: _Known) -> State:
        """To a state at the loop's head that a round leaves as it is."""
        head = entered
        for turn in range(2 * PATIENCE):
            breaks: list[State] = []
            continues: list[State] = []
            self.loops.append((breaks, continues))
            tested = self.block(node.setup, head)
            if tested is not None:
                self.read(node.test, tested)
                body = self.block(node.body, self.refined(node.test, tested))
            self.loops.pop()
            back = self.block(node.step, _join(body, *continues)) if tested is not None else None
            met = head if back is None else head.meet(back)
            if met == head:
                return _join(tested, *breaks)
            head = met if turn < PATIENCE else _Known(facts=met.facts)
        self.sound = False
        return None

    # --- what statements tell -----------------------------------------------------------------------------------------

    def assign(self, target: str, value: ir.Expression, state: _Known) -> _Known:
        if target == self.top:
            return self.assign_top(value, state)
        state = self.unknown(target, state)
        positive = self.bound(value)
        return replace(state, facts=state.facts | {target}) if positive is not None and positive >= 1 else state

    def assign_top(self, value: ir.Expression, state: _Known) -> _Known:
        match value:
            case ir.Constant(number):
                return _Known(state.prefix - int(number), int(number), int(number), state.prefix)
            case ir.Operate("add", (ir.Local(name), ir.Constant(number))) if name == self.top:
                return state.moved(int(number))
            case ir.Operate("subtract", (ir.Local(name), ir.Constant(number))) if name == self.top:
                return state.moved(-int(number))
        return _Known(prefix=state.prefix)

    def unknown(self, target: str, state: _Known) -> _Known:
        """A variable takes a value of which nothing is known."""
        if target == self.top:
            return _Known(prefix=state.prefix)
        return replace(state, facts=state.facts - {target})

    def element(self, index: ir.Expression, state: _Known) -> _Known:
        if _local(index) == self.top:
            return state.pushed()
        if isinstance(index, ir.Constant):
            return state.written_at(int(index.value))
        return state

    def refined(self, test: ir.Expression, state: _Known) -> _Known:
        """What is known where a test holds."""
        if isinstance(test, ir.Operate) and test.operation == "bit_and":
            return self.refined(test.arguments[1], self.refined(test.arguments[0], state))
        bound = 1 if _local(test) in state.facts else self.bound(test)
        return state if bound is None else state.at_least(bound)

    def bound(self, test: ir.Expression) -> int | None:
        """What top is at least where a comparison with a constant holds."""
        if not isinstance(test, ir.Operate) or test.operation not in _COMPARISONS:
            return None
        exchanged, beyond = _COMPARISONS[test.operation]
        constant, top = test.arguments if exchanged else test.arguments[::-1]
        if isinstance(constant, ir.Constant) and constant.type == I32 and _local(top) == self.top:
            return int(constant.value) + beyond
        return None

    def read(self, node: object, state: _Known) -> None:
        """Every read of the array, in an expression or statement, is of something that was written."""
        if any(True for _ in _read_indices(node, self.array)):
            written = state.written is not None and state.written >= 1
            self.sound = self.sound and written and state.low is not None and state.low >= 0


def _local(node: ir.Expression) -> str | None:
    return node.name if isinstance(node, ir.Local) else None


def _read_indices(node: object, array: str) -> Iterator[ir.Expression]:
    """The indices at which expressions in `node` read the array; a member that is set reads the rest of its element."""
    if isinstance(node, tuple):
        for one in node:
            yield from _read_indices(one, array)
    elif isinstance(node, ir.Node):
        if isinstance(node, ir.Element) and node.array == array:
            yield node.index
        if isinstance(node, ir.SetElement) and node.array == array and node.path:
            yield node.index
        for value in vars(node).values():
            yield from _read_indices(value, array)
