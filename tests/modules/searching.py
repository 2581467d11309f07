"""A scene of a few tables, its hierarchy built by the modules themselves, and the search over it, with and without."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tasuki.language import Case
from tasuki.mapping import map_module
from tasuki.modules import bvh, bvh_build, initialise
from tasuki.modules import records as rec
from tasuki.modules.parts import whole_thing
from tasuki.modules.search import NOTHING, OBJECT
from tasuki.renderers.fillers import Traits, default_fillers
from tasuki.renderers.raytrace import ERROR_BOUND
from tasuki.scene.kinds import kinds
from tests.modules.running import records

FILLERS = default_fillers(Traits(kinds(), nested=False))
NUMBERS = {kind.name: kind.number for kind in kinds()}


WHOLE = {"primitive_part": [Case(OBJECT, whole_thing, rec.boxes, "boxes")]}
"""Of nothing in the scene a part is known."""


def build_over(
    boxes: np.ndarray,
    slack: float = 0.0,
    *,
    room: int = 0,
    fill: Mapping[str, Any] = WHOLE,
    primitives: Mapping[str, np.ndarray] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """(nodes, references) of the hierarchy over `boxes`, of which `room` may be cut.

    `fill` says how parts of primitives are found, in the tables `primitives`.
    """
    references = records(rec.Box, len(boxes) + room)
    nodes = records(rec.BVHNode, max(1, len(references) - 1))
    tables = {**(primitives or {}), "boxes": boxes, "references": references, "bvh_nodes": nodes}
    arguments = np.int32([len(boxes)]), np.float32(slack)
    [count] = map_module(bvh_build.build_bvh, *arguments, fill=fill, tables=tables, width=1)
    return nodes[:count], references


@dataclass
class Scene:
    """Primitives by the name of their kind, and the tables that the search reads."""

    primitives: dict[str, np.ndarray]
    tables: dict[str, np.ndarray]

    @classmethod
    def of(cls, *, reach: float = 10.0, **primitives: np.ndarray) -> Scene:
        """`reach`: how far from 0 rays may begin."""
        counts = {kind.name: len(primitives.get(kind.name, ())) for kind in kinds()}
        codes = np.concatenate([np.arange(counts[kind.name], dtype=np.int32) * 32 + kind.number for kind in kinds()])
        costs = np.concatenate([np.full(counts[kind.name], kind.cost, np.float32) for kind in kinds()])
        tables = {kind.table_name: primitives.get(kind.name, records(kind.record, 0)) for kind in kinds()}
        boxes = records(rec.Box, len(codes))
        if len(codes):
            items = np.arange(len(codes), dtype=np.int32)
            given = {**tables, "boxes": boxes}
            map_module(initialise.initialise_object, items, codes, costs, fill=FILLERS, tables=given)
        finite = np.concatenate([boxes["low"], boxes["high"]])
        scale = np.abs(finite[np.abs(finite) < 1e29]).max(initial=reach)
        slack = scale * ERROR_BOUND
        nodes, references = build_over(boxes, slack, room=len(boxes) // 2, fill=FILLERS, primitives=tables)
        return cls(primitives, {**tables, "boxes": boxes, "references": references, "bvh_nodes": nodes})

    def nearest(self, origin: np.ndarray, direction: np.ndarray, left: Any = NOTHING, **options: Any) -> Any:
        left = np.broadcast_to(np.int32(left), len(origin))
        return self._search(bvh.nearest_intersection, origin, direction, left, **options)

    def shadow(self, origin: np.ndarray, direction: np.ndarray, distance: Any, left: Any = NOTHING, **options: Any):
        left = np.broadcast_to(np.int32(left), len(origin))
        return self._search(bvh.shadow_intersection, origin, direction, left, distance, **options)

    def _search(self, module: Any, *arguments: Any, **options: Any) -> Any:
        return map_module(module, *arguments, fill=FILLERS, tables=self.tables, **options)

    def nearest_of_all(self, origin: np.ndarray, direction: np.ndarray, left: Any = NOTHING) -> Any:
        """What `nearest` must give, by trying every primitive."""
        nearest = np.full(len(origin), np.inf, np.float32)
        hit = np.full(len(origin), NOTHING, np.int32)
        left = np.broadcast_to(np.int32(left), len(origin))
        by_name = {kind.name: kind for kind in kinds()}
        for name, rows in self.primitives.items():
            module = by_name[name].resolve("hit")
            for index in range(len(rows)):
                code = np.int32(index * 32 + NUMBERS[name])
                t = map_module(module, rows[index], origin, direction, left == code)
                closer = (t < nearest) | ((t == nearest) & (t < np.inf) & (code < hit))
                nearest = np.where(closer, t, nearest)
                hit = np.where(closer, code, hit)
        return nearest, hit
