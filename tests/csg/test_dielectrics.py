"""Glass: solids that lie within one another, and solids that touch, refract as the media on both sides ask."""

from __future__ import annotations

import numpy as np
import pytest

from tasuki.language import i32, module, select, vec3
from tasuki.mapping import map_module
from tasuki.modules.light_paths import Ray, fork_of
from tasuki.modules.search import NOTHING
from tasuki.renderers.options import RenderOptions
from tasuki.renderers.raytrace import RayTracer
from tasuki.scene import Camera, Material, Scene
from tasuki.scene.solids import Box, Cylinder, Ellipsoid, HalfSpace, Slab, Sphere
from tasuki.scene.tree import Difference, Intersection, Node, Union
from tests.csg.pictures import SIDE, flat_material, rendered
from tests.csg.rays import from_all_sides, towards

CAMERA = Camera((1.0, -6.0, 2.5), (0.0, 0.0, 0.1), (0.0, 0.0, 1.0), 34.0, (SIDE, SIDE))
BACKGROUND = (0.25, 0.5, 0.75)


def clear(index: float, **fields) -> Material:
    """A medium that shows nothing of its own."""
    return Material(f"index {index}", diffuse=0.0, ambient=0.0, transmission=1.0, index=index, **fields)


GLASS, WATER, AIR, DENSE = clear(1.5), clear(1.33), clear(1.0), clear(1.8)
TINTED = clear(1.5, transmittance=(0.3, 0.6, 0.9))
# Shadow rays do not pass through glass: things behind it show by ambient light alone.
STRIPES = [
    Box((-4.0, 1.6 + 0.4 * n, -1.5), (4.0, 2.0 + 0.4 * n, -1.4 + 0.3 * n), material=flat_material(73 * n % 512))
    for n in range(8)
]


def picture(*things: Node, camera: Camera = CAMERA, depth: int = 20) -> np.ndarray:
    return rendered(Scene(camera, (*things, *STRIPES), (), BACKGROUND), depth=depth)


def require_same(first: np.ndarray, second: np.ndarray, share: float = 0.01) -> None:
    """All pixels are the same but for that share of them, at edges, where a ray may pass on either side."""
    assert np.ptp(first[..., 0]) > 0.3
    differs = np.abs(first - second).max(axis=2) > 2e-3
    assert differs.mean() < share


BALL = Sphere((0.1, -0.1, 0.2), 0.7)
BASIN = Box((-1.2, -1.1, -0.9), (1.2, 1.1, 1.2))


def of(solid: Node, material: Material) -> Node:
    """A solid of a material, as a thing of its own."""
    return Union((solid,), material=material)


def test_a_ball_in_a_basin_and_a_basin_carved_for_it_look_alike():
    nested = picture(of(BALL, GLASS), of(BASIN, WATER))
    require_same(nested, picture(of(BASIN - BALL, WATER), of(BALL, GLASS)))
    require_same(nested, picture(of(BALL, GLASS), of(BASIN - BALL, WATER)))
    assert np.abs(nested - picture(of(BASIN, WATER))).max(axis=2).mean() > 0.02


def test_a_ball_that_stands_alone_is_a_medium_too():
    # Without a set operation it is a primitive of its own, searched in another way.
    nested = picture(Sphere(BALL.centre, BALL.radius, material=GLASS), of(BASIN, WATER))
    require_same(nested, picture(of(BALL, GLASS), of(BASIN, WATER)))


def test_where_media_overlap_the_first_rules():
    # What lies within the first is not there.
    require_same(picture(of(BASIN, WATER), of(BALL, GLASS)), picture(of(BASIN, WATER)))
    half = Sphere((0.0, 0.0, 1.2), 0.7)
    require_same(picture(of(BASIN, WATER), of(half, GLASS)), picture(of(BASIN, WATER), of(half - BASIN, GLASS)))


def test_a_hollow_ball_holds_air():
    outer, inner = Sphere((0.0, 0.0, 0.0), 1.2), Sphere((0.0, 0.0, 0.0), 1.0)
    require_same(picture(of(outer - inner, GLASS)), picture(of(inner, AIR), of(outer, GLASS)))


@pytest.mark.parametrize(
    ("whole", "cut"),
    [
        (Sphere((0.0, 0.0, 0.1), 1.0), HalfSpace((1.0, 0.3, 0.2), (0.1, 0.0, 0.0))),
        (BASIN, HalfSpace((1.0, 1.0, -0.5), (0.0, 0.0, 0.0))),
        (Ellipsoid((0.0, 0.0, 0.0), (1.0, 0.7, 1.2)), Cylinder((0, 0, -2), (0, 0, 2), 0.4)),
    ],
)
@pytest.mark.parametrize("material", [GLASS, TINTED])
def test_halves_that_touch_are_one(whole, cut, material):
    halves = of(Intersection((whole, cut)), material), of(Difference((whole, cut)), material)
    require_same(picture(of(whole, material)), picture(*halves), 0.015)
    require_same(picture(of(whole, material)), picture(of((whole & cut) | (whole - cut), material)))


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("ground", [Box((-1, -1, -1), (1, 1, 0)), HalfSpace((0, 0, 1), (0, 0, 0))])
def test_glass_that_stands_on_something_shows_its_face(first, ground):
    table = of(ground, flat_material(200))
    things = (of(Box((-1, -1, 0), (1, 1, 0.5)), AIR), table)
    require_same(picture(table), picture(*(things if first else things[::-1])))


def test_what_lies_under_glass_is_dimmed_by_fresnels_share():
    straight_down = Camera((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.01, (1, 1))
    table = of(Box((-1, -1, -1), (1, 1, 0)), flat_material(511))
    plate = of(Box((-1, -1, 0), (1, 1, 0.5)), GLASS)
    seen = picture(plate, table, camera=straight_down, depth=3)[0, 0]
    assert seen == pytest.approx(0.96 + 0.04 * np.array(BACKGROUND), abs=1e-5)


def test_in_a_furnace_nothing_of_glass_is_seen():
    # Light of 1 from everywhere: whatever media do to it, 1 comes out, less what the last rays carried.
    lens = Sphere((0.0, -0.6, 0.3), 1.0) & Sphere((0.0, 0.6, 0.3), 1.0)
    bubble = Sphere((0.9, 0.9, 0.9), 0.5)
    things = (of(lens, GLASS), of(BASIN - bubble, WATER), of(bubble, DENSE))
    short, long = (rendered(Scene(CAMERA, things, (), (1.0, 1.0, 1.0)), depth=depth) for depth in (6, 12))
    assert long.max() <= 1.0 + 1e-5
    assert (long >= short - 1e-5).all()
    assert short.mean() < long.mean()
    assert long.mean() > 0.97


# --- rays -------------------------------------------------------------------------------------------------------------


@module
def refracted(origin: vec3, direction: vec3, left: i32) -> tuple[bool, vec3, vec3, vec3, i32, vec3, vec3]:
    """Whether a ray meets something, and the normal there and the ray that is refracted: origin, direction, surface
    left; the shares that are mirrored and refracted.
    """
    fork = fork_of(Ray(origin, direction, vec3(1.0), left, False), vec3(0.0))
    onwards = fork.refracted
    mirrored = select(fork.mirrored.rests, vec3(0.0), fork.mirrored.weight)
    through = select(onwards.rests, vec3(0.0), onwards.weight)
    normal = fork.mirrored.direction - direction
    return fork.met != 0, normal, onwards.origin, onwards.direction, onwards.left, mirrored, through


class Tables:
    """A scene made ready, whose rays can be followed one crossing at a time."""

    def __init__(self, *things: Node) -> None:
        tracer = RayTracer(Scene(CAMERA, things, (), BACKGROUND), RenderOptions(SIDE, SIDE))
        memory = tracer.prepared.memory
        self.fillers = tracer.prepared.fillers()
        self.tables = {name: memory.table(name) for name in memory.tables}

    def refracted(self, origin: np.ndarray, direction: np.ndarray, left) -> list[np.ndarray]:
        return map_module(refracted, origin, direction, left, fill=self.fillers, tables=self.tables)


def sine(direction: np.ndarray, axis: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.cross(direction.astype(np.float64), axis), axis=-1)


@pytest.mark.parametrize("reversed_", [False, True])
def test_layers_that_touch_refract_once_at_each_shared_face(reversed_):
    # Slabs of different media on one another, in a scene turned by odd angles.
    media = [(GLASS, 1.5), (WATER, 1.33), (DENSE, 1.8)]
    layers = [
        of(Slab((0, 0, 1), (0, 0, 0.25 + 0.5 * n), 0.5), material).rotate((1, 2, 3), 40.0)
        for n, (material, _) in enumerate(media)
    ]
    here = Tables(*(layers[::-1] if reversed_ else layers))
    axis = layers[0].transform.matrix[:3, 2]
    draw = np.random.default_rng(4)
    across = layers[0].transform.matrix[:3, :2] @ draw.uniform(-2.0, 2.0, (2, 200))
    origin, direction = towards(across.T - 3.0 * axis, draw.uniform(-0.5, 0.5, (200, 3)))
    start, way, left = origin, direction, np.full(200, NOTHING, np.int32)
    for index in (*(index for _, index in media), 1.0):
        met, normal, start, way, left, mirrored, through = here.refracted(start, way, left)
        assert met.all()
        assert sine(normal, axis) == pytest.approx(0.0, abs=1e-5)
        assert index * sine(way, axis) == pytest.approx(sine(direction, axis), abs=1e-5)
        assert (mirrored + through)[:, 0] == pytest.approx(1.0, abs=1e-6)
    assert way == pytest.approx(direction, abs=1e-5)
    assert not here.refracted(start, way, left)[0].any()


def test_beyond_the_critical_angle_nothing_goes_through():
    # From glass into water through a face that they share: only that ratio of indices counts.
    here = Tables(of(Box((-2, -2, -1), (2, 2, 0)), GLASS), of(Box((-2, -2, 0), (2, 2, 1)), WATER))
    angles = np.linspace(0.1, 1.5, 100)
    direction = np.column_stack([np.sin(angles), np.zeros(100), np.cos(angles)]).astype(np.float32)
    origin = np.column_stack([-0.01 * np.tan(angles), np.zeros(100), np.full(100, -0.01)]).astype(np.float32)
    met, _, _, way, _, mirrored, through = here.refracted(origin, direction, NOTHING)
    assert met.all()
    total = np.sin(angles) > 1.33 / 1.5
    assert 10 < total.sum() < 90
    assert (mirrored[total] == 1.0).all()
    assert (through[total] == 0.0).all()
    assert (through[~total] > 0.0).all()
    assert (mirrored + through) == pytest.approx(np.ones((100, 3)), abs=1e-6)
    assert 1.33 * way[~total, 0] == pytest.approx(1.5 * np.sin(angles)[~total], abs=1e-5)


def test_shares_add_up_to_one_everywhere():
    here = Tables(of(BALL, GLASS), of(BASIN, WATER), of(Sphere((1.2, 0, 0), 0.6), DENSE))
    start, way = from_all_sides(np.random.default_rng(6), 2000)
    left = np.full(2000, NOTHING, np.int32)
    for _ in range(4):
        met, _, start, way, left, mirrored, through = here.refracted(start, way, left)
        assert ((mirrored >= 0.0) & (mirrored <= 1.0) & (through >= 0.0) & (through <= 1.0)).all()
        assert (mirrored + through)[met] == pytest.approx(np.ones((met.sum(), 3)), abs=1e-6)
        goes_on = through[:, 0] > 0.0
        start, way, left = start[goes_on], way[goes_on], left[goes_on]
        assert len(start) > 200
        assert np.linalg.norm(way, axis=1) == pytest.approx(1.0, abs=1e-5)


def test_of_plain_spheres_in_one_place_the_opaque_one_shows():
    glass, paint = (Sphere(BALL.centre, BALL.radius, material=material) for material in (GLASS, flat_material(300)))
    alone = picture(paint)
    assert np.array_equal(picture(glass, paint), alone)
    assert np.array_equal(picture(paint, glass), alone)
