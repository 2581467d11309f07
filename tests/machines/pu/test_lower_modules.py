"""The package's modules on the PU: each on random and nasty inputs, the search over a scene, small whole pictures."""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path

import numpy as np
import pytest

import tasuki.modules
from tasuki.diagnostics import TasukiError
from tasuki.ir.canonical import reachable
from tasuki.ir.interpret import interpret
from tasuki.ir.types import BOOL, I32, Table, Type
from tasuki.language.declare import Module
from tasuki.machines.cpu.structure import named_tables
from tasuki.machines.pu.lower import ARITHMETIC, Executable, compile_program
from tasuki.modules.raytrace import trace_pixel
from tasuki.modules.scanline.spans import draw_band
from tasuki.programs import link_program
from tasuki.renderers import scanline
from tasuki.renderers.options import Region, RenderOptions
from tasuki.renderers.raytrace import RayTracer, pixel_places
from tasuki.scene import load_scene
from tests.machines.pu.lowering import agree
from tests.machines.running import assert_same_bits
from tests.machines.test_conformance import random_leaves
from tests.modules.running import flat
from tests.modules.searching import FILLERS
from tests.modules.test_search import mixed_scene

DATA = Path(__file__).parents[2] / "data"
ITEMS = 60


def modules() -> dict[str, Module]:
    """Every module of the package that takes and gives values alone, by its name."""
    found: dict[str, Module] = {}
    for place in pkgutil.walk_packages(tasuki.modules.__path__, "tasuki.modules."):
        for one in vars(importlib.import_module(place.name)).values():
            if isinstance(one, Module) and one.name not in found and not _has_tables(one):
                found[one.name] = one
    return found


def _has_tables(module: Module) -> bool:
    if any(isinstance(kind, Table) for kind in module.signature.parameters):
        return True
    try:
        program = link_program(module, FILLERS)
    except TasukiError:
        return True
    return bool(named_tables(program)[program.entry])


def inputs(kind: Type, seed: int) -> list[np.ndarray]:
    """Numbers of usual size, then nasty ones; whole numbers small, since loops may count to them."""
    draw = np.random.default_rng(seed)
    leaves = random_leaves(kind, seed, ITEMS)
    for i, leaf in enumerate(kind.leaves):
        if leaf == "i32":
            leaves[i] = draw.integers(-2, 20, ITEMS).astype(np.int32)
        elif leaf == "f32":
            leaves[i][: ITEMS // 2] = draw.normal(size=ITEMS // 2)
    return leaves


@pytest.mark.parametrize("name", sorted(modules()))
def test_a_module_is_what_the_interpreter_says(name):
    module = modules()[name]
    values = [inputs(kind, 10 * i) for i, kind in enumerate(module.signature.parameters)]
    agree(link_program(module, FILLERS), values, ITEMS)


def test_the_package_has_modules_of_every_sort():
    """Vectors, records, truth values and integers as parameters; calls; loops: what the test above relies on."""
    kinds = {kind for module in modules().values() for kind in module.signature.parameters}
    assert {BOOL, I32} < kinds
    assert max(len(reachable(link_program(module, FILLERS))) for module in modules().values()) > 2


def test_the_search_over_a_scene():
    scene = mixed_scene()
    draw = np.random.default_rng(7)
    origin = draw.normal(size=(40, 3)).astype(np.float32) * 4
    way = draw.normal(size=(40, 3)) - origin
    direction = (way / np.linalg.norm(way, axis=1, keepdims=True)).astype(np.float32)
    found = scene.nearest(origin, direction, machine="pu")
    assert_same_bits(flat(found), flat(scene.nearest(origin, direction, machine="interpreter", arithmetic="pu")))
    assert (found[1] == scene.nearest(origin, direction)[1]).mean() > 0.95
    blocked = scene.shadow(origin, direction, np.float32(5.0), machine="pu")
    expected = scene.shadow(origin, direction, np.float32(5.0), machine="interpreter", arithmetic="pu")
    assert_same_bits(flat(blocked), flat(expected))


@pytest.mark.parametrize("name", ["still_life.nff", "pavilion.yaml"])
def test_a_picture_is_the_interpreters_and_close_to_the_cpus(name):
    options = RenderOptions(40, 30, depth=4, region=Region(9, 11, 22, 14))
    tracer = RayTracer(load_scene(DATA / name), options)
    cpu = tracer.render().copy()
    counts = tracer.ray_counts()
    program = link_program(trace_pixel, tracer.prepared.fillers())
    places = pixel_places(options.region)
    tracer.pixels()[:] = -1.0
    interpret(program, [[places]], lanes=len(places), tables=tracer.prepared.tables(), arithmetic=ARITHMETIC)
    expected, expected_counts = tracer.pixels().copy(), tracer.ray_counts()
    tracer.pixels()[:] = -1.0
    Executable(program).run([[places]], len(places), tables=tracer.prepared.tables())
    assert np.array_equal(tracer.pixels(), expected)
    assert tracer.ray_counts() == expected_counts
    assert (np.abs(tracer.pixels() - cpu).max(axis=2) < 2 / 255).mean() >= 0.99
    assert abs(sum(counts.values()) - sum(expected_counts.values())) <= 0.001 * sum(counts.values()) + 1


def test_a_program_is_compiled_to_the_same_text_each_time():
    program = link_program(draw_band, scanline.FILLERS)
    assert compile_program(program).source == compile_program(program).source
