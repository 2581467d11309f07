"""The system: a control processor (CP) and N processor units (PUs), by arithmetic on the steps of each piece of work.

The pieces (pixels, in groups that are handed out together) do not depend on each other, so that what one costs is known
from running it on one simulated PU. From these steps `run` finds when each PU does what, in one clock:

1. The CP sends the scene, one row to all PUs at a time. No PU begins before it has all of it.
2. *Static* distribution: group g belongs to PU g mod N, which knows so by itself. *Dynamic*: a PU that has nothing to do
   asks the CP for the next group; the CP answers one request at a time, in the order in which they come (of those that
   come in one step, the PU of the lowest number first).
3. A pixel that is computed goes to the display memory, which takes one at a time, in the order in which they come. Its
   PU waits until it is taken.

The picture is complete when the last pixel is in the display memory. The paper does not say how work is distributed, nor
how fast its buses are: the figures of `System` are ours. PUs have scenes of their own, so that they never wait for each
other's memory.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import numpy.typing as npt

Distribution = Literal["static", "dynamic"]
Steps = npt.NDArray[np.int64]


@dataclass(frozen=True)
class System:
    """The machine around N processor units; times in steps of a PU."""

    units: int = 1
    """N, the number of PUs."""
    distribution: Distribution = "dynamic"
    row_steps: int = 1
    """For each row of the scene that the CP sends to all PUs: four words."""
    request_steps: int = 16
    """Of the CP, to answer a request for work."""
    display_steps: int = 4
    """Of the display memory, to take a pixel: four words, one in each step."""


@dataclass(frozen=True)
class Timelines:
    """What each PU did, and when; arrays of a number for each PU, in steps, unless stated otherwise."""

    broadcast: int
    """Until this step all PUs receive the scene."""
    work: Steps
    """Computing pixels."""
    request_wait: Steps
    """Asking the CP for work, and waiting for its answer."""
    display_wait: Steps
    """Giving pixels to the display memory, and waiting for it."""
    finish: Steps
    """The step in which the PU has nothing to do any more."""
    owner: npt.NDArray[np.int32]
    """For each pixel the PU that computed it."""
    start: Steps
    """For each pixel the step in which its computation began."""

    @property
    def makespan(self) -> int:
        """T(N): steps from the first row of the scene to the last pixel."""
        return int(self.finish.max())

    @property
    def idle(self) -> Steps:
        """For each PU the steps for which it waited, at the end, for the last one to finish."""
        return self.makespan - self.finish


def run(system: System, steps: Sequence[int] | Steps, group_ends: Sequence[int] | Steps, scene_rows: int) -> Timelines:
    """The timelines of a picture.

    `steps`: of each pixel, in the order in which pixels are handed out; `group_ends[g]`: the number of pixels in groups
    0 to g, at least one in each; `scene_rows`: rows that are sent to the PUs.
    """
    return _Run(system, np.asarray(steps, np.int64), [0, *map(int, group_ends)], scene_rows).timelines()


def efficiency(alone: Timelines, together: Timelines) -> float:
    """T(1) / (N T(N)): the share of N PUs' time that one PU would have needed."""
    return alone.makespan / (len(together.finish) * together.makespan)


def saturation(system: System, pixels: int, groups: int, steps: int) -> dict[str, float | None]:
    """The numbers of PUs from which the display memory, and the CP's answers, would hold all of them up.

    A picture of `pixels` in `groups` costs one PU `steps` of computing; with more PUs than this the display memory (or
    the CP) is busy all the time. None where there is nothing to wait for.
    """
    display = pixels * system.display_steps
    control = groups * system.request_steps if system.distribution == "dynamic" else 0
    alone = steps + display + control
    return {
        "display_memory": alone / display if display else None,
        "control_processor": alone / control if control else None,
    }


class _Run:
    """One picture: events in the order of time, each the end of a pixel's computation."""

    def __init__(self, system: System, steps: Steps, ends: list[int], scene_rows: int) -> None:
        self.system = system
        self.steps = steps.tolist()
        self.groups = list(pairwise(ends))
        self.broadcast = scene_rows * system.row_steps
        units = system.units
        self.given = 0
        self.own = [range(unit, len(self.groups), units).__iter__() for unit in range(units)]
        self.control_free = self.display_free = self.broadcast
        self.work, self.request_wait, self.display_wait = [0] * units, [0] * units, [0] * units
        self.finish = [self.broadcast] * units
        self.owner, self.start = [0] * len(self.steps), [0] * len(self.steps)
        self.events: list[tuple[int, int, int, int]] = []
        """(step, PU, pixel, end of its group): when the pixel is computed."""

    def timelines(self) -> Timelines:
        for unit in range(self.system.units):
            self.next_group(unit, self.broadcast)
        while self.events:
            now, unit, pixel, end = heapq.heappop(self.events)
            self.display_free = max(now, self.display_free) + self.system.display_steps
            self.display_wait[unit] += self.display_free - now
            if pixel + 1 < end:
                self.compute(unit, self.display_free, pixel + 1, end)
            else:
                self.next_group(unit, self.display_free)
        counts = (self.work, self.request_wait, self.display_wait, self.finish)
        arrays = [np.array(count, np.int64) for count in counts]
        return Timelines(self.broadcast, *arrays, np.array(self.owner, np.int32), np.array(self.start, np.int64))

    def next_group(self, unit: int, now: int) -> None:
        """The PU goes on with a new group, if there is one."""
        self.finish[unit] = now
        if self.system.distribution == "static":
            group = next(self.own[unit], None)
            if group is not None:
                self.compute(unit, now, *self.groups[group])
        elif self.given < len(self.groups):
            self.control_free = max(now, self.control_free) + self.system.request_steps
            self.request_wait[unit] += self.control_free - now
            self.compute(unit, self.control_free, *self.groups[self.given])
            self.given += 1

    def compute(self, unit: int, now: int, pixel: int, end: int) -> None:
        steps = self.steps[pixel]
        self.owner[pixel], self.start[pixel] = unit, now
        self.work[unit] += steps
        heapq.heappush(self.events, (now + steps, unit, pixel, end))
