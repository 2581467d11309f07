"""Solids far away from the origin, for their size: their equations lose nothing on the way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tasuki.scene import Camera, Scene
from tasuki.scene.pack import pack
from tasuki.scene.solids import Cone, Cylinder, Ellipsoid, Hyperboloid, Paraboloid, Quadric, RoundedBox, Sphere, Tube
from tasuki.scene.tree import Node, Union
from tests.csg.pictures import BACKGROUND, RED, SIDE, rendered

CAMERA = Camera((3.0, -5.0, 4.0), (0.1, 0.2, 0.3), (0.0, 0.0, 1.0), 40.0, (SIDE, SIDE))
BALL = Sphere((0.0, 0.0, 0.0), 1.6)
SOLIDS = {
    "sphere": BALL & Sphere((0.5, 0.0, 0.0), 1.5),
    "ellipsoid": Ellipsoid((0.1, 0.0, 0.2), (1.2, 0.5, 0.9)),
    "cylinder": Cylinder((-0.5, -0.4, -0.7), (0.5, 0.6, 0.9), 0.5),
    "cone": Cone((-0.5, -0.4, -0.7), 0.8, (0.5, 0.6, 0.9), 0.2),
    "tube": Tube((0, 0, -1), (0.2, 0, 1), 0.8, 0.6),
    "hyperboloid": Hyperboloid((0, 0, 0), (0.4, 0.5, 0.6)) & BALL,
    "paraboloid": Paraboloid((0, 0, -1), (0.7, 0.8)) & BALL,
    "rounded box": RoundedBox((-1, -1, -0.5), (1, 0.8, 0.6), 0.2),
    "quadric": Quadric(((1, 0.2, 0), (0.2, 2, 0.1), (0, 0.1, 3)), (0.1, 0, 0), (0.3, -0.2, 0.5), 1.0),
}


def seen(solid: Node, away: np.ndarray) -> np.ndarray:
    """Which pixels show a solid, the camera moved with it."""
    camera = replace(CAMERA, eye=tuple(np.add(CAMERA.eye, away)), at=tuple(np.add(CAMERA.at, away)))
    return rendered(Scene(camera, [Union((solid,), material=RED)], (), BACKGROUND))[..., 0] > 0.0


@pytest.mark.parametrize("distance", [1e6, 1e8])
@pytest.mark.parametrize("name", SOLIDS)
def test_a_solid_that_is_moved_far_away_looks_as_it_did(name, distance):
    away = np.array([3.0, -2.0, 1.0]) * distance
    here, there = seen(SOLIDS[name], np.zeros(3)), seen(SOLIDS[name].translate(*away), away)
    assert 0.02 < here.mean() < 0.9
    assert (here != there).sum() <= 2


@pytest.mark.parametrize("distance", [1e6, 1e8])
def test_a_solid_may_itself_be_given_far_away(distance):
    away = np.array([3.0, -2.0, 1.0]) * distance
    for solid in (BALL, SOLIDS["ellipsoid"], SOLIDS["quadric"]):
        moved = replace(solid, centre=tuple(np.add(solid.centre, away)))
        assert (seen(solid, np.zeros(3)) != seen(moved, away)).sum() <= 2
    tube = SOLIDS["tube"]
    moved = replace(tube, base=tuple(np.add(tube.base, away)), apex=tuple(np.add(tube.apex, away)))
    assert (seen(tube, np.zeros(3)) != seen(moved, away)).sum() <= 2


def test_matrices_may_lead_far_away_and_back():
    there = (4e7, -2e7, 3e7)
    back = tuple(-one for one in there)
    for solid in SOLIDS.values():
        moved = Union((solid.translate(*there),)).rotate("z", 90.0).rotate("z", -90.0).translate(*back)
        assert (seen(solid, np.zeros(3)) != seen(moved, np.zeros(3))).sum() <= 2


@pytest.mark.parametrize("name", SOLIDS)
def test_surfaces_that_coincide_far_away_are_one(name):
    solid, there = SOLIDS[name], (4e7, -2e7, 3e7)
    detour = Union((solid.rotate("x", 33.0).translate(1e3, 0, 0),)).translate(-1e3, 0, 0).rotate("x", -33.0)
    alone, both = (pack(Scene(CAMERA, [Union(one).translate(*there)])) for one in ((solid,), (solid, detour)))
    for table in alone.objects.tables.keys() & {"planes", "quadrics"}:
        assert len(both.objects.tables[table]) == len(alone.objects.tables[table])
