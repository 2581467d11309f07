"""Random formulas beside the oracle; on every machine, in packets of any width, the same bits."""

from __future__ import annotations

import numpy as np
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from tasuki.scene.tree import Node
from tests.csg.agreement import agrees
from tests.csg.oracle import Oracle
from tests.csg.rays import from_all_sides, towards
from tests.csg.strategies import formulas
from tests.csg.tracing import Traced, trees_of
from tests.machines.running import WIDTHS, assert_same_bits

RAYS = 48
REACH = 4.0
"""How far solids of the strategies reach, for the most part."""
seeds = st.integers(0, 1 << 16)


def traced(node: Node, seed: int, two_sided: bool):
    """A formula in memory, its oracle, and rays."""
    [tree] = trees_of([node])
    rays = from_all_sides(np.random.default_rng(seed), RAYS, REACH)
    return Traced([tree], [two_sided]), Oracle(tree), rays


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(formulas(), seeds, st.booleans())
def test_t_and_owner_are_the_oracles(node, seed, two_sided):
    here, oracle, rays = traced(node, seed, two_sided)
    hits = oracle.first_hits(*rays, two_sided=two_sided)
    right = agrees(here.met(0, *rays), hits)
    assert right[hits.decided].all()
    assert hits.decided.mean() > 0.5


@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(formulas(), seeds, st.booleans())
def test_so_they_are_for_rays_that_go_on_from_there(node, seed, two_sided):
    here, oracle, (origin, direction) = traced(node, seed, two_sided)
    t, owner, code, _ = here.met(0, origin, direction)
    met = np.isfinite(t)
    start = origin[met] + t[met, None] * direction[met]
    start, onwards = towards(start, start + np.random.default_rng(seed).normal(size=start.shape))
    left = [oracle.surface_of(place) for place in owner[met]]
    hits = oracle.first_hits(start, onwards, two_sided=two_sided, left=left)
    assert agrees(here.met(0, start, onwards, code[met]), hits)[hits.decided].all()


@settings(max_examples=4, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
@given(st.lists(formulas(2), min_size=4, max_size=4), seeds)
def test_every_machine_and_width_finds_the_same(nodes, seed):
    trees = trees_of(nodes)
    here = Traced(trees, [True] * len(trees))
    kept = np.flatnonzero(here.rows >= 0)
    assume(len(kept))
    rays = from_all_sides(np.random.default_rng(seed), RAYS, REACH)
    numbers = np.repeat(kept, RAYS)
    every = [np.tile(array, (len(kept), 1)) for array in rays]
    expected = _leaves(here.met(numbers, *every, machine="interpreter"))
    for width in WIDTHS:
        # One formula after another, as renderers ask; and every lane its own.
        apart = [_leaves(here.met(number, *rays, width=width)) for number in kept]
        one_by_one = [np.concatenate(leaf) for leaf in zip(*apart, strict=True)]
        assert_same_bits(one_by_one, expected, f"width {width}")
        assert_same_bits(_leaves(here.met(numbers, *every, width=width)), expected, f"width {width}, mixed")
    precise = here.met(numbers, *every, machine="interpreter", precision="float64")
    for place, number in enumerate(kept):
        hits = Oracle(trees[number]).first_hits(*rays, two_sided=True)
        mine = [leaf[place * RAYS : (place + 1) * RAYS] for leaf in precise]
        assert agrees(mine, hits)[hits.decided].all()


def _leaves(found) -> list[np.ndarray]:
    t, owner, code, normal = found
    return [t, owner, code, *normal.T]
