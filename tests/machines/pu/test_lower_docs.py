"""The page about the compiler shows what the compiler makes."""

from __future__ import annotations

from pathlib import Path

from tasuki.machines.pu.isa import CALL_DEPTH
from tasuki.machines.pu.lower import compile_program, places
from tasuki.machines.pu.lower import program as lowering
from tasuki.modules.directions import reflection_direction
from tasuki.programs import link_program

TEXT = (Path(__file__).parents[3] / "docs" / "pu-compiler.md").read_text()


def test_the_microcode_shown_is_the_compilers():
    shown = TEXT.split("```macro\n", 1)[1].split("```", 1)[0]
    source = compile_program(link_program(reflection_direction, {})).source
    assert source.endswith(shown)


def test_the_numbers_are_the_compilers():
    assert f"Registers 0 to {places.ROWS - 1} of the banks and 0 to {places.INTEGERS - 1} of the ALU" in TEXT
    assert f"more than {lowering.INLINED} nodes" in TEXT
    assert f"at most {CALL_DEPTH} calls" in TEXT
