"""Rays for tests of solids about the origin, float32 as the modules take them."""

from __future__ import annotations

import numpy as np

FAR = 7.0
"""From how far away rays come that begin outside."""
REACH = 1.6
"""How far from the origin they aim."""

Rays = tuple[np.ndarray, np.ndarray]


def towards(origin: np.ndarray, target: np.ndarray) -> Rays:
    """Rays from points to points."""
    origin = origin.astype(np.float32)
    way = target - origin
    return origin, (way / np.linalg.norm(way, axis=1, keepdims=True)).astype(np.float32)


def from_all_sides(draw: np.random.Generator, count: int, reach: float = REACH) -> Rays:
    """Rays from a sphere around, aimed at what is within `reach`; every fourth begins there."""
    origin = draw.normal(size=(count, 3))
    origin *= (FAR + reach) / np.linalg.norm(origin, axis=1, keepdims=True)
    origin[::4] = draw.uniform(-reach, reach, (len(origin[::4]), 3))
    return towards(origin, draw.uniform(-reach, reach, (count, 3)))


def in_the_plane(draw: np.random.Generator, count: int) -> Rays:
    """Rays that lie in z = 0."""
    turn = draw.uniform(0.0, 2.0 * np.pi, count)
    origin = FAR * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(count)])
    return towards(origin, np.column_stack([draw.uniform(-REACH, REACH, (count, 2)), np.zeros(count)]))


def along_edges(draw: np.random.Generator, count: int) -> Rays:
    """Rays along lines x or y = -1, -1/2, 0, 1/2, 1 in z = 0, both ways, from outside and inside."""
    lines = np.zeros((2, count, 3))
    along = draw.integers(0, 2, count)
    rows = np.arange(count)
    lines[:, rows, 1 - along] = draw.integers(-2, 3, count) / 2.0
    lines[0, rows, along] = draw.uniform(-4.0, 4.0, count)
    lines[1, rows, along] = draw.choice([-5.0, 5.0], count)
    return towards(*lines)
