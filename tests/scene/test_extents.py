"""Spherical extents: they contain what they are around, are as tight as promised, and form the tree that is walked."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tasuki.diagnostics import SceneError
from tasuki.scene import (
    Box,
    Camera,
    Cone,
    Cylinder,
    Ellipsoid,
    Extent,
    Group,
    HalfSpace,
    Hyperboloid,
    Intersection,
    Paraboloid,
    Polygon,
    Quadric,
    RoundedBox,
    Scene,
    Slab,
    Sphere,
    Tube,
    Union,
    Wedge,
    extents,
)
from tasuki.scene.kinds import lookup
from tasuki.scene.pack import pack
from tests.csg.trees import trees_in
from tests.modules.primitives import cones, quads, spheres, triangles
from tests.scene.membership import inside
from tests.scene.strategies import solids, transforms

CAMERA = Camera((0.0, -5.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 45.0)
ORIGIN = (0.0, 0.0, 0.0)
BALL = Sphere((1.0, 2.0, 3.0), 0.5)
CUBE = Box(ORIGIN, (1.0, 1.0, 1.0))


def packed(*shapes):
    return pack(Scene(CAMERA, shapes))


def extent(node):
    """Centre and radius, (4,), around the only thing of a scene."""
    _, _, (found,) = extents.of_things(packed(node))
    return found


# What they contain

MORE = [
    Ellipsoid((0.5, 0.0, 1.0), (0.5, 1.0, 2.0)),
    Cone((0.0, 0.0, 0.0), 1.0, (1.0, 0.5, 2.0), 0.25),
    Cylinder((0.0, 1.0, 0.0), (1.0, -1.0, 1.0), 0.75),
    Tube((0.0, 0.0, 0.0), (1.0, 1.0, 0.0), 1.0, 0.5),
    RoundedBox((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), 0.25),
    Wedge((0.0, 0.0, 0.0), (1.0, 2.0, 1.0)),
    Paraboloid((0.0, 0.0, -1.0), (1.0, 0.5)) & HalfSpace((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)),
    Hyperboloid((0.0, 0.0, 0.0), (1.0, 0.5, 1.0)) & Slab((0.0, 0.0, 1.0), ORIGIN, 2.0),
    Quadric(((-1.0, 0.0, 0.0), (0.0, -2.0, 0.0), (0.0, 0.0, -1.0)), constant=-1.0),
]


@st.composite
def bounded_more(draw):
    return draw(st.sampled_from(MORE)).transformed(draw(transforms()))


def joined(inner):
    several = st.lists(inner, min_size=1, max_size=3)
    operations = [
        several.map(Union),
        several.map(Intersection),
        st.tuples(inner, inner).map(lambda two: two[0] - two[1]),
    ]
    return st.one_of(*operations, inner.map(lambda one: ~one))


trees = st.recursive(solids() | bounded_more(), joined, max_leaves=8)


@settings(deadline=None)
@given(trees, st.integers(0, 2**32 - 1))
def test_nothing_of_an_object_lies_beyond_its_extent(node, seed):
    scene = packed(Union((node,)))
    _, _, found = extents.of_things(scene)
    assume(len(found) and math.isfinite(found[0, 3]))
    centre, radius = found[0, :3], found[0, 3]
    draw = np.random.default_rng(seed)
    ways = draw.normal(size=(2000, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    beyond = radius * (1.0 + 1e-9 + np.concatenate([np.zeros(500), draw.exponential(0.5, 1500)]))
    (tree,) = trees_in(scene.flat)
    assert not inside(tree, centre + beyond[:, None] * ways).any()


@pytest.mark.parametrize("make", [spheres, cones, triangles, quads])
def test_primitives_that_stand_alone_lie_in_their_extents(make):
    records = make(5, 300)
    draw = np.random.default_rng(6)
    kind = {spheres: "quadric", cones: "cone", triangles: "triangle", quads: "quad"}[make]
    found = extents.of_primitives(lookup(kind), records)
    shares = draw.dirichlet([0.5] * (4 if kind == "quad" else 3), (300, 50))
    if kind in ("triangle", "quad"):
        points = sum(shares[:, :, i, None] * records[name][:, None] for i, name in enumerate("abcd"[: shares.shape[2]]))
    elif kind == "cone":
        along = draw.uniform(0, 1, (300, 50)) * records["length"][:, None]
        along[:, :25] = np.where(draw.integers(0, 2, (300, 25)), records["length"][:, None], 0)
        across = np.cross(records["axis"][:, None], draw.normal(size=(300, 50, 3)))
        across /= np.linalg.norm(across, axis=2)[:, :, None]
        radius = records["radius"][:, None] + records["slope"][:, None] * along
        points = records["base"][:, None] + along[..., None] * records["axis"][:, None] + radius[..., None] * across
    else:
        ways = draw.normal(size=(300, 50, 3))
        ways /= np.linalg.norm(ways, axis=2)[:, :, None]
        points = records["centre"][:, None] + np.sqrt(records["constant"])[:, None, None] * ways
    distance = np.linalg.norm(points - found[:, None, :3], axis=2)
    assert (distance <= found[:, 3:] * (1.0 + 1e-6)).all()
    assert (distance.max(axis=1) >= 0.7 * found[:, 3]).mean() > 0.9


# How tight they are

TIGHT = {
    "sphere": (BALL, (1, 2, 3), 0.5),
    "moved sphere": (BALL.translate(1, 0, 0).rotate("z", 90), (-2, 2, 3), 0.5),
    "stretched sphere": (Sphere(ORIGIN, 1).scale(1, 2, 3), ORIGIN, 3),
    "ellipsoid": (Ellipsoid((1, 1, 1), (0.5, 2, 1)), (1, 1, 1), 2),
    "ellipsoid made round": (Ellipsoid(ORIGIN, (1, 2, 4)).scale(4, 2, 1), ORIGIN, 4),
    "box": (Box((1, 1, 1), (3, 4, 7)), (2, 2.5, 4), 3.5),
    "turned box": (CUBE.rotate((1, 2, 3), 50).translate(5, 0, 0), None, math.sqrt(3) / 2),
    "sheared box": (CUBE.transformed([[1, 1, 0], [0, 1, 0], [0, 0, 1]]), (1, 0.5, 0.5), math.sqrt(1.5)),
    "slanting cylinder": (Cylinder(ORIGIN, (3, 0, 4), 1), (1.5, 0, 2), math.hypot(2.5, math.sqrt(2))),
    "the tightest of an intersection": (Sphere(ORIGIN, 3) & BALL & CUBE.scale(9), (1, 2, 3), 0.5),
    "what is left of a difference": (BALL - CUBE, (1, 2, 3), 0.5),
    "union of two": (Sphere((-2, 0, 0), 1) | Sphere((4, 0, 0), 2), (1.5, 0, 0), 4.5),
    "inside out, taken from outside": (
        ~Quadric(((-1, 0, 0), (0, -1, 0), (0, 0, -0.25)), (1, 0, 0), constant=-1.0),
        (1, 0, 0),
        2,
    ),
    "far away": (CUBE.rotate("z", 45).translate(1e7, 0, 0), None, math.sqrt(3) / 2),
}


@pytest.mark.parametrize("name", TIGHT)
def test_how_tight_they_are(name):
    node, centre, radius = TIGHT[name]
    found = extent(node | node)
    assert found[3] == pytest.approx(radius, rel=1e-6)
    if centre is not None:
        assert found[:3] == pytest.approx(centre, abs=1e-6)


ENDLESS = {
    "half-space": HalfSpace((0, 0, 1), ORIGIN),
    "slab": Slab((0, 0, 1), ORIGIN, 1),
    "paraboloid": Paraboloid(ORIGIN, (1, 1)),
    "complement": ~BALL,
    "complement of an intersection": ~(BALL & Sphere(BALL.centre, 0.25)),
    "inside out": Quadric(((-1, 0, 0), (0, -1, 0), (0, 0, -1)), constant=-1.0),
    "union with something endless": BALL | Slab((0, 0, 1), ORIGIN, 1),
    "intersection of endless things": Slab((0, 0, 1), ORIGIN, 1) & Slab((0, 1, 0), ORIGIN, 1),
    "endless less a ball": HalfSpace((0, 0, 1), ORIGIN) - BALL,
}


@pytest.mark.parametrize("name", ENDLESS)
def test_what_has_no_bounds_has_no_extent(name):
    assert extent(ENDLESS[name])[3] == math.inf


def test_users_are_believed_where_theirs_is_the_smaller():
    promised = Extent((0.5, 0.5, 0.5), 0.75)
    box, loose = Box(ORIGIN, (1, 1, 1), extent=promised), Box(ORIGIN, (1, 1, 1), extent=Extent(ORIGIN, 9.0))
    assert extent(box).tolist() == [0.5, 0.5, 0.5, 0.75]
    assert extent(loose)[3] == pytest.approx(math.sqrt(3) / 2)
    slab = Slab((0, 0, 1), ORIGIN, 1, extent=Extent(ORIGIN, 2.0)).scale(1, 3, 1)
    assert extent(slab).tolist() == [0.0, 0.0, 0.0, 6.0]


# The tree

TRIANGLE = Polygon((ORIGIN, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))


@st.composite
def groups(draw, levels=3):
    """Groups in groups, empty ones among them."""
    leaves = [BALL, CUBE, TRIANGLE, HalfSpace((0.0, 0.0, 1.0), ORIGIN), BALL | CUBE]
    members = st.sampled_from(leaves) | groups(levels - 1) if levels else st.sampled_from(leaves)
    children = draw(st.lists(members, max_size=4))
    node = Group(children, extent=draw(st.sampled_from([None, Extent(ORIGIN, 50.0)])) if children else None)
    return node.translate(*draw(st.tuples(*[st.integers(-3, 3)] * 3)))


@settings(deadline=None, max_examples=50)
@given(st.lists(groups(), max_size=4))
def test_the_nodes_are_the_tree_in_preorder(shapes):
    scene = packed(*shapes)
    nodes = extents.nodes(scene)
    numbers, codes, _ = extents.of_things(scene)
    things = nodes["code"] != extents.GROUP
    assert nodes["code"][things].tolist() == codes.tolist()
    assert len(set(codes.tolist())) == scene.things
    assert nodes["skip"][things].tolist() == (np.flatnonzero(things) + 1).tolist()
    held = [
        numbers[np.cumsum(things)[row] : np.cumsum(things)[skip - 1]].tolist()
        for row, skip in enumerate(nodes["skip"])
        if not things[row]
    ]
    ranges = [numbers[(numbers >= group.first) & (numbers < group.end)].tolist() for group in scene.flat.groups]
    assert all(members and members in ranges for members in held)
    for row in np.flatnonzero(~things).tolist():
        within = slice(row + 1, nodes["skip"][row])
        there = things[within] | (nodes["radius"][within] >= 0)
        reach = np.linalg.norm(nodes["centre"][within] - nodes["centre"][row], axis=1) + nodes["radius"][within]
        bounded = there & (nodes["radius"][within] >= 0)
        # Float32 numbers; a user's promise may cut what is computed.
        assert (reach[bounded] <= nodes["radius"][row] * 1.001 + 0.1).all() or nodes["radius"][row] >= 50.0
        assert (nodes["skip"][within] <= nodes["skip"][row]).all()


def test_groups_without_bounds_have_no_node():
    nodes = extents.nodes(packed(Group([BALL, Group([HalfSpace((0, 0, 1), ORIGIN)]), Group([CUBE, BALL])])))
    assert (nodes["code"] == extents.GROUP).tolist() == [False, False, True, False, False]
    assert nodes["radius"][1] < 0.0
    assert nodes["skip"].tolist() == [1, 2, 5, 4, 5]


def test_a_polygon_of_several_primitives_is_a_group_of_them():
    around_it = [(math.cos(angle), math.sin(angle), 0.0) for angle in np.linspace(0, 2 * math.pi, 9)[:-1]]
    nodes = extents.nodes(packed(BALL, Group([Polygon(around_it)])))
    primitives = len(nodes) - 3
    assert primitives == 4
    assert nodes["code"].tolist()[1:3] == [extents.GROUP] * 2
    assert nodes["skip"].tolist()[:3] == [1, len(nodes), len(nodes)]
    assert nodes["radius"][1:3] == pytest.approx([1.0, 1.0], rel=0.2)


def test_extents_are_wide_enough_for_float32():
    """Around numbers that float32 cannot hold, far from the origin and near it."""
    for far in (0.0, 1e3, 1e7):
        nodes = extents.nodes(packed(Group([CUBE.rotate((1, 2, 3), 17).translate(far + 0.1, 0.3, 0.7), BALL])))
        assert (nodes["radius"][nodes["code"] == extents.GROUP] > 0.0).all()
        exact = extents.nodes(packed(CUBE.rotate((1, 2, 3), 17)))["radius"]
        assert (nodes["radius"][1:] >= min(0.5, math.sqrt(3) / 2)).all()
        assert exact[0] > math.sqrt(3) / 2


def test_a_deep_tree_and_a_wide_one():
    node = Group([BALL])
    for _ in range(900):
        node = Group([node, CUBE])
    nodes = extents.nodes(packed(node))
    assert len(nodes) == 901 + 901
    assert nodes["skip"][0] == len(nodes)
    assert len(extents.nodes(packed())) == 0


def test_an_extent_that_cannot_be_computed_is_an_error():
    endless = Union((Slab((0, 0, 1), ORIGIN, 1), BALL), extent="auto")
    with pytest.raises(SceneError) as caught:
        packed(CUBE, Group([BALL, endless], extent="auto"))
    text = str(caught.value)
    assert "shapes[1].extent: this group has no bounds, so it can have no extent" in text
    assert "shapes[1].children[1].extent: this object has no bounds, so it can have no extent" in text
    packed(Group([BALL, Union((CUBE, BALL), extent="auto")], extent="auto"))
