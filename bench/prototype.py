"""The throw-away prototype as a contender: its frame of `balls`, measured in a process of its own that takes orders.

Run as a program it is that process: `python -B prototype.py FOLDER`. Each line that it reads, "THREADS FRAMES CLOCK",
it answers with the seconds of each frame.
"""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from types import ModuleType
from typing import Any

SIZE, DEPTH, TILE = 512, 5, 4
READY = "ready"
CLOCKS = {"wall": perf_counter, "cpu": process_time}
"""Time that passed, or time that a process kept processors busy, which other people's work disturbs less."""


class Prototype:
    """The process; a context manager, since it has to be ended."""

    def __init__(self, folder: Path) -> None:
        # -B: nothing is written into the prototype's folder.
        command = [sys.executable, "-B", __file__, str(folder)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self._answer_after(READY)

    def __enter__(self) -> Prototype:
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin
        self._process.stdin.close()
        self._process.wait()

    def seconds(self, threads: int, frames: int, clock: str) -> float:
        """The median of `frames` frames, in seconds of `clock` (a key of `CLOCKS`)."""
        assert self._process.stdin
        print(threads, frames, clock, file=self._process.stdin, flush=True)
        return median(float(word) for word in self._answer_after("seconds").split())

    def _answer_after(self, word: str) -> str:
        assert self._process.stdout
        for line in self._process.stdout:
            if line.startswith(word):
                return line.removeprefix(word)
        raise SystemExit(f"the prototype ended with exit code {self._process.wait()}")


def serve(folder: str) -> None:
    """Be the process."""
    sys.path.insert(0, folder)
    import whitted  # type: ignore[import-not-found]  # the prototype's own module

    arguments, counter = prepare(whitted)
    kernel = whitted.mk("whitted")
    print(READY, flush=True)
    for line in sys.stdin:
        threads, frames, clock = line.split()
        times = [frame(kernel, arguments, counter, int(threads), CLOCKS[clock]) for _ in range(int(frames))]
        print("seconds", *times, flush=True)


def prepare(whitted: ModuleType) -> tuple[list[Any], Any]:
    """The kernel's arguments, as the prototype's own main program makes them, and the tile counter among them."""
    import numpy as np

    array = whitted.A
    tiles = (SIZE // TILE) ** 2
    counter, statistics = (array(np.zeros(16, np.int32)) for _ in range(2))
    out = array(np.zeros(tiles * 48, np.float32))
    lights = array(np.array([4, 3, 2, 1, -4, 4, -3, 1, 5], np.float32))
    nodes, _, spheres = whitted.data2(1)
    wide_nodes, _, wide_spheres = whitted.data16(16)
    buffers = [nodes, nodes, spheres, wide_nodes, wide_nodes, wide_spheres]
    buffers += [whitted.camera(), lights, counter, statistics]
    numbers = [SIZE // TILE, tiles, 2.0 / SIZE, DEPTH, 0]
    # The arrays are returned with their addresses: they must outlive the calls.
    return [*buffers, *numbers, out], counter


def frame(kernel: Any, arguments: list[Any], counter: Any, threads: int, clock: Callable[[], float]) -> float:
    """Seconds of one frame."""
    addresses = [argument.ctypes.data if hasattr(argument, "ctypes") else argument for argument in arguments]
    workers = [threading.Thread(target=kernel, args=addresses) for _ in range(threads)]
    counter[0] = 0
    started = clock()
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    return clock() - started


if __name__ == "__main__":
    serve(sys.argv[1])
