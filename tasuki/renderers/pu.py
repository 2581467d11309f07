"""Pictures by the processor unit: the ray tracer's program as microcode, run pixel by pixel, and N units' share of it.

Packing the scene, module 1 and the building of the accelerator are work of the control processor: the host does it, as
for the CPU. One PU is simulated; it computes all pixels, one after another, and the steps of each are counted. What N
of them would do together follows from these steps (`tasuki.machines.pu.system`).
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt

from tasuki.language.declare import Module
from tasuki.machines.cpu.machine import Progress
from tasuki.machines.pu.lower import Executable, PUProgram
from tasuki.machines.pu.simulate.counters import UNITS, Counters, count
from tasuki.machines.pu.simulate.instruction import FPP
from tasuki.machines.pu.system import System, draw, saturation
from tasuki.programs import REPORT, link_program
from tasuki.renderers.microcode import stand_ins
from tasuki.renderers.options import RenderOptions
from tasuki.renderers.prepared import PreparedScene

CHUNK = 4096
"""Pixels between two reports of progress, at least. Data memory is copied for each chunk."""
MOST_CHUNKS = 50
MEGAHERTZ = 1e6
Run = tuple[PUProgram, npt.NDArray[np.int64]]
"""A program, and how often each of its microinstructions ran."""
PICTURE_TABLES = ("arguments", "picture", "ray_counts")
"""Tables of the program that are no part of the scene: nobody sends them to the PUs."""


@dataclass
class MicrocodeTracer:
    """An entry that traces pixels by their place, as microcode; and what the last picture took.

    Raises SourceError where a module asks for what the processor unit cannot do, and where a file cannot stand in for
    a module; LinkError where there is no such module.
    """

    entry: Module
    prepared: PreparedScene
    options: RenderOptions
    steps: npt.NDArray[np.int64] = field(init=False)
    """Of each pixel of the region, shape (height, width)."""
    executions: npt.NDArray[np.int64] = field(init=False)
    """How often each microinstruction ran."""

    def __post_init__(self) -> None:
        started = perf_counter()
        program = link_program(self.entry, self.prepared.fillers())
        [self.written] = stand_ins(self.options.microcode, [program])
        self.executable = Executable(program, self.options.schedule, written=self.written)
        REPORT.seconds += perf_counter() - started
        self._clear()

    @property
    def compiled(self) -> PUProgram:
        return self.executable.compiled

    def _clear(self) -> None:
        region = self.options.region
        self.steps = np.zeros((region.height, region.width), np.int64)
        self.executions = np.zeros(len(self.compiled.words.words), np.int64)

    def trace(self, places: npt.NDArray[np.int32], progress: Progress | None = None) -> None:
        """Trace the pixels at these places, row * 65536 + column each."""
        self._clear()
        tables = self.prepared.tables()
        done = 0
        for chunk in np.array_split(places, max(1, min(MOST_CHUNKS, len(places) // CHUNK))):
            self.executable.run([[chunk]], len(chunk), tables=tables)
            self.steps[chunk >> 16, chunk & 0xFFFF] = self.executable.steps
            self.executions += np.array(self.executable.executions)
            done += len(chunk)
            if progress:
                progress(done / len(places))

    # --- the report ---------------------------------------------------------------------------------------------------

    def scene_rows(self) -> int:
        """Rows that the control processor sends to all PUs: the tables that the program reads, but for places at their
        ends that the scene has left free. Memory begins as zeros.
        """
        rows, places = self.prepared.memory.words, self.prepared.memory.tables
        sent = [places[name] for name in self.compiled.tables if name not in PICTURE_TABLES]
        filled = (np.flatnonzero(rows[place.base : place.base + place.rows].any(axis=1)) for place in sent)
        return sum(int(some[-1]) + 1 for some in filled if len(some))

    def system(self, units: int) -> System:
        """So many PUs, with this scene and the options' distribution of work."""
        work = self.options.work
        pixels = self.options.region.width if isinstance(work, str) else work
        clock = self.options.clock * MEGAHERTZ
        return System(units, self.options.distribution, pixels, self.scene_rows(), clock=clock)

    def report(self) -> dict[str, Any]:
        """The entry "pu" of the report; times in steps unless named otherwise."""
        options = self.options
        counters = count(self.compiled.words, self.executions.tolist())
        return {
            "schedule": options.schedule,
            "words": len(self.compiled.words.words),
            "clock_megahertz": options.clock,
            "steps": int(self.steps.sum()),
            "steps_per_pixel": _spread(self.steps),
            "fpp_busy": mean_busy(counters),
            "busy": {unit: counters.busy_share(unit) for unit in UNITS},
            **self._system_report(),
            "microcode": {module: str(path) for module, path in self.written.items()},
            "modules": module_rows([(self.compiled, self.executions)]),
        }

    def _system_report(self) -> dict[str, Any]:
        steps = self.steps.reshape(-1)
        system = self.system(self.options.pus)
        frame, alone = draw(steps, system), draw(steps, replace(system, units=1))
        waits = {"work": frame.worked, "request": frame.waited_request, "display": frame.waited_display}
        return {
            "pus": system.units,
            "distribution": system.distribution,
            "work": self.options.work,
            "scene_rows": system.scene_rows,
            "rows_per_step": system.rows_per_step,
            "request_steps": system.request,
            "display_steps": system.display,
            "broadcast": system.broadcast,
            "makespan": frame.total,
            "makespan_of_one": alone.total,
            "seconds": frame.seconds,
            "efficiency": alone.total / (system.units * frame.total),
            "units": {name: counts.tolist() for name, counts in waits.items()},
            "saturating_units": saturation(steps, system),
            "display_binds": frame.display_binds,
        }


def module_rows(runs: Iterable[Run]) -> list[dict[str, Any]]:
    """Steps of each module, without those that it calls, the most first; the mean number of FPPs busy in them.

    The module "" takes items from the control processor, and goes from one to the next.
    """
    counters: defaultdict[str, Counters] = defaultdict(Counters)
    lengths: Counter[str] = Counter()
    for program, executions in runs:
        lengths.update(program.modules)
        for word, module, times in zip(program.words.words, program.modules, executions.tolist(), strict=True):
            counters[module].add(word, times)
    total = sum(part.steps for part in counters.values()) or 1
    rows = [
        {
            "module": module,
            "words": lengths[module],
            "steps": part.steps,
            "share": part.steps / total,
            "fpp_busy": mean_busy(part),
        }
        for module, part in counters.items()
    ]
    return sorted(rows, key=lambda row: (-row["steps"], row["module"]))


def mean_busy(counters: Counters) -> float:
    """The mean number, of four, of FPPs that have an operation in a step."""
    return sum(counters.busy_share(unit) for unit in FPP)


def _spread(steps: npt.NDArray[np.int64]) -> dict[str, float]:
    return {
        "min": int(steps.min()),
        "typical": float(np.median(steps)),
        "mean": float(steps.mean()),
        "max": int(steps.max()),
    }
