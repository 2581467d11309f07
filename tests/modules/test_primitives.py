"""Intersection modules: points lie on their surfaces, IN and OUT agree with the crossings, bounds hold what they bound.

In float32 a point on a surface is off by roundings of numbers as large as those that go in; tests state errors in units
of 2**-24 times that size. The float64 interpreter, given the same float32 numbers, is the oracle.
"""

from __future__ import annotations

import numpy as np
import pytest

from tasuki.mapping import map_module
from tasuki.modules import cone, plane, quad, quadric, triangle
from tasuki.modules.crossing import NOWHERE, first_crossing, quadratic_crossings
from tasuki.modules.records import INSIDE_ONLY, SPHERE, TWO_SIDED, Plane
from tests.modules.primitives import (
    COUNT,
    SHAPES,
    cones,
    gradient_of,
    planes,
    point_at,
    quadric_of,
    quads,
    random_quadrics,
    rays,
    spheres,
    triangles,
    value_at,
)
from tests.modules.running import EPSILON, dot, everywhere, exactly, random_directions, records, unit

# --- crossings --------------------------------------------------------------------------------------------------------


def test_the_table_of_first_crossing():
    """Every case by hand: which crossing shows, from where, for which sort of surface."""
    inf, nan = NOWHERE, np.nan
    table = [
        # enter, leave: front only, two-sided, inside only
        ((2, 5), (2, 2, 5)),
        ((-2, 5), (inf, 5, 5)),
        ((-5, -2), (inf, inf, inf)),
        ((5, 2), (5, 2, 2)),
        ((5, -2), (5, 5, inf)),
        ((0, 5), (inf, 5, 5)),
        ((2, 0), (2, 2, inf)),
        ((nan, nan), (inf, inf, inf)),
        ((3, nan), (3, 3, inf)),
        ((nan, 3), (inf, 3, 3)),
        ((inf, 3), (inf, 3, 3)),
        ((3, inf), (3, 3, inf)),
        ((inf, inf), (inf, inf, inf)),
        ((-inf, 3), (inf, 3, 3)),
        ((-0.0, -0.0), (inf, inf, inf)),
        ((1e-45, 2), (1e-45, 1e-45, 2)),
    ]
    given = np.array([row[0] for row in table], np.float32)
    for column, flags in enumerate((0, TWO_SIDED, INSIDE_ONLY)):
        found = everywhere(first_crossing, np.int32(flags | SPHERE), given[:, 0], given[:, 1])
        np.testing.assert_array_equal(found, np.array([row[1][column] for row in table], np.float32))


SPECIAL = [0.0, -0.0, 1.0, -1.0, 2.0, -3.0, 1e-20, -1e20, np.inf]


def test_quadratics_fall_where_they_enter_and_rise_where_they_leave():
    draw = np.random.default_rng(0)
    grid = np.array(np.meshgrid(SPECIAL, SPECIAL, SPECIAL)).reshape(3, -1).T
    numbers = np.concatenate([grid, draw.normal(size=(20000, 3)), draw.normal(size=(999, 3)) * [1, 1e4, 1]])
    a, b, c = numbers.astype(np.float32).T.copy()
    enter, leave = (t.astype(np.float64) for t in everywhere(quadratic_crossings, a, b, c))
    a, b, c = (x.astype(np.float64) for x in (a, b, c))
    with np.errstate(all="ignore"):
        discriminant = b * b - a * c
        tame = np.logical_and.reduce([(np.abs(x) > 1e-6) & (np.abs(x) < 1e6) for x in (a, c)]) & (np.abs(b) < 1e6)
        clear = tame & (discriminant > 1e-6 * (b * b + np.abs(a * c)))
        steep = np.sqrt(discriminant)
        for t, slope in ((enter, -steep), (leave, steep)):
            # a t + b is half the derivative.
            wrong = np.abs(a * t + b - slope) > 2e-3 * (np.abs(b) + steep)
            assert not (wrong & clear).any()
            size = np.abs(a * t * t) + np.abs(2 * b * t) + np.abs(c)
            off = np.abs(a * t * t + 2 * b * t + c) > 20 * EPSILON * size * (1 + np.abs(b) / steep)
            assert not (off & clear).any()
        none = tame & (discriminant < -1e-6 * (b * b + np.abs(a * c)))
    assert np.isnan(enter[none]).all()
    assert np.isnan(leave[none]).all()


def test_a_quadratic_without_a_constant_has_a_root_of_exactly_zero():
    a, b = np.random.default_rng(1).normal(size=(2, 1000)).astype(np.float32)
    enter, leave = everywhere(quadratic_crossings, a, b, np.float32(0))
    np.testing.assert_array_equal(np.where(b < 0, enter, leave), 0)


def test_a_linear_equation_has_one_crossing():
    """a = 0, a ray along a paraboloid's axis: one crossing, the other infinitely far on the right side."""
    enter, leave = everywhere(quadratic_crossings, np.float32(0), np.float32([1, -1]), np.float32([-6, -6]))
    np.testing.assert_array_equal(enter, [-np.inf, -3])
    np.testing.assert_array_equal(leave, [3, np.inf])


# --- planes -----------------------------------------------------------------------------------------------------------


def test_hits_of_planes_lie_in_them():
    given, (origin, direction) = planes(1), rays(2)
    t = everywhere(plane.plane_intersection, given, origin, direction)
    point = point_at(origin, direction, t)
    steepness = np.abs(dot(given["normal"], direction))
    fair = steepness > 1e-3
    off = np.abs(dot(given["normal"], point) + given["d"]) * steepness
    assert fair.mean() > 0.9
    assert (off[fair] < 40 * EPSILON * (20 + np.abs(t[fair]))).all()


def test_planes_are_in_before_they_are_left():
    given, (origin, direction) = planes(3, flags=0), rays(4)
    t = map_module(plane.plane_intersection, given, origin, direction)
    inside = everywhere(plane.plane_inside, given, origin)
    falls = dot(given["normal"], direction) < 0
    # Ahead and falling: from OUT to IN. Behind: the origin has crossed already.
    fair = (np.abs(t) > 1e-4) & (np.abs(dot(given["normal"], direction)) > 1e-3)
    np.testing.assert_array_equal(inside[fair], (falls ^ (t > 0))[fair])
    hit = everywhere(plane.plane_hit, given, origin, direction, np.zeros(COUNT, bool))
    shows = falls & (t > 0)
    np.testing.assert_array_equal(hit[fair], np.where(shows, t, np.inf)[fair])


def test_a_plane_is_not_met_by_rays_that_leave_it_or_run_along_it():
    given, (origin, direction) = planes(5), rays(6)
    assert np.isinf(map_module(plane.plane_hit, given, origin, direction, np.ones(COUNT, bool))).all()
    along = records(Plane, 4, normal=[0, 0, 1], d=[0, -1, 1, 0], flags=TWO_SIDED)
    hit = everywhere(plane.plane_hit, along, np.zeros(3), np.array([1.0, 0, 0]), False)
    assert not (hit < np.inf).any()


# --- quadrics ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SHAPES)
def test_crossings_of_quadrics(name):
    """They lie on the surface; the ray falls into IN where it enters and rises out of it where it leaves."""
    given, (origin, direction) = random_quadrics(name, 7), rays(8)
    enter, leave = everywhere(quadric.quadric_intersection, given, origin, direction, np.zeros(COUNT, bool))
    exact = exactly(quadric.quadric_intersection, given, origin, direction, np.zeros(COUNT, bool))
    judged = 0
    for t, reference, sign in ((enter, exact[0], -1), (leave, exact[1], 1)):
        met = np.isfinite(t) & np.isfinite(reference)
        with np.errstate(all="ignore"):
            point = point_at(origin, direction, t)
            value, gradient, size = value_at(given, point)
            reach = np.abs(t) + np.linalg.norm(origin, axis=-1) + 1
        rising = dot(gradient_of(given, np.nan_to_num(point, posinf=0, neginf=0)), direction)
        clear = met & (np.abs(rising) > 1e-2 * np.maximum(gradient, 1e-3)) & (np.abs(t) < 50)
        assert (np.sign(rising[clear]) == sign).all()
        # What the value of a point may be off by: roundings of the value itself, and of t times its slope.
        bound = 100 * EPSILON * (size + gradient * reach) * np.maximum(1, gradient / np.maximum(np.abs(rising), 1e-9))
        assert (np.abs(value) <= bound)[clear].all()
        judged += clear.sum()
    assert judged > COUNT / 4


@pytest.mark.parametrize("name", SHAPES)
def test_inside_agrees_with_the_crossings(name):
    given, (origin, direction) = random_quadrics(name, 9), rays(10)
    enter, leave = map_module(quadric.quadric_intersection, given, origin, direction, np.zeros(COUNT, bool))
    judged = 0
    for t in (-3.0, 0.0, 0.7, 4.0):
        where = point_at(origin, direction, np.full(COUNT, t)).astype(np.float32)
        inside = everywhere(quadric.quadric_inside, given, where)
        value, _, size = value_at(given, where.astype(np.float64))
        fair = np.abs(value) > 100 * EPSILON * size
        np.testing.assert_array_equal(inside[fair], value[fair] < 0)
        # After an entry, and not after a leaving since: IN. With the ray's ends inside, it is OUT between the two.
        with np.errstate(all="ignore"):
            both = np.isfinite(enter) & np.isfinite(leave) & (np.abs(leave - enter) > 1e-2) & fair
            both &= (np.abs(enter - t) > 1e-2) & (np.abs(leave - t) > 1e-2)
        expected = np.where(enter < leave, (enter < t) & (t < leave), (t < leave) | (enter < t))
        np.testing.assert_array_equal(inside[both], expected[both])
        judged += both.sum()
    assert judged > COUNT / 3


def test_rays_in_every_direction_through_the_centre_enter_before_they_leave():
    """The quadratic's middle coefficient is then a zero of either sign."""
    signs = np.array(np.meshgrid([1, -1, 0], [1, -1, 0], [1, -1, 0])).reshape(3, -1).T
    signs = signs[np.abs(signs).any(axis=1)].astype(np.float64)
    direction = unit(np.concatenate([signs, -signs * [1, 2, 4]]))
    matrix = np.tile(np.diag([1.0, 2, 3]), (len(direction), 1, 1))
    given = quadric_of(matrix, np.zeros(3), np.zeros((len(direction), 3)), np.ones(len(direction)))
    for distance in (0.0, 4.0):
        origin = -distance * direction
        enter, leave = everywhere(quadric.quadric_intersection, given, origin, direction, False)
        assert (enter < leave).all()


@pytest.mark.parametrize("name", SHAPES)
def test_rays_that_leave_a_quadric_have_a_crossing_at_exactly_zero(name):
    given, (origin, direction) = random_quadrics(name, 11), rays(12)
    enter, _ = map_module(quadric.quadric_intersection, given, origin, direction, np.zeros(COUNT, bool))
    start = np.where(np.isfinite(enter) & (np.abs(enter) < 20), enter, np.nan)
    there = np.isfinite(start)
    surface = point_at(origin, direction, np.nan_to_num(start)).astype(np.float32)
    outward = random_directions(np.random.default_rng(13), COUNT)
    # Along a straight line in the surface there is no crossing.
    there &= np.abs(dot(gradient_of(given, surface), outward)) > 1e-5
    first, second = everywhere(quadric.quadric_intersection, given, surface, outward, np.ones(COUNT, bool))
    with np.errstate(invalid="ignore"):
        assert ((first == 0) | (second == 0))[there].all()
    # Nothing is hit at once, from either side.
    given["flags"] = TWO_SIDED
    hit = map_module(quadric.quadric_hit, given, surface, outward, np.ones(COUNT, bool))
    assert not (hit[there] <= 0).any()


def test_crossings_of_spheres():
    given, (origin, direction) = spheres(14), rays(15)
    # Aim at the spheres, near their rims too.
    draw = np.random.default_rng(16)
    aim = given["centre"] + random_directions(draw, COUNT) * np.sqrt(given["constant"])[:, None]
    direction = unit(aim - origin)
    enter, leave = everywhere(quadric.sphere_crossings, given, origin, direction, np.zeros(COUNT, bool))
    exact_enter, exact_leave = exactly(quadric.sphere_crossings, given, origin, direction, np.zeros(COUNT, bool))
    met = np.isfinite(enter)
    assert (enter <= leave)[met].all()
    assert met.mean() > 0.8
    radius = np.sqrt(given["constant"].astype(np.float64))
    distance = np.linalg.norm(origin - given["centre"], axis=-1)
    # Off the surface by roundings of the distance, not of its square.
    for t in (enter, leave):
        off = np.abs(np.linalg.norm(point_at(origin, direction, t) - given["centre"], axis=-1) - radius)
        depth = np.abs(exact_leave - exact_enter) / 2
        fair = met & np.isfinite(exact_enter) & (depth > 0.1 * radius)
        assert (off <= 40 * EPSILON * (distance + radius + 5) * np.maximum(1, radius / depth))[fair].all()
    # Where the float64 oracle clearly meets or misses, so does float32.
    aside = np.linalg.norm(np.cross((given["centre"] - origin).astype(np.float64), direction), axis=-1)
    margin = 40 * EPSILON * (distance + radius + 5)
    assert met[aside < radius - margin].all()
    assert not met[aside > radius + margin].any()


def test_spheres_as_spheres_and_as_quadrics():
    given, (origin, direction) = spheres(17), rays(18)
    leaving = np.random.default_rng(19).integers(0, 2, COUNT) > 0
    origin[leaving] = given["centre"][leaving] + direction[leaving] * np.sqrt(given["constant"])[leaving, None]
    direction = random_directions(np.random.default_rng(20), COUNT)
    special = everywhere(quadric.sphere_crossings, given, origin, direction, leaving)
    general = everywhere(quadric.quadric_intersection, given, origin, direction, leaving)
    distance = np.linalg.norm(origin - given["centre"], axis=-1)
    for one, other in zip(special, general, strict=True):
        both = np.isfinite(one) & np.isfinite(other)
        radius = np.sqrt(given["constant"])
        depth = np.abs(special[1] - special[0])
        fair = both & (depth > 0.2 * radius)
        assert (np.abs(one - other) <= 100 * EPSILON * (distance + 5) * (1 + distance / radius))[fair].all()
    assert ((special[0] == 0) | (special[1] == 0))[leaving].all()
    hits = everywhere(quadric.quadric_hit, given, origin, direction, leaving)
    narrow = everywhere(quadric.sphere_hit, given, origin, direction, leaving)
    np.testing.assert_array_equal(hits, narrow)


def test_normals_of_quadrics_are_unit_and_point_out():
    for name in SHAPES:
        given, (origin, direction) = random_quadrics(name, 21), rays(22)
        enter, _ = map_module(quadric.quadric_intersection, given, origin, direction, np.zeros(COUNT, bool))
        met = np.isfinite(enter) & (np.abs(enter) < 30)
        point = point_at(origin, direction, np.where(met, enter, 0)).astype(np.float32)
        geometry, shading, attribute, _ = everywhere(quadric.quadric_surface, given, origin, direction, point)
        np.testing.assert_array_equal(geometry, shading)
        np.testing.assert_array_equal(attribute, given["attribute"])
        gradient = gradient_of(given, point.astype(np.float64))
        fair = met & (np.linalg.norm(gradient, axis=-1) > 1e-2)
        assert np.abs(np.linalg.norm(geometry[fair], axis=-1) - 1).max() < 4 * EPSILON
        assert (dot(geometry, gradient)[fair] > 0).all()
        # It enters where it falls: against the normal.
        steep = np.abs(dot(geometry, direction)) > 1e-2
        assert (dot(geometry, direction)[fair & steep] < 0).all()


@pytest.mark.parametrize("name", SHAPES)
def test_bounds_of_quadrics_hold_their_points(name):
    given = random_quadrics(name, 23, 500)
    low, high = everywhere(quadric.quadric_bounds, given)
    judged = 0
    for seed in range(20):
        direction = random_directions(np.random.default_rng(seed), 500)
        origin = given["centre"].astype(np.float64) - 3 * direction
        for t in exactly(quadric.quadric_intersection, given, origin.astype(np.float32), direction, False):
            met = np.isfinite(t)
            point = point_at(origin.astype(np.float32), direction, t)
            assert ((low <= point) & (point <= high))[met].all()
            judged += met.sum()
    assert judged > 3000
    if "ellipsoid" in name or name == "displaced":
        assert (high - low < 10).all()
    else:
        assert (high >= 1e30).all()


def test_bounds_of_a_sphere_are_tight():
    given = spheres(24)
    low, high = everywhere(quadric.quadric_bounds, given)
    radius = np.sqrt(given["constant"].astype(np.float64))[:, None]
    for bound, sign in ((low, -1), (high, 1)):
        beyond = sign * (bound - given["centre"]) - radius
        assert (beyond >= -EPSILON * np.abs(bound)).all()
        assert (beyond <= 4e-5 * radius + 4 * EPSILON * np.abs(given["centre"])).all()


# --- cones and cylinders ----------------------------------------------------------------------------------------------


def cone_terms(given: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Height above the base, distance from the axis, and the radius there."""
    f = point - given["base"]
    height = dot(f, given["axis"])
    aside = np.linalg.norm(f - height[:, None] * given["axis"], axis=-1)
    return height, aside, given["radius"] + given["slope"].astype(np.float64) * height


def test_crossings_of_cones():
    given, (origin, direction) = cones(25), rays(26)
    everything = everywhere(cone.cone_intersection, given, origin, direction, np.zeros(COUNT, bool))
    judged = 0
    for t, sign in zip(everything, (-1, 1), strict=True):
        met = np.isfinite(t)
        point = point_at(origin, direction, np.where(met, t, 0))
        height, aside, radius = cone_terms(given, point)
        normal, _, attribute, _ = map_module(cone.cone_surface, given, origin, direction, point.astype(np.float32))
        steepness = np.abs(dot(normal, direction))
        fair = met & (steepness > 2e-2) & (aside > 1e-2)
        assert (np.abs(aside - radius) * steepness < 300 * EPSILON * (np.abs(t) + 10))[fair].all()
        assert (height > -1e-5)[fair].all()
        assert (height < given["length"] + 1e-5)[fair].all()
        assert (np.sign(dot(normal, direction)) == sign)[fair].all()
        assert np.abs(np.linalg.norm(normal[fair], axis=-1) - 1).max() < 4 * EPSILON
        np.testing.assert_array_equal(attribute, given["attribute"])
        judged += fair.sum()
    assert judged > 500


def test_rays_that_leave_a_cone_meet_nothing_at_once():
    given, direction = cones(27), rays(28)[1]
    draw = np.random.default_rng(29)
    # Points on the cones.
    height = draw.uniform(0.05, 0.95, COUNT) * given["length"]
    across = np.cross(given["axis"], draw.normal(size=(COUNT, 3)))
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    radius = given["radius"] + given["slope"] * height
    surface = (given["base"] + height[:, None] * given["axis"] + radius[:, None] * across).astype(np.float32)
    enter, leave = everywhere(cone.cone_intersection, given, surface, direction, np.ones(COUNT, bool))
    normal, _, _, _ = map_module(cone.cone_surface, given, surface, direction, surface)
    # Along a straight line in the surface there is no crossing.
    across = np.abs(dot(normal, direction)) > 1e-5
    assert ((enter == 0) | (leave == 0))[across].all()
    hit = everywhere(cone.cone_hit, given, surface, direction, np.ones(COUNT, bool))
    assert (hit > 1e-6)[across].all()


def test_bounds_of_cones_hold_their_points():
    given = cones(30, 999)
    low, high = everywhere(cone.cone_bounds, given)
    draw = np.random.default_rng(31)
    across = np.cross(given["axis"], draw.normal(size=(999, 3)))
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    other = np.cross(given["axis"], across)
    for angle in np.linspace(0, 2 * np.pi, 40):
        outward = np.cos(angle) * across + np.sin(angle) * other
        for share in (0.0, 0.5, 1.0):
            height = share * given["length"].astype(np.float64)
            radius = given["radius"] + given["slope"] * height
            point = given["base"] + height[:, None] * given["axis"] + radius[:, None] * outward
            slack = 20 * EPSILON * (1 + np.abs(point))
            assert ((low - slack <= point) & (point <= high + slack)).all()


# --- all kinds --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("module", "made"),
    [
        (plane.plane_hit, planes),
        (quadric.quadric_hit, spheres),
        (quadric.quadric_hit, lambda seed, count: random_quadrics("hyperboloid of one sheet", seed, count)),
        (cone.cone_hit, cones),
        (triangle.triangle_hit, triangles),
        (quad.quad_hit, quads),
    ],
)
def test_plain_python_gives_the_same_hits(module, made):
    given, (origin, direction) = made(45, 40), rays(46, 40)
    leaving = np.arange(40) % 3 == 0
    plain = map_module(module, given, origin, direction, leaving, machine="python")
    np.testing.assert_array_equal(plain, map_module(module, given, origin, direction, leaving))


def test_this_file_covers_the_kinds():
    from tasuki.scene.kinds import kinds

    assert {kind.name for kind in kinds()} == {"plane", "quadric", "cone", "triangle", "quad"}
