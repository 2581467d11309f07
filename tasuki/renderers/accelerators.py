"""The registry of accelerators: how the search for hits is kept short. Used by the renderers, and by files of users.

An accelerator is two modules that search tables, and what fills those tables. The table "boxes" holds the bounds,
code and cost of every thing in the scene; `build` may put it into another order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.modules import records as rec
from tasuki.scene import extents
from tasuki.scene.kinds import resolve
from tasuki.scene.pack import Packed
from tasuki.scene.registry import Origin, Registry
from tasuki.scene.source import BROUGHT, suggestion

Tables = Mapping[str, Any]
"""Tables by name: (record, count) for zeros, or a structured array."""


@dataclass(frozen=True)
class Accelerator:
    """`nearest` and `blocked` fill the sockets `nearest_hit` and `is_blocked` (modules 14 and 15).

    `tables` says which tables they need for a packed scene. `build`, if any, is a module that fills them, on one lane:
    it takes the number of boxes, and by how much boxes must be widened so that no slab test misses what lies in them
    (f32); it returns the number of nodes. `steps` are the modules whose calls count as steps of a ray through the
    accelerator's structure: to a node, or a cell. Modules may be given as "package.module:name".
    """

    name: str
    nearest: Any
    blocked: Any
    tables: Callable[[Packed], Tables]
    build: Any = None
    steps: Sequence[Any] = ()

    def resolve(self, role: str) -> Any:
        """The object in field `role`, imported where it is given by name."""
        return _resolved(getattr(self, role))

    def step_modules(self) -> list[Any]:
        """The modules in `steps`."""
        return [_resolved(module) for module in self.steps]


def _resolved(value: Any) -> Any:
    return resolve(value) if isinstance(value, str) else value


MOST_CUTS = 0.5
"""How many times the builder of the BVH may cut a thing in two, for each thing in the scene."""

_ACCELERATORS: Registry[Accelerator] = Registry("accelerator")


def register(accelerator: Accelerator) -> Accelerator:
    """Make `accelerator` known. What the same file registered under its name is replaced.

    SceneError where another file has taken the name.
    """
    return _ACCELERATORS.enter(accelerator.name, accelerator, Origin.of_caller())


def lookup(name: str) -> Accelerator:
    """The accelerator named `name`; SceneError, naming those that exist, where there is none."""
    if name not in _ACCELERATORS:
        known = list(_ACCELERATORS)
        message, hint = f"unknown accelerator {name!r}", suggestion(name, known) or BROUGHT
        raise SceneError(str(Diagnostic(message, None, ", ".join(known), repr(name), hint)))
    return _ACCELERATORS[name]


def accelerators() -> tuple[Accelerator, ...]:
    """All accelerators, in the order in which they were registered."""
    return tuple(_ACCELERATORS.values())


def _bvh_tables(packed: Packed) -> Tables:
    references = packed.things + int(packed.things * MOST_CUTS)
    nodes = max(1, references - 1) if references else 0
    return {"references": (rec.Box, references), "bvh_nodes": (rec.BVHNode, nodes)}


def _extents_tables(packed: Packed) -> Tables:
    return {"extent_nodes": extents.nodes(packed)}


register(
    Accelerator(
        "bvh",
        nearest="tasuki.modules.bvh:nearest_intersection",
        blocked="tasuki.modules.bvh:shadow_intersection",
        tables=_bvh_tables,
        build="tasuki.modules.bvh_build:build_bvh",
        steps=[f"tasuki.modules.bvh:{name}" for name in ("child_entries", "nearest_in_leaf", "blocked_in_leaf")],
    )
)
register(
    Accelerator(
        "extents",
        nearest="tasuki.modules.extents:nearest_in_extents",
        blocked="tasuki.modules.extents:shadow_in_extents",
        tables=_extents_tables,
        steps=["tasuki.modules.extents:enters_extent"],
    )
)
