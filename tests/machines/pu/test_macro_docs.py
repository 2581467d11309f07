"""The macro half of the tutorial: its programs are assembled and run, and do what the text says."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tasuki.machines.pu import macro
from tasuki.machines.pu.macro.reader import Reader
from tasuki.machines.pu.meta.source import Errors
from tasuki.machines.pu.simulate import Outcome, run

TUTORIAL = Path(__file__).parents[3] / "docs" / "pu-tutorial.md"
TEXT = TUTORIAL.read_text()
SOURCES = re.findall(r"^```macro\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)


def floats(words: object) -> list[float]:
    return np.asarray(words, dtype=np.uint32).view(np.float32).tolist()


def vector(outcome: Outcome, number: int) -> list[float]:
    return floats([outcome.state.registers[bank][number] for bank in "xyzs"])


def the_length(outcome: Outcome) -> None:
    assert vector(outcome, 2)[3] == pytest.approx(7)
    assert vector(outcome, 3)[:3] == pytest.approx([2 / 7, 3 / 7, 6 / 7])
    assert outcome.state.steps == 4 + 12 + 18 + 1


def the_centre(outcome: Outcome) -> None:
    assert floats(outcome.state.memory[8])[:3] == [2.0, 1.0, 2.0]


def the_macros(outcome: Outcome) -> None:
    assert vector(outcome, 3) == [2.0, 1.0, 0.5, 0.0]
    assert outcome.state.registers["alu"][2] == 64
    assert vector(outcome, 10)[0] == -5.0


def the_shades(outcome: Outcome) -> None:
    memory = outcome.state.memory.view(np.float32).astype(np.float64)
    light, normals = memory[0, :3], memory[1:9, :3]
    cosines = normals @ light / np.linalg.norm(normals, axis=1) / np.linalg.norm(light)
    np.testing.assert_allclose(memory[9:17, 0], np.maximum(cosines, 0), atol=1e-6)


PROGRAMS: dict[str, Callable[[Outcome], None]] = {
    "length": the_length,
    "centre": the_centre,
    "lerp": the_macros,
    "lambert": the_shades,
}


def test_every_program_is_tested():
    assert [re.match(r"; (\w+)\.macro: ", text)[1] for text in SOURCES] == list(PROGRAMS)


@pytest.mark.parametrize(("name", "text"), list(zip(PROGRAMS, SOURCES, strict=True)), ids=list(PROGRAMS))
def test_the_programs_do_what_they_say(name, text):
    PROGRAMS[name](run(macro.assemble(text, f"{name}.macro").program, machine="plain", limit=10_000))


def test_the_translation_shown_is_the_assemblers():
    shown = TEXT.split("```\n; norm s2, v1\n", 1)[1].split("```", 1)[0]
    assert "; norm s2, v1\n" + shown in macro.assemble(SOURCES[0]).meta


def test_the_list_of_instructions_is_complete():
    listed = set(re.findall(r"\w+", TEXT.split("## The instructions", 1)[1].split("##", 1)[0]))
    reader = Reader(Errors())
    reader.read_library(sorted(macro.LIBRARY.glob("*.macro")))
    # Parts of other macros, of no use to a program.
    parts = {"rcp_out", "rcp_correction", "dot4", "matcol"}
    assert set(reader.library) - parts <= listed
