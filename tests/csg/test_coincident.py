"""Solids that share faces, from all sides: no ray is wrong but where float32 cannot decide, and that is seldom.

Every pair of kinds, in every relation of their faces, under every operation, is an object of one scene, placed there
through two chains of matrices that differ by rounding.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import combinations_with_replacement

import numpy as np
import pytest

from tests.csg.agreement import Tally, agrees, agrees_on_a_side
from tests.csg.operands import CUT, OPERATIONS, RELATIONS, by_detours, directly
from tests.csg.oracle import Oracle
from tests.csg.rays import along_edges, from_all_sides, in_the_plane, towards
from tests.csg.tracing import Traced, trees_of

PAIRS = list(combinations_with_replacement(CUT, 2))
FEW = 0.002
"""The share of rays that may be undecided."""


@dataclass(frozen=True)
class Suite:
    """Every pair and operation of one relation. Every other formula shows from both sides."""

    relation: str
    placed: bool

    @cached_property
    def names(self) -> list[str]:
        return [f"{a} {operation} {b}" for a, b in PAIRS for operation in OPERATIONS]

    @cached_property
    def oracles(self) -> list[Oracle]:
        nodes = []
        for pair in PAIRS:
            a, b = RELATIONS[self.relation](*pair)
            if self.placed:
                a, b = directly(a), by_detours(b)
            nodes += [operation(a, b) for operation in OPERATIONS.values()]
        return [Oracle(tree) for tree in trees_of(nodes)]

    @property
    def two_sided(self) -> list[bool]:
        return [number % 2 == 1 for number in range(len(self.names))]

    @cached_property
    def traced(self) -> Traced:
        return Traced([oracle.root for oracle in self.oracles], self.two_sided)

    def __iter__(self) -> Iterator[tuple[str, Oracle]]:
        return zip(self.names, self.oracles, strict=True)


@cache
def suite(relation: str, *, placed: bool = True) -> Suite:
    return Suite(relation, placed)


@pytest.mark.parametrize("relation", RELATIONS)
def test_surfaces_that_coincide_are_one(relation):
    # The oracle compares coefficients, the packer features of the surfaces: they must find the same.
    for oracle in suite(relation).oracles[:: len(OPERATIONS)]:
        tables = Traced([oracle.root]).tables
        assert len(tables["planes"]) + len(tables["quadrics"]) == len(oracle.surfaces)


@pytest.mark.parametrize("relation", RELATIONS)
def test_no_ray_is_wrong_on_the_cpu(relation):
    here, tally = suite(relation), Tally()
    for number, (name, oracle) in enumerate(here):
        rays = from_all_sides(np.random.default_rng(number), 128)
        hits = oracle.first_hits(*rays, two_sided=here.two_sided[number])
        tally.add(name, agrees(here.traced.met(number, *rays), hits), hits.decided)
    tally.require(FEW)


@pytest.mark.parametrize("relation", RELATIONS)
def test_no_ray_is_wrong_on_the_interpreter_in_float64(relation):
    here, tally = suite(relation), Tally()
    rays = from_all_sides(np.random.default_rng(1), 16)
    numbers = np.repeat(np.arange(len(here.names)), 16)
    every = (np.tile(array, (len(here.names), 1)) for array in rays)
    found = here.traced.met(numbers, *every, machine="interpreter", precision="float64")
    for number, (name, oracle) in enumerate(here):
        hits = oracle.first_hits(*rays, two_sided=here.two_sided[number])
        mine = [leaf[16 * number : 16 * (number + 1)] for leaf in found]
        tally.add(name, agrees(mine, hits), hits.decided)
    tally.require(FEW)


@pytest.mark.parametrize("relation", ["shared", "opposite", "nested"])
def test_rays_in_a_shared_face_are_on_one_side_of_it(relation):
    here, tally = suite(relation, placed=False), Tally()
    rays = in_the_plane(np.random.default_rng(2), 48)
    for number, (name, oracle) in enumerate(here):
        found = here.traced.met(number, *rays)
        tally.add(name, *agrees_on_a_side(found, oracle, *rays, two_sided=here.two_sided[number]))
    # Rims that coincide are crossed at once.
    tally.require(0.2)


@pytest.mark.parametrize("relation", ["shared", "opposite", "nested"])
def test_rays_along_shared_edges_are_on_one_side_of_each_face(relation):
    here, tally = suite(relation, placed=False), Tally()
    rays = along_edges(np.random.default_rng(3), 64)
    for number, (name, oracle) in enumerate(here):
        if set(name.split()) <= {"box", "half-space", *OPERATIONS}:
            found = here.traced.met(number, *rays)
            tally.add(name, *agrees_on_a_side(found, oracle, *rays, two_sided=here.two_sided[number]))
    tally.require(0.0)


@pytest.mark.parametrize("relation", RELATIONS)
def test_rays_go_on_from_a_shared_face(relation):
    here, tally = suite(relation), Tally()
    for number, (name, oracle) in enumerate(here):
        draw = np.random.default_rng(number)
        origin, direction = from_all_sides(draw, 64)
        t, owner, code, _ = here.traced.met(number, origin, direction)
        met = np.isfinite(t)
        start = origin[met] + t[met, None] * direction[met]
        start, onwards = towards(start, start + draw.normal(size=start.shape))
        left = [oracle.surface_of(place) for place in owner[met]]
        hits = oracle.first_hits(start, onwards, two_sided=here.two_sided[number], left=left)
        tally.add(name, agrees(here.traced.met(number, start, onwards, code[met]), hits), hits.decided)
    tally.require(FEW)
