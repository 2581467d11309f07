"""Objects as triangles: literals as manifolds of stated tolerance, set operations by manifold3d (extra "meshes").

A literal with two curved axes of one sign is a solid of revolution under an affine map: an ellipsoid, cylinder, cone,
hyperboloid or paraboloid. What is bounded only outside (the complement of a drill) is made as what it leaves out, and
subtracted. Each literal keeps its name through all operations, so that every triangle knows its surface.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from tasuki.diagnostics import Diagnostic, SceneError, Span
from tasuki.scene.bounds import is_bounded
from tasuki.scene.csg import PLANE, QUADRIC, Literal, negated
from tasuki.scene.formula import Part
from tasuki.scene.surfaces import completed

LEAST_SEGMENTS, MOST_SEGMENTS = 16, 1024
"""Around a circle."""
FLAT = 1e-9
"""Eigenvalues below this share of the largest are zero but for rounding."""
MARGIN = 0.1
"""By how much of its size the box is widened within which an object's unbounded literals are made."""


@dataclass
class SolidMesh:
    """Triangles of one literal's surface: corners (n, 3, 3), and normals there, (n, 3, 3), zero on a plane."""

    literal: Literal
    corners: np.ndarray
    normals: np.ndarray


@dataclass
class Tessellator:
    """Makes a solid to `tolerance`, the largest distance of a chord from its surface, in the scene's unit.

    `surface_of` gives the surface of a plane or quadric in the scene: coefficients as in `csg.Literals`, its sign left
    out; `place_of` where the solid of a literal stands in its file.
    """

    tolerance: float
    surface_of: Callable[[Literal], np.ndarray]
    place_of: Callable[[Literal], Span | None]
    literals: dict[int, Literal] = field(default_factory=dict)

    def meshes(self, root: Part, box: np.ndarray, place: Span | None) -> list[SolidMesh]:
        """The surface of an object around which there is `box`; SceneError where that has no bounds."""
        if not is_bounded(box):
            hint = "cut it with a box, or draw it by ray tracing"
            message = "this object has no bounds, so it cannot be made of triangles"
            raise SceneError(str(Diagnostic(message, place, "a bounded object", "one without bounds", hint)))
        manifold, outside = self._solid(root, _widened(box))
        assert not outside, "the complement of what is bounded is not"
        return self._split(manifold.to_mesh64())

    # --- set operations -----------------------------------------------------------------------------------------------

    def _solid(self, root: Part, box: np.ndarray) -> tuple[Any, bool]:
        """A part within the box as a manifold, and whether that is what the part leaves out. Without recursion."""
        made: dict[int, tuple[Any, bool]] = {}
        waiting = [(root, False)]
        while waiting:
            part, ready = waiting.pop()
            if part.leaf:
                made[id(part)] = self._literal(part.leaf, box)
            elif not ready:
                waiting += [(part, True), *((one, False) for one in part.parts)]
            else:
                made[id(part)] = _joined([made.pop(id(one)) for one in part.parts], is_union=part.is_union)
        return made[id(root)]

    def _literal(self, literal: Literal, box: np.ndarray) -> tuple[Any, bool]:
        if literal.kind not in (PLANE, QUADRIC):
            message = f"a {literal.kind} cannot be made of triangles"
            raise SceneError(str(Diagnostic(message, self.place_of(literal), "planes and quadrics", literal.kind)))
        surface = self.surface_of(literal)
        if literal.kind == PLANE:
            manifold, outside = _half_space(-surface if literal.inverted else surface, box), False
        else:
            manifold, outside = self._quadric(surface, box, literal)
            outside = outside != literal.inverted
        named = manifold.as_original()
        self.literals[named.original_id()] = literal
        return named, outside

    def _quadric(self, surface: np.ndarray, box: np.ndarray, literal: Literal) -> tuple[Any, bool]:
        """The inside of a quadric, as far as the box reaches; or, second, what it leaves out."""
        values, axes = np.linalg.eigh(surface[:3, :3])
        values[np.abs(values) < FLAT * np.abs(values).max()] = 0.0
        if (values < 0.0).sum() > 1:
            manifold, outside = self._quadric(negated(surface, QUADRIC), box, literal)
            return manifold, not outside
        if (values > 0.0).sum() < 2:
            expected = "an ellipsoid, cylinder, cone, hyperboloid or paraboloid"
            message = "a quadric of this sort cannot be made of triangles"
            place = self.place_of(literal)
            raise SceneError(str(Diagnostic(message, place, expected, f"eigenvalues {values}")))
        # eigh sorts: the two that are positive and nearest come last, what is left is the axis.
        values, axes = values[[2, 1, 0]], axes[:, [2, 1, 0]]
        middle = box.reshape(2, 3).mean(axis=0)
        [centre], [linear], [constant] = completed(surface[None], middle)
        slope = float(linear @ axes[:, 2])
        reach = (_corners(box) - centre) @ axes[:, 2]
        profile = self._profile(float(constant), float(values[2]), slope, (reach.min(), reach.max()), values[:2])
        matrix = np.column_stack([axes[:, 0] / np.sqrt(values[0]), axes[:, 1] / np.sqrt(values[1]), axes[:, 2], centre])
        return _revolved(profile, self._segments(profile, values[:2])).transform(matrix), False

    def _profile(
        self, constant: float, curve: float, slope: float, reach: tuple[float, float], values: np.ndarray
    ) -> list[np.ndarray]:
        """Outlines (radius, height) of the solid of revolution radius^2 < constant - slope z - curve z^2."""

        def square(z: Any) -> Any:
            return constant - slope * z - curve * z * z

        roots = _real_roots(-curve, -slope, constant)
        ends = [reach[0], *(z for z in roots if reach[0] < z < reach[1]), reach[1]]
        outlines = []
        for low, high in pairwise(ends):
            middle = (low + high) / 2.0
            if square(middle) <= 0.0:
                continue
            straight = slope == 0.0 and (curve == 0.0 or constant == 0.0)
            widest = np.sqrt(max(map(square, (low, middle, high))))
            steps = 1 if straight else self._arcs(widest / np.sqrt(values.min()), high - low)
            heights = (low + high) / 2.0 - (high - low) / 2.0 * np.cos(np.linspace(0.0, np.pi, steps + 1))
            squares = np.maximum(square(heights), 0.0)
            squares[0] = 0.0 if low in roots else squares[0]
            squares[-1] = 0.0 if high in roots else squares[-1]
            outline = np.column_stack([np.sqrt(squares), heights])
            outlines.append(np.concatenate([[[0.0, heights[0]]], outline, [[0.0, heights[-1]]]]))
        return outlines

    def _arcs(self, radius: float, length: float) -> int:
        return max(segments_of(radius, self.tolerance), segments_of(length, self.tolerance)) // 2

    def _segments(self, profile: Sequence[np.ndarray], values: np.ndarray) -> int:
        widest = max((outline[:, 0].max() for outline in profile), default=1.0)
        return segments_of(widest / np.sqrt(values.min()), self.tolerance)

    # --- out of manifold's hands --------------------------------------------------------------------------------------

    def _split(self, mesh: Any) -> list[SolidMesh]:
        """The triangles of each literal."""
        positions = np.asarray(mesh.vert_properties)[:, :3]
        triangles = np.asarray(mesh.tri_verts).astype(np.int64)
        found = []
        for run, name in enumerate(mesh.run_original_id):
            mine = triangles[mesh.run_index[run] // 3 : mesh.run_index[run + 1] // 3]
            literal = self.literals[int(name)]
            corners = positions[mine]
            found.append(SolidMesh(literal, corners, self._normals(literal, corners)))
        return [one for one in found if len(one.corners)]

    def _normals(self, literal: Literal, corners: np.ndarray) -> np.ndarray:
        """The gradient of a quadric, turned to the side to which the triangles face; zero on a plane."""
        if literal.kind == PLANE:
            return np.zeros_like(corners)
        surface = self.surface_of(literal)
        gradients = (corners - surface[3, :3]) @ surface[:3, :3] + surface[:3, 3] / 2.0
        face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        turned = np.einsum("nij,nj->n", gradients, face) < 0.0
        gradients[turned] *= -1.0
        lengths = np.linalg.norm(gradients, axis=2, keepdims=True)
        return np.divide(gradients, lengths, out=np.zeros_like(gradients), where=lengths > 0.0)


def _joined(operands: Sequence[tuple[Any, bool]], *, is_union: bool) -> tuple[Any, bool]:
    """Solids, each with whether it stands for what it leaves out, as one."""
    import manifold3d as m

    inside = [manifold for manifold, outside in operands if not outside]
    outside = [manifold for manifold, left_out in operands if left_out]
    add, intersect = m.OpType.Add, m.OpType.Intersect
    if is_union and outside:
        # A union with complements leaves out what all of them do, but for the others.
        left_out = m.Manifold.batch_boolean(outside, intersect)
        return (left_out - m.Manifold.batch_boolean(inside, add) if inside else left_out), True
    if is_union:
        return m.Manifold.batch_boolean(inside, add), False
    if not inside:
        return m.Manifold.batch_boolean(outside, add), True
    common = m.Manifold.batch_boolean(inside, intersect)
    return (common - m.Manifold.batch_boolean(outside, add) if outside else common), False


def _half_space(plane: np.ndarray, box: np.ndarray) -> Any:
    """What of a box lies in n . P + d < 0."""
    import manifold3d as m

    corners = _corners(box)
    heights = corners @ plane[:3] + plane[3]
    kept = [corners[heights <= 0.0]]
    for a in range(8):
        for axis in (1, 2, 4):
            b = a | axis
            if a != b and heights[a] * heights[b] < 0.0:
                share = heights[a] / (heights[a] - heights[b])
                kept.append((corners[a] + share * (corners[b] - corners[a]))[None])
    points = np.concatenate(kept)
    return m.Manifold.hull_points(points) if len(points) > 3 else m.Manifold()


def _revolved(profile: Sequence[np.ndarray], segments: int) -> Any:
    import manifold3d as m

    return m.CrossSection([*profile]).revolve(segments) if profile else m.Manifold()


def segments_of(radius: float, tolerance: float) -> int:
    """Around a circle, so that no chord is farther than `tolerance` from it; a multiple of four."""
    angle = np.arccos(max(1.0 - tolerance / max(radius, 1e-300), 0.0))
    return int(np.clip(-(-np.pi / max(angle, 1e-9) // 4) * 4, LEAST_SEGMENTS, MOST_SEGMENTS))


def _real_roots(a: float, b: float, c: float) -> list[float]:
    """Where a z^2 + b z + c is zero, in order."""
    roots = np.roots([a, b, c]) if a or b else np.zeros(0)
    return sorted(float(root.real) for root in roots if abs(root.imag) <= 1e-9 * (1.0 + abs(root.real)))


def _widened(box: np.ndarray) -> np.ndarray:
    margin = MARGIN * (box[3:] - box[:3]).max()
    return np.concatenate([box[:3] - margin, box[3:] + margin])


def _corners(box: np.ndarray) -> np.ndarray:
    """The eight corners (8, 3): number n has the higher x, y, z where bits 0, 1, 2 of n are set."""
    ends = box.reshape(2, 3)
    return np.array([[ends[n >> axis & 1, axis] for axis in range(3)] for n in range(8)])
