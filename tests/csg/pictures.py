"""Whole pictures of solids whose colours tell them apart, and the pictures that the oracle expects."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tasuki import render
from tasuki.scene import Camera, Material, Scene
from tasuki.scene.flatten import flatten
from tasuki.scene.tree import Node, Union
from tests.csg.oracle import Oracle
from tests.csg.trees import trees_in

SIDE = 64
"""Pixels along the side of a picture."""
CAMERA = Camera((3.1, -4.3, 2.2), (0.1, 0.0, 0.05), (0.0, 0.0, 1.0), 32.0, (SIDE, SIDE))
FAR = 1e9
SAME = 1e-9
"""Hits on one surface differ by less than this in t."""
BACKGROUND = (0.0, 0.25, 0.5)


def camera_from(number: int) -> Camera:
    """One of many cameras that look at the origin from all sides, spread evenly (golden angle)."""
    height = (2.0 * ((number * 0.618034) % 1.0) - 1.0) * 0.95
    turn, across = 2.39996 * number, 5.7 * (1.0 - height**2) ** 0.5
    eye = (across * math.cos(turn), across * math.sin(turn), 5.7 * height)
    return replace(CAMERA, eye=eye)


def flat_material(number: int) -> Material:
    """A material that shows its own colour only, whatever light there is; another for every number below 512."""
    colour = tuple((1 + (number >> 3 * i) % 8) / 8.0 for i in range(3))
    return Material(f"flat {number}", colour, ambient=1.0, diffuse=0.0)


RED, BLUE = flat_material(7), flat_material(7 << 6)


def coloured(a: Node, b: Node) -> tuple[Node, Node]:
    """The two, red and blue."""
    return replace(a, material=RED), replace(b, material=BLUE)


def scene_of(*nodes: Node, camera: Camera = CAMERA) -> Scene:
    """A scene without lamps."""
    return Scene(camera, nodes, (), BACKGROUND)


def rendered(scene: Scene, **options) -> np.ndarray:
    """The picture's colours, (height, width, 3)."""
    return render(scene, threads=1, **options).pixels[..., :3].copy()


def expected(scene: Scene, size: tuple[int, int] = (SIDE, SIDE)) -> tuple[np.ndarray, np.ndarray]:
    """The picture of flat materials as the oracle has it, and which of its pixels are decided.

    Objects with one hit at one t go by their order, opaque ones all.
    """
    flat = flatten(Scene(scene.camera, [Union((node,)) for node in scene.shapes]))
    origin, direction = eye_rays(scene.camera, size)
    known: list[np.ndarray] = []
    nearest, doubt = np.full(len(origin), FAR), np.zeros(len(origin))
    colour = np.tile(np.array(scene.background), (len(origin), 1))
    decided = np.ones(len(origin), bool)
    for tree in trees_in(flat):
        oracle = Oracle(tree, known)
        known += oracle.surfaces
        hits = oracle.first_hits(origin, direction)
        ahead = nearest - np.minimum(hits.t, FAR)
        # Who comes first is decided where the two are apart, or at one t.
        decided &= hits.decided & ((np.abs(ahead) <= SAME) | (np.abs(ahead) > hits.error + doubt))
        first = ahead > SAME
        own = np.array([flat.materials[leaf.material].colour for leaf in oracle.leaves])
        colour[first] = own[hits.owner[first]]
        nearest, doubt = np.where(first, hits.t, nearest), np.where(first, hits.error, doubt)
    shape = size[::-1]
    return colour.reshape(*shape, 3).astype(np.float32), decided.reshape(shape)


def eye_rays(camera: Camera, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """The rays through the middles of all pixels, row by row, in float64."""
    width, height = size
    frame = camera.frame(width, height)
    y, x = np.mgrid[:height, :width] + 0.5
    direction = frame.corner + x.reshape(-1, 1) * frame.right + y.reshape(-1, 1) * frame.down
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return np.broadcast_to(frame.eye, direction.shape), direction
