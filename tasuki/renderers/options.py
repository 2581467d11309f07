"""What every renderer is told: size, samples, depth, region, threads. Checked when made."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Integral, Real
from pathlib import Path
from typing import Literal, get_args

from tasuki.diagnostics import Diagnostic, SceneError

LARGEST_SIDE = 65535
"""A pixel's row and column share one 32-bit word."""
MOST_UNITS = 4096
"""Processor units."""
Schedule = Literal["macro", "compact"]
Distribution = Literal["static", "dynamic"]
Work = int | Literal["scanline"]
MOST_PIXELS = 1 << 27
"""They take 32 bytes each of a memory of 8 GiB, half of which is left for the scene."""


@dataclass(frozen=True)
class Region:
    """The part of the picture that is rendered, in pixels from its upper left corner."""

    x: int
    y: int
    width: int
    height: int


@dataclass(frozen=True)
class RenderOptions:
    """How a scene is rendered. Raises SceneError with what was expected and found.

    `samples` rays go through each pixel; `depth` generations of rays are followed, the eye ray counted, but none whose
    weight in its pixel is `cutoff` or less; `threads` 0: one for each processor. `unchecked`: users' modules run
    without checks of their accesses to tables.
    `machine`: "cpu", "python" or "pu". For the latter `pus` is the number of processor units, `schedule` how their
    microcode is laid out, `clock` their steps in a second, in millions, and `distribution` how they come by their
    `work`, static (interleaved) or dynamic: so many pixels at a time, counted row by row, or a scanline of the region.
    `microcode`: files that stand in for modules, by the modules' names (`tasuki.renderers.microcode`).
    `accelerator`: one of `tasuki.renderers.accelerators`. `count`: afterwards the search is counted
    (`tasuki.renderers.search_counts`).
    """

    width: int = 512
    height: int = 512
    samples: int = 1
    depth: int = 5
    cutoff: float = 0.0
    threads: int = 0
    region: Region = field(default_factory=lambda: Region(0, 0, 0, 0))
    unchecked: bool = False
    profile: bool = False
    count: bool = False
    machine: str = "cpu"
    accelerator: str = "bvh"
    pus: int = 1
    schedule: Schedule = "compact"
    clock: float = 5.0
    distribution: Distribution = "dynamic"
    work: Work = 4
    microcode: Mapping[str, Path] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, least, most in (
            ("width", 1, LARGEST_SIDE),
            ("height", 1, LARGEST_SIDE),
            ("samples", 1, 1 << 20),
            ("depth", 1, 1 << 20),
            ("threads", 0, 1 << 10),
            ("pus", 1, MOST_UNITS),
        ):
            value = getattr(self, name)
            if not (isinstance(value, Integral) and least <= int(value) <= most):
                raise SceneError(f"error: {name} is out of range\n  expected: {least} to {most}\n  found: {value}")
        if not 0.0 <= self.cutoff <= 1.0:
            raise SceneError(f"error: cutoff is out of range\n  expected: 0 to 1\n  found: {self.cutoff:g}")
        self._check_processor_units()
        object.__setattr__(self, "threads", self.threads or os.cpu_count() or 1)
        region = self.region
        if not all(isinstance(value, Integral) for value in (region.x, region.y, region.width, region.height)):
            raise SceneError(f"error: the region is not in whole pixels\n  found: {region}")
        if region == Region(0, 0, 0, 0):
            region = Region(0, 0, self.width, self.height)
            object.__setattr__(self, "region", region)
        if region.width * region.height > MOST_PIXELS:
            raise SceneError(
                "error: too many pixels at once\n"
                f"  expected: at most {MOST_PIXELS:,}\n"
                f"  found: {region.width} x {region.height} = {region.width * region.height:,}\n"
                "  hint: render the picture in parts, with a region for each"
            )
        inside = 0 <= region.x < region.x + region.width <= self.width
        if not (inside and 0 <= region.y < region.y + region.height <= self.height):
            raise SceneError(
                "error: the region is not a part of the picture\n"
                f"  expected: X,Y,WIDTH,HEIGHT within {self.width}x{self.height}\n"
                f"  found: {region.x},{region.y},{region.width},{region.height}"
            )

    def _check_processor_units(self) -> None:
        if self.microcode and self.machine != "pu":
            message = "only the machine pu runs microcode written by hand"
            raise SceneError(str(Diagnostic(message, expected="the machine pu", found=self.machine)))
        for name, known in (
            ("schedule", get_args(Schedule)),
            ("distribution", get_args(Distribution)),
        ):
            value = getattr(self, name)
            if value not in known:
                raise SceneError(
                    str(Diagnostic(f"unknown {name} {value!r}", expected=", ".join(known), found=repr(value)))
                )
        if self.work != "scanline" and not (isinstance(self.work, Integral) and 1 <= self.work <= MOST_PIXELS):
            expected = f"scanline, or 1 to {MOST_PIXELS:,} pixels"
            raise SceneError(str(Diagnostic("no such piece of work", expected=expected, found=str(self.work))))
        if not (isinstance(self.clock, Real) and 0 < self.clock < float("inf")):
            raise SceneError(
                str(Diagnostic("the clock is out of range", expected="more than 0", found=str(self.clock)))
            )
