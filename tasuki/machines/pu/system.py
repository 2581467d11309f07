"""A control processor (CP) with N processor units: how a picture's work is spread, and where units wait.

What each pixel costs is known from running its microcode; this is arithmetic on those step counts, event by event. The
CP broadcasts the scene to all units at once, a few rows a step. Then the units work:

- **static**, interleaved: unit p computes the work p, p + N, p + 2N, ... without asking;
- **dynamic**: a unit that is free asks the CP for the next piece of work; the CP answers one request at a time.

A piece of work is a run of pixels. When it is done the unit sends its pixels to the display memory, whose bus serves
one unit at a time, first come, first served (at one time the lower number first); the unit waits meanwhile.

Known inaccuracies: a unit sends the pixels of a piece together at its end, where real ones would send each when it is
ready; requests and answers have no latency beyond the CP's own steps.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from tasuki.diagnostics import MachineError

Distribution = Literal["static", "dynamic"]
Steps = npt.NDArray[np.int64]
CLOCK = 5_000_000
"""Steps in a second: what the paper's time gives a horizontal machine with single-chip floating-point units (ours)."""
MOST_UNITS = 1 << 12


@dataclass(frozen=True)
class System:
    """The machine around the processor units. Times are in steps of their common clock."""

    units: int = 16
    distribution: Distribution = "dynamic"
    pixels: int = 1
    """Pixels in a piece of work."""
    scene_rows: int = 0
    """Rows of memory that every unit needs before it begins."""
    rows_per_step: int = 1
    """Rows that the CP broadcasts in a step."""
    request: int = 16
    """Steps that the CP takes for one request."""
    display: int = 1
    """Steps that the display memory's bus takes for one pixel."""
    clock: float = CLOCK

    def __post_init__(self) -> None:
        least = {"units": 1, "pixels": 1, "scene_rows": 0, "rows_per_step": 1, "request": 0, "display": 0}
        for name, low in least.items():
            value = getattr(self, name)
            if value < low or (name == "units" and value > MOST_UNITS):
                limits = f"{low} to {MOST_UNITS}" if name == "units" else f"at least {low}"
                raise MachineError(f"{name}: expected {limits}, found {value}")
        if self.distribution not in get_args(Distribution):
            raise MachineError(f"distribution: expected static or dynamic, found {self.distribution!r}")
        if not self.clock > 0:
            raise MachineError(f"clock: expected a number of steps a second, found {self.clock}")

    @property
    def broadcast(self) -> int:
        """Steps until every unit has the scene."""
        return -(-self.scene_rows // self.rows_per_step)


@dataclass(frozen=True)
class Stretch:
    """What a unit did from step `start` to step `end`: it worked, or waited for the CP or for the display memory."""

    start: int
    end: int
    what: Literal["work", "request", "display"]


@dataclass(frozen=True)
class Frame:
    """One picture. For each unit the steps that it worked, and that it waited for the CP and the display memory.

    `total` is when the last pixel stands in the display memory, from the beginning of the broadcast on; a unit that is
    done before waits for the end. `timelines` is filled where it was asked for.
    """

    system: System
    pixels: int
    total: int
    worked: Steps
    waited_request: Steps
    waited_display: Steps
    timelines: tuple[tuple[Stretch, ...], ...] = ()

    @property
    def seconds(self) -> float:
        """The picture's time at the system's clock."""
        return self.total / self.system.clock

    @property
    def busy_share(self) -> float:
        """The share of all units' time, 0 to 1, in which they worked."""
        return float(self.worked.sum()) / (self.system.units * self.total) if self.total else 1.0

    @property
    def display_binds(self) -> bool:
        """Whether the bus of the display memory was busy for nine tenths of the time, or more, after the broadcast."""
        return self.pixels * self.system.display >= 0.9 * (self.total - self.system.broadcast) > 0


def draw(steps: Sequence[int] | Steps, system: System, *, timelines: bool = False) -> Frame:
    """A picture whose pixel i, in the order in which pixels are handed out, costs `steps[i]` steps."""
    return _Run(np.asarray(steps, np.int64), system, timelines).run()


def efficiency(steps: Sequence[int] | Steps, system: System) -> float:
    """T(1) / (N T(N)), each with its broadcast, its requests and its waiting for the display memory."""
    alone = draw(steps, replace(system, units=1)).total
    return alone / (system.units * draw(steps, system).total)


def saturation(steps: Sequence[int] | Steps, system: System) -> dict[str, float | None]:
    """The numbers of units from which the display memory, and the CP, are busy all the time, so that more do not help.

    The time of one unit for the picture, over what each of the two takes for it; None where it takes nothing.
    """
    display = len(steps) * system.display
    requests = -(-len(steps) // system.pixels) * system.request if system.distribution == "dynamic" else 0
    alone = int(np.sum(steps, dtype=np.int64)) + display + requests
    return {
        "display_memory": alone / display if display else None,
        "control_processor": alone / requests if requests else None,
    }


class _Run:
    """Events in the order of their time: a unit's pixels are ready; it sends them, and begins the next piece.

    The bus serves units in the order in which they are ready, so that they also ask the CP in this order.
    """

    def __init__(self, steps: Steps, system: System, timelines: bool) -> None:
        self.system = system
        starts = range(0, len(steps), system.pixels)
        self.work = np.add.reduceat(steps, starts).tolist() if len(steps) else []
        self.sizes = [min(system.pixels, len(steps) - start) for start in starts]
        self.pixels = len(steps)
        self.next = 0
        self.own = list(range(system.units))
        self.cp_free = self.bus_free = system.broadcast
        self.worked, self.waited_request, self.waited_display = (np.zeros(system.units, np.int64) for _ in range(3))
        self.stretches: list[list[Stretch]] | None = [[] for _ in range(system.units)] if timelines else None

    def run(self) -> Frame:
        begin = self.system.broadcast
        events = [(begin, unit, -1) for unit in range(self.system.units)]
        total = begin
        while events:
            time, unit, piece = heapq.heappop(events)
            if piece >= 0:
                time = self.send(time, unit, piece)
                total = max(total, time)
            taken = self.take(unit)
            if taken is not None:
                ready = self.begin(time, unit, taken)
                heapq.heappush(events, (ready, unit, taken))
        timelines = tuple(map(tuple, self.stretches)) if self.stretches is not None else ()
        waits = (self.worked, self.waited_request, self.waited_display)
        return Frame(self.system, self.pixels, total, *waits, timelines)

    def take(self, unit: int) -> int | None:
        """The number of the unit's next piece of work."""
        if self.system.distribution == "dynamic":
            piece = self.next
            self.next += 1
        else:
            piece = self.own[unit]
            self.own[unit] += self.system.units
        return piece if piece < len(self.work) else None

    def begin(self, time: int, unit: int, piece: int) -> int:
        """When the piece is computed, by a unit that is free at `time`."""
        if self.system.distribution == "dynamic":
            self.cp_free = max(time, self.cp_free) + self.system.request
            self.note(unit, time, self.cp_free, "request")
            time = self.cp_free
        self.note(unit, time, time + self.work[piece], "work")
        return time + self.work[piece]

    def send(self, time: int, unit: int, piece: int) -> int:
        """When the piece's pixels, ready at `time`, are in the display memory."""
        self.bus_free = max(time, self.bus_free) + self.sizes[piece] * self.system.display
        self.note(unit, time, self.bus_free, "display")
        return self.bus_free

    def note(self, unit: int, start: int, end: int, what: Literal["work", "request", "display"]) -> None:
        sums = {"work": self.worked, "request": self.waited_request, "display": self.waited_display}
        sums[what][unit] += end - start
        if self.stretches is not None and end > start:
            self.stretches[unit].append(Stretch(start, end, what))
