"""How much searching a ray takes: intersection tests and traversal steps, as in V. Havran's tables.

V. Havran, "Heuristic Ray Shooting Algorithms", dissertation, Prague, 2000, compares accelerators by these counts, which
depend on no machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, sqrt
from typing import Any

import numpy as np

from tasuki.language.declare import Module
from tasuki.machines.cpu.machine import EdgeProfile, Items
from tasuki.modules.raytrace import trace_pixel
from tasuki.programs import Filler, Options, executable
from tasuki.renderers.options import Region
from tasuki.renderers.raytrace import RayTracer

MOST_PIXELS = 4096
"""Pixels of a picture that are traced again, at most."""


def search_counts(tracer: RayTracer) -> dict[str, Any]:
    """What searching took per ray, counted over a regular sample of the picture's pixels; for the report.

    The pixels are traced once more, one ray at a time: packets would look at what any of their rays needs. "rays" are
    all that this sends: eye, mirror, refracted and shadow rays. "tests_per_ray" are the things that a ray was tested
    against; a thing is a primitive, or an object, however many tests its formula asks for. "steps_per_ray" are calls of
    the modules that the accelerator names as its steps (`Accelerator.steps`); None where none of them takes part.
    """
    places = sampled_places(tracer.options.region)
    fillers = tracer.prepared.fillers()
    options = Options(("items",), width=1, checked=tracer.prepared.checked, profile=True)
    program = executable(trace_pixel, options, fillers)
    program.run([Items([places])], len(places), tables=tracer.prepared.tables())
    searches = _names([fillers["nearest_hit"], fillers["is_blocked"]])
    # One of the two searches may be made with the other.
    rays = sum(edge.lanes for edge in program.profile if edge.callee in searches and edge.caller not in searches)
    tests = _calls(program.profile, _names([fillers["hit_of"]]))
    steps = _names(tracer.accelerator.step_modules())
    taken = any(edge.callee in steps for edge in program.profile)
    return {
        "accelerator": tracer.accelerator.name,
        "rays": rays,
        "tests_per_ray": tests / rays,
        "steps_per_ray": _calls(program.profile, steps) / rays if taken else None,
        "sampled_pixels": len(places),
    }


def _names(modules: Sequence[Filler]) -> set[str]:
    return {module.qualified_name for module in modules if isinstance(module, Module)}


def _calls(profile: Sequence[EdgeProfile], callees: set[str]) -> int:
    return sum(edge.lanes for edge in profile if edge.callee in callees)


def sampled_places(region: Region) -> np.ndarray:
    """row * 65536 + column of at most `MOST_PIXELS` pixels that lie evenly over a region, (n,) int32."""
    short, long = sorted((region.width, region.height))
    apart = ceil(sqrt(short * long / MOST_PIXELS))
    across = _spaced(short, apart)
    along = _spaced(long, ceil(long * len(across) / MOST_PIXELS))
    columns, rows = (across, along) if region.width == short else (along, across)
    return ((rows[:, None] << 16) | columns[None, :]).reshape(-1)


def _spaced(side: int, apart: int) -> np.ndarray:
    return np.arange(min(apart, side) // 2, side, apart, dtype=np.int32)
