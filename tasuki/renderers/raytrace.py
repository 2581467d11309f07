"""The ray tracer's host side: a packed scene, a BVH, compiled modules, a picture."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.language.declare import Module
from tasuki.language.link import reached_sockets
from tasuki.machines.cpu.machine import EdgeProfile, Items, Progress, Same
from tasuki.modules import raytrace
from tasuki.modules import records as rec
from tasuki.modules.light_paths import DEEPEST, trace_mirrors
from tasuki.programs import REPORT, Filler, Options, executable
from tasuki.renderers.accelerators import lookup
from tasuki.renderers.options import Region, RenderOptions
from tasuki.renderers.prepared import UNBOUNDED, PreparedScene
from tasuki.renderers.waves import WaveTracer, wave_tables
from tasuki.scene.model import Scene
from tasuki.scene.pack import Packed

if TYPE_CHECKING:
    from tasuki.renderers.pu import MicrocodeTracer

ERROR_BOUND = 2.0**-21
"""Of the fused slab test, relative to the largest coordinate: roundings of 2**-24 on distances of twice that size."""
TILE = 4
"""Pixels along the side of a tile: the 16 pixels of a tile travel together in a packet of 16 lanes."""
CHUNK_TILES = 16
"""Tiles that a thread takes at a time; with more samples fewer, since threads stop for Ctrl-C between chunks only."""


class RayTracer:
    """A scene made ready: packed, its BVH built, its modules compiled. Renders any number of pictures.

    `seconds` tells how long "build" (packing and BVH) took. Raises SceneError, SourceError or LinkError.
    """

    def __init__(self, scene: Scene, options: RenderOptions, modules: Mapping[str, Module] | None = None) -> None:
        self.scene = scene
        self.options = options
        self.seconds: dict[str, float] = {}
        compiling = REPORT.seconds
        started = perf_counter()
        self.accelerator = lookup(options.accelerator)
        self._pixels = options.region.width * options.region.height
        # Profiles are counted by one thread.
        self._threads = 1 if options.profile else options.threads
        self.prepared = PreparedScene(
            scene,
            self._tables,
            modules,
            accelerator=self.accelerator,
            unchecked=options.unchecked,
            profile=options.profile and options.machine == "cpu",
        )
        self.scene = self.prepared.packed.scene
        self.memory = self.prepared.memory
        self._check_depth()
        self._fill_view()
        self.nodes = self._build_accelerator()
        # Compiling the builder is no part of building: a second scene would not wait for it.
        self.seconds["build"] = perf_counter() - started - (REPORT.seconds - compiling)
        self.microcode: MicrocodeTracer | None = None
        self.waves: WaveTracer | None = None
        if options.machine == "pu":
            self.microcode = self._microcode()
        elif self._has_waves():
            self.waves = WaveTracer(self.prepared, self._pixels, self._threads)
        else:
            self.program = self.prepared.compile(raytrace.trace_pixel, "items")

    # --- making ready -------------------------------------------------------------------------------------------------

    def _tables(self, packed: Packed) -> dict[str, Any]:
        """What tracing needs beside the scene."""
        return {
            **self.accelerator.tables(packed),
            "views": (rec.View, 1),
            "picture": (rec.Pixel, self._pixels),
            "ray_counts": (rec.RayCounts, self._pixels),
            **(wave_tables(self._pixels, self._threads) if self.options.machine == "cpu" else {}),
        }

    def _check_depth(self) -> None:
        if self.prepared.traits.transparent and self.options.depth > DEEPEST:
            message = "a scene with transparent materials cannot be traced to this depth"
            raise SceneError(str(Diagnostic(message, expected=f"1 to {DEEPEST}", found=str(self.options.depth))))

    def _has_waves(self) -> bool:
        """Whether paths may wait: they have one ray at a time, and more than one generation."""
        chain = self.fillers()["traced_light"] is trace_mirrors
        mirrors = bool((self.memory.table("attributes")["reflection"] > 0.0).any())
        return self.options.machine == "cpu" and chain and mirrors and self.options.depth > 1

    def _fill_view(self) -> None:
        options = self.options
        frame = self.scene.camera.frame(options.width, options.height)
        view = self.memory.table("views")
        view["origin"] = self.prepared.packed.origin
        view["eye"] = frame.eye - self.prepared.packed.origin
        for name in ("corner", "right", "down"):
            view[name] = getattr(frame, name)
        view["background"] = self.scene.background
        view["width"], view["height"] = options.width, options.height
        view["samples"], view["depth"], view["cutoff"] = options.samples, options.depth, options.cutoff
        region = options.region
        view["region_x"], view["region_y"] = region.x, region.y
        view["region_width"], view["region_height"] = region.width, region.height

    def _build_accelerator(self) -> int:
        """Fill the tables of the accelerator; the number of its nodes."""
        boxes = self.memory.table("boxes")
        corners = np.concatenate([boxes["low"], boxes["high"], self.memory.table("views")["eye"]])
        size = np.abs(corners[np.abs(corners) < UNBOUNDED]).max(initial=0.0)
        if self.accelerator.build is None:
            return 0
        options = Options(("same", "same"), width=1, checked=self.prepared.checked)
        builder = executable(self.accelerator.resolve("build"), options, self.fillers())
        arguments = [Same([len(boxes)]), Same([float(size) * ERROR_BOUND])]
        return int(builder.run(arguments, 1, tables=self.prepared.tables())[0][0])

    def _microcode(self) -> MicrocodeTracer:
        from tasuki.renderers.pu import MicrocodeTracer

        return MicrocodeTracer(raytrace.trace_pixel, self.prepared, self.options)

    # --- rendering ----------------------------------------------------------------------------------------------------

    def render(self, progress: Progress | None = None) -> np.ndarray:
        """Trace every pixel of the region; (height, width, 4) float32: linear red, green, blue, and coverage.

        A view of the scene's memory: the next picture overwrites it.
        """
        region = self.options.region
        places = pixel_places(region)
        started = perf_counter()
        if self.microcode:
            self.microcode.trace(places, progress)
        elif self.options.machine == "python":
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
        if self.waves:
            self.waves.trace(places, self.options.samples, progress)
            return

        # Many samples make a pixel slow: small chunks keep progress, and Ctrl-C, prompt.
        chunk = TILE * TILE * max(1, CHUNK_TILES // self.options.samples)
        arguments = [Items([places])]
        tables = self.prepared.tables()
        self.program.run(arguments, len(places), tables=tables, threads=self._threads, chunk=chunk, progress=progress)

    def _trace_plainly(self, places: np.ndarray, progress: Progress | None) -> None:
        """Every pixel by the modules' own Python source, one after another: slow, and open to any Python debugger."""
        from tasuki.language.plain import tables

        fillers = self.prepared.fillers()
        with ExitStack() as stack:
            stack.enter_context(tables(self.prepared.tables()))
            for name, socket in reached_sockets(raytrace.trace_pixel, fillers).items():
                stack.enter_context(socket.filled(fillers[name]))
            for number, place in enumerate(places.tolist()):
                raytrace.trace_pixel(place)
                if progress:
                    progress((number + 1) / len(places))

    def fillers(self) -> Mapping[str, Filler]:
        """What fills every socket."""
        return self.prepared.fillers()

    def counts(self) -> dict[str, Any]:
        """What the report says of the scene in memory."""
        packed = self.prepared.packed
        return {"primitives": dict(packed.counts), "objects": packed.objects.count, "bvh_nodes": self.nodes}

    def profile(self) -> list[EdgeProfile]:
        """What the last picture cost in each module, if programs are profiled."""
        return self.waves.profile() if self.waves else self.program.profile

    def ray_counts(self) -> dict[str, int]:
        """Rays sent for the last picture."""
        counts = self.memory.table("ray_counts")
        region = self.options.region
        eye = region.width * region.height * self.options.samples
        names = counts.dtype.names or ()
        return {"eye": eye} | {name: int(counts[name].sum(dtype=np.int64)) for name in names}


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
