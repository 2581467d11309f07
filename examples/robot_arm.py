"""Three poses of the arm in scenes/robot_arm.yaml side by side: only the matrices of its joints change.

python examples/robot_arm.py poses.png
"""

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

import tasuki
from tasuki.renderers.picture import Picture
from tasuki.scene import Node, Scene, load_scene
from tasuki.scene.transforms import rotate

SCENE = Path(__file__).parent / "scenes/robot_arm.yaml"
AXES = {"waist": "z", "shoulder": "y", "elbow": "y", "wrist": "y", "left finger": "y", "right finger": "y"}
POSES = (
    {},
    {"shoulder": 38, "elbow": 12, "wrist": -18},
    {"waist": 150, "shoulder": -25, "elbow": -10, "wrist": -30, "left finger": -18, "right finger": 18},
)
"""The degrees by which each joint turns from where the scene file has it."""


def posed(node: Node, angles: Mapping[str, float]) -> Node:
    """The node with every joint in it turned: a joint is a node whose name is one of the angles'."""
    node = node.of_inner([posed(child, angles) for child in node.inner])
    if node.name in angles:
        node = replace(node, transform=rotate(AXES[node.name], angles[node.name]).then(node.transform))
    return node


def in_pose(scene: Scene, angles: Mapping[str, float]) -> Scene:
    """The scene with its joints turned."""
    return replace(scene, shapes=[posed(node, angles) for node in scene.shapes])


def poses(size: tuple[int, int], samples: int = 1) -> list[Picture]:
    """A picture, of a size in pixels, for each pose."""
    scene = load_scene(SCENE)
    return [tasuki.render(in_pose(scene, angles), size=size, samples=samples) for angles in POSES]


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python examples/robot_arm.py OUT.png")
    Picture(np.concatenate([np.asarray(picture) for picture in poses((400, 400), samples=9)], axis=1)).save(sys.argv[1])
