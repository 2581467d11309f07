"""Scanline pictures by one processor unit: the passes of `tasuki.renderers.scanline`, each program as microcode.

Finding the mesh and setting up tables is work of the control processor: the host does it, as for the CPU. All thirteen
modules are microcode. A pass takes its items one after another.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.language.declare import Module
from tasuki.machines.cpu.machine import Progress
from tasuki.machines.pu.lower import Executable
from tasuki.machines.pu.simulate.counters import UNITS, Counters
from tasuki.machines.pu.simulate.instruction import cost, instruction
from tasuki.modules import records as rec
from tasuki.modules.scanline import luminance
from tasuki.modules.scanline import records as scan
from tasuki.modules.scanline.clipping import MOST_CORNERS
from tasuki.programs import REPORT, link_program
from tasuki.renderers.depth_buffer import depth_buffer
from tasuki.renderers.microcode import stand_ins
from tasuki.renderers.options import RenderOptions
from tasuki.renderers.pu import MEGAHERTZ, Run, mean_busy, module_rows
from tasuki.renderers.scanline import LANES, SERIAL, ScanlineRenderer
from tasuki.scene.model import Scene

PICTURE = "picture"
"""The table that stands for the display memory."""
BASED = ("linear", "linear_lit", "base_lit")
"""The address modes in which compiled programs reach tables: by their base register."""


@dataclass
class Pass:
    """An entry of the scanline method as microcode, and what it took in the last picture, all samples together."""

    executable: Executable
    items: int = 0
    executions: npt.NDArray[np.int64] = field(init=False)
    """How often each microinstruction ran."""

    def __post_init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Nothing has run yet."""
        self.items = 0
        self.executions = np.zeros(len(self.executable.compiled.words.words), np.int64)

    def run(self, items: int, tables: Mapping[str, Any]) -> None:
        """The entry for items 0 .. `items` - 1. Raises MachineError where a checked access fails."""
        self.executable.run([[np.arange(items, dtype=np.int32)]], items, tables=tables)
        self.items += items
        self.executions += np.array(self.executable.executions)

    @property
    def counted(self) -> Run:
        return self.executable.compiled, self.executions

    def words_stored(self, table: str) -> int:
        """Words that it wrote to one of its tables."""
        compiled = self.executable.compiled
        stored = 0
        for word, times in zip(compiled.words.words, self.executions.tolist(), strict=True):
            one = instruction(word)
            if one.name["ag.mode"] in BASED and one.number["ag.br"] == compiled.bases[table]:
                stored += times * cost(one).words_written
        return stored


class MicrocodeScanline(ScanlineRenderer):
    """A scene made ready for the scanline method on one processor unit.

    Raises SceneError for more units than one, and else as `tasuki.renderers.pu.MicrocodeTracer`.
    """

    def __init__(self, scene: Scene, options: RenderOptions, modules: Mapping[str, Module] | None = None) -> None:
        if options.pus != 1:
            message = "the scanline method runs on one processor unit"
            raise SceneError(str(Diagnostic(message, expected="1", found=str(options.pus))))
        # Bands of rows are as many as one of the host's threads would take: steps do not depend on the host.
        super().__init__(scene, replace(options, threads=1), modules)

    def _compile(self, checked: bool) -> None:
        started = perf_counter()
        schedule, entries = self.options.schedule, (*SERIAL, *LANES)
        programs = [link_program(entry, self._fillers) for entry in entries]
        self.written = stand_ins(self.options.microcode, programs)
        self.passes = {
            entry: Pass(Executable(program, schedule, checked=checked, written=written))
            for entry, program, written in zip(entries, programs, self.written, strict=True)
        }
        REPORT.seconds += perf_counter() - started

    def render(self, progress: Progress | None = None) -> np.ndarray:
        for one in self.passes.values():
            one.clear()
        self.tested = self.passed = 0
        return super().render(progress)

    def _run(self, entry: Module, items: int) -> None:
        if items:
            self.passes[entry].run(items, self.tables)

    def _draw_sample(self, sample: int) -> None:
        super()._draw_sample(sample)
        entries = len(self.mesh.edges) + MOST_CORNERS * self.counted("partial")
        self.depths = depth_buffer(
            self.records("edges", scan.Edge)[:entries],
            self.records("face_planes", scan.FacePlane),
            self.records("views", rec.View)[0],
            self.records("frames", scan.Frame)[0],
        )
        self.tested += self.depths.tested
        self.passed += self.depths.passed

    # --- the report ---------------------------------------------------------------------------------------------------

    def report(self) -> dict[str, Any]:
        """The entry "pu" of the report, for the last picture; times in steps unless named otherwise."""
        rows = self._pass_rows()
        counters = Counters()
        for one in self.passes.values():
            program, executions = one.counted
            for word, times in zip(program.words.words, executions.tolist(), strict=True):
                counters.add(word, times)
        return {
            "pus": 1,
            "schedule": self.options.schedule,
            "words": sum(row["words"] for row in rows),
            "clock_megahertz": self.options.clock,
            "steps": counters.steps,
            "seconds": counters.steps / (self.options.clock * MEGAHERTZ),
            "fpp_busy": mean_busy(counters),
            "busy": {unit: counters.busy_share(unit) for unit in UNITS},
            "display": self._display(),
            "microcode": {module: str(path) for files in self.written for module, path in files.items()},
            "passes": rows,
            "modules": module_rows(one.counted for one in self.passes.values()),
        }

    def _pass_rows(self) -> list[dict[str, Any]]:
        """Of each pass its entry, items, steps and microinstructions."""
        rows = []
        for entry, one in self.passes.items():
            steps = int(one.executions.sum())
            rows.append({"entry": entry.name, "items": one.items, "steps": steps, "words": len(one.executions)})
        return rows

    def _display(self) -> dict[str, int]:
        """Pixels written to the display memory, all samples together, beside what a depth buffer would do.

        It writes every pixel of the background first, and reads a depth for each that it compares.
        """
        drawing = self.passes[luminance.draw_pixel]
        writes = drawing.words_stored(PICTURE) // len(drawing.executable.compiled.records[PICTURE].leaves)
        background = self.options.region.width * self.options.region.height * self.options.samples
        return {"writes": writes, "depth_buffer_writes": background + self.passed, "depth_buffer_reads": self.tested}
