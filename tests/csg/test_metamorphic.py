"""Pictures stay what they are where a scene is only written, or placed, in another way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tasuki.scene import Camera, Material, PointLight, Polygon, Scene
from tasuki.scene.solids import Box, Cone, Cylinder, Ellipsoid, HalfSpace, Quadric, RoundedBox, Sphere, Tube
from tasuki.scene.tree import Difference, Formula, Group, Instance, Intersection, Node, Union
from tests.csg.pictures import SIDE, flat_material, rendered

CAMERA = Camera((4.0, -6.0, 3.5), (0.0, 0.0, 0.4), (0.0, 0.0, 1.0), 36.0, (SIDE, SIDE))
LIGHTS = (PointLight((3.0, -5.0, 6.0)), PointLight((-4.0, -2.0, 5.0), (0.4, 0.3, 0.2)))
FLOOR = Polygon(
    ((-9.0, -9.0, -1.5), (9.0, -9.0, -1.5), (9.0, 9.0, -1.5), (-9.0, 9.0, -1.5)),
    material=Material(colour=(0.8, 0.5, 0.3)),
)
A = Box((-1.2, -1.1, -0.9), (1.0, 1.3, 0.8), material=Material(colour=(0.9, 0.2, 0.1), specular=0.4, exponent=20.0))
B = Sphere((0.5, -0.6, 0.7), 0.9, material=Material(colour=(0.2, 0.4, 0.9), reflection=0.3))
C = Cylinder((-2.0, 0.1, 0.2), (2.0, 0.1, 0.3), 0.5, material=Material(colour=(0.2, 0.8, 0.3)))
D = Cone((0.2, 0.1, -0.7), 0.6, (0.1, 0.0, 2.2), material=Material(colour=(0.9, 0.8, 0.2)))
ABOVE = HalfSpace((0.0, 0.1, -1.0), (0.0, 0.0, 0.1))
WHOLE = ((A - B) | (C & ~D)) & ~(ABOVE & Ellipsoid((0.0, 0.0, 1.0), (2.0, 0.7, 0.9)))

BESIDE = Box((1.0, -1.1, -0.9), (1.6, 1.3, 0.8), material=A.material)
BOTH = Box((-1.2, -1.1, -0.9), (1.6, 1.3, 0.8), material=A.material)
FLUSH = Box((-1.2, 0.0, -0.5), (0.5, 1.3, 0.8), material=A.material)

SAME: dict[str, tuple[Node, Node]] = {
    "operands of a union in another order": (Union((A, B, C, D)), Union((D, B, A, C))),
    "operands of an intersection in another order": (Intersection((A, ~B, ~D)), Intersection((~D, A, ~B))),
    "what is taken away in another order": (Difference((A, B, C, D)), Difference((A, D, C, B))),
    "complemented twice": (WHOLE, ~~WHOLE),
    "De Morgan, of a union": (~(~A & ~B & ~C), A | B | C),
    "De Morgan, of an intersection": (~(~A | B | ~ABOVE), A & ~B & ABOVE),
    "a difference is an intersection": (A - B - C, A & ~B & ~C),
    "a union in parts": ((A | B) | (C | D), Union((A, B, C, D))),
    "boxes that touch, in another order": (A | BESIDE, BESIDE | A),
    "a box in two that touch": (BOTH - B, (A | BESIDE) - B),
    "a box and what is flush within it": (A - C, (A | FLUSH) - C),
    "what touches, taken away": (A, BOTH - BESIDE),
    "taken away and put back": (A | C, (A - FLUSH) | FLUSH | C),
    "what two that touch have in common, added": (A - B, (A - B) | (A & BESIDE)),
    "distributed": (A & (~B | ~C), (A & ~B) | (A & ~C)),
    "absorbed": (A - B, (A - B) | ((A - B) & C)),
    "absorbed by an intersection": (A - B, (A - B) & ((A - B) | C)),
    "nothing added": (WHOLE, WHOLE | (B - B)),
    "all of it kept": (WHOLE, WHOLE & (D | ~D)),
    "as a formula": ((A - B) | (C & D), Formula({"a": A, "b": B, "c": C, "d": D}, "a - b + c * d")),
    "as a Polish formula": ((A - B) | (C & D), Formula({"a": A, "b": B, "c": C, "d": D}, polish="+ - a b * c d")),
    "placed at once": (
        (A - B).translate(0.1, 0.2, 0.3),
        Union((A.translate(0.1, 0.2, 0.3) - B.translate(0.1, 0.2, 0.3),)),
    ),
    "an instance": ((A - B).rotate("z", 30.0), Instance(A - B).rotate("z", 30.0)),
}


def scene_of(*things: Node, camera: Camera = CAMERA, lights=LIGHTS) -> Scene:
    return Scene(camera, things, lights, (0.3, 0.5, 0.7))


@pytest.mark.parametrize("name", SAME)
def test_the_same_solid_in_other_words_makes_the_same_picture(name):
    first, second = (rendered(scene_of(solid, FLOOR)) for solid in SAME[name])
    assert np.ptp(first[..., 0]) > 0.3
    assert np.array_equal(first, second)


def test_things_apart_in_another_order_make_the_same_picture():
    things = [FLOOR, A - B, Tube((2, 1, -1), (2, 1.5, 1), 0.6, 0.4), RoundedBox((-3, 0, -1), (-2, 1, 0), 0.2)]
    forwards, backwards = rendered(scene_of(*things)), rendered(scene_of(*reversed(things)))
    assert np.array_equal(forwards, backwards)
    assert np.array_equal(forwards, rendered(scene_of(Group(children=things[:2]), Group(children=things[2:]))))


def moved(move) -> Scene:
    """The whole scene, camera and lamps included, after `move`, which takes a node."""
    transform = move(A).transform

    def point(place):
        return tuple((transform.matrix @ [*place, 1.0])[:3].tolist())

    up = tuple((transform.matrix[:3, :3] @ CAMERA.up).tolist())
    camera = replace(CAMERA, eye=point(CAMERA.eye), at=point(CAMERA.at), up=up)
    lights = [PointLight(point(light.position), light.colour or (0.35, 0.35, 0.35)) for light in LIGHTS]
    return scene_of(move(Group(children=(WHOLE, FLOOR))), camera=camera, lights=lights)


HOME = moved(lambda node: node)


def test_a_scene_of_another_size_makes_the_same_picture():
    # By a power of two: every number of the way to the picture keeps its bits.
    for size in (2.0, 0.125, 1024.0):
        assert np.array_equal(rendered(HOME), rendered(moved(lambda node, size=size: node.scale(size))))


@pytest.mark.parametrize(
    "move",
    [
        lambda node: node.translate(0.3, -11.0, 5.7),
        lambda node: node.translate(4000.0, 1e5, -3e4),
        lambda node: node.rotate("z", 90.0),
        lambda node: node.rotate((1.0, 2.0, -0.5), 77.0),
        lambda node: node.scale(3.7).rotate("x", -33.0).translate(1.0, 2.0, 3.0),
    ],
)
def test_a_scene_in_another_place_makes_the_same_picture(move):
    differs = np.abs(rendered(moved(move)) - rendered(HOME)).max(axis=2) > 1e-2
    # At edges, also those of shadows and of what mirrors show, a pixel may fall to either side.
    assert differs.mean() < 0.004


def test_a_mirrored_scene_makes_the_mirrored_picture():
    mirrored = rendered(moved(lambda node: node.scale(-1.0, 1.0, 1.0)))[:, ::-1]
    differs = np.abs(mirrored - rendered(HOME)).max(axis=2) > 1e-2
    assert differs.mean() < 0.004


@pytest.mark.parametrize("half", [1e5, 1e7])
def test_small_things_on_large_ground_keep_their_faces(half):
    def picture(half):
        # The things share the plane of the ground; their other faces are near it for a scene of this size.
        ground = Box((-half, -half, -half), (half, half, 0.0), material=flat_material(3))
        plate = Box((-1.0, -1.0, 0.0), (1.0, 1.0, 0.02), material=flat_material(73))
        drilled = Box((-0.5, -0.5, 0.0), (0.5, 0.5, 0.4)) - Cylinder((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), 0.2)
        return rendered(scene_of(ground, plate, replace(drilled, material=flat_material(146)), lights=()))

    assert (picture(half) != picture(100.0)).any(axis=2).mean() < 0.01


def test_a_quadric_without_a_matrix_is_a_half_space():
    nothing = ((0.0, 0.0, 0.0),) * 3
    sloping = Quadric(nothing, centre=(0.0, 0.0, 0.2), linear=(0.0, 0.3, 2.0), constant=0.1, material=A.material)
    plane = HalfSpace((0.0, 0.3, 2.0), (0.0, 0.0, 0.25), material=A.material)
    for first, second in (
        (sloping, plane),
        (A - sloping, A - plane),
        (A & sloping.rotate("x", 20.0), A & plane.rotate("x", 20.0)),
    ):
        differs = np.abs(rendered(scene_of(first)) - rendered(scene_of(second))).max(axis=2) > 1e-3
        assert differs.mean() < 0.004
