"""Random formulas beside the oracle; on every machine, in packets of any width, the same bits."""

from __future__ import annotations

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tasuki.scene.tree import Node
from tests.csg.agreement import agrees
from tests.csg.oracle import Oracle
from tests.csg.rays import from_all_sides
from tests.csg.strategies import formulas
from tests.csg.tracing import Traced, trees_of
from tests.machines.running import WIDTHS, assert_same_bits

RAYS = 48
REACH = 4.0
"""How far solids of the strategies reach, for the most part."""
seeds = st.integers(0, 1 << 16)


def traced(node: Node, seed: int, two_sided: bool):
    """Formula, rays, and what the oracle says of them; None where the formula holds nothing, or everything."""
    [tree] = trees_of([node])
    oracle = Oracle(tree)
    origin, direction = from_all_sides(np.random.default_rng(seed), RAYS, REACH)
    hits = oracle.first_hits(origin, direction, two_sided=two_sided)
    return Traced([tree], [two_sided]), (origin, direction), hits


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(formulas(), seeds, st.booleans())
def test_t_and_owner_are_the_oracles(node, seed, two_sided):
    here, rays, hits = traced(node, seed, two_sided)
    if here.rows[0] < 0:
        assert np.isinf(hits.t).all()
        return
    right = agrees(here.met(0, *rays), hits)
    assert right[hits.decided].all()
    assert hits.decided.mean() > 0.5


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(formulas(3), seeds, st.booleans())
def test_every_machine_and_width_finds_the_same(node, seed, two_sided):
    here, rays, hits = traced(node, seed, two_sided)
    if here.rows[0] < 0:
        return
    expected = here.met(0, *rays, machine="interpreter")
    for width in WIDTHS:
        found = here.met(0, *rays, width=width)
        assert_same_bits([*found[:3], *found[3].T], [*expected[:3], *expected[3].T], f"width {width}")
    precise = here.met(0, *rays, machine="interpreter", precision="float64")
    assert agrees(precise, hits)[hits.decided].all()
