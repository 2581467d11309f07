"""Waves of rays on the CPU: between two steps (`tasuki.modules.waves`) the rays that wait are sorted.

Used by the ray tracer alone, for scenes in which nothing is transparent: there a path has one ray at a time.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait
from queue import SimpleQueue
from typing import Any

import numpy as np

from tasuki.machines.cpu.machine import Argument, EdgeProfile, Executable, Items, Number, Progress, Same
from tasuki.modules import waves
from tasuki.native.compile import lanes
from tasuki.renderers.prepared import PreparedScene

BAND = 1 << 17
"""Pixels whose paths may wait together, at most: the more they are, the nearer are their neighbours once sorted."""
PROMPT = 0.1
"""Seconds between two looks at how far the threads are."""
SPARSE = 0.5
"""Rays part when a smaller share of a packet's lanes has one left (measured: docs/benchmarks.md)."""


def wave_tables(pixels: int, threads: int) -> dict[str, Any]:
    """What the steps need beside the ray tracer's own tables. Each thread has room for the paths of two bands: those
    that wait, and those that are going to.
    """
    places = 2 * _band(pixels, threads) * threads
    return {
        "waves": (waves.Wave, 1),
        "waiting_paths": (waves.WaitingPath, places),
        "waiting_hits": (waves.WaitingHit, places),
    }


class WaveTracer:
    """The programs of the steps for one scene, in whose memory there are the `wave_tables`.

    For at most so many pixels, and so many threads. `waited` counts the rays that waited in the last picture.
    """

    def __init__(self, prepared: PreparedScene, pixels: int, threads: int) -> None:
        self.prepared = prepared
        self.threads = threads
        self.band = _band(pixels, threads)
        self.rooms = range(0, 2 * self.band * threads, 2 * self.band)
        self.begin = prepared.compile(waves.begin_wave, "items", "number", "same", "same")
        self.search = prepared.compile(waves.search_wave, "items")
        self.shade = prepared.compile(waves.shade_wave, "items", "number", "same")
        self.waited = 0
        self._done = 0
        self._stopped = False
        self._profile: dict[tuple[str, str], EdgeProfile] = {}
        self._tables = prepared.tables()
        wave = prepared.memory.table("waves")
        wave["fewest"] = round(SPARSE * lanes())
        bounds = prepared.bounds()
        if bounds is not None:
            low, high = bounds
            wave["low"] = low - prepared.packed.origin
            wave["scale"] = waves.CELLS / np.maximum(high - low, 1e-30)

    def trace(self, places: np.ndarray, samples: int, progress: Progress | None) -> None:
        """Trace the pixels at these places, row * 65536 + column each; colour and coverage are means over the samples.

        Each thread takes a band of the picture through all its waves. On Ctrl-C they stop at the end of a step; pixels
        are then means over the samples that had begun.
        """
        self.waited, self._done, self._profile, self._stopped = 0, 0, {}, False
        bands = np.array_split(places, -(-len(places) // self.band))
        rooms: SimpleQueue[int] = SimpleQueue()
        for first in self.rooms:
            rooms.put(first)
        with ThreadPoolExecutor(self.threads) as pool:
            turns = [pool.submit(self._trace_band, band, samples, rooms) for band in bands]
            try:
                self._watch(turns, len(bands) * samples, progress)
            except BaseException:
                self._stopped = True
                pool.shutdown(wait=False, cancel_futures=True)
                raise

    def _watch(self, turns: Sequence[Future[int]], steps: int, progress: Progress | None) -> None:
        """Until all threads have finished, say how many of the steps, a sample of a band each, are done."""
        running = set(turns)
        while running:
            finished, running = wait(running, PROMPT, FIRST_EXCEPTION)
            self.waited += sum(turn.result() for turn in finished)
            if progress:
                progress(self._done / steps)

    def _trace_band(self, places: np.ndarray, samples: int, rooms: SimpleQueue[int]) -> int:
        """Trace some pixels; how many rays waited."""
        room = rooms.get()
        waited = begun = 0
        try:
            while begun < samples and not self._stopped:
                begun += 1
                waited += self._trace_sample(places, begun - 1, room)
        finally:
            rooms.put(room)
            self._average(places, begun)
        return waited

    def _trace_sample(self, places: np.ndarray, sample: int, room: int) -> int:
        keys = self._run(self.begin, places, Number(), Same([room]), Same([sample]))
        first = room
        waited = 0
        while len(waiting := _sorted_by(keys) + np.int32(first)):
            waited += len(waiting)
            waiting = waiting[_sorted_by(self._run(self.search, waiting))]
            first = 2 * room + self.band - first
            keys = self._run(self.shade, waiting, Number(), Same([first]))
        self._done += 1
        return waited

    def _average(self, places: np.ndarray, samples: int) -> None:
        """Make means of the sums that these pixels hold."""
        if samples <= 1:
            return
        pixels = (places >> 16 & 65535) * self.prepared.memory.table("views")["region_width"] + (places & 65535)
        picture = self.prepared.memory.table("picture")
        for name in ("colour", "coverage"):
            picture[name][pixels] *= np.float32(1.0 / samples)

    def _run(self, program: Executable, items: np.ndarray, *others: Argument) -> np.ndarray:
        """One step, in this thread; no item where it has been stopped."""
        if self._stopped:
            items = items[:0]
        (keys,) = program.run([Items([items]), *others], len(items), tables=self._tables, chunk=len(items))
        for edge in program.profile:
            pair = (edge.caller, edge.callee)
            known = self._profile.get(pair, EdgeProfile(*pair, 0, 0, 0))
            counts = (known.calls + edge.calls, known.lanes + edge.lanes, known.cycles + edge.cycles)
            self._profile[pair] = EdgeProfile(*pair, *counts)
        return keys

    def profile(self) -> list[EdgeProfile]:
        """What the last picture cost in each module, all steps together."""
        return list(self._profile.values())


def _band(pixels: int, threads: int) -> int:
    """Pixels of a band: as many as may be, as long as there are two for each of several threads. Bands differ in what
    they take: with one each, a thread whose part is all sky would soon have nothing to do.
    """
    return min(BAND, -(-pixels // (2 * threads))) if threads > 1 else min(BAND, pixels)


def _sorted_by(keys: np.ndarray) -> np.ndarray:
    """The numbers of the paths that have not ended, in the order of their keys; (n,) int32."""
    short = keys.astype(np.uint16)
    waiting = np.flatnonzero(short != waves.ENDED).astype(np.int32)
    # NumPy sorts 16-bit numbers digit by digit: in linear time.
    return waiting[np.argsort(short[waiting], kind="stable")]
