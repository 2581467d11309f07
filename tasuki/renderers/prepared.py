"""A scene made ready for modules: packed into memory, its objects initialised (module 1), its sockets filled.

What the renderers and `tasuki info` have in common. Imported by them alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tasuki.ir.memory import MemoryTable
from tasuki.language.declare import Module
from tasuki.machines.cpu.machine import Executable, Items, Number
from tasuki.modules import records as rec
from tasuki.modules.initialise import initialise_object
from tasuki.modules.search import OBJECT
from tasuki.programs import Filler, Options, executable
from tasuki.renderers.accelerators import Accelerator, lookup
from tasuki.renderers.fillers import Traits, default_fillers
from tasuki.scene.kinds import PrimitiveKind
from tasuki.scene.local_surfaces import complete
from tasuki.scene.model import Scene
from tasuki.scene.pack import Packed, pack

UNBOUNDED = 1e29
"""Coordinates from here on are those of boxes without bounds."""


class PreparedScene:
    """A scene in memory, with the table "boxes" filled.

    `tables`, given the packed scene, says which tables to add: arrays, or (record, count), by name. `modules` fills
    sockets by name, in the place of ours. Where a socket is filled with a module of a user's, accesses to tables are
    checked unless `unchecked`. `profile`: programs are compiled to time modules. Raises SceneError, SourceError or
    LinkError.
    """

    def __init__(
        self,
        scene: Scene,
        tables: Callable[[Packed], Mapping[str, Any]] = lambda packed: {},
        modules: Mapping[str, Module] | None = None,
        *,
        accelerator: Accelerator | None = None,
        unchecked: bool = False,
        profile: bool = False,
    ) -> None:
        self.packed = pack(scene)
        self.modules = dict(modules or {})
        self.profile = profile
        builder = self.packed.builder
        builder.add("boxes", (rec.Box, self.packed.things))
        for name, content in tables(self.packed).items():
            builder.add(name, content)
        self.memory = self.packed.build()
        complete(self.memory, self.packed.objects.operands)
        self.accelerator = accelerator or lookup("bvh")
        self.traits = Traits(
            [one.kind.narrowed(one.records) for one in self.packed.primitives],
            self.packed.objects.operands,
            transparent=bool((self.memory.table("attributes")["transmission"] > 0.0).any()),
            nested=bool(len(self.memory.table("media"))),
            textures=self.packed.textures,
        )
        # Modules that come with the package may run unchecked: their tables were verified when they were packed.
        self.checked = not unchecked and any(map(_is_foreign, self.fillers().values()))
        self._initialise_objects()

    def _initialise_objects(self) -> None:
        if self.packed.things:
            codes, costs = codes_and_costs(self.traits.standing, self.packed)
            program = self.compile(initialise_object, "number", "items", "items")
            program.run([Number(), Items([codes]), Items([costs])], self.packed.things, tables=self.tables())

    def compile(self, entry: Module, *bindings: str) -> Executable:
        """The program of `entry`, its sockets filled; `bindings` says how items reach its parameters."""
        options = Options(bindings, checked=self.checked, profile=self.profile)  # type: ignore[arg-type]
        return executable(entry, options, self.fillers())

    def fillers(self) -> dict[str, Filler]:
        """What fills every socket: the user's modules, else ours; and for each primitive kind in use its own."""
        return default_fillers(self.traits, self.accelerator) | self.modules

    def tables(self) -> dict[str, MemoryTable]:
        """Every table of the memory, by name."""
        places = self.memory.tables
        return {name: MemoryTable(self.memory.rows, place.base, place.count) for name, place in places.items()}

    def bounds(self) -> tuple[np.ndarray, np.ndarray] | None:
        """The corners of the box around all primitives that have bounds, in the scene's coordinates, float64.

        None where there are none.
        """
        boxes = self.memory.table("boxes")
        bounded = (np.abs(boxes["low"]) < UNBOUNDED).all(axis=1) & (np.abs(boxes["high"]) < UNBOUNDED).all(axis=1)
        if not bounded.any():
            return None
        low, high = boxes["low"][bounded].min(axis=0), boxes["high"][bounded].max(axis=0)
        return low + self.packed.origin, high + self.packed.origin


def _is_foreign(filler: Filler) -> bool:
    """Whether a module that is no part of the package is among those that fill a socket."""
    modules = [filler] if isinstance(filler, Module) else [case.module for case in filler]
    return not all(module.__module__.startswith("tasuki.") for module in modules)


def codes_and_costs(kinds: Sequence[PrimitiveKind], packed: Packed) -> tuple[np.ndarray, np.ndarray]:
    """index * 32 + kind of every thing in the scene, int32; and what each costs to intersect, float32."""
    costs = [np.full(packed.counts[kind.name], kind.cost, np.float32) for kind in kinds] + [packed.objects.costs]
    numbers = [kind.number for kind in kinds] + [OBJECT]
    codes = [np.arange(len(cost), dtype=np.int32) * 32 + number for cost, number in zip(costs, numbers, strict=True)]
    return np.concatenate(codes), np.concatenate(costs)
