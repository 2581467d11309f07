"""Solids much thinner than they are long: their own faces are never one surface, and what may not show is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tasuki.scene import Camera, Scene
from tasuki.scene.pack import Packed, pack
from tasuki.scene.solids import Box, Cylinder, RoundedBox, Slab, Tube, Wedge
from tasuki.scene.tree import Group, Node, Union
from tests.csg.pictures import BACKGROUND, RED, SIDE, rendered

NEAR = Camera((1.0, -3.0, 2.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 40.0, (SIDE, SIDE))


def packed(*things: Node) -> Packed:
    return pack(Scene(NEAR, [Union((one,)) for one in things]))


def seen(solid: Node) -> np.ndarray:
    """Which pixels show the solid."""
    return rendered(Scene(NEAR, [Union((solid,), material=RED)], (), BACKGROUND))[..., 0] > 0.0


def beam(length: float) -> Node:
    return Box((-length, -0.5, -0.05), (length, 0.5, 0.05))


def turned(solid: Node) -> Node:
    return solid.rotate("z", 37.0).rotate((1.0, 0.3, 0.0), 20.0)


@pytest.mark.parametrize("placed", [Union, lambda solids: turned(solids[0])])
def test_from_near_by_a_beam_is_a_beam_however_long(placed):
    short, long = (seen(placed((beam(length),))) for length in (1e3, 1e7))
    assert 0.1 < short.mean() < 0.9
    # Far away the ends of the shorter one may be seen.
    assert (short != long).mean() < 0.01


@pytest.mark.parametrize(
    ("solid", "planes", "quadrics"),
    [
        (beam(1e7), 6, 0),
        (turned(beam(1e7)), 6, 0),
        (Slab((0, 0, 1), (0, 0, 0), 1e-8), 2, 0),
        (Tube((0, 0, -1), (0, 0, 1), 1.0, 1.0 - 1e-8), 2, 2),
        (Wedge((0, 0, 0), (1, 1, 1e-8)), 5, 0),
        (Box((0, 0, 0), (1, 1, 1)).scale(1, 1, 1e-8), 6, 0),
    ],
)
def test_faces_of_one_solid_are_never_one_surface(solid, planes, quadrics):
    found = packed(solid)
    tables = found.objects.tables
    assert (len(tables["planes"]), len(tables.get("quadrics", ()))) == (planes, quadrics)
    [warning] = found.scene.warnings
    assert warning.startswith("shapes[0]: warning: a solid of this object is thinner than a millionth of its size")


def test_faces_of_thin_solids_that_touch_are_one_surface():
    lower = beam(1e7)
    upper = replace(lower, low=(-1e7, -0.5, 0.05), high=(1e7, 0.5, 0.15))
    turn = Group((lower, upper)).rotate((1, 2, 3), 30.0)
    # Six faces of each, five of them shared.
    assert len(pack(Scene(NEAR, [lower, upper])).objects.tables["planes"]) == 7
    assert len(pack(Scene(NEAR, [turn])).objects.tables["planes"]) == 7


def test_no_solid_of_usual_shape_is_called_thin():
    draw = np.random.default_rng(0)
    solids = [
        RoundedBox((0, 0, 0), (3, 2, 1), 0.2),
        Tube((0, 0, 0), (1, 2, 3), 1.0, 0.7),
        Wedge((0, 0, 0), (1, 2, 3)),
        Cylinder((0, 0, 0), (1, 2, 3), 1.0),
        Box((0, 0, 0), (1, 2, 3)),
    ]
    for number in range(60):
        size = 10.0 ** draw.uniform(-5.0, 5.0)
        away = draw.normal(size=3) * size * 10.0 ** draw.uniform(-2.0, 5.0)
        stretched = solids[number % 5].rotate(draw.normal(size=3), 40.0).scale(*10.0 ** draw.uniform(-2.0, 2.0, 3))
        placed = stretched.rotate(draw.normal(size=3), 33.0).scale(size).translate(*away)
        camera = replace(NEAR, eye=tuple(away), at=tuple(away + size))
        assert not pack(Scene(camera, [placed])).scene.warnings
