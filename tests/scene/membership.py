"""Exact membership in float64: which points lie inside a formula of literals."""

import numpy as np

from tasuki.scene.csg import PLANE
from tests.csg.trees import Branch


def inside(tree, points):
    """Which of `points` (n, 3), in the scene's coordinates, lie inside `tree`, (n,)."""
    if isinstance(tree, Branch):
        operands = [inside(child, points) for child in tree.children]
        joined = (np.logical_or if tree.operation == "union" else np.logical_and).reduce(operands)
        return joined != tree.inverted
    local = (np.append(points, np.ones((len(points), 1)), axis=1) @ np.linalg.inv(tree.matrix).T)[:, :4]
    values = local @ tree.values if tree.kind == PLANE else quadric_value(tree.values, local[:, :3])
    return (values < 0.0) != tree.inverted


def quadric_value(values, points):
    """What is negative inside of a quadric, as `csg.Leaf` has it, at `points` (n, 3): (n,)."""
    v = points - values[3, :3]
    return np.einsum("ni,ij,nj->n", v, values[:3, :3], v) + v @ values[:3, 3] - values[3, 3]


def literals(tree):
    """The leaves of `tree`, in order."""
    return [leaf for child in tree.children for leaf in literals(child)] if isinstance(tree, Branch) else [tree]
