"""Whole pictures of solids that share faces: the owner's colour in every pixel that float32 can decide."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
import pytest

from tests.csg.operands import CUT, OPERATIONS, RELATIONS, by_detours, directly
from tests.csg.pictures import camera_from, coloured, expected, rendered, scene_of

PAIRS = list(combinations_with_replacement(CUT, 2))
FEW = 0.03
"""The share of pixels that may be undecided: those that show edges, and where a cylinder touches a box from within."""


def require(scene) -> None:
    """The picture is as expected."""
    picture, (owners, decided) = rendered(scene), expected(scene)
    assert np.array_equal(picture[decided], owners[decided])
    assert decided.mean() > 1.0 - FEW


@pytest.mark.parametrize("relation", RELATIONS)
@pytest.mark.parametrize("first", CUT)
def test_every_pixel_shows_its_owner(relation, first):
    for pair in (pair for pair in PAIRS if pair[0] == first):
        a, b = coloured(*RELATIONS[relation](*pair))
        # Every operation comes in turn, and every picture is taken from another side.
        number = PAIRS.index(pair) + list(RELATIONS).index(relation)
        operation = list(OPERATIONS.values())[number % len(OPERATIONS)]
        require(scene_of(operation(directly(a), by_detours(b)), camera=camera_from(number)))


@pytest.mark.parametrize("relation", RELATIONS)
@pytest.mark.parametrize("first", CUT)
def test_of_two_things_in_one_place_the_first_shows(relation, first):
    for pair in (pair for pair in PAIRS if pair[0] == first):
        a, b = coloured(*RELATIONS[relation](*pair))
        require(scene_of(directly(a), by_detours(b), camera=camera_from(PAIRS.index(pair))))
