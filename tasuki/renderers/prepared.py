"""A scene made ready for modules: packed into memory, its objects initialised (module 1), its sockets filled.

What the renderers and `tasuki info` have in common. Imported by them alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tasuki.ir.memory import MemoryTable
from tasuki.language.declare import Case, Module
from tasuki.machines.cpu.machine import Executable, Items, Number
from tasuki.modules import records as rec
from tasuki.modules.initialise import initialise_object
from tasuki.modules.light_paths import trace_mirrors, trace_tree
from tasuki.modules.shading import diffuse_and_highlight
from tasuki.programs import Filler, Options, executable
from tasuki.scene.kinds import MOST_KINDS, PrimitiveKind
from tasuki.scene.model import Scene
from tasuki.scene.pack import pack

FILLED = {"primitive_hit": "hit", "primitive_surface": "surface", "primitive_bounds": "box"}
"""Dispatch sockets, and the role of the module of each primitive kind that fills them."""
UNBOUNDED = 1e29
"""Coordinates from here on are those of boxes without bounds."""


class PreparedScene:
    """A scene in memory, with the table "boxes" filled.

    `tables`, given the number of primitives, says which tables to add: (record, count) by name. `modules` fills sockets
    by name, in the place of ours; they run with checked accesses unless `unchecked`. `profile`: programs are compiled
    to time modules. Raises SceneError, SourceError or LinkError.
    """

    def __init__(
        self,
        scene: Scene,
        tables: Callable[[int], Mapping[str, tuple[Any, int]]] = lambda primitives: {},
        modules: Mapping[str, Module] | None = None,
        *,
        unchecked: bool = False,
        profile: bool = False,
    ) -> None:
        self.packed = pack(scene)
        self.modules = dict(modules or {})
        # Modules that come with the package may run unchecked: their tables were verified when they were packed.
        self.checked = bool(self.modules) and not unchecked
        self.profile = profile
        self.primitives = sum(self.packed.counts.values())
        builder = self.packed.builder
        builder.add("boxes", (rec.Box, self.primitives))
        for name, content in tables(self.primitives).items():
            builder.add(name, content)
        self.memory = self.packed.build()
        self.kinds = [kind.narrowed(self.memory.table(kind.table_name)) for kind in self.packed.kinds]
        self.transparent = bool((self.memory.table("attributes")["transmission"] > 0.0).any())
        self._initialise_objects()

    def _initialise_objects(self) -> None:
        if self.primitives:
            codes, costs = primitive_codes(self.kinds, self.packed.counts)
            program = self.compile(initialise_object, "number", "items", "items")
            program.run([Number(), Items([codes]), Items([costs])], self.primitives, tables=self.tables())

    def compile(self, entry: Module, *bindings: str) -> Executable:
        """The program of `entry`, its sockets filled; `bindings` says how items reach its parameters."""
        options = Options(bindings, checked=self.checked, profile=self.profile)  # type: ignore[arg-type]
        return executable(entry, options, self.fillers())

    def fillers(self) -> dict[str, Filler]:
        """What fills every socket: the user's modules, else ours; and for each primitive kind in use its own."""
        return default_fillers(self.kinds, self.transparent) | self.modules

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


def default_fillers(kinds: Sequence[PrimitiveKind], transparent: bool = True) -> dict[str, Filler]:
    """What fills the sockets of the ray tracer by default; dispatch sockets with cases for `kinds`.

    `transparent`: whether anything in the scene lets light through.
    """
    paths = trace_tree if transparent else trace_mirrors
    filled: dict[str, Filler] = {"shading": diffuse_and_highlight, "traced_light": paths}
    for socket, role in FILLED.items():
        filled[socket] = [
            Case(kind.number, kind.resolve(role), kind.resolve("table"), kind.table_name) for kind in kinds
        ]
    return filled


def primitive_codes(kinds: Sequence[PrimitiveKind], counts: Mapping[str, int]) -> tuple[np.ndarray, np.ndarray]:
    """index * 32 + kind of every primitive, int32; and what each costs to intersect, float32."""
    codes = [np.arange(counts[kind.name], dtype=np.int32) * MOST_KINDS + kind.number for kind in kinds]
    costs = [np.full(counts[kind.name], kind.cost, np.float32) for kind in kinds]
    return np.concatenate([np.zeros(0, np.int32), *codes]), np.concatenate([np.zeros(0, np.float32), *costs])
