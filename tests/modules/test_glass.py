"""Dielectrics: Snell's law, Fresnel's equations, total internal reflection."""

from __future__ import annotations

import numpy as np
import pytest

from tasuki.mapping import map_module
from tasuki.modules.glass import energy_ratio, refraction_direction
from tests.modules.running import EPSILON, dot, everywhere, exactly, random_directions

COUNT = 5000


def arrivals(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directions, normals that face them, and ratios of indices."""
    draw = np.random.default_rng(seed)
    direction, normal = random_directions(draw, COUNT), random_directions(draw, COUNT)
    facing = np.where(dot(direction, normal) > 0, -1, 1)[:, None].astype(np.float32)
    return direction, normal * facing, draw.uniform(0.4, 2.5, COUNT).astype(np.float32)


def test_refraction_obeys_snells_law():
    direction, normal, ratio = arrivals(0)
    bent, possible = everywhere(refraction_direction, direction, normal, ratio)
    bent, direction, normal, ratio = bent[possible], direction[possible], normal[possible], ratio[possible]
    assert len(bent) > COUNT / 3
    assert np.abs(np.linalg.norm(bent, axis=1) - 1).max() < 1e-3
    sine_before = np.linalg.norm(np.cross(direction.astype(float), normal.astype(float)), axis=1)
    sine_behind = np.linalg.norm(np.cross(bent.astype(float), normal.astype(float)), axis=1)
    assert np.abs(sine_behind - ratio * sine_before).max() < 16 * EPSILON
    # Behind the surface, in the plane of incidence.
    assert (dot(bent, normal) <= 16 * EPSILON).all()
    assert np.abs(dot(bent, np.cross(direction, normal))).max() < 32 * EPSILON


def test_there_is_none_where_the_sine_would_be_above_one():
    direction, normal, ratio = arrivals(1)
    _, possible = map_module(refraction_direction, direction, normal, ratio)
    sine = ratio * np.linalg.norm(np.cross(direction.astype(float), normal.astype(float)), axis=1)
    clear = np.abs(sine - 1) > 1e-5
    assert (possible == (sine < 1))[clear].all()


def test_an_index_that_does_not_change_bends_nothing():
    direction, normal, _ = arrivals(2)
    bent, possible = map_module(refraction_direction, direction, normal, 1.0)
    assert possible[dot(direction, normal) < -1e-3].all()
    assert np.abs(bent - direction)[dot(direction, normal) < -0.05].max() < 64 * EPSILON
    reflected, _ = map_module(energy_ratio, direction, normal, 1.0)
    assert reflected[dot(direction, normal) < -0.05].max() < 1e-6


def test_energy_is_neither_made_nor_lost():
    reflected, transmitted = everywhere(energy_ratio, *arrivals(3))
    assert ((reflected >= 0) & (reflected <= 1)).all()
    assert ((transmitted >= 0) & (transmitted <= 1)).all()
    assert (reflected + transmitted == 1).all()


def test_energy_ratio_beside_float64():
    direction, normal, ratio = arrivals(4)
    reflected, _ = map_module(energy_ratio, direction, normal, ratio)
    precise, _ = exactly(energy_ratio, direction, normal, ratio)
    sine = ratio * np.linalg.norm(np.cross(direction.astype(float), normal.astype(float)), axis=1)
    clear = np.abs(sine - 1) > 1e-3
    assert np.abs(reflected - precise)[clear].max() < 1e-4


@pytest.mark.parametrize("index", [1.33, 1.5, 2.4])
def test_energy_ratio_at_known_angles(index):
    normal = np.array([0.0, 0.0, 1.0], np.float32)
    straight = np.array([0.0, 0.0, -1.0], np.float32)
    expected = ((index - 1) / (index + 1)) ** 2
    for ratio in (1 / index, index):
        assert map_module(energy_ratio, straight, normal, ratio)[0][0] == pytest.approx(expected, rel=1e-5)
    # Grazing light is reflected whole; at Brewster's angle light polarised along the plane is not reflected.
    grazing = np.array([1.0, 0.0, 0.0], np.float32)
    assert map_module(energy_ratio, grazing, normal, 1 / index)[0][0] == pytest.approx(1.0, abs=1e-6)
    angle = np.arctan(index)
    brewster = np.array([np.sin(angle), 0.0, -np.cos(angle)], np.float32)
    across = np.cos(2 * angle) ** 2
    assert map_module(energy_ratio, brewster, normal, 1 / index)[0][0] == pytest.approx(across / 2, abs=1e-5)
    assert map_module(energy_ratio, grazing, normal, index)[0][0] == 1.0
