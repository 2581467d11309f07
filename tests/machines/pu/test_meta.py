"""The meta-assembler: bits or the error stated beside the line (asm/*.meta), output formats, round trips, bad files."""

import re
from pathlib import Path

import pytest

from tasuki.diagnostics import SourceError
from tasuki.machines.pu import meta
from tasuki.machines.pu.isa import DEFAULT, InstructionSet, Widths

ASM = Path(__file__).parent / "asm"
SOURCES = sorted(ASM.rglob("*.meta"))


def stated_bits(text: str) -> int:
    """The word that a comment states: high:low=value pairs, or hex in which ".." fills up with zeros."""
    if ":" not in text:
        head, dots, tail = text.strip().partition("..")
        return int(head + "0" * (64 - len(head) - len(tail)) + tail if dots else head, 16)
    word = 0
    for high, low, value in re.findall(r"(\d+):(\d+)=(\d+)", text):
        assert int(value) < 1 << int(high) - int(low) + 1, f"{text}: the value is wider than its bits"
        word |= int(value) << int(low)
    return word


def stated(path: Path, pattern: str) -> dict[int, tuple[str, ...]]:
    found = {}
    for number, line in enumerate(path.read_text().splitlines(), 1):
        match = re.search(pattern, line)
        if match and not line.startswith(";"):
            found[number] = match.groups()
    return found


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.stem)
def test_every_line_gives_the_bits_or_the_error_beside_it(path: Path):
    errors = stated(path, r"; error (\d+): (.*)$")
    if errors:
        with pytest.raises(SourceError) as caught:
            meta.assemble_file(path)
        own = {(one.span.line, one.span.column + 1): one.message for one in caught.value.diagnostics}
        assert {place[0] for place in own} == set(errors), str(caught.value)
        for line, (column, message) in errors.items():
            assert message in own.get((line, int(column)), "nothing here"), str(caught.value)
        return
    assembly = meta.assemble_file(path)
    expected = {line: stated_bits(bits) for line, (bits,) in stated(path, r"; = (.*)$").items()}
    words = {}
    for listed in assembly.listed:
        if listed.address is not None and listed.source.name == str(path):
            ends = listed.line
            while assembly.listed[0].source.lines[ends - 1].endswith("\\"):
                ends += 1
            words[ends] = assembly.program.words[listed.address]
    assert {line: f"{word:064x}" for line, word in words.items()} == {
        line: f"{word:064x}" for line, word in expected.items()
    }


@pytest.mark.parametrize("path", [path for path in SOURCES if "error" not in path.stem], ids=lambda path: path.stem)
def test_assemble_disassemble_assemble(path: Path):
    program = meta.assemble_file(path).program
    again = meta.assemble(meta.disassemble(program)).program
    assert again.words == program.words
    assert again.labels.items() >= program.labels.items()
    assert meta.disassemble(again) == meta.disassemble(program)


def test_hex_and_binary_come_back():
    program = meta.assemble_file(ASM / "fields.meta").program
    text = meta.to_hex(program)
    assert all(re.fullmatch(r"[0-9a-f]{64}(  // .*)?", line) for line in text.splitlines())
    assert meta.from_hex(text) == program.words
    data = meta.to_binary(program)
    assert len(data) == 32 * len(program.words)
    assert meta.from_binary(data) == program.words


def test_hex_names_labels_in_comments():
    assert meta.to_hex(meta.assemble("start: also: nop").program) == "0" * 64 + "  // start, also\n"


def test_listing_shows_address_bits_and_source():
    listing = meta.listing(meta.assemble(".const one = 1\nstart: lit=one ; the literal", "small.meta"))
    lines = listing.splitlines()
    assert lines[2].endswith(".const one = 1")
    assert lines[3] == "00000  " + "00000000 " * 7 + "00000001  start: lit=one ; the literal"


def test_wrong_binary_and_hex():
    with pytest.raises(SourceError, match="multiple of 32 bytes"):
        meta.from_binary(b"123")
    with pytest.raises(SourceError, match="too long"):
        meta.from_binary(bytes(32) * (DEFAULT.program_words + 1))
    with pytest.raises(SourceError) as caught:
        meta.from_hex("12\nxyz 34\n" + "f" * 65)
    assert [(one.span.line, one.message) for one in caught.value.diagnostics] == [
        (2, "this is no word"),
        (3, "the word is wider than 256 bits"),
    ]


def test_data_and_sizes():
    program = meta.assemble(".memory 10\n.display 20\n.const base = 3\n.data base+1: 1.0, 2, -1, pi, 5").program
    assert (program.memory_rows, program.display_rows) == (10, 20)
    assert program.memory == {4: (0x3F800000, 2, 0xFFFFFFFF, 0x40490FDB), 5: (5, 0, 0, 0)}


def test_lines_may_point_into_the_source_they_were_made_from():
    program = meta.assemble('nop\n.line 12 "wheel.macro"\nnop\nnop\n.line\nnop', "made.meta").program
    assert [str(span) for span in program.spans] == [
        "made.meta:1:1",
        "wheel.macro:12:1",
        "wheel.macro:12:1",
        "made.meta:6:1",
    ]


def failure(path: Path) -> str:
    with pytest.raises(SourceError) as caught:
        meta.assemble_file(path)
    return str(caught.value)


def test_a_definition_points_to_its_use():
    with pytest.raises(SourceError) as caught:
        meta.assemble(".define wrong(r) = x.ra=r x.rc=r\nwrong(R1)", "w.meta")
    assert str(caught.value) == (
        "w.meta:1:27: error: there is no field 'x.rc'\n"
        "    1 | .define wrong(r) = x.ra=r x.rc=r\n"
        "      |                           ^^^^\n"
        "  expected: perhaps x.rd\n"
        "w.meta:2:1: note: in the expansion of 'wrong'\n"
        "    2 | wrong(R1)\n"
        "      | ^^^^^"
    )


def test_bad_files(tmp_path: Path):
    assert "there is no such file" in failure(tmp_path / "none.meta")
    assert "not a file" in failure(tmp_path)
    (tmp_path / "binary.meta").write_bytes(b"nop\nnop\xff\n")
    assert "line 2: this is not text" in failure(tmp_path / "binary.meta")
    (tmp_path / "nul.meta").write_bytes(b"nop\n\0")
    assert "line 2: this is not text" in failure(tmp_path / "nul.meta")


def test_a_huge_source_is_refused_at_once(tmp_path: Path):
    path = tmp_path / "huge.meta"
    with path.open("wb") as file:
        file.truncate(100_000_000)
    assert "the source is too large" in failure(path)


def test_includes_that_go_round(tmp_path: Path):
    (tmp_path / "a.meta").write_text('.include "b.meta"\n')
    (tmp_path / "b.meta").write_text('nop\n  .include "a.meta"\n')
    message = failure(tmp_path / "a.meta")
    assert "b.meta:2:12: error: the file includes itself" in message
    assert "found: a.meta -> b.meta -> a.meta" in message


def test_includes_nested_too_deeply(tmp_path: Path):
    for i in range(100):
        (tmp_path / f"{i}.meta").write_text(f'.include "{i + 1}.meta"\n')
    assert "includes are nested too deeply" in failure(tmp_path / "0.meta")


def test_what_could_run_away_stops():
    words = "\n".join(["nop"] * (DEFAULT.program_words + 1))
    doubling = ".define d0 = nop nop\n" + "\n".join(f".define d{i + 1} = d{i} d{i}" for i in range(60)) + "\nd60"
    deep = "\n".join(f".define d{i + 1} = d{i}" for i in range(200)) + "\n.define d0 =\nd200"
    constants = "\n".join(f".const c{i} = c{i + 1}" for i in range(500)) + "\n.const c500 = 1"
    for source, message in [
        (words, "the program is too long"),
        (doubling, "the expansion is too long"),
        (deep, "too deeply"),
        (constants, "too deeply"),
        ("lit=" + "(" * 5000 + "1" + ")" * 5000, "nested too deeply"),
        ("lit=" + "-" * 5000 + "1", "nested too deeply"),
        ("lit=" + "9" * 5000, "cannot be represented"),
        ("nop " * 50_000, "line 1 is too long"),
        ("x.oops=1\n" * 1000, "too many errors"),
    ]:
        with pytest.raises(SourceError) as caught:
            meta.assemble(source)
        assert message in str(caught.value)


def test_a_long_sum_needs_no_depth():
    assert meta.assemble("lit=" + "+".join(["1"] * 40_000)).program.words == (40_000,)


def test_other_widths_go_through_assembler_and_disassembler():
    """A machine with 128 registers a bank: 268 bits, every one of which comes back from every form."""
    wider = InstructionSet(Widths(fpp_register=7))
    program = meta.assemble("x.ra=R127 seq.op=halt\n.word (1 << 268) - 1", isa=wider).program
    assert program.words[1].bit_length() == wider.bits == 268
    assert meta.assemble(meta.disassemble(program, wider), isa=wider).program.words == program.words
    assert meta.from_hex(meta.to_hex(program, wider), isa=wider) == program.words
    assert meta.from_binary(meta.to_binary(program, wider), isa=wider) == program.words
