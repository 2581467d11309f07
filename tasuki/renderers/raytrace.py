"""The ray tracer's host side: a packed scene, a BVH, compiled modules, a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from time import perf_counter
from typing import Any

import numpy as np

from tasuki.ir.memory import MemoryTable
from tasuki.language.declare import Case, Module
from tasuki.machines.cpu.machine import Executable, Items, Number, Progress, Same
from tasuki.modules import bvh_build, initialise, raytrace
from tasuki.modules import records as rec
from tasuki.modules.bvh import primitive_hit
from tasuki.modules.shading import diffuse_and_highlight, shading
from tasuki.programs import REPORT, Filler, Options, executable
from tasuki.renderers.options import Region, RenderOptions
from tasuki.scene.kinds import MOST_KINDS, PrimitiveKind
from tasuki.scene.memory import Memory
from tasuki.scene.model import Scene
from tasuki.scene.pack import pack

ERROR_BOUND = 2.0**-21
"""Of the fused slab test, relative to the largest coordinate: roundings of 2**-24 on distances of twice that size."""
TILE = 4
"""Pixels along the side of a tile: the 16 pixels of a tile travel together in a packet of 16 lanes."""
CHUNK_TILES = 16
"""Tiles that a thread takes at a time; with more samples fewer, since threads stop for Ctrl-C between chunks only."""

FILLED = {"primitive_hit": "hit", "primitive_surface": "surface", "primitive_bounds": "box"}
"""Dispatch sockets, and the role of the module of each primitive kind that fills them."""


SOCKETS = (shading, primitive_hit, raytrace.primitive_surface)
"""What a machine without a linker must fill before it traces."""


class RayTracer:
    """A scene made ready: packed, its BVH built, its modules compiled. Renders any number of pictures.

    `seconds` tells how long "build" (packing and BVH) took. Raises SceneError, SourceError or LinkError.
    """

    def __init__(self, scene: Scene, options: RenderOptions, modules: Mapping[str, Module] | None = None) -> None:
        self.scene = scene
        self.options = options
        self.modules = dict(modules or {})
        self.seconds: dict[str, float] = {}
        compiling = REPORT.seconds
        started = perf_counter()
        self.packed = pack(scene)
        self.memory = self._allocate()
        self.kinds = [kind.narrowed(self.memory.table(kind.table_name)) for kind in self.packed.kinds]
        self._fill_view()
        self.nodes = self._build_bvh()
        # Compiling the builder is no part of building: a second scene would not wait for it.
        self.seconds["build"] = perf_counter() - started - (REPORT.seconds - compiling)
        self.program = self._compile(raytrace.trace_pixel, "items")

    # --- making ready -------------------------------------------------------------------------------------------------

    def _allocate(self) -> Memory:
        builder = self.packed.builder
        count = sum(self.packed.counts.values())
        pixels = self.options.region.width * self.options.region.height
        builder.add("views", (rec.View, 1))
        builder.add("boxes", (rec.Box, count))
        builder.add("bvh_nodes", (rec.BVHNode, max(1, count - 1) if count else 0))
        builder.add("picture", (rec.Pixel, pixels))
        builder.add("ray_counts", (rec.RayCounts, pixels))
        return self.packed.build()

    def _fill_view(self) -> None:
        options = self.options
        frame = self.scene.camera.frame(options.width, options.height)
        view = self.memory.table("views")
        for name in ("eye", "corner", "right", "down"):
            view[name] = getattr(frame, name)
        view["background"] = self.scene.background
        view["width"], view["height"] = options.width, options.height
        view["samples"], view["depth"] = options.samples, options.depth
        region = options.region
        view["region_x"], view["region_y"] = region.x, region.y
        view["region_width"], view["region_height"] = region.width, region.height

    def _build_bvh(self) -> int:
        """Fill the tables "boxes" and "bvh_nodes"; the number of nodes."""
        codes, costs = primitive_codes(self.kinds, self.packed.counts)
        if not len(codes):
            return 0
        initialiser = self._compile(initialise.initialise_object, "number", "items", "items")
        initialiser.run([Number(), Items([codes]), Items([costs])], len(codes), tables=self.tables())
        boxes = self.memory.table("boxes")
        finite = np.concatenate([boxes["low"], boxes["high"], self.memory.table("views")["eye"]])
        scale = np.abs(finite[np.abs(finite) < 1e29]).max(initial=0.0)
        builder = executable(bvh_build.build_bvh, Options(("same", "same"), width=1, checked=False))
        arguments = [Same([len(codes)]), Same([float(scale) * ERROR_BOUND])]
        return int(builder.run(arguments, 1, tables=self.tables())[0][0])

    def _compile(self, entry: Module, *bindings: str) -> Executable:
        # Modules that come with the package may run unchecked: their tables were verified when they were packed.
        checked = bool(self.modules) and not self.options.unchecked
        options = Options(bindings, checked=checked, profile=self.options.profile)  # type: ignore[arg-type]
        return executable(entry, options, self.fillers())

    def fillers(self) -> dict[str, Filler]:
        """What fills every socket: the user's modules, else ours; and for each primitive kind in use its own."""
        return default_fillers(self.kinds) | self.modules

    def tables(self) -> dict[str, MemoryTable]:
        places = self.memory.tables
        return {name: MemoryTable(self.memory.rows, place.base, place.count) for name, place in places.items()}

    # --- rendering ----------------------------------------------------------------------------------------------------

    def render(self, progress: Progress | None = None) -> np.ndarray:
        """Trace every pixel of the region; (height, width, 4) float32: linear red, green, blue, and coverage.

        A view of the scene's memory: the next picture overwrites it.
        """
        region = self.options.region
        places = pixel_places(region)
        started = perf_counter()
        if self.options.machine == "python":
            self._trace_plainly(places, progress)
        else:
            self._trace_packets(places, progress)
        self.seconds["render"] = perf_counter() - started
        return self.pixels()

    def pixels(self) -> np.ndarray:
        """What `render` gives, as far as it is done."""
        region = self.options.region
        place = self.memory.tables["picture"]
        rows = self.memory.rows[place.base : place.base + place.count]
        return rows.reshape(region.height, region.width, 4)

    def _trace_packets(self, places: np.ndarray, progress: Progress | None) -> None:
        # Many samples make a pixel slow: small chunks keep progress, and Ctrl-C, prompt.
        chunk = TILE * TILE * max(1, CHUNK_TILES // self.options.samples)
        threads = self.options.threads
        arguments = [Items([places])]
        self.program.run(arguments, len(places), tables=self.tables(), threads=threads, chunk=chunk, progress=progress)

    def _trace_plainly(self, places: np.ndarray, progress: Progress | None) -> None:
        """Every pixel by the modules' own Python source, one after another: slow, and open to any Python debugger."""
        from tasuki.language.plain import tables

        fillers = self.fillers()
        with ExitStack() as stack:
            stack.enter_context(tables(self.tables()))
            for socket in SOCKETS:
                stack.enter_context(socket.filled(fillers[socket.name]))
            for number, place in enumerate(places.tolist()):
                raytrace.trace_pixel(place)
                if progress:
                    progress((number + 1) / len(places))

    def ray_counts(self) -> dict[str, int]:
        """Rays sent for the last picture."""
        counts = self.memory.table("ray_counts")
        region = self.options.region
        eye = region.width * region.height * self.options.samples
        names = counts.dtype.names or ()
        return {"eye": eye} | {name: int(counts[name].sum(dtype=np.int64)) for name in names}


def default_fillers(kinds: Sequence[PrimitiveKind]) -> dict[str, Filler]:
    """What fills the sockets of the ray tracer by default; dispatch sockets with cases for `kinds`."""
    filled: dict[str, Filler] = {"shading": diffuse_and_highlight}
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


def pixel_places(region: Region) -> np.ndarray:
    """row * 65536 + column of every pixel of a region, tile by tile, the rest of the last tiles left out; int32."""
    columns, rows = np.arange(region.width, dtype=np.int32), np.arange(region.height, dtype=np.int32)
    places = (rows[:, None] << 16) | columns[None, :]
    whole_rows, whole_columns = region.height // TILE * TILE, region.width // TILE * TILE
    tiles = places[:whole_rows, :whole_columns].reshape(whole_rows // TILE, TILE, whole_columns // TILE, TILE)
    inner = tiles.transpose(0, 2, 1, 3).reshape(-1)
    right = places[:whole_rows, whole_columns:].reshape(-1)
    below = places[whole_rows:].reshape(-1)
    return np.concatenate([inner, right, below])


def render_scene(
    scene: Scene, options: RenderOptions, modules: Mapping[str, Module] | None = None, progress: Any = None
) -> tuple[np.ndarray, RayTracer]:
    """One picture of a scene, and the tracer that made it."""
    tracer = RayTracer(scene, options, modules)
    return tracer.render(progress), tracer
