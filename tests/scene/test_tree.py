"""The scene tree: values, operators, transforms, materials, and every message about what cannot be."""

import math
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tasuki.diagnostics import SceneError
from tasuki.language import Table, i32, record
from tasuki.scene import (
    Box,
    Camera,
    Complement,
    Cone,
    Cylinder,
    Difference,
    DirectionalLight,
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
    PointLight,
    Polygon,
    Quadric,
    RoundedBox,
    Scene,
    Shapes,
    Slab,
    Solid,
    Sphere,
    Texture,
    Tube,
    Union,
    Wedge,
    kinds,
)
from tasuki.scene.check import problems, with_advice, with_sides
from tasuki.scene.flatten import flatten
from tasuki.scene.formula_text import FormulaError
from tasuki.scene.shapes import NODE
from tasuki.scene.transforms import IDENTITY, TransformError, matrix, rotate, scale, translate
from tasuki.scene.traverse import materials_of, measure
from tasuki.scene.tree import MOST_LEVELS
from tests.scene.strategies import solids, transforms

CAMERA = Camera((0.0, -5.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 45.0)
ORIGIN, TOP, ONES = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 1.0)
BALL, UNIT = Sphere(ORIGIN, 1.0), Box(ORIGIN, ONES)
TRIANGLE = Polygon((ORIGIN, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
RED, BLUE = Material("red", (1.0, 0.0, 0.0)), Material("blue", (0.0, 0.0, 1.0))


def found(*shapes):
    """What is wrong with a scene of `shapes`: each problem as one line."""
    scene = Scene(CAMERA, shapes)
    return [f"{one.dotted}: {one.message}; {one.expected}; {one.found}" for one in problems(scene)]


def nested(node, levels):
    for _ in range(levels - 1):
        node = Group([node])
    return node


@pytest.fixture
def registry(monkeypatch):
    monkeypatch.setattr(kinds, "_KINDS", kinds._KINDS.copy())


@record
class Counted:
    kind: i32
    attribute: i32
    matrix: i32
    flags: i32
    count: i32


# Nodes are values


def test_operators_are_set_operations():
    assert Union([BALL, UNIT]) == BALL | UNIT
    assert Intersection((BALL, UNIT)) == BALL & UNIT
    assert Difference([BALL, UNIT]) == BALL - UNIT
    assert Complement(BALL) == ~BALL
    assert Instance(BALL) | UNIT == Union([Instance(BALL), UNIT])


def test_operators_in_a_row_make_one_operation():
    balls = [Sphere((float(n), 0.0, 0.0), 1.0) for n in range(3000)]
    together = cut = balls[0]
    for ball in balls[1:]:
        together, cut = together | ball, cut - ball
    assert together == Union(balls)
    assert cut == Difference(balls)
    named = Union(balls[:2], name="pair")
    assert named | UNIT == Union([named, UNIT])
    assert (BALL | UNIT).translate(1.0, 0.0, 0.0) | BALL == Union([Union([BALL, UNIT]).translate(1.0, 0.0, 0.0), BALL])


def test_nodes_do_not_change_so_none_can_hold_itself():
    with pytest.raises(FrozenInstanceError):
        BALL.radius = 2.0
    children = [BALL]
    group = Group(children)
    children.append(group)
    assert group.children == (BALL,)
    parts = {"ball": BALL}
    formula = Formula(parts, "ball")
    parts["ball"] = formula
    assert formula.parts == {"ball": BALL}


@given(solids(), solids())
def test_equality_is_that_of_values(a, b):
    first, second = (Group([a - b, Instance(a), Formula({"a": a, "b": ~b}, "a & b")], material=RED) for _ in range(2))
    assert first == second
    assert first != replace(first, name="other")
    assert first != Group([a - b, Instance(a), Formula({"a": a, "b": ~b}, "a - b")], material=RED)
    assert first != Group([*first.children, a], material=RED)
    assert Difference([a, b]) != Intersection([a, b])


def test_deep_and_shared_trees_are_compared_and_shown():
    assert nested(BALL, 5000) == nested(BALL, 5000)
    assert nested(BALL, 5000) != nested(UNIT, 5000)
    assert repr(nested(BALL, 5000)) == "<group of 1 node>"
    assert repr(Union([BALL, UNIT], name="both")) == "<union 'both' of 2 nodes>"
    assert doubled(BALL, 60) == doubled(BALL, 60)


def doubled(node, times):
    for _ in range(times):
        node = Group([node, node])
    return node


def test_arrays_and_lists_become_tuples():
    from_arrays = Box(np.zeros(3), [1.0, 1.0, 1.0])
    assert from_arrays == UNIT
    assert Polygon(np.array(TRIANGLE.points)) == TRIANGLE
    assert Quadric(np.eye(3)).matrix == ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    assert Solid("torus", centre=[0, 0, 0], major=2.0).fields == {"centre": (0, 0, 0), "major": 2.0}
    assert Solid("torus", fields={"major": 2.0}) == Solid("torus", major=2.0)
    assert hash(Texture("checker", {"size": [1, 2]})) == hash(Texture("checker", {"size": (1, 2)}))


def test_a_scene_keeps_its_nodes_as_they_are():
    given_nodes = [
        Sphere(ORIGIN, 1.0, material=RED),
        Sphere(ORIGIN, 1.0, name="ball"),
        Cylinder(ORIGIN, TOP, 1.0, material=RED),
        Cylinder(ORIGIN, TOP, -1.0, open=True, material=BLUE),
        Group([TRIANGLE], material=BLUE).rotate("x", 30.0),
        Polygon(TRIANGLE.points, material=RED),
        Sphere(ORIGIN, 1.0, extent="auto"),
    ]
    scene = Scene(CAMERA, given_nodes)
    assert list(scene.shapes) == given_nodes
    assert [n for n, sort in enumerate(scene.shapes.sorts) if sort == NODE] == [1, 2, 4, 6]
    assert scene == Scene(CAMERA, given_nodes)
    assert scene.materials == (RED, Material(), BLUE)
    assert Shapes.of([Sphere(ORIGIN, 1.0, transform=matrix(np.eye(3)), material=RED)])[0] == given_nodes[0]


# Transforms


@given(transforms(), transforms())
def test_transforms_apply_one_after_the_other(first, second):
    node = BALL.transformed(first).transformed(second)
    np.testing.assert_allclose(node.transform.matrix, second.matrix @ first.matrix)
    assert node.transform == first.then(second)
    assert hash(first.then(second)) == hash(node.transform)


def test_transforms_do_what_they_say():
    node = BALL.translate(1.0, 0.0, 0.0).rotate("z", 90.0).scale(2.0, 3.0, 4.0)
    assert node.transform.matrix.tolist() == [[0, -2, 0, 0], [3, 0, 0, 3], [0, 0, 4, 0], [0, 0, 0, 1]]
    assert BALL.scale(2.0).transform == matrix(np.diag([2.0, 2.0, 2.0, 1.0]))
    assert matrix([[1, 0, 0, 5], [0, 1, 0, 6], [0, 0, 1, 7]]) == translate(5.0, 6.0, 7.0)
    assert repr(IDENTITY) == "IDENTITY"


@given(st.integers(-9, 9), st.sampled_from("xyz"))
def test_quarter_turns_are_exact(quarters, axis):
    turned = rotate(axis, 90.0 * quarters).matrix
    assert np.isin(turned, (-1.0, 0.0, 1.0)).all()
    assert rotate(axis, 90.0 * (quarters + 4)) == rotate(axis, 90.0 * quarters)
    np.testing.assert_allclose(turned, rotate(axis, 30.0).then(rotate(axis, 90.0 * quarters - 30.0)).matrix, atol=1e-15)


@given(st.floats(-720.0, 720.0), st.tuples(*[st.floats(-1e3, 1e3)] * 3).filter(lambda axis: max(map(abs, axis)) > 1e-3))
def test_a_turn_keeps_its_axis_and_all_lengths_and_is_right_handed(degrees, axis):
    turn = rotate(axis, degrees).matrix[:3, :3]
    np.testing.assert_allclose(turn @ axis, axis, atol=1e-9)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    across = np.cross(axis, (axis[1], -axis[2], axis[0] + 1.0))
    across -= np.dot(across, axis) / np.dot(axis, axis) * np.array(axis)
    if np.linalg.norm(across) > 1e-6:
        way = np.cross(across, turn @ across) @ axis
        assert way * math.sin(math.radians(degrees)) > -1e-6 * np.dot(across, across)


@pytest.mark.parametrize(
    ("made", "text"),
    [
        (
            lambda: rotate((0, 0, 0), 30),
            "this axis has no direction\n  expected: a vector other than zero\n  found: 0 0 0",
        ),
        (lambda: rotate("w", 30), "no such axis\n  expected: x, y, z or a vector\n  found: 'w'"),
        (lambda: rotate((0, 1), 30), "this axis is no vector\n  expected: three numbers\n  found: 2 numbers"),
        (
            lambda: rotate("x", math.nan),
            "this angle is not finite\n  expected: finite numbers\n  found: NaN or infinity",
        ),
        (lambda: translate(math.inf, 0, 0), "this move is not finite"),
        (
            lambda: scale(1.0, 0.0, 2.0),
            "flattens what it is applied to\n  expected: factors other than 0\n  found: 1 0 2",
        ),
        (lambda: scale(1.0, 2.0), "this scale is incomplete\n  expected: one factor or three\n  found: two factors"),
        (
            lambda: matrix([[1, 2, 3], [4, 5, 6], [7, 8, 9]]),
            "this matrix is singular\n  expected: a matrix that can be",
        ),
        (lambda: matrix(np.zeros((4, 4))), "the last row of this matrix is not that of a transform"),
        (
            lambda: matrix([[1, 2], [3, 4]]),
            "no matrix of a transform\n  expected: 3 x 3, 3 x 4 or 4 x 4 numbers\n  found: 2 x 2",
        ),
        (lambda: matrix([[1, 2], [3]]), "this is no matrix"),
        (lambda: matrix([[math.nan, 0, 0], [0, 1, 0], [0, 0, 1]]), "this matrix is not finite"),
        (lambda: BALL.transformed(1e-200 * np.diag([1, 1, 0])), "this matrix is singular"),
    ],
)
def test_transforms_that_do_not_exist(made, text):
    with pytest.raises(TransformError) as caught:
        made()
    assert text in str(caught.value)


def test_a_tiny_or_flat_transform_is_not_singular():
    flat = rotate((1, 2, 3), 40).then(scale(1e-150)).then(rotate("y", 20)).then(scale(1.0, 1.0, 1e-9))
    assert found(Group([UNIT]).transformed(flat)) == []


# Materials


def test_materials_are_those_named_and_white_where_none_is():
    inner = Group([BALL, Sphere(ORIGIN, 2.0, material=RED)])
    assert materials_of([replace(inner, material=BLUE)]) == [BLUE, RED]
    assert materials_of([inner]) == [Material(), RED]
    assert materials_of([Instance(inner), Group([Shapes.of([TRIANGLE])], material=BLUE)]) == [BLUE, Material(), RED]


def test_sides_can_be_set_throughout_a_tree():
    part = Sphere(ORIGIN, 1.0, material=RED)
    scene = with_sides(Scene(CAMERA, [Group([part, part, Shapes.of([part]), UNIT]), BALL - part, TRIANGLE]), True)
    materials = list(flatten(scene).materials)
    assert [material.two_sided for material in materials] == [True] * len(materials)
    assert set(materials) == set(scene.materials)
    first, second, *_ = scene.shapes[0].children
    assert first is second


# What is wrong


@pytest.mark.parametrize(
    ("node", "expected"),
    [
        (Ellipsoid(ORIGIN, (1.0, 0.0, 2.0)), ["shapes[0].radii: no such radii; numbers greater than 0; 1 0 2"]),
        (
            Box(ORIGIN, (1.0, -1.0, 1.0)),
            ["shapes[0].high: there is no volume between the corners; more than `low` along every axis; 1 -1 1"],
        ),
        (Cylinder(ORIGIN, TOP, -1.0), ["shapes[0].radius: no such radius; a number greater than 0; -1"]),
        (
            Cylinder(TOP, TOP, 1.0),
            ["shapes[0].apex: the base and the apex coincide; a point other than the base; 0 0 1"],
        ),
        (Cone(ORIGIN, 1.0, TOP, -1.0), ["shapes[0].apex_radius: a closed cone has no negative radius; 0 or more; -1"]),
        (
            Cone(ORIGIN, 0.0, TOP, 0.0, name="point"),
            ["shapes[0].base_radius: this cone has no such surface; two radii of one sign, not both 0; 0"],
        ),
        (Hyperboloid(ORIGIN, ONES, sheets=3), ["shapes[0].sheets: no such number of sheets; 1 or 2; 3"]),
        (Paraboloid(ORIGIN, (-1.0, 1.0)), ["shapes[0].radii: no such radii; numbers greater than 0; -1 1"]),
        (
            HalfSpace(ORIGIN, TOP),
            ["shapes[0].normal: this normal has no direction; a vector other than zero; 0 0 0"],
        ),
        (Slab(TOP, ORIGIN, 0.0), ["shapes[0].thickness: no such thickness; a number greater than 0; 0"]),
        (
            Quadric(((1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 0.0, 1.0))),
            ["shapes[0].matrix: this matrix is not symmetric; the same numbers across the diagonal; 1 0 0 1 1 0 0 0 1"],
        ),
        (
            Quadric(((0.0, 0.0, 0.0),) * 3),
            [
                "shapes[0].matrix: this quadric has no surface; a matrix or linear term other than zero; "
                "0 0 0 0 0 0 0 0 0"
            ],
        ),
        (
            RoundedBox(ORIGIN, ONES, 0.5),
            ["shapes[0].radius: no such radius; more than 0, less than half the shortest edge; 0.5"],
        ),
        (Tube(ORIGIN, TOP, 1.0, 1.0), ["shapes[0].hole: no such hole; more than 0, less than the radius; 1"]),
        (Wedge(ORIGIN, (1.0, math.nan, 1.0)), ["shapes[0].high: this is no such value; 3 finite numbers; 1 nan 1"]),
        (Ellipsoid(ORIGIN, (1.0, 1.0)), ["shapes[0].radii: this is no such value; 3 finite numbers; 1 1"]),
        (Slab("up", ORIGIN, 1.0), ["shapes[0].normal: this is no such value; 3 finite numbers; 'up'"]),
        (
            Group([Sphere(ORIGIN, 0.0), Polygon((ORIGIN, TOP, (math.inf, 0.0, 0.0)))]),
            [
                "shapes[0].children[0].radius: this sphere has no size; a radius other than 0; 0",
                "shapes[0].children[1].points: not all of these are three finite numbers; finite numbers; "
                "0 0 0 0 0 1 inf 0 0",
            ],
        ),
        (
            Group([Shapes.of([TRIANGLE, Sphere(ORIGIN, 0.0)])]),
            ["shapes[0].children[0][1].radius: this sphere has no size; a radius other than 0; 0"],
        ),
        (
            Union([UNIT], extent=Extent(ORIGIN, -1.0)),
            ["shapes[0].extent.radius: no such radius; a number greater than 0; -1"],
        ),
        (
            Group([], extent=Extent((0.0, math.nan, 0.0), 1.0)),
            ["shapes[0].extent.centre: this is no point; three finite numbers; (0.0, nan, 0.0)"],
        ),
        (Group([], extent="large"), ["shapes[0].extent: this is no extent; a centre and a radius, or 'auto'; 'large'"]),
        (
            Cone(ORIGIN, 1.0, TOP, open=True, extent="auto"),
            ["shapes[0].extent: an open cone can have no extent; an extent of a group or a solid; one here"],
        ),
    ],
)
def test_numbers_that_no_such_node_can_have(node, expected):
    assert sorted(found(node)) == expected


@pytest.mark.parametrize(
    ("node", "expected"),
    [
        (
            UNIT | Cylinder(ORIGIN, TOP, 1.0, open=True),
            "shapes[0].children[1]: an open cylinder has no inside, so it cannot be an operand of a union; "
            "a solid; an open cylinder",
        ),
        (
            Group([Complement(TRIANGLE)]),
            "shapes[0].children[0].child: a polygon has no inside, so it cannot be an operand of a complement; "
            "a solid; a polygon",
        ),
        (
            UNIT - Instance(Instance(Sphere(ORIGIN, -1.0))),
            "shapes[0].children[1]: an instance of a sphere of negative radius has no inside, "
            "so it cannot be an operand of a difference; a solid; an instance of a sphere of negative radius",
        ),
        (
            Formula({"a": UNIT, "b": Group([UNIT])}, "a & b"),
            "shapes[0].parts.b: a group has no inside, so it cannot be an operand of a formula; a solid; a group",
        ),
        (
            Intersection([Solid("triangle"), UNIT]),
            "shapes[0].children[0]: a triangle has no inside, so it cannot be an operand of an intersection; "
            "a solid; a triangle",
        ),
    ],
)
def test_surfaces_are_no_operands(node, expected):
    assert expected in found(node)


@pytest.mark.usefixtures("registry")
def test_a_solid_of_a_kind_that_does_not_exist_or_is_ours_or_has_other_fields():
    assert found(Solid("torsu")) == ["shapes[0].kind: there is no such kind; a registered kind; 'torsu'"]
    ours = "what comes with Tasuki has nodes of its own; a kind that a user registered"
    assert found(Solid("plane", normal=(0.0, 0.0, 1.0), d=1.0)) == [f"shapes[0].kind: {ours}; 'plane'"]
    kinds.register(replace(kinds.lookup("plane"), name="mine", is_built_in=False))
    assert found(Solid("mine", normal=(0.0, 1.0), dd=1.0)) == [
        "shapes[0].normal: this is no such value; 3 finite numbers; 0 1",
        "shapes[0].d: this is missing; a finite number; nothing",
        "shapes[0].dd: there is no such field, did you mean 'd'?; one of normal, d; 'dd'",
    ]


@pytest.mark.usefixtures("registry")
def test_whole_numbers_of_a_registered_kind_are_whole():
    kinds.register(replace(kinds.lookup("plane"), name="counted", table=Table(Counted), is_built_in=False))
    assert found(Solid("counted", count=2)) == []
    assert found(Solid("counted", count=2.5)) == ["shapes[0].count: this is no such value; a whole number; 2.5"]


def test_what_nodes_can_hold():
    with pytest.raises(SceneError, match="a group can hold nodes only\n  expected: a node of a scene\n  found: str"):
        Group(["ball"])
    with pytest.raises(SceneError, match="a union can hold nodes only"):
        Union([Shapes.of([TRIANGLE])])
    with pytest.raises(SceneError, match="a difference without operands\n  expected: 1 or more solids"):
        Difference([])
    with pytest.raises(SceneError, match="found: both"):
        Formula({"a": UNIT}, "a", "a")
    with pytest.raises(SceneError, match="found: neither"):
        Formula({"a": UNIT})
    with pytest.raises(FormulaError, match="an operand is missing"):
        Formula({"a": UNIT}, "a -")


def test_nesting_has_a_limit():
    assert found(nested(UNIT, MOST_LEVELS)) == []
    assert len(flatten(Scene(CAMERA, [nested(UNIT, MOST_LEVELS)]))) == 1
    assert found(BALL, nested(UNIT, 10_000)) == [
        "shapes[1]: nodes are nested too deeply here; at most 1000 levels; 10000 levels"
    ]


def test_instances_count_one_by_one():
    assert measure([doubled(BALL, 30)]) == [(31, 2**31 - 1)]
    assert measure([Formula({"a": doubled(BALL, 3), "b": BALL, "c": UNIT}, "a - (a + b)")]) == [(5, 1 + 2 * 15 + 1)]
    assert found(UNIT, doubled(UNIT, 40)) == [
        "shapes[1]: the scene has too many nodes, most of them here: instances count one by one; "
        "at most 16,777,216; 2,199,023,255,552"
    ]


def test_lights():
    lights = [DirectionalLight(ORIGIN), DirectionalLight((0.0, math.nan, 1.0)), PointLight(ORIGIN, (1.0, -1.0, 1.0))]
    wrong = problems(Scene(CAMERA, [], lights))
    assert [one.dotted for one in wrong] == ["lights[0].direction", "lights[1].direction[1]", "lights[2].colour[1]"]


def test_an_empty_scene_works_with_a_warning():
    for shapes in ([], [Group([])]):
        scene = with_advice(Scene(CAMERA, shapes, [PointLight(TOP)]))
        assert problems(scene) == []
        assert len(flatten(scene)) == 0
        assert scene.warnings == ["warning: the scene has no shapes: only the background will show"]
