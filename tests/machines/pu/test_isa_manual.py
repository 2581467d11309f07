"""The manual's tables are up to date; its programs and the tutorial's assemble, run, and do what the text says."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tasuki.diagnostics import SourceError
from tasuki.machines.pu import meta
from tasuki.machines.pu.isa import DEFAULT
from tasuki.machines.pu.isa.manual import SECTIONS, renewed, sections
from tasuki.machines.pu.simulate import State, run

DOCS = Path(__file__).parents[3] / "docs"
MANUAL = DOCS / "pu-manual.md"
TUTORIAL = DOCS / "pu-tutorial.md"


def programs(page: Path) -> list[str]:
    return re.findall(r"^```meta\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE)


def test_generated_tables_are_up_to_date():
    page = MANUAL.read_text()
    assert renewed(page) == page, "run: python -m tasuki.machines.pu.isa.manual docs/pu-manual.md"


def test_the_manual_shows_every_section_once():
    assert sorted(sections(MANUAL.read_text())) == sorted(SECTIONS)


def test_every_field_and_value_is_in_the_manual():
    page = MANUAL.read_text()
    for one in DEFAULT.fields:
        assert f"`{one.name}`" in page
        assert all(f"`{value.name}`" in page for value in one.values)


@pytest.mark.parametrize("text", programs(MANUAL), ids=lambda text: text.split("\n")[0])
def test_the_manuals_programs_assemble(text: str):
    assert meta.assemble(text).program.words


def floats(words: object) -> list[float]:
    return np.asarray(words, dtype=np.uint32).view(np.float32).tolist()


def the_sum(state: State) -> None:
    assert floats(state.memory[2]) == [11, 22, 33, 0]
    assert state.steps == 4


def the_inner_product(state: State) -> None:
    assert floats(state.registers["s"][3]) == 60
    assert state.steps == 4 + 3 + 1


def the_cosine(state: State) -> None:
    assert floats(state.registers["s"][3]) == np.float32(0.8)


def the_reciprocal(state: State) -> None:
    assert floats(state.registers["s"][2]) == pytest.approx(1 / 3, rel=2**-23)


def the_unit_vector(state: State) -> None:
    vector = [floats(state.registers[bank][2]) for bank in "xyz"]
    assert vector == pytest.approx([2 / 7, 3 / 7, 6 / 7], rel=2**-22)
    assert state.steps == 3 + 18 + 1


def the_picture(state: State) -> None:
    lines, columns = np.mgrid[0:64, 0:64] / 64
    expected = np.stack([columns, lines, np.full_like(lines, 0.5), np.zeros_like(lines)], axis=-1)
    np.testing.assert_array_equal(state.display.view(np.float32).reshape(64, 64, 4), expected.astype(np.float32))
    assert state.frames == 1
    assert state.steps == 4 + 64 * (64 + 3) + 1


def the_greatest(state: State) -> None:
    assert floats(state.registers["x"][1]) == 9
    assert state.registers["alu"][1] == 5


TUTORIAL_PROGRAMS: dict[str, Callable[[State], None]] = {
    "first": the_sum,
    "dot": the_inner_product,
    "names": the_cosine,
    "reciprocal": the_reciprocal,
    "normalise": the_unit_vector,
    "gradient": the_picture,
    "greatest": the_greatest,
}


def test_every_program_of_the_tutorial_is_tested():
    names = [re.match(r"; (\w+)\.meta: ", text) for text in programs(TUTORIAL)]
    assert [name and name[1] for name in names] == list(TUTORIAL_PROGRAMS)


@pytest.mark.parametrize("name", TUTORIAL_PROGRAMS)
def test_the_tutorials_programs_do_what_they_say(name: str):
    (text,) = (text for text in programs(TUTORIAL) if text.startswith(f"; {name}.meta:"))
    outcome = run(meta.assemble(text, f"{name}.meta").program, machine="plain", limit=100_000)
    TUTORIAL_PROGRAMS[name](outcome.state)


def test_the_tutorials_error_is_the_assemblers():
    shown = TUTORIAL.read_text().split("```\noops.meta:", 1)[1].split("```", 1)[0]
    with pytest.raises(SourceError) as caught:
        meta.assemble("\nx.op=plus x.a=regs\n", "oops.meta")
    actual = str(caught.value).replace(", ".join(DEFAULT.by_name["x.op"].codes), "nop, copy, add, sub, mul, ...")
    assert actual.split() == ("oops.meta:" + shown).split()
