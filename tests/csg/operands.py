"""Solids that share surfaces in every way: pairs of operands, the operations on them, and ways to one place."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from tasuki.scene.solids import (
    Box,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hyperboloid,
    Paraboloid,
    Sphere,
)
from tasuki.scene.tree import Node

UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
CENTRE = (0.0, 0.0, 0.0)
BELOW, ABOVE = HalfSpace(UP, CENTRE), HalfSpace(DOWN, CENTRE)

CUT: Mapping[str, Node] = {
    "box": Box((-1, -1, -1), (1, 1, 0)),
    "sphere": Sphere(CENTRE, 1) & BELOW,
    "cylinder": Cylinder((0, 0, -1), CENTRE, 1),
    "cone": Cone((0, 0, -1.5), 0.25, CENTRE, 1),
    "half-space": BELOW,
    "ellipsoid": Ellipsoid(CENTRE, (1, 1.5, 0.75)) & BELOW,
    "paraboloid": Paraboloid((0, 0, -1), (1, 1)) & BELOW,
    "hyperboloid": Hyperboloid((0, 0, -0.5), (0.75, 0.75, 1)) & BELOW & HalfSpace(DOWN, (0, 0, -1)),
}
"""Every kind, below the plane z = 0 and with a face in it; the rims of most of them are the unit circle."""

WHOLE: Mapping[str, Node] = {
    "box": Box((-1, -1, -1), (1, 1, 0)),
    "sphere": Sphere((0, 0, -1), 1),
    "cylinder": Cylinder((-1, 0, -0.75), (1, 0, -0.75), 0.75),
    "cone": Cone((0, 0, -1.5), 1, CENTRE),
    "half-space": BELOW,
    "ellipsoid": Ellipsoid((0, 0, -0.75), (1, 1.5, 0.75)),
    "paraboloid": Paraboloid(CENTRE, (1, 1)).scale(1, 1, -1),
    "hyperboloid": Hyperboloid((0, 0, 1), (1, 1, 1), sheets=2) & BELOW,
}
"""Every kind, touching the plane z = 0 from below: where it is curved, in a line or a point."""

OPERATIONS: Mapping[str, Callable[[Node, Node], Node]] = {
    "union": lambda a, b: a | b,
    "intersection": lambda a, b: a & b,
    "difference": lambda a, b: a - b,
    "reversed": lambda a, b: b - a,
    "outside": lambda a, b: ~a & ~b,
    "either": lambda a, b: (a - b) | (b - a),
    "again": lambda a, b: (a | b) - a,
    "split": lambda a, b: (a & b) | (a - b),
}
"""Set operations on two operands; in the last three each surface stands more than once."""


def mirrored(node: Node) -> Node:
    """What lies above z = 0 as the node does below."""
    return node.scale(1, 1, -1)


RELATIONS: Mapping[str, Callable[[str, str], tuple[Node, Node]]] = {
    "shared": lambda a, b: (CUT[a], CUT[b]),
    "opposite": lambda a, b: (CUT[a], mirrored(CUT[b])),
    "nested": lambda a, b: (CUT[a], CUT[b].scale(0.5)),
    "touching": lambda a, b: (WHOLE[a], mirrored(WHOLE[b])),
}
"""How the faces of two kinds meet: flush, from both sides, one within the other, and where curved ones touch."""

AXIS = (3.0, -1.0, 2.0)
MISS = 4e-7
"""Surfaces that are off by this are one."""


def directly(node: Node) -> Node:
    """The node, moved and turned by odd angles."""
    return node.rotate("z", 31.0).rotate(AXIS, 47.0).translate(0.3, -0.2, 0.1)


def by_detours(node: Node) -> Node:
    """The same place, reached in other steps, and missed by less than float32 can tell there."""
    turned = node.translate(0.7, 0.1, -0.4).scale(3.0, 3.0, 3.0).translate(-2.1, -0.3, 1.2).scale(1.0 / 3.0)
    back = turned.rotate("x", 77.0).rotate("x", -77.0).rotate("z", 31.0 - 360.0)
    return back.rotate(AXIS, 23.0).rotate(AXIS, 24.0 + 1e-5).translate(0.1, 0.0, 0.3).translate(0.2, -0.2 - MISS, -0.2)
