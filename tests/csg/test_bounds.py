"""The boxes that formulas have: around all of the solid, tight around single constructors; and solids without any."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tasuki.scene import Scene
from tasuki.scene.bounds import EMPTY
from tasuki.scene.objects import Formulas
from tasuki.scene.pack import pack
from tasuki.scene.solids import (
    Box,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hyperboloid,
    Paraboloid,
    RoundedBox,
    Slab,
    Sphere,
    Tube,
    Wedge,
)
from tasuki.scene.tree import Node
from tests.csg.operands import directly
from tests.csg.oracle import Oracle
from tests.csg.rays import from_all_sides
from tests.csg.strategies import formulas
from tests.csg.tracing import CAMERA, SIDES, Traced, trees_of
from tests.csg.trees import Tree, columns_of

HALF = np.sqrt(0.5)


Bounds = tuple[float, float, float, float, float, float]


def boxes_of_all(trees: Sequence[Tree]) -> np.ndarray:
    """The boxes (n, 2, 6) around formulas of one scene and around their complements."""
    objects, frames = columns_of(trees, [0] * len(trees))
    found = np.empty((len(trees), 2, 6))
    for batch in Formulas(objects, SIDES, frames).batches():
        found[batch.members] = np.stack([batch.root.boxes, batch.root.gaps], axis=1)
    return found


def boxes_of(tree: Tree) -> tuple[np.ndarray, np.ndarray] | None:
    """The boxes around a formula and around its complement; None where it is found to hold nothing, or everything."""
    [(box, gap)] = boxes_of_all([tree])
    return None if (box == EMPTY).all() or (gap == EMPTY).all() else (box, gap)


def holds(box: np.ndarray, points: np.ndarray) -> np.ndarray:
    return ((points >= box[:3] - 1e-9) & (points <= box[3:] + 1e-9)).all(axis=1)


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(formulas(3), st.integers(0, 1 << 16), st.sampled_from([1.0, 4.0, 40.0]))
def test_nothing_of_a_solid_lies_beyond_its_box(node, seed, reach):
    [tree] = trees_of([node])
    points = np.random.default_rng(seed).uniform(-reach, reach, (2000, 3))
    inside = Oracle(tree).inside(points)
    boxes = boxes_of(tree)
    if boxes is None:
        assert inside.all() or not inside.any()
    else:
        box, gap = boxes
        assert holds(box, points[inside]).all()
        assert holds(gap, points[~inside]).all()


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(formulas(2), min_size=1, max_size=4), st.integers(1, 4))
def test_boxes_do_not_depend_on_what_else_there_is(nodes, times):
    trees = trees_of([node.translate(float(number), 0.0, 0.0) for number in range(times) for node in nodes])
    alone = np.concatenate([boxes_of_all([tree]) for tree in trees])
    np.testing.assert_allclose(boxes_of_all(trees), alone, rtol=1e-12, atol=1e-12)


def test_four_planes_are_no_quadric():
    side = HalfSpace((1, 0, 0), (0, 0, 0))
    [tree] = trees_of([side | Tube((0, 0, 0), (1, 0, 0), 2, 1) | side])
    assert boxes_of_all([tree])[0, 1].tolist() == [0.0, -np.inf, -np.inf, np.inf, np.inf, np.inf]


TIGHT: dict[str, tuple[Node, Bounds]] = {
    "box": (Box((-1, 0, 2), (3, 4, 5)), (-1, 0, 2, 3, 4, 5)),
    "turned box": (Box((-1, -1, 0), (1, 1, 1)).rotate("z", 45.0), (-2 * HALF, -2 * HALF, 0, 2 * HALF, 2 * HALF, 1)),
    "sphere": (Sphere((1, 2, 3), 2), (-1, 0, 1, 3, 4, 5)),
    "ellipsoid": (Ellipsoid((1, 2, 3), (1, 2, 3)), (0, 0, 0, 2, 4, 6)),
    "turned ellipsoid": (
        Ellipsoid((0, 0, 0), (1, 3, 2)).rotate("z", 45.0),
        (-np.sqrt(5), -np.sqrt(5), -2, np.sqrt(5), np.sqrt(5), 2),
    ),
    "cylinder": (Cylinder((0, 0, 1), (0, 0, 4), 2), (-2, -2, 1, 2, 2, 4)),
    "cone": (Cone((0, 0, 0), 2, (0, 0, 3), 1), (-2, -2, 0, 2, 2, 3)),
    "pointed cone": (Cone((0, 1, 0), 2, (0, 4, 0)), (-2, 1, -2, 2, 4, 2)),
    "tube": (Tube((0, 0, 0), (5, 0, 0), 2, 1), (0, -2, -2, 5, 2, 2)),
    "wedge": (Wedge((0, 0, 0), (1, 2, 3)), (0, 0, 0, 1, 2, 3)),
    "rounded box": (RoundedBox((0, 0, 0), (1, 2, 3), 0.25), (0, 0, 0, 1, 2, 3)),
    "cut paraboloid": (Paraboloid((0, 0, 0), (1, 2)) & HalfSpace((0, 0, 1), (0, 0, 4)), (-2, -4, 0, 2, 4, 4)),
    "cut hyperboloid": (
        Hyperboloid((0, 0, 0), (1, 1, 1)) & Slab((0, 0, 1), (0, 0, 0), 2),
        (-np.sqrt(2), -np.sqrt(2), -1, np.sqrt(2), np.sqrt(2), 1),
    ),
    "union": (Sphere((0, 0, 0), 1) | Box((1, 0, 0), (2, 2, 2)), (-1, -1, -1, 2, 2, 2)),
    "lens": (Sphere((0, 0, -1), 2) & Sphere((0, 0, 1), 2), (-2, -2, -1, 2, 2, 1)),
    "difference": (Box((0, 0, 0), (1, 1, 1)) - Sphere((0, 0, 0), 9), (0, 0, 0, 1, 1, 1)),
}


@pytest.mark.parametrize("name", TIGHT)
def test_boxes_of_single_solids_are_tight(name):
    node, expected = TIGHT[name]
    [tree] = trees_of([node])
    boxes = boxes_of(tree)
    assert boxes is not None
    assert boxes[0] == pytest.approx(expected, abs=1e-9)


UNBOUNDED = {
    "half-space": HalfSpace((1, 2, 3), (0, 0, 0)),
    "slab": Slab((1, 0, 0), (0, 0, 0), 1),
    "paraboloid": Paraboloid((0, 0, 0), (1, 1)),
    "hyperboloid": Hyperboloid((0, 0, 0), (1, 1, 1)),
    "complement": ~Box((0, 0, 0), (1, 1, 1)),
    "union": Sphere((0, 0, 0), 1) | HalfSpace((0, 0, 1), (0, 0, 0)),
}


@pytest.mark.parametrize("name", UNBOUNDED)
def test_what_has_no_bounds_has_no_box(name):
    [tree] = trees_of([directly(UNBOUNDED[name])])
    boxes = boxes_of(tree)
    assert boxes is not None
    assert np.isinf(boxes[0]).any()


APART = Sphere((0, 0, 0), 1) & Sphere((5, 0, 0), 1)


@pytest.mark.parametrize("node", [APART, ~APART, APART - Box((0, 0, 0), (1, 1, 1)), ~Sphere((0, 0, 0), 1) | ~APART])
def test_what_is_empty_or_everything_is_left_out_with_a_message(node):
    [tree] = trees_of([node])
    assert boxes_of(tree) is None
    packed = pack(Scene(CAMERA, [node]))
    assert packed.things == 0
    [warning] = packed.scene.warnings
    assert "this object is empty, or fills all space" in warning


@pytest.mark.parametrize(
    "node",
    [
        Sphere((0, 0, 0), 1) - Sphere((0, 0, 0), 1),
        Box((0, 0, 0), (1, 1, 1)) & ~Box((0, 0, 0), (1, 1, 1)),
        Sphere((0, 0, 0), 1) | ~Sphere((0, 0, 0), 1),
        HalfSpace((0, 0, 1), (0, 0, 0)) & HalfSpace((0, 0, -1), (0, 0, 0)),
    ],
)
def test_solids_that_turn_out_empty_or_everything_show_nothing(node):
    traced = Traced(trees_of([node]), [True])
    rays = from_all_sides(np.random.default_rng(1), 500)
    assert np.isinf(traced.met(0, *rays)[0]).all()
