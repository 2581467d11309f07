"""Formulas of thousands of literals: any depth, the right answer, and no more work than what lies along a ray asks.

Work is counted, not timed: in tokens, and in how often a profiled run asks literals.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import reduce
from typing import Literal

import numpy as np
import pytest

from tasuki.language import f32, i32, module, vec3
from tasuki.machines.cpu.machine import Items, Same
from tasuki.mapping import TableArray, map_module
from tasuki.modules.objects import object_hit
from tasuki.programs import Options, executable
from tasuki.scene import formula, objects
from tasuki.scene.bounds import EVERYTHING
from tasuki.scene.csg import QUADRIC
from tasuki.scene.solids import Box, Sphere
from tasuki.scene.tree import Difference, Formula, Intersection, Node, Union
from tests.csg.operands import CENTRE, CUT, WHOLE
from tests.csg.rays import from_all_sides
from tests.csg.tracing import FILLERS, Traced, met, roots_of, trees_of
from tests.csg.trees import Branch, Leaf, Tree
from tests.machines.running import assert_same_bits

MANY = 2000
BLOCK = 1.2
"""Half the side of the box that is drilled."""
TOLERANCE = 2e-5
SOLIDS = (*WHOLE.values(), *CUT.values())
Operation = Literal["union", "intersection"]


def ball(centre, radius: float) -> Leaf:
    """A sphere as a literal."""
    values = np.eye(4)
    values[3, :3], values[3, 3] = centre, radius**2
    return Leaf(QUADRIC, values, np.eye(4), 0)


def balls(count: int, spread: float, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Centres, within `spread`, and radii, up to `radius`, of balls."""
    draw = np.random.default_rng(5)
    return draw.uniform(-spread, spread, (count, 3)), draw.uniform(0.8, 1.0, count) * radius


def comb(literals: Sequence[Leaf], *, leftwards: bool) -> Tree:
    """Unions and intersections in turn, each of a literal and all that came before it."""

    def joined(tree: Tree, numbered: tuple[int, Leaf]) -> Tree:
        number, literal = numbered
        operation: Operation = "union" if number % 2 else "intersection"
        return Branch(operation, (tree, literal) if leftwards else (literal, tree))

    return reduce(joined, enumerate(literals[1:]), literals[0])


def asked(traced: Traced, origin: np.ndarray, direction: np.ndarray) -> float:
    """How many literals formula 0 asks for a ray, on average."""
    program = executable(met, Options(("same", "items", "items", "same"), width=1, profile=True), FILLERS)
    tables = {name: TableArray(name, table).table for name, table in traced.tables.items()}
    arguments = [Same([0]), Items(list(origin.T)), Items(list(direction.T)), Same([-1])]
    program.run(arguments, len(origin), tables=tables)
    return sum(edge.calls for edge in program.profile if edge.callee.endswith(":literal_span")) / len(origin)


@contextmanager
def no_boxes() -> Iterator[None]:
    """Formulas that are packed here have no bounds: nothing is grouped, nothing passed over."""

    def unbounded(root: formula.Part, placed: formula.Placed) -> formula.Part:
        for part in formula.parents_last(formula.with_boxes(root, placed)):
            part.boxes[:] = part.gaps[:] = EVERYTHING
            part.states[:] = formula.LOOSE
        return root

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(objects, "with_boxes", unbounded)
        yield


def spans(origin: np.ndarray, direction: np.ndarray, centres: np.ndarray, radii: np.ndarray):
    """Where one ray of unit direction enters and leaves balls, (n, 2); NaN where it misses."""
    to_centre = centres - origin
    middle = to_centre @ direction
    aside = ((to_centre - middle[:, None] * direction) ** 2).sum(axis=1)
    half = np.sqrt(np.where(aside < radii**2, radii**2 - aside, np.nan))
    return np.stack([middle - half, middle + half], axis=1)


def in_float64(origin: np.ndarray, direction: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """The rays, one after another."""
    yield from zip(origin.astype(np.float64), direction.astype(np.float64), strict=True)


def comb_hit(span: np.ndarray) -> tuple[float, int, float]:
    """Where a ray from outside enters the comb of balls with such spans (inf: nowhere), the ball to which that crossing
    belongs, and the shortest way on which the ray is inside or outside before it is inside for good.
    """
    every = np.where(span > 0.0, span, np.inf).reshape(-1)
    order = np.argsort(every)[: np.isfinite(every).sum()]
    events = every[order]
    ends = np.concatenate([[0.0], events, [events.max(initial=0.0) + 1.0]])
    middles = (ends[1:] + ends[:-1]) / 2.0
    state = (span[0, 0] < middles) & (middles < span[0, 1])
    for number, (enter, leave) in enumerate(span[1:], 1):
        inside = (enter < middles) & (middles < leave)
        state = state & inside if number % 2 else state | inside
    changes = np.flatnonzero(state[1:] != state[:-1])
    if not len(changes):
        return np.inf, -1, np.inf
    return events[changes[0]], order[changes[0]] // 2, np.diff(events[changes[:2]])[0]


@pytest.mark.parametrize("leftwards", [True, False])
def test_a_comb_of_unions_and_intersections(leftwards):
    centres, radii = balls(MANY, 0.4, 1.3)
    literals = [replace(ball(*one), material=place) for place, one in enumerate(zip(centres, radii, strict=True))]
    traced = Traced([comb(literals, leftwards=leftwards)])
    assert 2 * MANY < len(traced.tables["tokens"]) < 3 * MANY
    origin, direction = from_all_sides(np.random.default_rng(6), 48)
    outside = np.linalg.norm(origin, axis=1) > 2.0
    origin, direction = origin[outside], direction[outside]
    t, owner, _, _ = traced.met(0, origin, direction)
    expected = [comb_hit(spans(*ray, centres, radii)) for ray in in_float64(origin, direction)]
    hit, literal, thin = map(np.array, zip(*expected, strict=True))
    assert np.isfinite(t).sum() > 15
    assert (thin > TOLERANCE).all()
    assert t == pytest.approx(hit, abs=TOLERANCE)
    assert (owner == literal).all()
    # Where one operand has decided, those within the other are passed over.
    assert 0 < asked(traced, origin, direction) < MANY / 2


@pytest.mark.parametrize("leftwards", [True, False])
def test_a_comb_may_be_written_as_one_formula(leftwards):
    centres, radii = balls(MANY, 0.4, 1.3)
    parts = {f"b{place}": Sphere(*one) for place, one in enumerate(zip(centres.tolist(), radii.tolist(), strict=True))}
    operators = ["+" if number % 2 else "*" for number in range(MANY - 1)][::-1]
    if leftwards:
        words = [*operators, *parts]
    else:
        words = [word for pair in zip(operators, list(parts)[:0:-1], strict=True) for word in pair] + ["b0"]
    written = Traced(roots_of([Formula(parts, polish=" ".join(words))]))
    tree = comb([ball(*one) for one in zip(centres, radii, strict=True)], leftwards=leftwards)
    assert np.array_equal(written.tables["tokens"]["operator"], Traced([tree]).tables["tokens"]["operator"])


def drilled() -> tuple[Difference, np.ndarray, np.ndarray]:
    """A box less many balls, and those."""
    centres, radii = balls(MANY, 1.5, 0.09)
    box = Box((-BLOCK,) * 3, (BLOCK,) * 3)
    return Difference((box, *map(Sphere, map(tuple, centres.tolist()), radii.tolist()))), centres, radii


def drilled_hit(origin: np.ndarray, direction: np.ndarray, centres: np.ndarray, radii: np.ndarray) -> float:
    """Where a ray from outside enters what is left of the box: where that begins, or where the balls there end."""
    sides = np.sort((np.array([[-BLOCK], [BLOCK]]) - origin) / direction, axis=0)
    t, end = max(sides[0].max(), 0.0), sides[1].min()
    span = spans(origin, direction, centres, radii)
    while t < end and (around := (span[:, 0] < t) & (t < span[:, 1])).any():
        t = span[around, 1].max()
    return t if t < end else np.inf


def test_one_difference_of_many_balls():
    node, centres, radii = drilled()
    traced = Traced(trees_of([node]))
    origin, direction = from_all_sides(np.random.default_rng(6), 512)
    outside = (np.abs(origin) > BLOCK).any(axis=1)
    origin, direction = origin[outside], direction[outside]
    expected = [drilled_hit(*ray, centres, radii) for ray in in_float64(origin, direction)]
    t = traced.met(0, origin, direction)[0]
    assert np.isfinite(t).mean() > 0.5
    assert t == pytest.approx(np.array(expected), abs=TOLERANCE)
    # The six sides, and what lies along the ray: not two thousand.
    assert asked(traced, origin, direction) < 60


def test_one_union_of_many_balls():
    centres, radii = balls(MANY, 1.5, 0.09)
    traced = Traced(trees_of([Union(tuple(map(Sphere, map(tuple, centres.tolist()), radii.tolist())))]))
    origin, direction = from_all_sides(np.random.default_rng(7), 512)
    outside = np.linalg.norm(origin, axis=1) > 3.0
    origin, direction = origin[outside], direction[outside]
    spans_of_all = [spans(*ray, centres, radii)[:, 0] for ray in in_float64(origin, direction)]
    nearest = [np.where(enter > 0.0, enter, np.inf).min() for enter in spans_of_all]
    assert traced.met(0, origin, direction)[0] == pytest.approx(np.array(nearest), abs=TOLERANCE)
    assert asked(traced, origin, direction) < 60


@pytest.mark.parametrize("times", [MANY, MANY + 1])
def test_complements_of_complements_cost_nothing(times):
    tree: Tree = ball(CENTRE, 1.0)
    for _ in range(times):
        tree = Branch("union", (tree,), inverted=True)
    traced = Traced([tree], [True])
    assert len(traced.tables["tokens"]) == 1
    plain = Traced([replace(ball(CENTRE, 1.0), inverted=times % 2 == 1)], [True])
    rays = from_all_sides(np.random.default_rng(8), 64)
    assert_same_bits(leaves(traced.met(0, *rays)), leaves(plain.met(0, *rays)), f"{times} complements")


def leaves(found) -> list[np.ndarray]:
    """What `met` gave as arrays (n,)."""
    t, owner, code, normal = found
    return [t, owner, code, *normal.T]


def bushy(depth: int, seed: int) -> Node:
    """Set operations on what lies here and there, two at a time."""
    draw = np.random.default_rng(seed)

    def solid(level: int) -> Node:
        if level == 0:
            place = draw.uniform(-1.0, 1.0, 3)
            kind = SOLIDS[draw.integers(len(SOLIDS))]
            return kind.scale(0.6).rotate(place.tolist(), 50.0).translate(*place.tolist())
        operation = draw.choice([Union, Union, Intersection, Difference])
        return operation((solid(level - 1), solid(level - 1)))

    return solid(depth)


@pytest.mark.parametrize("width", [1, 16])
def test_skip_links_and_groups_change_no_result(width):
    nodes = [drilled()[0], *(bushy(depth, depth) for depth in (4, 5, 6, 7))]
    trees = [*trees_of(nodes), comb([ball(*one) for one in zip(*balls(300, 0.8, 1.3), strict=True)], leftwards=False)]
    with_boxes = Traced(trees)
    with no_boxes():
        without = Traced(trees)
    assert len(with_boxes.tables["bounds"]) > MANY
    assert len(without.tables["bounds"]) == 0
    rays = from_all_sides(np.random.default_rng(9), 256)
    met_any = 0
    for number in range(len(trees)):
        found = leaves(with_boxes.met(number, *rays, width=width))
        assert_same_bits(found, leaves(without.met(number, *rays, width=width)), f"formula {number}")
        met_any += np.isfinite(found[0]).sum()
    assert met_any > 300


@module
def met_before(index: i32, origin: vec3, direction: vec3, far: f32) -> f32:
    return object_hit(index, origin, direction, -1, far)


@pytest.mark.parametrize("far", [2.0, 1.0, 1e-38, 1e-45, 0.0])
def test_a_search_that_may_go_no_farther_ends(far):
    # From within nothing shows; at 1e-45 no float lies between `far` and what is a little farther.
    [tree] = trees_of([Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))])
    here = Traced([tree])
    origin, direction = np.array([[0.5, 0.5, 0.5]]), np.array([[0.0, 0.0, 1.0]])
    t = map_module(met_before, here.rows[0], origin, direction, np.float32(far), fill=FILLERS, tables=here.tables)
    assert t == [np.inf]
