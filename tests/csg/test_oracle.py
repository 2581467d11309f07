"""The oracle itself: beside plain membership of points, and on formulas whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from tasuki.scene.solids import Box, HalfSpace, Sphere
from tests.csg.operands import OPERATIONS, RELATIONS, by_detours, directly
from tests.csg.oracle import Oracle
from tests.csg.rays import from_all_sides
from tests.csg.tracing import trees_of

LEFT, RIGHT = Box((-1, -1, -1), (0, 1, 1)), Box((0, -1, -1), (1, 1, 1))
ALONG_X = (np.array([[-5.0, 0.25, 0.5]]), np.array([[1.0, 0.0, 0.0]]))


@pytest.mark.parametrize("relation", RELATIONS)
@pytest.mark.parametrize("operation", OPERATIONS)
def test_points_before_and_behind_a_hit_are_where_it_says(relation, operation):
    draw = np.random.default_rng(1)
    origin, direction = (array.astype(np.float64) for array in from_all_sides(draw, 200))
    a, b = RELATIONS[relation]("box", "hyperboloid")
    [tree] = trees_of([OPERATIONS[operation](directly(a), by_detours(b))])
    oracle = Oracle(tree)
    hits = oracle.first_hits(origin, direction, two_sided=True)
    begins = oracle.inside(origin)
    found = hits.decided & np.isfinite(hits.t)
    assert (hits.entering == ~begins)[found].all()
    for share in (0.2, 0.7, 0.999):
        assert (oracle.inside(origin + (share * hits.t)[:, None] * direction) == begins)[found].all()
    behind = origin + (hits.t + 1e-4)[:, None] * direction
    # Another crossing may follow within that step: of thin edges only.
    assert (oracle.inside(behind) == begins)[found].sum() <= 0.02 * found.sum()
    nowhere = hits.decided & np.isinf(hits.t)
    assert (oracle.inside(origin + 3.0 * direction) == begins)[nowhere].all()


def test_boxes_that_touch_are_one():
    [tree] = trees_of([LEFT | RIGHT])
    outside = Oracle(tree).first_hits(*ALONG_X)
    assert (outside.t[0], outside.owner[0], outside.entering[0]) == (4.0, 0, True)
    inside = Oracle(tree).first_hits(ALONG_X[0] + 4.5 * ALONG_X[1], ALONG_X[1], two_sided=True)
    assert (inside.t[0], inside.owner[0], inside.entering[0]) == (1.5, 7, False)


def test_boxes_that_touch_have_nothing_in_common():
    [tree] = trees_of([LEFT & RIGHT])
    assert np.isinf(Oracle(tree).first_hits(*ALONG_X, two_sided=True).t[0])


def test_what_is_taken_away_flush_leaves_no_skin():
    [tree] = trees_of([LEFT - Box((-1, -0.5, 0), (0, 0.5, 1))])
    hit = Oracle(tree).first_hits(np.array([[-0.5, 0.25, 5.0]]), np.array([[0.0, 0.0, -1.0]]))
    assert (hit.t[0], hit.owner[0]) == (5.0, 10)


def test_the_first_operand_owns_a_shared_face():
    [tree] = trees_of([LEFT - RIGHT])
    hit = Oracle(tree).first_hits(np.array([[5.0, 0.25, 0.5]]), np.array([[-1.0, 0.0, 0.0]]))
    assert (hit.t[0], hit.owner[0]) == (5.0, 1)


def test_a_ray_near_an_edge_is_not_decided():
    [tree] = trees_of([LEFT])
    rays = np.array([[-5.0, 1.0 + offset, 0.0] for offset in (-1e-2, -1e-7, 1e-7, 1e-2)])
    assert Oracle(tree).first_hits(rays, np.tile(ALONG_X[1], (4, 1))).decided.tolist() == [True, False, False, True]


def test_a_ray_in_a_face_may_be_on_either_side():
    [tree] = trees_of([HalfSpace((0, 0, 1), (0, 0, 0)) & Sphere((0, 0, 0), 1)])
    oracle = Oracle(tree)
    ray = np.array([[-5.0, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0]])
    [plane] = np.flatnonzero(oracle.lie_in(*ray)[0])
    assert not oracle.first_hits(*ray).decided[0]
    found = {float(oracle.first_hits(*ray, beside=side << int(plane)).t[0]) for side in (0, 1)}
    assert found == {4.0, np.inf}
