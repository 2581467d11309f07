"""Packing: the layout that the paper gives, the rules about sides and lights, triangles, bounds, and the limits."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tasuki.diagnostics import SceneError
from tasuki.modules import records
from tasuki.scene import Camera, Cone, Cylinder, Material, PointLight, Polygon, Scene, Sphere
from tasuki.scene import lower as lowering
from tasuki.scene.flatten import flatten
from tasuki.scene.kinds import OBJECT, lookup
from tasuki.scene.memory import MOST_ROWS, MemoryBuilder
from tasuki.scene.pack import pack, verify
from tasuki.scene.quads import with_pairs_together
from tasuki.scene.solids import Box
from tests.scene.strategies import polygons

CAMERA = Camera((0.0, -5.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 45.0)
DATA = Path(__file__).parents[1] / "data"


def packed(*shapes, lights=()):
    return pack(Scene(CAMERA, shapes, lights))


def row(memory, table, row_in_table, kind=float):
    """One row of a table as the four banks hold it."""
    rows = memory.rows if kind is float else memory.words
    return rows[memory.tables[table].base + row_in_table].tolist()


# The records of READING.md, sections 4 and 6: which word stands in which row and bank


def test_a_quadric_in_memory():
    memory = packed(Sphere((1.0, 2.0, 3.0), 4.0)).build()
    kind = lookup("quadric").number
    assert row(memory, "quadrics", 0, int) == [kind, 0, -1, records.SPHERE]
    assert row(memory, "quadrics", 1) == [1.0, 2.0, 3.0, 16.0]
    assert [row(memory, "quadrics", n) for n in (2, 3, 4)] == [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
    ]


def test_a_cone_in_memory():
    memory = packed(Cone((1.0, 2.0, 3.0), 2.0, (1.0, 2.0, 7.0), 1.0, open=True)).build()
    assert row(memory, "cones", 0, int) == [lookup("cone").number, 0, -1, 0]
    assert row(memory, "cones", 1) == [1.0, 2.0, 3.0, 2.0]
    assert row(memory, "cones", 2) == [0.0, 0.0, 1.0, 4.0]
    assert row(memory, "cones", 3)[0] == -0.25


def test_a_triangle_in_memory():
    corners = ((1.0, 0.0, 0.0), (3.0, 0.0, 0.0), (1.0, 2.0, 0.0))
    memory = packed(Polygon(corners)).build()
    assert row(memory, "triangles", 0, int) == [lookup("triangle").number, 0, -1, 0]
    assert [tuple(row(memory, "triangles", n)[:3]) for n in (1, 2, 3)] == list(corners)
    assert [row(memory, "triangles", n)[:3] for n in (4, 5, 6)] == [[0.0, 0.0, 1.0]] * 3


def test_an_attribute_in_memory():
    material = Material("all", (1.0, 2.0, 3.0), 0.5, 0.25, 0.125, 7.0, 0.75, 0.0625, 1.5, (4.0, 5.0, 6.0))
    memory = packed(Sphere((0.0, 0.0, 0.0), 1.0, material=material)).build()
    assert row(memory, "attributes", 0)[:3] == [1.0, 2.0, 3.0]
    assert row(memory, "attributes", 0, int)[3] == records.TWO_SIDED
    assert row(memory, "attributes", 1) == [0.5, 0.25, 0.125, 7.0]
    assert row(memory, "attributes", 2)[:3] == [0.75, 0.0625, 1.5]
    assert row(memory, "attributes", 3)[:3] == [4.0, 5.0, 6.0]


def test_lights_in_memory():
    lights = [PointLight((1.0, 2.0, 3.0)), PointLight((4.0, 5.0, 6.0), (0.5, 0.25, 0.125))]
    memory = packed(lights=lights).build()
    table = memory.table("lights")
    assert table["position"].tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
    assert table["colour"][0] == pytest.approx([math.sqrt(2) / 4] * 3)
    assert table["colour"][1].tolist() == [0.5, 0.25, 0.125]


def test_ambient_follows_the_lights_unless_given():
    shapes = [
        Sphere((0.0, 0.0, 0.0), 1.0, material=Material(diffuse=0.8)),
        Sphere((0.0, 0.0, 0.0), 1.0, material=Material(ambient=0.1)),
    ]
    memory = packed(*shapes, lights=[PointLight((0.0, 0.0, 9.0))] * 4).build()
    assert memory.table("attributes")["ambient"].tolist() == pytest.approx([0.8 * 0.25, 0.1])


# Sides


def test_the_flags_are_those_of_the_records():
    flags = (lowering.TWO_SIDED, lowering.INSIDE_ONLY, lowering.UNIT_MATRIX)
    assert flags == (records.TWO_SIDED, records.INSIDE_ONLY, records.SPHERE)


def test_which_sides_show():
    glass, sheet = Material("glass", transmission=0.9), Material("sheet", two_sided=True)
    corners, up = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), ((0.0, 0.0, 1.0),) * 3
    memory = packed(
        Sphere((0.0, 0.0, 0.0), 1.0),
        Sphere((0.0, 0.0, 0.0), -1.0),
        Sphere((5.0, 0.0, 0.0), 1.0, material=glass),
        Sphere((5.0, 0.0, 0.0), -1.0, material=glass),
        Cone((0.0, 0.0, 0.0), -1.0, (0.0, 0.0, 1.0), 0.0, open=True),
        Cone((0.0, 0.0, 0.0), 1.0, (0.0, 0.0, 1.0), 0.0, open=True, material=sheet),
        Polygon(corners),
        Polygon(corners, up),
    ).build()
    two_sided, inside_only = records.TWO_SIDED, records.INSIDE_ONLY
    assert (memory.table("quadrics")["flags"] & ~records.SPHERE).tolist() == [0, inside_only, two_sided, inside_only]
    assert memory.table("cones")["flags"].tolist() == [inside_only, two_sided]
    assert memory.table("cones")["radius"].tolist() == [1.0, 1.0]
    assert memory.table("triangles")["flags"].tolist() == [0, two_sided]


# Triangles


def corners_of(memory, kind, names):
    if f"{kind}s" not in memory.tables:
        return np.zeros((0, len(names), 3))
    table = memory.table(f"{kind}s")
    return np.stack([table[name] for name in names], axis=1).astype(np.float64)


def triangles_of(*shapes):
    """What the polygons became: triangles, and of every quadrilateral the two on either side of a c."""
    memory = packed(*shapes).build()
    quads = corners_of(memory, "quad", "abcd")
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]], corners_of(memory, "triangle", "abc")])


def areas(triangles):
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2.0


def test_a_convex_polygon_is_a_fan_from_its_first_corner():
    house = Polygon(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.5, 1.5, 0.0), (0.0, 1.0, 0.0)))
    found = triangles_of(house)
    assert found[:, 0].tolist() == [[0.0, 0.0, 0.0]] * 3
    assert areas(found)[:, 2].tolist() == [0.5, 0.5, 0.25]


def test_neighbours_in_a_polygon_become_quadrilaterals():
    corners = [(math.cos(angle), math.sin(angle), 0.0) for angle in np.arange(144) * math.tau / 144]
    found = packed(Polygon(tuple(corners)))
    assert found.counts["quad"] * 2 + found.counts["triangle"] == 142
    assert found.counts["quad"] > 40
    star = [(x * (1.0 - 0.5 * (n % 2)), y * (1.0 - 0.5 * (n % 2)), 0.0) for n, (x, y, _) in enumerate(corners)]
    found = packed(Polygon(tuple(star)))
    assert found.counts["quad"] * 2 + found.counts["triangle"] == 142
    assert found.counts["quad"] > 20


@pytest.mark.parametrize("bent", [1e-7, -1e-7])
def test_a_corner_that_is_almost_straight_makes_no_quadrilateral(bent):
    assert packed(Polygon(((0.0, 0.0, 0.0), (1.0, -bent, 0.0), (2.0, 0.0, 0.0), (1.0, 2.0, 0.0)))).counts == {
        "triangle": 2
    }


def most_pairs(triangles):
    """How many pairs of neighbours there can be, each triangle in one at most: dynamic programming on their tree."""
    near = {n: [m for m, u in enumerate(triangles) if len(set(t) & set(u)) == 2] for n, t in enumerate(triangles)}

    def best(n, parent):
        """The most pairs below n, and the most that leave n itself alone."""
        found = [best(m, n) for m in near[n] if m != parent]
        alone = sum(most for most, _ in found)
        return max([alone] + [alone - most + free + 1 for most, free in found]), alone

    return best(0, None)[0]


@given(st.integers(3, 40), st.data())
def test_pairs_are_neighbours_and_as_many_as_there_can_be(corners, data):
    # Any triangulation of a polygon: ears taken away at random.
    left, triangles = list(range(corners)), []
    while len(left) > 2:
        at = data.draw(st.integers(0, len(left) - 1))
        triangles.append((left[at - 1], left[at], left[(at + 1) % len(left)]))
        del left[at]
    ordered = with_pairs_together(triangles)
    assert sorted(map(sorted, ordered.tolist())) == sorted(map(sorted, triangles))
    pairs = 0
    while 2 * pairs + 1 < len(ordered) and len(set(ordered[2 * pairs]) & set(ordered[2 * pairs + 1])) == 2:
        pairs += 1
    assert pairs >= most_pairs(triangles)


def test_a_flat_convex_quadrilateral_stays_whole():
    points = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 2.0, 0.0), (0.0, 1.0, 0.0))
    memory = packed(Polygon(points)).build()
    (quad,) = memory.table("quads")
    assert [quad[name].tolist() for name in "abcd"] == [list(point) for point in points]
    assert quad["normal_d"].tolist() == [0.0, 0.0, 1.0]
    assert quad["kind"] == lookup("quad").number


@pytest.mark.parametrize("height", [0.01, -0.5])
def test_a_quadrilateral_that_is_not_flat_is_cut(height):
    points = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, height), (0.0, 1.0, 0.0))
    assert len(triangles_of(Polygon(points))) == 2


@pytest.mark.parametrize("first", range(4))
def test_a_concave_quadrilateral_is_cut_where_it_is_hollow(first):
    points = ((0.0, 0.0, 0.0), (1.0, -1.0, 0.0), (0.25, 0.0, 0.0), (1.0, 1.0, 0.0))
    found = areas(triangles_of(Polygon(points[first:] + points[:first])))
    assert (found[:, 2] > 0.0).all()
    assert found[:, 2].sum() == pytest.approx(0.25)


def test_a_comb_is_clipped_ear_by_ear():
    teeth = 12
    points = [(0.0, 0.0, -1.0), (2.0 * teeth, 0.0, -1.0)]
    for tooth in reversed(range(teeth)):
        points += [(2.0 * tooth + 2.0, 0.0, 0.0), (2.0 * tooth + 1.0, 0.0, 5.0), (2.0 * tooth + 0.5, 0.0, 0.0)]
    found = areas(triangles_of(Polygon(tuple(points))))
    # Seen from the front, -y, the comb turns counterclockwise.
    assert (found[:, 1] < 0.0).all()
    expected = Scene(CAMERA, [Polygon(tuple(points))]).shapes.polygons.area_vectors[0, 1] / 2.0
    assert found[:, 1].sum() == pytest.approx(expected)


@given(st.lists(polygons(Material()), min_size=1, max_size=5))
def test_triangles_cover_their_polygon_and_face_its_way(shapes):
    scene = Scene(CAMERA, shapes)
    corners, owner = lowering.triangulate(scene.shapes.polygons)
    points = scene.shapes.polygons.points[corners]
    for number in range(len(shapes)):
        whole = scene.shapes.polygons.area_vectors[number] / 2.0
        parts = areas(points[owner == number])
        assert parts.sum(axis=0) == pytest.approx(whole, rel=1e-9, abs=1e-9)
        assert (parts @ whole > 0.0).all()
    assert (np.diff(owner) >= 0).all()


def test_corners_in_a_straight_line_leave_no_triangle_of_no_area():
    points = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0), (2.0, 2.0, 0.0))
    assert len(triangles_of(Polygon(points))) == 1


def test_a_zero_normal_is_replaced_by_that_of_the_face():
    normals = ((0.0, 0.0, 0.0), (0.0, 0.0, 5.0), (1.0, 0.0, 0.0))
    memory = packed(Polygon(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), normals)).build()
    (triangle,) = memory.table("triangles")
    assert triangle["normal_a"].tolist() == [0.0, 0.0, 1.0]
    assert triangle["normal_b"].tolist() == [0.0, 0.0, 5.0]


# Which primitive came from which shape, and what is refused


def test_primitives_know_their_shapes_and_kinds():
    square = Polygon(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)))
    found = packed(square, Sphere((0.0, 0.0, 0.0), 1.0), square, Sphere((1.0, 0.0, 0.0), 1.0))
    assert [kind.name for kind in found.kinds] == ["quadric", "quad"]
    assert found.counts == {"quadric": 2, "quad": 2}
    assert [one.shapes.tolist() for one in found.primitives] == [[1, 3], [0, 2]]


def test_a_scene_of_nothing_packs():
    found = packed()
    assert found.kinds == ()
    assert found.build().tables["lights"].count == 0


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (Sphere((0.0, 0.0, 0.0), 1e30), "the scene's size is out of range"),
        (Cone((0.0, 0.0, 1e39), 1.0, (0.0, 0.0, 0.0), 1.0, open=True), "the scene's size is out of range"),
        (Cone((0.0, 0.0, 1e15), 1.0, (0.0, 0.0, 0.0), 1.0, open=True), "the scene's size is out of range"),
        (Sphere((math.nan, 0.0, 0.0), 1.0), r"shapes\[0\]: not all of its numbers are finite"),
        (Sphere((0.0, 0.0, 0.0), 0.0), r"shapes\[0\].radius: this sphere has no size"),
        (Sphere((0.0, 0.0, 0.0), 1.0, material=Material(index=0.0)), r"materials\[0\].index: no such refractive index"),
        (Sphere((0.0, 0.0, 0.0), 1.0, material=Material(exponent=1e300)), "material 0 cannot be packed"),
    ],
)
def test_what_cannot_be_drawn_is_refused(shape, message):
    with pytest.raises(SceneError, match=message):
        packed(shape)


def test_an_attribute_that_does_not_exist_is_found():
    scene = Scene(CAMERA, [Sphere((0.0, 0.0, 0.0), 1.0)])
    found = pack(scene).primitives[0]
    found.records["attribute"] = 1
    with pytest.raises(SceneError, match="a material, 0 to 0"):
        verify(found, flatten(scene))


# Memory


def test_tables_are_aligned_and_views_write_through():
    builder = MemoryBuilder()
    builder.add("lights", np.ones(3, records.Light.numpy_dtype()))
    builder.add("picture", (records.Pixel, 5))
    memory = builder.build()
    assert memory.rows.ctypes.data % 64 == 0
    assert [place.base % 4 for place in memory.tables.values()] == [0, 0]
    assert memory.tables["picture"].base == 8
    memory.table("picture")["coverage"][4] = 0.5
    assert memory.rows[memory.tables["picture"].base + 4].tolist() == [0.0, 0.0, 0.0, 0.5]
    assert np.shares_memory(memory.words, memory.rows)


def test_a_picture_beyond_the_addresses_is_refused_before_it_is_allocated():
    builder = MemoryBuilder()
    builder.add("views", (records.View, 1))
    with pytest.raises(SceneError, match="table 'picture' needs 16 GiB of memory"):
        builder.add("picture", (records.Pixel, 2 * MOST_ROWS))
    with pytest.raises(ValueError, match="already"):
        builder.add("views", (records.View, 1))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("factor", "expected"), [(1e-150, "matrix 0 cannot be packed"), (1e200, "cannot be placed")])
def test_scales_that_no_float_holds_are_told(factor, expected):
    with pytest.raises(SceneError, match=expected):
        packed(Cylinder((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0.1).scale(factor))


@given(st.integers(1, 20), st.integers(0, 1 << 16))
def test_glass_that_touches_something_is_a_medium(count, seed):
    # Boxes with whole coordinates: many touch.
    draw = np.random.default_rng(seed)
    low = draw.integers(0, 9, (count, 3))
    high = low + draw.integers(1, 4, (count, 3))
    material = Material(transmission=0.5)
    boxes = [Box(tuple(a), tuple(b), material=material) for a, b in zip(low.tolist(), high.tolist(), strict=True)]
    touches = ((low[:, None] <= high) & (high[:, None] >= low)).all(axis=2).sum(axis=1) > 1
    media = packed(*boxes).build().table("media")
    assert media["code"].tolist() == [number * 32 + OBJECT for number in np.flatnonzero(touches)]
