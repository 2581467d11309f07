"""The scanline method's host side: a scene as one mesh, compiled modules, a picture (paper, section 7, Figure 12).

A picture takes one pass for each sample of a pixel: geometry on lanes, the edge table sorted by rows, bands of rows on
threads, each of which decides what shows, and then luminance with a pixel to a lane.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from functools import cache
from time import perf_counter
from typing import Any

import numpy as np

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.ir.memory import MemoryTable
from tasuki.language.declare import Module
from tasuki.machines.cpu.machine import EdgeProfile, Executable, Number, Progress
from tasuki.modules import records as rec
from tasuki.modules.raytrace import GOLDEN_X, GOLDEN_Y
from tasuki.modules.scanline import edges, geometry, luminance, reference, spans
from tasuki.modules.scanline import records as scan
from tasuki.modules.scanline.clipping import MOST_CORNERS
from tasuki.modules.scanline.fixed import SUBPIXEL
from tasuki.modules.shading import diffuse_and_highlight, shading
from tasuki.native.buffers import aligned_zeros
from tasuki.programs import Filler, Options, executable
from tasuki.renderers.mesh import mesh_of
from tasuki.renderers.options import RenderOptions
from tasuki.scene.memory import MOST_ROWS, Memory
from tasuki.scene.model import Camera, Scene
from tasuki.scene.pack import pack
from tasuki.scene.tessellate import tessellated

NEAREST = 1e-6
"""Of the distance to the farthest vertex: what is nearer to the eye does not show."""
BANDS_PER_THREAD = 16
"""Threads take bands as they get done: with this many, the last one out keeps the others waiting for little."""
LEAST_BAND = 3
"""A band has at least 2**LEAST_BAND rows: an edge has an entry in each band that it reaches."""
ALONE = 16384
"""So many items, or fewer, are done at once: to start threads would take longer."""
CHUNK = 1024
"""Items that one of several threads takes at a time."""
SERIAL = (reference.begin_frame, edges.lay_out_buckets, spans.draw_band)
"""Modules that decide item by item: they run with packets of one lane."""
LANES = (
    geometry.transform,
    geometry.place_face,
    edges.clip_face,
    edges.construct_edge,
    edges.sort_edge,
    luminance.draw_pixel,
)


FILLERS: dict[str, Filler] = {"shading": diffuse_and_highlight, "luminance": luminance.phong_luminance}
"""What fills the sockets by default."""


class ScanlineRenderer:
    """A scene made ready: one mesh in memory, its modules compiled. Renders any number of pictures.

    `seconds` tells how long "build" (finding the mesh) and the last "render" took. Raises SceneError, SourceError or
    LinkError.
    """

    def __init__(self, scene: Scene, options: RenderOptions, modules: Mapping[str, Module] | None = None) -> None:
        self.scene = scene
        self.options = options
        self.seconds: dict[str, float] = {}
        self._profile: list[EdgeProfile] = []
        self._fillers: dict[str, Filler] = FILLERS | dict(modules or {})
        started = perf_counter()
        packed = pack(tessellated(scene))
        self.origin = packed.origin
        self.mesh = mesh_of(packed)
        self.corners = _box_corners(self.mesh.vertices["position"])
        self.tables: dict[str, MemoryTable] = {}
        self._fill_tables(packed.build())
        self.look(scene.camera)
        self.place(np.eye(4))
        self.seconds["build"] = perf_counter() - started
        self._compile(bool(modules) and not options.unchecked)

    def _compile(self, checked: bool) -> None:
        """Make ready what `_run` runs."""
        self.programs = {entry: self._program(entry, checked) for entry in (*SERIAL, *LANES)}

    def _program(self, entry: Module, checked: bool) -> Executable:
        profile = self.options.profile
        # LLVM cannot pass the mask of a single lane to a function, and profiled modules are functions.
        serial = 2 if profile else 1
        options = Options(("number",), serial if entry in SERIAL else 0, checked, profile)
        return executable(entry, options, self._fillers)

    # --- making ready -------------------------------------------------------------------------------------------------

    def _fill_tables(self, packed: Memory) -> None:
        """Every table with as many records as it will ever need, but for those of edges, which `_reserve` makes."""
        mesh, options = self.mesh, self.options
        region = options.region
        quads = -(-region.width // 4)
        rows = -(-region.height // (BANDS_PER_THREAD * options.threads))
        self.band_shift = max(LEAST_BAND, (rows - 1).bit_length())
        self.bands = -(-region.height >> self.band_shift)
        lights = packed.table("lights")
        contents: dict[str, np.ndarray | tuple[Any, int]] = {
            "vertices": mesh.vertices,
            "vertex_normals": mesh.normals,
            "faces": mesh.faces,
            "face_edges": mesh.edges,
            "attributes": packed.table("attributes"),
            "lights": lights,
            "reference_lights": (rec.Light, len(lights)),
            "reference_vertices": (scan.ReferenceVertex, len(mesh.vertices)),
            "screen_vertices": (scan.ScreenVertex, len(mesh.vertices)),
            "reference_normals": (scan.VertexNormal, len(mesh.normals)),
            "face_planes": (scan.FacePlane, len(mesh.faces)),
            "partial_faces": (scan.Partial, len(mesh.faces)),
            "row_buckets": (scan.RowBucket, region.height),
            "columns": (scan.Column, self.bands * quads * 4),
            "marks": (scan.Mark, self.bands * quads),
            "visible_faces": (scan.Visible, region.height * quads),
            "picture": (rec.Pixel, region.height * region.width),
            "views": (rec.View, 1),
            "frames": (scan.Frame, 1),
            "frame_counts": (scan.FrameCounts, 1),
        }
        for name, content in contents.items():
            self.tables[name] = _table(name, content)

    def _reserve(self, name: str, record: Any, count: int) -> None:
        """Make sure that a table whose contents need not be kept has room for `count` records."""
        if name not in self.tables or self.tables[name].count < count:
            self.tables[name] = _table(name, (record, count))

    def look(self, camera: Camera) -> None:
        """Take the next pictures from here."""
        options = self.options
        frame = camera.frame(options.width, options.height)
        view = self.records("views", rec.View)
        view["origin"] = self.origin
        view["eye"] = frame.eye - self.origin
        for name in ("corner", "right", "down"):
            view[name] = getattr(frame, name)
        view["background"] = self.scene.background
        view["width"], view["height"] = options.width, options.height
        region = options.region
        view["region_x"], view["region_y"] = region.x, region.y
        view["region_width"], view["region_height"] = region.width, region.height

    def place(self, matrix: np.ndarray) -> None:
        """Move the mesh for the next pictures by `matrix`, (4, 4): a point p of the scene to matrix @ (p, 1).

        The lamps stay. TasukiError where the matrix is no affine motion of finite numbers.
        """
        matrix = np.array(matrix, np.float64)
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all() or (matrix[3] != (0.0, 0.0, 0.0, 1.0)).any():
            expected, found = "a (4, 4) array of finite numbers whose last row is 0, 0, 0, 1", repr(matrix)
            raise SceneError(str(Diagnostic("this matrix places nothing", expected=expected, found=found)))
        matrix[:3, 3] += matrix[:3, :3] @ self.origin - self.origin
        self.records("frames", scan.Frame)["scene_from_object"] = matrix

    # --- rendering ----------------------------------------------------------------------------------------------------

    def render(self, progress: Progress | None = None) -> np.ndarray:
        """Draw the region; (height, width, 4) float32: linear red, green, blue, and coverage.

        A view of the renderer's memory: the next picture overwrites it.
        """
        started = perf_counter()
        self._profile.clear()
        self._fill_frame()
        for sample in range(self.options.samples):
            self._draw_sample(sample)
            if progress:
                progress((sample + 1) / self.options.samples)
        self.seconds["render"] = perf_counter() - started
        return self.pixels()

    def pixels(self) -> np.ndarray:
        """What `render` gives, as far as it is done."""
        region = self.options.region
        return self.tables["picture"].memory[: region.height * region.width].reshape(region.height, region.width, 4)

    def visible(self) -> np.ndarray:
        """The face, by its number in `mesh.faces`, that the last sample of every pixel showed; -1: none."""
        region = self.options.region
        return self.tables["visible_faces"].words.reshape(region.height, -1)[:, : region.width]

    def _fill_frame(self) -> None:
        """What all samples of a picture have in common."""
        frame = self.records("frames", scan.Frame)
        view = self.records("views", rec.View)
        far = _farthest(self.corners, frame["scene_from_object"][0], view["eye"][0])
        frame["pixel"] = np.linalg.norm(view["right"])
        frame["near"], frame["nearest"], frame["farthest"] = far * NEAREST, 1.0 / (far * NEAREST), 1.0 / far
        frame["share"] = 1.0 / self.options.samples
        frame["band_shift"] = self.band_shift
        frame["row_shift"] = _row_shift(self.options.region.width)

    def _draw_sample(self, sample: int) -> None:
        """One look at every pixel: the flow of Figure 12."""
        frame = self.records("frames", scan.Frame)
        frame["sample"] = sample
        frame["sample_x"], frame["sample_y"] = (
            int((0.5 + sample * step) % 1.0 * SUBPIXEL) for step in (GOLDEN_X, GOLDEN_Y)
        )
        mesh = self.mesh
        self._run(reference.begin_frame, 1)
        self._run(geometry.transform, max(len(mesh.vertices), len(mesh.normals)))
        self._run(geometry.place_face, len(mesh.faces))
        partial = self.counted("partial")
        entries = len(mesh.edges) + MOST_CORNERS * partial
        self._reserve("edges", scan.Edge, entries)
        self._run(edges.construct_edge, len(mesh.edges))
        self._run(edges.clip_face, partial)
        self._run(edges.lay_out_buckets, 1)
        crossing = self.counted("sorted")
        self._reserve("sorted_edges", scan.Edge, crossing)
        self._reserve("links", scan.Link, crossing)
        self._reserve("layers", scan.Layer, crossing)
        self._reserve("face_slots", scan.FaceSlot, 2 * crossing)
        self._run(edges.sort_edge, entries)
        self._run(spans.draw_band, self.bands)
        self._run(luminance.draw_pixel, self.options.region.height << _row_shift(self.options.region.width))

    def _run(self, entry: Module, items: int) -> None:
        if self.options.machine == "python":
            self._run_plainly(entry, items)
        elif items:
            chunk = 1 if entry in SERIAL else items if items <= ALONE else CHUNK
            threads = min(self.options.threads, -(-items // chunk))
            program = self.programs[entry]
            program.run([Number()], items, tables=self.tables, threads=threads, chunk=chunk)
            self._profile += program.profile

    def _run_plainly(self, entry: Module, items: int) -> None:
        """The module's own Python source, one item after another: slow, and open to any Python debugger."""
        from tasuki.language.plain import tables

        with ExitStack() as stack:
            stack.enter_context(tables(self.tables))
            for socket in (shading, luminance.luminance):
                stack.enter_context(socket.filled(self._fillers[socket.name]))
            for item in range(items):
                entry(item)

    # --- what the report says -----------------------------------------------------------------------------------------

    def fillers(self) -> Mapping[str, Filler]:
        """What fills every socket."""
        return self._fillers

    def counts(self) -> dict[str, Any]:
        """Of the mesh, and of the last sample that was drawn."""
        mesh = self.mesh
        return {
            "primitives": {"triangle": len(mesh.faces)},
            "vertices": len(mesh.vertices),
            "edges": len(mesh.edges),
            "clipped": self.counted("partial"),
            "edge_table": self.counted("sorted"),
        }

    def profile(self) -> list[EdgeProfile]:
        """What the last picture cost in each module, if programs are profiled."""
        return self._profile

    def ray_counts(self) -> None:
        """None were sent."""

    def counted(self, what: str) -> int:
        """Of the last sample: "partial" faces, which were clipped, or "sorted" entries of the edge table."""
        return int(self.records("frame_counts", scan.FrameCounts)[what][0])

    def records(self, name: str, record: Any) -> np.ndarray:
        """The records of a table: a view."""
        table = self.tables[name]
        return table.memory.reshape(-1).view(_dtype(record))[: table.count]


@cache
def _dtype(record: Any) -> np.dtype:
    """How a record lies in memory: asked for several times a frame."""
    return record.numpy_dtype()


def _table(name: str, content: np.ndarray | tuple[Any, int]) -> MemoryTable:
    """A table of its own: with the records given, or (record type, count) of zeros."""
    if isinstance(content, np.ndarray):
        dtype, count = content.dtype, len(content)
    else:
        dtype, count = _dtype(content[0]), content[1]
    rows = max(1, count) * dtype.itemsize // 16
    if rows > MOST_ROWS:
        raise SceneError(
            str(Diagnostic(f"table {name!r} is too large", expected=f"at most {MOST_ROWS} rows", found=str(rows)))
        )
    memory = aligned_zeros((rows, 4), np.float32)
    if isinstance(content, np.ndarray):
        memory.reshape(-1).view(dtype)[:count] = content
    return MemoryTable(memory, 0, count)


def _box_corners(positions: np.ndarray) -> np.ndarray:
    """The corners of the box around points (n, 3): (8, 3); of no points, of none."""
    if not len(positions):
        return np.zeros((0, 3))
    ends = np.array([positions.min(axis=0), positions.max(axis=0)], np.float64)
    return np.array([[ends[i >> axis & 1, axis] for axis in range(3)] for i in range(8)])


def _farthest(corners: np.ndarray, scene_from_object: np.ndarray, eye: np.ndarray) -> float:
    """More than the distance from the eye of every point in a box that is moved; positive."""
    moved = corners @ scene_from_object[:3, :3].T + scene_from_object[:3, 3]
    return 1.01 * float(np.linalg.norm(moved - eye, axis=1).max(initial=0.0)) or 1.0


def _row_shift(width: int) -> int:
    """The least s for which 2**s pixels are as many as a row has."""
    return (width - 1).bit_length()
