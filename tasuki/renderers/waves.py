"""Waves of rays on the CPU: between two steps (`tasuki.modules.waves`) the rays that wait are sorted.

Used by the ray tracer alone, for scenes in which nothing is transparent: there a path has one ray at a time.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tasuki.machines.cpu.machine import Argument, EdgeProfile, Executable, Items, Number, Progress, Same
from tasuki.modules import waves
from tasuki.native.compile import lanes
from tasuki.renderers.prepared import PreparedScene

BAND = 1 << 18
"""Pixels whose paths may wait together: enough to find neighbours, few enough to stay in the cache."""
CHUNK = 1024
"""Rays of a wave that a thread takes at a time."""
SPARSE = 0.5
"""Rays part when a smaller share of a packet's lanes has one left (measured: docs/benchmarks.md)."""


def wave_tables(pixels: int) -> dict[str, Any]:
    """What the steps need beside the ray tracer's own tables: paths wait in either half, by turns."""
    places = 2 * min(pixels, BAND)
    return {
        "waves": (waves.Wave, 1),
        "waiting_paths": (waves.WaitingPath, places),
        "waiting_hits": (waves.WaitingHit, places),
    }


class WaveTracer:
    """The programs of the steps for one scene, in whose memory there are the `wave_tables`.

    `waited` counts the rays that waited in the last picture.
    """

    def __init__(self, prepared: PreparedScene) -> None:
        self.prepared = prepared
        self.begin = prepared.compile(waves.begin_wave, "items", "number", "same")
        self.search = prepared.compile(waves.search_wave, "items")
        self.shade = prepared.compile(waves.shade_wave, "items", "number", "same")
        self.half = len(prepared.memory.table("waiting_paths")) // 2
        self.threads = 1
        self.waited = 0
        self._profile: dict[tuple[str, str], EdgeProfile] = {}
        wave = prepared.memory.table("waves")
        wave["fewest"] = round(SPARSE * lanes())
        bounds = prepared.bounds()
        if bounds is not None:
            low, high = bounds
            wave["low"] = low - prepared.packed.origin
            wave["scale"] = waves.CELLS / np.maximum(high - low, 1e-30)

    def trace(self, places: np.ndarray, samples: int, threads: int, chunk: int, progress: Progress | None) -> None:
        """Trace the pixels at these places, row * 65536 + column each; colour and coverage are means over the samples.

        `chunk` pixels at a time go to each of `threads` threads.
        """
        self.threads, self.waited, self._profile = threads, 0, {}
        bands = np.array_split(places, -(-len(places) // self.half))
        turns = [(band, sample) for band in bands for sample in range(samples)]
        try:
            for done, (band, sample) in enumerate(turns):
                self._trace_band(band, sample, chunk)
                if progress:
                    progress((done + 1) / len(turns))
        finally:
            # Pixels hold sums; as interrupted pictures are kept, theirs, too, become means.
            if samples > 1:
                picture = self.prepared.memory.table("picture")
                for name in ("colour", "coverage"):
                    picture[name] *= np.float32(1.0 / samples)

    def _trace_band(self, places: np.ndarray, sample: int, chunk: int) -> None:
        keys = self._run(self.begin, places, chunk, Number(), Same([sample]))
        first = 0
        while len(waiting := _sorted_by(keys) + np.int32(first)):
            self.waited += len(waiting)
            waiting = waiting[_sorted_by(self._run(self.search, waiting, CHUNK))]
            first = self.half - first
            keys = self._run(self.shade, waiting, CHUNK, Number(), Same([first]))

    def _run(self, program: Executable, items: np.ndarray, chunk: int, *others: Argument) -> np.ndarray:
        tables = self.prepared.tables()
        (keys,) = program.run([Items([items]), *others], len(items), tables=tables, threads=self.threads, chunk=chunk)
        for edge in program.profile:
            pair = (edge.caller, edge.callee)
            known = self._profile.get(pair, EdgeProfile(*pair, 0, 0, 0))
            counts = (known.calls + edge.calls, known.lanes + edge.lanes, known.cycles + edge.cycles)
            self._profile[pair] = EdgeProfile(*pair, *counts)
        return keys

    def profile(self) -> list[EdgeProfile]:
        """What the last picture cost in each module, all steps together."""
        return list(self._profile.values())


def _sorted_by(keys: np.ndarray) -> np.ndarray:
    """The numbers of the paths that have not ended, in the order of their keys; (n,) int32."""
    short = keys.astype(np.uint16)
    waiting = np.flatnonzero(short != waves.ENDED).astype(np.int32)
    # NumPy sorts 16-bit numbers digit by digit: in linear time.
    return waiting[np.argsort(short[waiting], kind="stable")]
