"""Flat scenes: constructors against their plain descriptions, set operations, composed transforms, order, groups."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tasuki.diagnostics import SceneError
from tasuki.scene import (
    Box,
    Camera,
    Complement,
    Cone,
    Cylinder,
    Difference,
    Ellipsoid,
    Extent,
    Formula,
    Group,
    HalfSpace,
    Hyperboloid,
    Instance,
    Intersection,
    Material,
    Paraboloid,
    Polygon,
    Quadric,
    RoundedBox,
    Scene,
    Shapes,
    Slab,
    Solid,
    Sphere,
    Tube,
    Union,
    Wedge,
    kinds,
)
from tasuki.scene.check import problems, without_degenerate
from tasuki.scene.flatten import OBJECT, flatten
from tasuki.scene.shapes import CONE, POLYGON, SPHERE
from tests.csg.trees import Leaf, trees_in
from tests.scene.membership import inside, literals, quadric_value
from tests.scene.strategies import solids, transforms

CAMERA = Camera((0.0, -5.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 45.0)
ORIGIN = (0.0, 0.0, 0.0)
UNIT = Box(ORIGIN, (1.0, 1.0, 1.0))
RED, BLUE = Material("red", (1.0, 0.0, 0.0)), Material("blue", (0.0, 0.0, 1.0))
TRIANGLE = Polygon(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))


def flat(*shapes):
    return flatten(Scene(CAMERA, shapes))


def root(node):
    (found,) = trees_in(flat(node))
    return found


def cloud(seed, count=400, size=3.0):
    return np.random.default_rng(seed).uniform(-size, size, (count, 3))


def placed(points, transform):
    return points @ transform.matrix[:3, :3].T + transform.matrix[:3, 3]


# Constructors. Of each: a node, and what is less than zero inside it, and only there


def around_axis(base, apex):
    """Of points: how far along the way from base to apex, and their distance from it."""
    base, along = np.array(base), np.subtract(apex, base)

    def measured(p):
        share = (p - base) @ along / (along @ along)
        return share, np.linalg.norm(p - base - share[:, None] * along, axis=1)

    return measured


def in_frustum(base, apex, first, second):
    measured = around_axis(base, apex)

    def value(p):
        share, distance = measured(p)
        return np.maximum.reduce([-share, share - 1.0, distance - (first + share * (second - first))])

    return value


def in_box(low, high):
    return lambda p: np.maximum(low - p, p - high).max(axis=1)


def rounded(low, high, radius):
    low, high = np.add(low, radius), np.subtract(high, radius)
    return lambda p: np.linalg.norm(np.maximum(np.maximum(low - p, p - high), 0.0), axis=1) - radius


A, B, LOW, HIGH = (-1.0, 0.5, -0.5), (1.0, 1.0, 1.5), np.array((-1.0, -0.5, -2.0)), np.array((1.5, 0.5, 1.0))
MATRIX = ((1.0, 0.2, 0.0), (0.2, -0.5, 0.3), (0.0, 0.3, 2.0))
CONSTRUCTED = [
    (Sphere((0.5, 0.0, -0.5), 1.5), lambda p: np.linalg.norm(p - (0.5, 0.0, -0.5), axis=1) - 1.5),
    (
        Ellipsoid((0.5, 0, 0), (2.0, 1.0, 0.5)),
        lambda p: np.linalg.norm((p - (0.5, 0, 0)) / (2.0, 1.0, 0.5), axis=1) - 1,
    ),
    (Box(tuple(LOW), tuple(HIGH)), in_box(LOW, HIGH)),
    (Cylinder(A, B, 0.8), in_frustum(A, B, 0.8, 0.8)),
    (Cone(A, 1.5, B), in_frustum(A, B, 1.5, 0.0)),
    (Cone(A, 0.5, B, 2.0), in_frustum(A, B, 0.5, 2.0)),
    (
        Hyperboloid((0.5, 0.0, 0.0), (1.0, 0.7, 0.5)),
        lambda p: ((p - (0.5, 0, 0)) ** 2 / (1.0, 0.49, -0.25)).sum(axis=1) - 1.0,
    ),
    (
        Hyperboloid((0.5, 0.0, 0.0), (1.0, 0.7, 0.5), sheets=2),
        lambda p: ((p - (0.5, 0, 0)) ** 2 / (1.0, 0.49, -0.25)).sum(axis=1) + 1.0,
    ),
    (
        Paraboloid((0.5, 0.0, -1.0), (1.0, 2.0)),
        lambda p: (p[:, 0] - 0.5) ** 2 + (p[:, 1] / 2.0) ** 2 - (p[:, 2] + 1.0),
    ),
    (HalfSpace((1.0, 2.0, -3.0), (0.5, 0.0, 0.0)), lambda p: (p - (0.5, 0.0, 0.0)) @ (1.0, 2.0, -3.0)),
    (Slab((0.0, 3.0, 4.0), (0.0, 1.0, 0.0), 2.0), lambda p: np.abs((p - (0.0, 1.0, 0.0)) @ (0.0, 0.6, 0.8)) - 1.0),
    (
        Wedge(tuple(LOW), tuple(HIGH)),
        lambda p: np.maximum(in_box(LOW, HIGH)(p), ((p - LOW) / (HIGH - LOW))[:, [0, 2]].sum(axis=1) - 1.0),
    ),
    (
        Quadric(MATRIX, (0.5, 0.0, 0.0), (1.0, 0.0, -1.0), 2.0),
        lambda p: (
            np.einsum("ni,ij,nj->n", p - (0.5, 0, 0), MATRIX, p - (0.5, 0, 0)) + (p - (0.5, 0, 0)) @ (1, 0, -1) - 2
        ),
    ),
    (RoundedBox(tuple(LOW), tuple(HIGH), 0.3), rounded(LOW, HIGH, 0.3)),
    (
        Tube(A, B, 1.5, 0.7),
        lambda p: np.maximum(in_frustum(A, B, 1.5, 1.5)(p), 0.7 - around_axis(A, B)(p)[1]),
    ),
]


@pytest.mark.parametrize(("node", "value"), CONSTRUCTED, ids=lambda one: getattr(one, "noun", ""))
@given(transform=transforms(), seed=st.integers(0, 2**32))
def test_a_constructor_is_what_it_says(node, value, transform, seed):
    points = cloud(seed)
    values = value(points)
    clear = np.abs(values) > 1e-6
    tree = root(Union([node]).transformed(transform))
    found = inside(tree, placed(points, transform))
    np.testing.assert_array_equal(found[clear], (values < 0.0)[clear])


def test_every_constructor_is_held():
    from tasuki.scene.constructors import CONSTRUCTORS

    assert {type(node) for node, _ in CONSTRUCTED} == set(CONSTRUCTORS)


# Set operations


@given(solids(), solids(), st.integers(0, 2**32))
def test_de_morgan(a, b, seed):
    points = cloud(seed)
    pairs = [(~(a | b), ~a & ~b), (~(a & b), ~a | ~b), (a - b, a & ~b), (~~a | b, a | b), (~(a - b), ~a | b)]
    for one, other in pairs:
        np.testing.assert_array_equal(inside(root(one), points), inside(root(other), points))


@given(solids(), solids(), solids(), transforms(), st.integers(0, 2**32))
def test_set_operations_are_those_of_their_operands(a, b, c, transform, seed):
    points = cloud(seed)
    in_a, in_b, in_c = (inside(root(Union([one])), points) for one in (a, b, c))
    scene_points = placed(points, transform)

    def found(node):
        return inside(root(node.transformed(transform)), scene_points)

    # Rounding may part the two where a point lies all but on a surface.
    def agree(node, expected):
        assert np.count_nonzero(found(node) != expected) <= 1

    agree(Union([a, b, c]), in_a | in_b | in_c)
    agree(Intersection([a, b, c]), in_a & in_b & in_c)
    agree(Difference([a, b, c]), in_a & ~in_b & ~in_c)
    agree(Complement(Difference([a, b])), ~(in_a & ~in_b))
    agree(Instance(Union([a, Complement(b)])) & c, (in_a | ~in_b) & in_c)
    parts = {"a": a, "b": b, "c": c}
    agree(Formula(parts, "a - (b + ~c) & a"), in_a & ~((in_b | ~in_c) & in_a))
    agree(Formula(parts, polish="- a * + b ~ c a"), in_a & ~((in_b | ~in_c) & in_a))


def test_a_formula_of_thousands_of_parts():
    balls = {f"b{n}": Sphere((float(n), 0.0, 0.0), 0.25) for n in range(2000)}
    found = root(Formula(balls, " + ".join(balls)))
    leaves, trees = 0, [found]
    while trees:
        tree = trees.pop()
        leaves += isinstance(tree, Leaf)
        trees += [] if isinstance(tree, Leaf) else tree.children
    assert leaves == 2000


# Transforms


@given(transforms(), transforms(), transforms(), st.integers(0, 2**32))
def test_nested_groups_compose_their_matrices(outer, middle, inner, seed):
    ball = Ellipsoid((0.1, 0.2, 0.3), (1.0, 2.0, 0.5)).transformed(inner)
    nested = Group([Group([ball]).transformed(middle)]).transformed(outer)
    at_once = Group([ball.transformed(middle).transformed(outer)])
    instanced = Instance(Instance(ball).transformed(middle)).transformed(outer)
    matrices = [root(node).matrix for node in (nested, at_once, instanced)]
    expected = outer.matrix @ middle.matrix @ inner.matrix
    for matrix in matrices:
        np.testing.assert_allclose(matrix, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())


@given(transforms())
def test_polygons_keep_their_front(transform):
    patch = Polygon(TRIANGLE.points, ((0.0, 0.0, 1.0), (0.0, 1.0, 1.0), (1.0, 0.0, 1.0)))
    front = np.array((0.2, 0.2, 1.0))
    found = flat(patch.transformed(transform)).shapes.polygons
    ((point, *_),) = [found.points.tolist()]
    above = placed(front[None], transform)[0] - point
    assert found.area_vectors[0] @ above > 0.0
    assert (found.normals @ above > 0.0).all()
    corners = sorted(map(tuple, placed(np.array(patch.points), transform).tolist()))
    np.testing.assert_allclose(sorted(map(tuple, found.points.tolist())), corners, rtol=1e-12, atol=1e-9)


def test_normals_stay_with_their_points_and_at_right_angles():
    normals = ((1.0, 0.0, 1.0), (0.0, 0.0, 1.0), (0.0, 0.0, 2.0))
    found = flat(Polygon(TRIANGLE.points, normals).scale(1.0, 1.0, -4.0)).shapes.polygons
    assert found.points.tolist() == [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    directions = found.normals / np.abs(found.normals).max(axis=1, keepdims=True)
    assert directions.tolist() == [[0.0, 0.0, -1.0], [0.0, 0.0, -1.0], [1.0, 0.0, -0.25]]


def test_similarities_keep_shapes_in_their_batches():
    nodes = [Sphere((1.0, 0.0, 0.0), -1.0), Cone(ORIGIN, 1.0, (0.0, 0.0, 1.0), 0.5, open=True)]
    found = flat(Group(nodes).rotate("z", 90).scale(-2.0).translate(0.0, 0.0, 5.0), Sphere(ORIGIN, 3.0))
    assert found.sorts.tolist() == [SPHERE, CONE, SPHERE]
    assert found.shapes.spheres.centre.tolist() == [[0.0, -2.0, 5.0], [0.0, 0.0, 0.0]]
    assert found.shapes.spheres.radius == pytest.approx([-2.0, 3.0])
    assert found.shapes.cones.apex.tolist() == [[0.0, 0.0, 3.0]]
    assert found.shapes.cones.apex_radius == pytest.approx([1.0])
    assert found.shapes.spheres.frame.tolist() == [0, -1]
    assert found.shapes.cones.frame.tolist() == [0]
    np.testing.assert_array_equal(found.frames[0][:3, 3], [0.0, 0.0, 5.0])


@pytest.mark.parametrize("wrapped", [lambda ball: ball, lambda ball: Shapes.of([TRIANGLE, ball])])
def test_a_stretched_sphere_is_an_object(wrapped):
    found = flat(Group([wrapped(Sphere(ORIGIN, 1.0, material=RED))]).scale(1.0, 2.0, 3.0))
    (ellipsoid,) = trees_in(found)
    assert isinstance(ellipsoid, Leaf)
    assert found.sorts.tolist()[-1] == OBJECT
    assert found.materials[ellipsoid.material] == RED
    points = np.array([(0.9, 0.0, 0.0), (1.1, 0.0, 0.0), (0.0, 0.0, 2.9), (0.0, 0.0, 3.1)])
    assert inside(ellipsoid, points).tolist() == [True, False, True, False]


# Order, materials, groups


def test_things_keep_the_order_of_the_scene():
    ball, slab = Sphere(ORIGIN, 1.0), Slab((0.0, 0.0, 1.0), ORIGIN, 1.0)
    inner = Shapes.of([ball, UNIT, TRIANGLE])
    found = flat(TRIANGLE, Group([ball, UNIT | ball, Group([inner, slab])]), ball, Instance(Group([TRIANGLE, UNIT])))
    assert found.sorts.tolist() == [
        *(POLYGON, SPHERE, OBJECT, SPHERE, OBJECT, POLYGON, OBJECT),
        *(SPHERE, POLYGON, OBJECT),
    ]
    assert [(group.first, group.end) for group in found.groups] == [(1, 7), (3, 7), (8, 10)]
    assert found.objects.paths == [
        ("shapes", 1, "children", 1),
        ("shapes", 1, "children", 2, "children", 0, 1),
        ("shapes", 1, "children", 2, "children", 1),
        ("shapes", 3, "of", "children", 1),
    ]
    positions = [found.positions[found.sorts == sort].tolist() for sort in (SPHERE, CONE, POLYGON, OBJECT)]
    assert positions == [[0, 1, 2], [], [0, 1, 2], [0, 1, 2, 3]]


def test_a_material_is_that_of_the_nearest_node_that_names_one():
    group = Group(
        [UNIT | Box(ORIGIN, (1.0, 1.0, 2.0), material=BLUE), TRIANGLE, Group([UNIT], material=BLUE)], material=RED
    )
    found = flat(group, UNIT)
    names = [[found.materials[leaf.material].name for leaf in literals(tree)] for tree in trees_in(found)]
    assert names == [["red"] * 6 + ["blue"] * 6, ["blue"] * 6, ["default"] * 6]
    assert [found.materials[number].name for number in found.objects.material] == ["red", "blue", "default"]
    assert [found.materials[number].name for number in found.shapes.polygons.material] == ["red"]
    assert found.materials == Scene(CAMERA, [group, UNIT]).materials == (RED, Material(), BLUE)


def test_the_medium_is_the_objects_own_material_or_that_of_its_first_literal():
    first, second = Box(ORIGIN, (1.0, 1.0, 1.0), material=RED), Box(ORIGIN, (2.0, 2.0, 2.0), material=BLUE)
    found = flat(second - first, Difference([second, first], material=RED))
    assert [found.materials[number].name for number in found.objects.material] == ["blue", "red"]


def test_extents_go_where_their_nodes_go():
    extent = Extent((1.0, 0.0, 0.0), 2.0)
    group = (
        Group([Union([UNIT], extent="auto"), TRIANGLE], extent=extent).scale(1.0, 3.0, -2.0).translate(0.0, 0.0, 7.0)
    )
    found = flat(Union([UNIT], extent=extent), group)
    assert found.objects.extents == [((1.0, 0.0, 0.0), 2.0), "auto"]
    ((centre, radius),) = [one.extent for one in found.groups]
    assert centre == (1.0, 0.0, 7.0)
    assert radius == pytest.approx(6.0)


def test_instances_share_their_coefficients():
    part = Tube(ORIGIN, (0.0, 0.0, 1.0), 1.0, 0.5)
    found = flat(*(Instance(part).translate(float(n), 0.0, 0.0) for n in range(3)))
    first, *others = [literals(tree) for tree in trees_in(found)]
    for other in others:
        assert all(np.shares_memory(a.values, b.values) for a, b in zip(first, other, strict=True))
        assert all(a.matrix is not b.matrix for a, b in zip(first, other, strict=True))


def test_a_solid_of_a_registered_kind_is_a_literal(monkeypatch):
    monkeypatch.setattr(kinds, "_KINDS", kinds._KINDS.copy())
    kinds.register(replace(kinds.lookup("plane"), name="mine", is_built_in=False))
    found = root(Solid("mine", normal=[0, 0, 1], d=2).translate(1.0, 0.0, 0.0) - UNIT)
    literal, _ = found.children
    assert literal.kind == "mine"
    assert literal.values == {"normal": (0, 0, 1), "d": 2}
    assert literal.matrix[0, 3] == 1.0


def test_a_scene_of_batches_stays_as_it_is():
    scene = Scene(CAMERA, [Sphere(ORIGIN, 1.0), TRIANGLE])
    assert flatten(scene).shapes is scene.shapes
    assert len(flat()) == 0


def test_polygons_without_area_are_left_out_with_a_warning():
    line = Polygon(((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (2.0, 2.0, 2.0)))
    scene = Scene(CAMERA, [line, Group([line, UNIT, Group([line]), TRIANGLE]).scale(2.0), UNIT])
    found = flatten(scene)
    assert found.sorts.tolist() == [OBJECT, POLYGON, OBJECT]
    assert [(group.first, group.end) for group in found.groups] == [(0, 2), (1, 1)]
    warned = without_degenerate(scene)
    assert len(warned.shapes) == 2
    assert [warning.partition(":")[0] for warning in warned.warnings] == ["polygon 0", "shapes[1].children[0]"]


def test_what_only_shows_together_is_refused():
    flattened = Group([Group([UNIT]).scale(1e-200)]).scale(1e-200)
    with pytest.raises(SceneError, match=r"shapes\[0\]\.children\[0\]\.transform: the transforms .* singular"):
        flat(flattened)
    (problem,) = problems(Scene(CAMERA, [flattened]))
    assert problem.path == ("shapes", 0, "children", 0, "transform")
    stretched = Group([Cylinder(ORIGIN, (0.0, 0.0, 1.0), 1.0, open=True), Sphere(ORIGIN, -1.0)]).scale(1.0, 2.0, 1.0)
    found = problems(Scene(CAMERA, [stretched]))
    assert [problem.dotted for problem in found] == ["shapes[0].children[0]", "shapes[0].children[1]"]
    assert [problem.message.partition(" can ")[0] for problem in found] == [
        "an open cylinder",
        "a sphere of negative radius",
    ]


def test_the_coefficients_of_large_and_tilted_solids_are_exact_enough():
    base, apex = (100.0, 200.0, 300.0), (101.0, 203.0, 299.0)
    (side, *_) = literals(root(Cylinder(base, apex, 0.5)))
    across = np.cross(np.subtract(apex, base), (0.0, 0.0, 1.0))
    on = np.add(base, 0.5 * across / math.hypot(*across))
    assert abs(quadric_value(side.values, on[None])[0]) < 1e-9
