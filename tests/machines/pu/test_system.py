"""CP and N units: what is worked, who waits for whom, and the bounds that no distribution can beat."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tasuki.diagnostics import MachineError
from tasuki.machines.pu.system import System, draw, efficiency, saturation

systems = st.builds(
    System,
    units=st.integers(1, 9),
    distribution=st.sampled_from(["static", "dynamic"]),
    pixels=st.integers(1, 4),
    scene_rows=st.integers(0, 50),
    rows_per_step=st.integers(1, 3),
    request=st.integers(0, 30),
    display=st.integers(0, 5),
)
costs = st.lists(st.integers(0, 200), max_size=60)


def test_two_units_by_hand():
    system = System(2, "dynamic", scene_rows=10, request=3, display=2)
    frame = draw([20, 10, 5], system, timelines=True)
    # The CP answers unit 0 at 13, unit 1 at 16. Unit 1 is ready at 26, has sent at 28, gets pixel 2 at 31 and is ready
    # at 36, when unit 0, ready at 33, has its pixel out since 35.
    assert [[(s.start, s.end, s.what) for s in line] for line in frame.timelines] == [
        [(10, 13, "request"), (13, 33, "work"), (33, 35, "display")],
        [(10, 16, "request"), (16, 26, "work"), (26, 28, "display"), (28, 31, "request"), (31, 36, "work"),
         (36, 38, "display")],
    ]  # fmt: skip
    assert frame.total == 38
    assert frame.worked.tolist() == [20, 15]
    assert frame.waited_request.tolist() == [3, 9]
    assert frame.waited_display.tolist() == [2, 4]


def test_one_unit_does_one_thing_after_another():
    system = System(1, "dynamic", scene_rows=7, rows_per_step=2, request=16, display=3, clock=1000.0)
    frame = draw([5, 6, 7], system)
    assert frame.total == 4 + 3 * (16 + 3) + 18
    assert frame.seconds == frame.total / 1000.0
    assert draw([5, 6, 7], replace(system, distribution="static")).total == 4 + 3 * 3 + 18


@given(costs, systems)
def test_every_step_is_worked_once_and_no_time_is_lost(steps, system):
    frame = draw(steps, system, timelines=True)
    assert frame.worked.sum() == sum(steps)
    pieces = -(-len(steps) // system.pixels)
    if system.distribution == "static":
        assert not frame.waited_request.any()
    for unit, line in enumerate(frame.timelines):
        ends = [system.broadcast, *(stretch.end for stretch in line)]
        assert [stretch.start for stretch in line] == ends[:-1]
        assert ends[-1] <= frame.total
        assert sum(s.end - s.start for s in line if s.what == "work") == frame.worked[unit]
    assert frame.total == max([system.broadcast, *(line[-1].end for line in frame.timelines if line)])
    assert 0 <= frame.busy_share <= 1
    assert frame.pixels == len(steps) <= pieces * system.pixels


@given(costs, systems)
def test_no_distribution_beats_these_bounds(steps, system):
    after = draw(steps, system).total - system.broadcast
    assert after * system.units >= sum(steps)
    assert after >= max(steps, default=0)
    assert after >= len(steps) * system.display
    if system.distribution == "dynamic":
        assert after >= -(-len(steps) // system.pixels) * system.request


@given(costs, systems)
def test_nobody_waits_where_nothing_is_shared(steps, system):
    system = replace(system, request=0, display=0)
    frame = draw(steps, system)
    assert not frame.waited_request.any()
    assert not frame.waited_display.any()


def test_equal_pixels_are_spread_without_loss():
    steps = np.full(16 * 1000, 300)
    for distribution in ("static", "dynamic"):
        system = System(16, distribution, request=16, display=1)
        assert efficiency(steps, system) > 0.94
    assert efficiency(steps, System(16, "static", display=0)) == 1.0


def test_costly_pixels_in_one_column_are_what_interleaving_cannot_spread():
    steps = np.full((64, 64), 100)
    steps[:, ::16] = 5000
    steps = steps.ravel()
    static = draw(steps, System(16, "static"))
    dynamic = draw(steps, System(16, "dynamic"))
    assert static.total > 5 * dynamic.total
    assert static.busy_share < 0.2 < 0.9 < dynamic.busy_share


def test_the_display_memory_binds_where_units_are_many_and_pixels_cheap():
    steps = np.full(4096, 40)
    assert draw(steps, System(64, "static", display=4)).display_binds
    assert not draw(steps, System(4, "static", display=4)).display_binds
    assert not draw([], System(4)).display_binds


@given(costs, systems)
def test_more_units_than_saturate_do_not_help(steps, system):
    for shared, units in saturation(steps, system).items():
        if units is not None:
            after = draw(steps, system).total - system.broadcast
            alone = draw(steps, replace(system, units=1)).total - system.broadcast
            assert alone <= units * after * (1 + 1e-9), shared


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"units": 0}, "units: expected 1 to 4096, found 0"),
        ({"units": 5000}, "units: expected 1 to 4096, found 5000"),
        ({"pixels": 0}, "pixels: expected at least 1, found 0"),
        ({"request": -1}, "request: expected at least 0, found -1"),
        ({"distribution": "random"}, "distribution: expected static or dynamic, found 'random'"),
        ({"clock": 0.0}, "clock: expected a number of steps a second, found 0.0"),
    ],
)
def test_bad_parameters_are_named(options, message):
    with pytest.raises(MachineError, match=message):
        System(**options)
