"""Set operations by interval algebra along rays, in float64: what the modules' answers are held to.

Every surface of a formula splits a ray into intervals in which each literal is IN or OUT all the way. The formula's
value is worked out in every interval; a hit is a crossing where it changes, and its owner is found from the definition:
from the root, always into the first operand whose own value changes. Surfaces that coincide are one surface here, by a
comparison of their coefficients. Answers that errors of float32 could change are marked as not decided.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tasuki.scene.csg import PLANE
from tests.csg.trees import Leaf, Tree

SAME = 2e-6
"""Relative difference of coefficients below which surfaces are one; those that tests tell apart differ by far more."""
ERROR = 2.0**-20
"""Relative error, with room to spare, of the place of a surface and of a point in float32."""


@dataclass(frozen=True)
class Hits:
    """The first visible crossing of each of n rays: `t` (inf: none), by how much it may be off, which leaf owns it
    (-1: none), by its place in the formula's text, whether the ray goes IN there, and whether all of this is `decided`.
    """

    t: np.ndarray
    error: np.ndarray
    owner: np.ndarray
    entering: np.ndarray
    decided: np.ndarray


class Oracle:
    """A formula, ready to be asked. `leaves` are its literals in the order of its text.

    Where its surfaces coincide with `known` ones, of other formulas, they are those.
    """

    def __init__(self, root: Tree, known: Sequence[np.ndarray] = ()) -> None:
        self.root = root
        self.leaves: list[Leaf] = list(_leaves(root))
        self.surfaces: list[np.ndarray] = []
        self._sides = {id(leaf): self._canonical(leaf, known) for leaf in self.leaves}
        self._places = {id(leaf): place for place, leaf in enumerate(self.leaves)}

    def _canonical(self, leaf: Leaf, known: Sequence[np.ndarray]) -> tuple[int, bool]:
        """The number of a leaf's surface, and whether the leaf is IN where that surface's value is negative."""
        values = placed(leaf)
        for number, surface in enumerate(self.surfaces):
            if (turned := _turned(surface, values)) is not None:
                return number, leaf.inverted == turned
        elsewhere = ((surface, _turned(surface, values)) for surface in known)
        surface, turned = next((pair for pair in elsewhere if pair[1] is not None), (values, False))
        self.surfaces.append(surface)
        return len(self.surfaces) - 1, leaf.inverted == turned

    def surface_of(self, place: int) -> int:
        """The number of the surface of the leaf at `place` in the text."""
        return self._sides[id(self.leaves[place])][0]

    def lie_in(self, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Which rays lie in which surfaces, (n, m)."""
        return _Rays(self.surfaces, origin.astype(np.float64), direction.astype(np.float64), -1, None).lie_in

    def inside(self, points: np.ndarray) -> np.ndarray:
        """Whether points (n, 3) are IN, each literal from the sign of its own equation."""
        homogeneous = np.column_stack([points, np.ones(len(points))])

        def value(leaf: Leaf) -> np.ndarray:
            negative = np.einsum("ni,ij,nj->n", homogeneous, placed(leaf), homogeneous) < 0.0
            return negative != leaf.inverted

        return _evaluated(self.root, value)

    def first_hits(
        self,
        origin: np.ndarray,
        direction: np.ndarray,
        *,
        two_sided: bool = False,
        left: np.ndarray | int = -1,
        beside: int | None = None,
    ) -> Hits:
        """The first crossings with t > 0 that show: those into the solid, or all. `left`: the number of the surface on
        which a ray begins, whose nearest crossing is at exactly 0.

        A ray that lies in a surface is not decided; with `beside`, it counts as on that side of surface k that bit k
        says (set: the negative one).
        """
        rays = _Rays(self.surfaces, origin.astype(np.float64), direction.astype(np.float64), left, beside)
        values = self._values(rays.negative)
        changes = (values[:, 1:] != values[:, :-1]) & np.isfinite(rays.t)
        shown = changes & (values[:, 1:] | two_sided)
        event, any_shown = shown.argmax(axis=1), shown.any(axis=1)
        row = np.arange(len(event))
        before, after = rays.negative[row, event], rays.negative[row, event + 1]
        _, _, owner = self._owner(self.root, before, after)
        t = np.where(any_shown, rays.t[row, event], np.inf)
        error = np.where(any_shown, rays.error[row, event], 0.0)
        decided = np.isposinf(rays.doubt) | (rays.doubt > t + error)
        return Hits(t, error, np.where(any_shown, owner, -1), values[row, event + 1] & any_shown, decided)

    def _values(self, negative: np.ndarray) -> np.ndarray:
        """The formula's value, given of which surfaces (..., m) the values are negative."""

        def value(leaf: Leaf) -> np.ndarray:
            number, inside = self._sides[id(leaf)]
            return negative[..., number] == inside

        return _evaluated(self.root, value)

    def _owner(self, node: Tree, before: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A part's values before and after, and the leaf that owns the change (-1: it does not change)."""
        if isinstance(node, Leaf):
            number, inside = self._sides[id(node)]
            was, will = before[:, number] == inside, after[:, number] == inside
            return was, will, np.where(was != will, self._places[id(node)], -1)
        parts = [self._owner(child, before, after) for child in node.children]
        join = np.logical_or if node.operation == "union" else np.logical_and
        was, will = (join.reduce([part[i] for part in parts]) != node.inverted for i in (0, 1))
        owner = np.full(len(was), -1)
        for _, _, own in reversed(parts):
            owner = np.where(own >= 0, own, owner)
        return was, will, np.where(was != will, owner, -1)


def placed(leaf: Leaf) -> np.ndarray:
    """A leaf's surface in the scene as S (4, 4) of (P, 1)^T S (P, 1), its gradient's largest coefficient about 1."""
    values = np.asarray(leaf.values, np.float64)
    if leaf.kind == PLANE:
        normal, values = values, np.zeros((4, 4))
        values[:3, 3] = values[3, :3] = normal[:3] / 2.0
        values[3, 3] = normal[3]
    else:
        values = _expanded(values)
    back = np.linalg.inv(leaf.matrix)
    values = back.T @ values @ back
    size = np.abs(values[:3, :3]).max() if leaf.kind != PLANE else np.linalg.norm(values[:3, 3])
    return values / size


def _expanded(quadric: np.ndarray) -> np.ndarray:
    """S (4, 4) of a quadric as `Leaf.values` has it."""
    centred, back = np.zeros((4, 4)), np.eye(4)
    centred[:3, :3] = quadric[:3, :3]
    centred[:3, 3] = centred[3, :3] = quadric[:3, 3] / 2.0
    centred[3, 3] = -quadric[3, 3]
    back[:3, 3] = -quadric[3, :3]
    return back.T @ centred @ back


def _turned(surface: np.ndarray, other: np.ndarray) -> bool | None:
    """Whether two surfaces that coincide have their insides on opposite sides; None where they do not."""
    for turned in (False, True):
        if np.abs(surface - (-other if turned else other)).max() < SAME * np.abs(surface).max():
            return turned
    return None


def _leaves(root: Tree) -> Iterator[Leaf]:
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if isinstance(node, Leaf):
            yield node
        else:
            waiting += reversed(node.children)


def _evaluated(node: Tree, value: Callable[[Leaf], np.ndarray]) -> np.ndarray:
    """A formula's value, given those of its literals."""
    if isinstance(node, Leaf):
        return value(node)
    join = np.logical_or if node.operation == "union" else np.logical_and
    return join.reduce([_evaluated(child, value) for child in node.children]) != node.inverted


class _Rays:
    """Where n rays cross m surfaces: `t` (n, 2 m) in ascending order, inf where there is none, each with its `error`;
    `negative` (n, 2 m + 1, m): of which surfaces the values are negative before, between and behind the crossings;
    `doubt` (n,): from which t on errors could change the order of crossings.
    """

    def __init__(
        self,
        surfaces: list[np.ndarray],
        origin: np.ndarray,
        direction: np.ndarray,
        left: np.ndarray | int,
        beside: int | None,
    ) -> None:
        self.surfaces = np.array(surfaces)
        self.origin = np.column_stack([origin, np.ones(len(origin))])
        self.direction = np.column_stack([direction, np.zeros(len(origin))])
        # S times origins and directions, (n, m, 4).
        of_origin = np.tensordot(self.origin, self.surfaces, (1, 2))
        of_direction = np.tensordot(self.direction, self.surfaces, (1, 2))
        self.a = np.einsum("nmi,ni->nm", of_direction, self.direction)
        self.b = np.einsum("nmi,ni->nm", of_direction, self.origin)
        self.c = np.einsum("nmi,ni->nm", of_origin, self.origin)
        # The square of half the gradient at t is g0 + 2 g1 t + g2 t^2: each (n, 1, m).
        at, along = of_origin[..., :3], of_direction[..., :3]
        pairs = ((at, at), (at, along), (along, along))
        self.gradients = [np.einsum("nmi,nmi->nm", one, other)[:, None] for one, other in pairs]
        self.lie_in = (self.a == 0.0) & (self.b == 0.0) & (self.c == 0.0)
        self.leaves_it = np.arange(len(surfaces)) == np.broadcast_to(left, len(origin))[:, None]
        roots = self._roots()
        self._sort(roots, *self._start(roots, beside))

    def _roots(self) -> np.ndarray:
        """(n, 2, m), NaN where there is none; of a surface that the ray leaves the one nearer to 0 is 0."""
        a, b, c = self.a, self.b, self.c
        with np.errstate(invalid="ignore", divide="ignore"):
            q = -(b + np.copysign(np.sqrt(b * b - a * c), b))
            roots = np.stack([c / q, q / a], axis=1)
        roots[~np.isfinite(roots)] = np.nan
        nearer = np.abs(roots) == np.nanmin(np.abs(roots), axis=1, keepdims=True, initial=np.inf)
        roots[nearer & self.leaves_it[:, None]] = 0.0
        return roots

    def _start(self, roots: np.ndarray, beside: int | None) -> tuple[np.ndarray, np.ndarray]:
        """Of which surfaces the values are negative just after 0, and of which that is in doubt."""
        a, b, c = self.a, self.b, self.c
        far_behind = np.where(a != 0.0, a < 0.0, np.where(b != 0.0, b > 0.0, c < 0.0))
        passed = (roots <= 0.0).sum(axis=1) % 2 == 1
        negative = far_behind != passed
        within = self.lie_in
        if beside is not None:
            negative = np.where(within, beside >> np.arange(len(self.surfaces)) & 1 == 1, negative)
            within = np.zeros_like(within)
        return negative, within

    def _errors(self, t: np.ndarray) -> np.ndarray:
        """By how much surfaces' values (n, ..., m) at t may be off: what a small way along the gradient makes."""
        square = self.gradients[0] + t * (2.0 * self.gradients[1] + t * self.gradients[2])
        gradient = 2.0 * np.sqrt(np.maximum(square, 0.0))
        way = ERROR * (2.0 * np.abs(self.origin).max(axis=-1)[:, None, None] + np.abs(t))
        bend = np.abs(self.surfaces[:, :3, :3]).max(axis=(1, 2))
        return way * (gradient + bend * way)

    def _sort(self, roots: np.ndarray, negative: np.ndarray, within: np.ndarray) -> None:
        rows = np.arange(len(roots))[:, None]
        count = len(self.surfaces)
        slope = 2.0 * np.sqrt(np.maximum(self.b**2 - self.a * self.c, 0.0))[:, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            errors = self._errors(roots) / slope
        doubt = np.where(within.any(axis=1), 0.0, self._misses())
        begins = (np.abs(roots) <= errors) & ~((roots == 0.0) & self.leaves_it[:, None])
        doubt = np.where(begins.any(axis=(1, 2)), 0.0, doubt)
        ahead = np.where(roots > 0.0, roots, np.inf).reshape(-1, 2 * count)
        order = np.argsort(ahead, axis=1, kind="stable")
        self.t, self.error = ahead[rows, order], errors.reshape(-1, 2 * count)[rows, order]
        toggles = (order[..., None] % count == np.arange(count)) & np.isfinite(self.t)[..., None]
        states = np.concatenate([negative[:, None], toggles], axis=1)
        self.negative = np.logical_xor.accumulate(states, axis=1)
        with np.errstate(invalid="ignore"):
            close = self.t[:, 1:] - self.error[:, 1:] <= self.t[:, :-1] + self.error[:, :-1]
            places = np.where(close & np.isfinite(self.t[:, 1:]), self.t[:, :-1] - self.error[:, :-1], np.inf)
        self.doubt = np.minimum(doubt, places.min(axis=1, initial=np.inf))

    def _misses(self) -> np.ndarray:
        """From which t on a ray passes so near to a surface, without crossing it, that it might do so."""
        curved = (self.b**2 - self.a * self.c <= 0.0) & (self.a != 0.0)
        parallel = (self.a == 0.0) & (self.b == 0.0) & (self.c != 0.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            nearest = np.where(curved, -self.b / self.a, 0.0)
            errors = self._errors(nearest[:, None])[:, 0]
            value = np.where(curved, self.c - self.b**2 / self.a, self.c)
            reach = np.sqrt(errors / np.abs(self.a))
            begins = np.where(curved, nearest - reach, 0.0)
        near = (curved & (nearest + reach >= 0.0) | parallel) & (np.abs(value) <= errors)
        return np.where(near, begins, np.inf).min(axis=1, initial=np.inf)
