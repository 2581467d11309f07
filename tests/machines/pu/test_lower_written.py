"""Modules written by hand: equal bits, equal pictures, registers of the callers, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tasuki.diagnostics import SourceError
from tasuki.language import f32, i32, module, vec3
from tasuki.machines.pu.lower import Executable, compile_program
from tasuki.modules.directions import reflection_direction
from tasuki.modules.raytrace import trace_pixel
from tasuki.programs import link_program
from tasuki.renderers.options import RenderOptions
from tasuki.renderers.raytrace import RayTracer, pixel_places
from tasuki.scene import load_scene
from tests.machines.pu.lowering import SCHEDULES
from tests.machines.running import assert_same_bits
from tests.machines.test_conformance import random_leaves

ROOT = Path(__file__).parents[3]
MIRROR = "tasuki.modules.directions:reflection_direction"
BY_HAND = {MIRROR: ROOT / "examples" / "pu" / "reflection_direction.macro"}
ITEMS = 500


@module
def mixed(count: i32, scale: f32, way: vec3, flag: i32) -> f32:
    """Parts of every sort, in an order in which their numbers matter."""
    return way.x * scale + f32(count - flag)


@module
def around(count: i32, scale: f32, way: vec3) -> f32:
    """Values that live through calls, and arguments that are numbers."""
    kept = scale * 3.0
    first = mixed(count, scale, way, 2)
    second = mixed(count + 1, 0.5, way + way, count)
    return kept + first * second + way.y


MIXED = """
        alu.op=sub alu.ra=I0 alu.rb=I3
        x.op=copy x.ra=R2
        jump onward
        s.op=copy s.a=lit lit=1.0 s.rd=R0 s.w=result
onward: s.op=mul s.a=x s.b=reg s.rb=R1 s.rd=R2 s.w=result
        s.op=itof s.a=alu
        s.op=add s.ra=R2 s.b=own s.rd=R0 s.w=result
"""


def leaves(of, seed=3):
    """Nasty numbers, and as many of usual size."""
    found = [leaf for i, kind in enumerate(of.signature.parameters) for leaf in [random_leaves(kind, seed + i, ITEMS)]]
    draw = np.random.default_rng(seed)
    for value in found:
        for i, leaf in enumerate(value):
            if leaf.dtype == np.float32:
                value[i][: ITEMS // 2] = draw.normal(size=ITEMS // 2)
    return found


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_the_mirror_direction_by_hand_is_the_modules(schedule):
    program = link_program(reflection_direction, {})
    values = leaves(reflection_direction)
    expected = Executable(program, schedule).run(values, ITEMS)
    assert_same_bits(Executable(program, schedule, written=BY_HAND).run(values, ITEMS), expected, schedule)


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_callers_keep_their_values_out_of_the_way(schedule, tmp_path):
    path = tmp_path / "mixed.macro"
    path.write_text(MIXED)
    program = link_program(around, {})
    [name] = [one for one in program.functions if one.endswith("mixed")]
    values = leaves(around)
    executable = Executable(program, schedule, written={name: path})
    found = executable.run(values, ITEMS)
    assert_same_bits(found, Executable(program, schedule).run(values, ITEMS), executable.compiled.source)
    if schedule == "macro":
        assert executable.steps_by_module()[name] == 2 * 7 * ITEMS


def test_a_picture_with_a_stand_in_is_the_picture():
    options = RenderOptions(24, 18, depth=3)
    tracer = RayTracer(load_scene(ROOT / "tests" / "data" / "still_life.nff"), options)
    program, tables = link_program(trace_pixel, tracer.prepared.fillers()), tracer.prepared.tables()
    places = pixel_places(options.region) if options.region else np.arange(24 * 18, dtype=np.int32)
    pictures, steps = [], []
    for written in ({}, BY_HAND):
        tracer.pixels()[:] = -1.0
        executable = Executable(program, written=written)
        executable.run([[places]], len(places), tables=tables)
        pictures.append(tracer.pixels().copy())
        steps.append(executable.steps_by_module()[MIRROR])
    assert np.array_equal(*pictures)
    # Six steps either way; by hand also the return.
    assert steps[0] > 0
    assert 6 * steps[1] == 7 * steps[0]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("nonsense v1, v2", "nonsense"),
        ("halt", "seq.op=halt"),
        ("mem.op=write mem.on=xyz ag.mode=base_lit lit=0", "mem.op=write"),
        (".const five = 5", "no directives"),
        ("item: nop", "stands elsewhere"),
    ],
)
def test_what_a_stand_in_cannot_have_is_refused_at_its_line(line, message, tmp_path):
    path = tmp_path / "mine.macro"
    path.write_text(f"; mine\n        {line}\n")
    with pytest.raises(SourceError) as error:
        compile_program(link_program(reflection_direction, {}), written={MIRROR: path})
    assert f"{path}:2:" in str(error.value)
    assert message in str(error.value)


def test_a_stand_in_for_no_module_is_refused(tmp_path):
    path = tmp_path / "mine.macro"
    with pytest.raises(SourceError, match="that the program does not have") as error:
        compile_program(link_program(reflection_direction, {}), written={"no.such:module": path})
    assert str(path) in str(error.value)
    assert MIRROR in str(error.value)
    with pytest.raises(SourceError, match=r"mine\.macro"):
        compile_program(link_program(reflection_direction, {}), written={MIRROR: path})
