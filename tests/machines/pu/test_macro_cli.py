"""`tasuki asm`, `tasuki run` and `tasuki macros`: what they write and say, and their exit codes."""

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from tasuki.cli import app
from tasuki.machines.pu import macro, meta
from tasuki.terminal import print_macros

EXAMPLES = Path(__file__).parents[3] / "examples" / "pu"
NORMALIZE = EXAMPLES / "normalize.macro"


def tasuki(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_run_prints_steps_and_busy_shares():
    result = tasuki("run", NORMALIZE)
    assert result.exit_code == 0, result.stderr
    assert re.search(r"^steps +23$", result.stdout, re.MULTILINE)
    assert re.search(r"^figure_5 +18 +16\.7 +11\.1", result.stdout, re.MULTILINE)


def test_the_trace_of_the_normalisation_is_figure_5():
    lines = tasuki("run", NORMALIZE, "--trace").stdout.splitlines()
    steps = [line for line in lines if "figure_5" in line][:18]
    assert len(steps) == 18
    assert re.search(r"mul R1,R1.*mul R1,R1.*mul R1,R1", steps[0])
    assert "add own,y" in steps[1]
    assert "add x,z" in steps[2]
    assert all("mul R1,s" not in line for line in steps[:17])
    assert re.search(r"mul R1,s.*mul R1,s.*mul R1,s.*X\.R2=.*Y\.R2=.*Z\.R2=", steps[17])


def test_run_writes_a_value_change_dump(tmp_path):
    assert tasuki("run", NORMALIZE, "--vcd", tmp_path / "out.vcd").exit_code == 0
    assert "$enddefinitions $end" in (tmp_path / "out.vcd").read_text()


def test_a_value_change_dump_reaches_to_the_trap(tmp_path):
    path, dump = tmp_path / "trap.meta", tmp_path / "trap.vcd"
    path.write_text("x.op=copy x.a=lit lit=1.0\nseq.op=return\n")
    result = tasuki("run", path, "--vcd", dump)
    assert (result.exit_code, "empty call stack" in result.stderr) == (2, True)
    assert "\n#1\n" in dump.read_text()


def test_run_shows_memory():
    lines = tasuki("run", EXAMPLES / "picture.macro", "--memory", "513,2").stdout.splitlines()
    assert lines[-2].split() == [
        "513",
        "3b000000",
        "0.001953125",
        "3b000000",
        "0.001953125",
        "3f000000",
        "0.5",
        "3f800000",
        "1",
    ]


def test_run_takes_what_asm_wrote(tmp_path):
    translated = tmp_path / "out.meta"
    assert tasuki("asm", NORMALIZE, "--emit", "meta", "-o", translated).exit_code == 0
    assert tasuki("run", translated).stdout == tasuki("run", NORMALIZE).stdout


def test_asm_writes_every_form(tmp_path):
    program = macro.assemble_file(NORMALIZE).program
    binary = tmp_path / "out.bin"
    assert tasuki("asm", NORMALIZE, "--emit", "binary", "-o", binary).exit_code == 0
    assert meta.from_binary(binary.read_bytes()) == program.words
    assert meta.from_hex(tasuki("asm", NORMALIZE, "--emit", "hex").stdout) == program.words
    assert macro.assemble(tasuki("asm", NORMALIZE, "--emit", "macro").stdout).program.words == program.words
    assert "normalize v2, v1" in tasuki("asm", NORMALIZE).stdout


@pytest.mark.parametrize(("form", "suffix"), [("hex", ".hex"), ("binary", ".bin")])
def test_words_alone_are_disassembled_and_run(tmp_path, form, suffix):
    words = tmp_path / f"out{suffix}"
    assert tasuki("asm", NORMALIZE, "--emit", form, "-o", words).exit_code == 0
    again = tasuki("asm", words, "--emit", "meta").stdout
    assert meta.assemble(again).program.words == macro.assemble_file(NORMALIZE).program.words
    assert re.search(r"^steps +23$", tasuki("run", words).stdout, re.MULTILINE)


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("wrong.bin", b"123", "wrong.bin: this is no microcode"),
        ("wrong.hex", b"12\nxyz\n", "wrong.hex:2:1: error: this is no word"),
        ("wrong.hex", b"\xff\xff", "wrong.hex: line 1: this is not text"),
    ],
)
def test_wrong_words(tmp_path, name, content, expected):
    path = tmp_path / name
    path.write_bytes(content)
    wrong(path, expected)


def wrong(path: Path, *expected: str) -> None:
    for command in ("asm", "run"):
        result = tasuki(command, path)
        assert result.exit_code == 2
        assert "Traceback" not in result.output
        assert result.stdout == ""
        for text in expected:
            assert text in result.stderr


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("nop\n  frob s1\n", ["wrong.macro:2:3: error: there is no instruction 'frob'", "  frob s1\n", "^^^^"]),
        (
            "dot s1, v2\n",
            ["wrong.macro:1:1: error: 'dot' does not take these arguments", "expected: dot d:s, a:v, b:v"],
        ),
        ("a: nop\na: jump b\n", ["wrong.macro:2:1: error: 'a' is defined twice", "wrong.macro:2:9: error: 'b' is not"]),
        (".macro m\n m\n.end\nm\n", ["wrong.macro:2:2: error: the macro 'm' calls itself without end"]),
        ('.include "wrong.macro"\n', ["wrong.macro:1:10: error: the file includes itself"]),
    ],
)
def test_wrong_sources(tmp_path, source, expected):
    path = tmp_path / "wrong.macro"
    path.write_text(source)
    wrong(path, *expected)


def test_a_source_of_100_megabytes(tmp_path):
    path = tmp_path / "large.macro"
    with path.open("wb") as file:
        file.truncate(100_000_000)
    wrong(path, "large.macro: the source is too large", "100000000 bytes")


def test_a_binary_file(tmp_path):
    path = tmp_path / "binary.macro"
    path.write_bytes(b"nop\n\xff\xfe\x00\x01")
    wrong(path, "binary.macro: line 2: this is not text")


def test_missing_files_folders_and_foreign_suffixes(tmp_path):
    wrong(tmp_path / "missing.macro", "there is no such file")
    (tmp_path / "folder.meta").mkdir()
    wrong(tmp_path / "folder.meta", "this is not a file")
    wrong(tmp_path / "scene.yaml", "expected: a name ending in .macro or .meta")


def test_a_trap_is_one_message(tmp_path):
    path = tmp_path / "trap.macro"
    path.write_text("nop\nreturn\n")
    result = tasuki("run", path)
    assert result.exit_code == 2
    assert "trap.macro:2:1: error: return with an empty call stack" in result.stderr


def test_a_program_without_end_can_be_limited(tmp_path):
    path = tmp_path / "endless.macro"
    path.write_text("again: jump again\n")
    result = tasuki("run", path, "--limit", 1000)
    assert result.exit_code == 2
    assert "no halt within 1000 steps" in result.stderr


@pytest.mark.parametrize("arguments", [["--emit", "bits"], ["-o", "missing/out"]])
def test_asm_with_wrong_options(arguments):
    result = tasuki("asm", NORMALIZE, *arguments)
    assert result.exit_code == 2
    assert result.stderr.startswith("error: ")


def test_there_is_no_macro_source_of_a_meta_file(tmp_path):
    path = tmp_path / "one.meta"
    path.write_text("seq.op=halt\n")
    result = tasuki("asm", path, "--emit", "macro")
    assert (result.exit_code, "there is no macro source" in result.stderr) == (2, True)


def test_macros_as_json_and_as_a_table(capsys):
    rows = json.loads(tasuki("macros", "--json", "--values", 2000).stdout)
    assert {"operation", "published", "steps", "error", "note"} <= rows[0].keys()
    assert [row["steps"] for row in rows if row["operation"] in ("norm", "normalize")] == [12, 18]
    print_macros(rows)
    text = capsys.readouterr().out
    assert re.search(r"^matrix times matrix +matmat +64 +64 ", text, re.MULTILINE)
    assert re.search(r"^vector divide +vdiv +damaged +18 ", text, re.MULTILINE)
