"""The macro assembler: what it translates to, and what it says about wrong sources."""

import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasuki.diagnostics import SourceError
from tasuki.machines.pu import macro, meta, simulate
from tasuki.machines.pu.isa import DEFAULT, mnemonics
from tasuki.machines.pu.macro.reader import Reader
from tasuki.machines.pu.meta.source import Errors

EXAMPLES = sorted((Path(__file__).parents[3] / "examples" / "pu").glob("*.macro"))
LIBRARY = sorted(macro.LIBRARY.glob("*.macro"))


def fields(source: str) -> list[dict[str, int | str]]:
    return [mnemonics(word) for word in macro.assemble(source).program.words]


def errors(source: str) -> list[str]:
    """Line, column and message of every error."""
    with pytest.raises(SourceError) as caught:
        macro.assemble(source, "wrong.macro")
    for one in caught.value.diagnostics:
        assert one.span is not None
        assert "^" in str(one), one
    return [f"{one.span.line}:{one.span.column + 1} {one.message}" for one in caught.value.diagnostics]


def run(source: str) -> simulate.State:
    return simulate.run(macro.assemble(source).program, machine="plain").state


# --- translation ------------------------------------------------------------------------------------------------------


def test_a_call_becomes_the_microinstructions_of_its_macro():
    assert fields("add s3, s1, s2") == [{"s.op": "add", "s.ra": 1, "s.rb": 2, "s.rd": 3, "s.w": "result"}]


def test_the_kinds_of_the_operands_choose_between_macros_of_one_name():
    assert fields("add s3, s1, 0.5")[0]["lit"] == 0x3F000000
    assert fields("add s3, s1, 1")[0]["lit"] == 0x3F800000
    assert fields("move i3, 1") == [{"alu.op": "copy", "alu.a": "lit", "alu.rd": 3, "alu.w": "result", "lit": 1}]


def test_fields_may_be_named_directly_for_several_units_at_once():
    assert fields("xz.op=mul xz.ra=v3 xz.a=reg xz.rb=R4") == [
        {"x.op": "mul", "x.ra": 3, "x.rb": 4, "z.op": "mul", "z.ra": 3, "z.rb": 4}
    ]


def test_macros_with_parameters_that_call_macros():
    source = """
        .macro twice d:s, a:s
            add d, a, a
        .end
        .macro four_times d:s, a:s
            twice d, a
            twice d, d
        .end
        .const N = 2 + 3
        .name total = s9
        four_times total, s2
        move s1, 2*N
    """
    assert fields(source) == [*fields("add s9, s2, s2"), *fields("add s9, s9, s9"), *fields("move s1, 10.0")]


def test_macros_may_be_used_before_they_are_defined():
    assert fields("mine\n.macro mine\n nop\n halt\n.end") == fields("nop\nhalt")


def test_labels_inside_macros_belong_to_one_expansion():
    source = ".macro wait n:integer\n count n\nagain: loop again\n.end\nwait 2\nwait 3\nagain: halt"
    program = macro.assemble(source).program
    assert [mnemonics(word).get("seq.to") for word in program.words] == [None, 1, None, 3, None]
    assert program.labels["again"] == 4


def test_labels_as_arguments():
    assert fields(".macro go to:label\n jump to\n.end\nnop\nhere: go here")[1] == {"seq.op": "jump", "seq.to": 1}


def test_a_macro_of_the_program_hides_the_librarys():
    source = ".macro rcp_out a:s\n halt\n.end\n rcp_out s1\n div s1, s2, s3"
    assert fields(source)[0] == {"seq.op": "halt"}
    assert len(fields(source)) == 1 + len(fields("div s1, s2, s3"))


TABLES = """
.record sphere
    .row centre: cx cy cz radius
    .row colour: red green blue -
.end
.table spheres, sphere, 10, 100
.table others, sphere, 5
.picture screen, 16, 8
.data spheres+2: 1.5, -2, 0x10, inf, 7
"""


def test_tables_are_placed_one_behind_the_other():
    reader = macro.assemble(TABLES + "open others\nopen_picture screen")
    literals = [mnemonics(word).get("lit", 0) for word in reader.program.words]
    assert literals[:3] == [120, 2, 0]
    assert literals[3:] == [130, 16, 16, 0, 0]


def test_initial_memory():
    memory = macro.assemble(TABLES).program.memory
    assert memory == {102: (0x3FC00000, 0xFFFFFFFE, 0x10, 0x7F800000), 103: (7, 0, 0, 0)}


def test_memory_grows_with_its_tables():
    assert macro.assemble(".picture p, 512, 512\nopen_picture p").program.memory_rows == 512 * 512
    assert macro.assemble(".memory 10\n.display 3\nnop").program.memory_rows == 10


def test_fields_of_records_reach_their_row_and_bank():
    source = (
        TABLES
        + """
        open spheres
        seek spheres, 1
        load v1, spheres.centre
        load s2, spheres.cx
        load i3, spheres.radius
        store spheres.green, s2
        store spheres.blue, i3
        halt
    """
    )
    state = run(source)
    assert [state.registers[bank][1] for bank in "xyzs"] == [0x3FC00000, 0xFFFFFFFE, 0x10, 0x7F800000]
    assert state.registers["s"][2] == 0x3FC00000
    assert state.registers["alu"][3] == 0x7F800000
    assert state.memory[103].tolist() == [7, 0x3FC00000, 0x7F800000, 0]


def test_a_picture_is_filled_line_by_line():
    state = run(
        ".picture p, 3, 2, 50\n open_picture p\n count 6\nagain: tell_column i1, p\n tell_line i2, p\n"
        " move s1, i1\n move x1, s1\n move s1, i2\n put p, v1\n loop again\n halt"
    )
    assert state.memory[50:56, [0, 3]].tolist() == [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]]


def test_includes_are_read_once(tmp_path):
    (tmp_path / "shared.macro").write_text(".const N = 3\n.macro mine\n nop\n.end\n")
    main = tmp_path / "main.macro"
    main.write_text('.include "shared.macro"\n.include "shared.macro"\nmine\ncount N\nhalt\n')
    made = macro.assemble_file(main)
    assert [mnemonics(word) for word in made.program.words] == fields("nop\ncount 3\nhalt")
    assert macro.assemble(made.source).program.words == made.program.words


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_translation_assembles_to_the_same_bits(path):
    made = macro.assemble_file(path)
    again = meta.assemble(made.meta).program
    assert again.words == made.program.words
    assert (again.memory, again.memory_rows, again.labels) == (
        made.program.memory,
        made.program.memory_rows,
        made.program.labels,
    )


def test_every_call_is_a_comment_in_the_translation():
    lines = macro.assemble("normalize v2, v1").meta.splitlines()
    assert [line.strip() for line in lines if line.lstrip().startswith(";")][1:] == [
        "; normalize v2, v1",
        "; norm s2, v1",
        "; dot s2, v1, v1",
        "; sqrt s2, s2",
        "; rcp_out s2",
        "; rcp_correction s2",
    ]


def test_spans_are_lines_of_the_macro_source():
    program = macro.assemble("nop\n\ndot s1, v1, v2\n", "mine.macro").program
    assert [(span.file, span.line) for span in program.spans] == [("mine.macro", 1), *[("mine.macro", 3)] * 3]


# --- the instructions that Table 1 does not have ----------------------------------------------------------------------


def floats(state: simulate.State, number: int) -> list[float]:
    return [float(np.uint32(state.registers[bank][number]).view(np.float32)) for bank in "xyzs"]


def test_cross_product():
    state = run("move v1, 1, 2, 3, 9\nmove v2, 5, -7, 11, 9\ncross v3, v1, v2\nhalt")
    assert floats(state, 3)[:3] == [43.0, 4.0, -17.0]


def test_scalars_and_integers_go_to_and_fro():
    state = run("move i1, -7\nitof s1, i1\nmul s1, s1, 1.5\nftoi i2, s1\nmove x5, s1\nmove s6, x5\nhalt")
    assert np.int32(np.uint32(state.registers["alu"][2])) == -10
    assert floats(state, 6)[3] == -10.5


@pytest.mark.parametrize(
    ("operation", "expected"),
    [
        *[("iadd", 15), ("isub", 9), ("imul", 36), ("iand", 0), ("ior", 15), ("ixor", 15), ("ishl", 96), ("ishr", 1)],
        *[("isar", 1), ("imin", 3), ("imax", 12)],
    ],
)
def test_integer_arithmetic(operation, expected):
    for second in ("i2", "3"):
        state = run(f"move i1, 12\nmove i2, 3\n{operation} i3, i1, {second}\nhalt")
        assert state.registers["alu"][3] == expected


def test_subroutines_loops_and_branches():
    state = run("""
            move i1, 0
            move i3, 3
            count i3
    again:  call more
            loop again
            compare i1, 6
            branch alu.eq, good
            halt
    good:   move i2, 1
            halt
    more:   iadd i1, i1, 2
            return
    """)
    assert state.registers["alu"][1:3] == [6, 1]


def test_select_takes_the_first_where_the_condition_holds():
    state = run("move s1, 1\nmove s2, 2\ncompare s1, s2\nselect s3, s1, s2, s.lt\nselect s4, s1, s2, s.eq\nhalt")
    assert (floats(state, 3)[3], floats(state, 4)[3]) == (1.0, 2.0)


def test_every_macro_of_the_library_has_an_operand_that_it_takes():
    """Each macro, called with plain operands of its kinds, assembles."""
    reader = Reader(Errors())
    reader.read_library(LIBRARY)
    sample = {"s": "s", "x": "x", "y": "y", "z": "z", "v": "v", "i": "i"}
    plain = {"float": "1.5", "integer": "3", "label": "here", "condition": "s.lt"}
    tables = ".record r\n.row all: f0 f1 f2 f3\n.end\n.table t, r, 4\n.picture p, 4, 4\nhere: nop\n"
    for same in reader.library.values():
        for one in same:
            arguments = []
            vector = any(kind == "v" for _, kind in one.parameters)
            for i, (_, kind) in enumerate(one.parameters):
                own = {"m": f"m{4 * i}", "table": "p", "field": "t.all" if vector else "t.f1"}
                arguments.append(plain.get(kind) or own.get(kind) or f"{sample[kind]}{20 + i}")
            macro.assemble(f"{tables}{one.name.text} {', '.join(arguments)}")


# --- errors -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("frob s1", ["1:1 there is no instruction 'frob'"]),
        ("add s1, s2", ["1:1 'add' does not take these arguments"]),
        ("dot s1, v2, v99", ["1:13 there is no register v99"]),
        ("add s1,, s2", ["1:1 an argument is missing"]),
        ("vecmat v1, v1, m4", ["1:1 'vecmat' needs two different operands here"]),
        ("matmat m5, m0, m4", ["1:1 'matmat' needs two different operands here"]),
        ("nop\njump nowhere", ["2:6 'nowhere' is not defined"]),
        ("a: nop\na: nop", ["2:1 'a' is defined twice"]),
        ("m4: nop", ["1:1 'm4' is predefined"]),
        ("x.op=add x.op=sub", ["1:10 the field x.op is given twice"]),
        ("foo=3", ["1:1 there is no field 'foo'"]),
        ("x.op=blah", ["1:6 'blah' is not a value of x.op"]),
        ("x.ra=s3", ["1:6 x.ra does not take s3"]),
        ("x.ra=3", ["1:6 x.ra does not take 3"]),
        ("lit=99999999999", ["1:5 99999999999 does not fit lit: expected -2147483648 to 4294967295 (32 bits)"]),
        ("x.ra=R1+", ["1:8 a value is missing after this"]),
        (".const a = 1\n.const a = 2", ["2:8 'a' is defined twice"]),
        (".name b = 3", ["1:11 .name names a register"]),
        (".data 0: 1, 2\n.data 0: 3", ["2:10 row 0 is given twice"]),
        (".record r\n nop\n.end", ["1:1 a record without rows", "2:2 an instruction cannot stand here"]),
        (".macro m\n nop", ["1:1 .macro without its .end"]),
        (".end", ["1:1 .end is malformed"]),
        (".macro m a:q\n.end", ["1:12 there is no kind 'q'"]),
        (".frobnicate", ["1:1 '.frobnicate' is not a directive"]),
        (".macro a\n b\n.end\n.macro b\n a\n.end\na", ["5:2 the macro 'a' calls itself without end"]),
        (".macro q d:s\n add d, d, z9\n.end\nq s1", ["2:2 'add' does not take these arguments"]),
        (
            ".record r\n.row all: a b c d\n.end\n.table t, r, 2, 4\n.table u, r, 9, 0",
            ["5:8 'u' lies over 't'"],
        ),
        (
            ".record r\n.row all: a b c d\n.end\n.table t, r, 2\nload s1, t.all",
            ["5:1 'load': t.all is more than one word"],
        ),
        ("ag.load=ir_lit ag.update=inc", ["1:1 write conflict: index register 0 is loaded and goes on in one step"]),
        ('.include "missing.macro"', ["1:10 missing.macro: there is no such file"]),
        (
            "frob\nadd s1\n\njump there",
            [
                "1:1 there is no instruction 'frob'",
                "2:1 'add' does not take these arguments",
                "4:6 'there' is not defined",
            ],
        ),
    ],
)
def test_errors_have_their_place_and_come_together(source, expected):
    assert errors(source) == expected


def test_an_include_that_includes_itself(tmp_path):
    (tmp_path / "a.macro").write_text('.include "b.macro"\n')
    (tmp_path / "b.macro").write_text('nop\n.include "a.macro"\n')
    with pytest.raises(SourceError, match="the file includes itself") as caught:
        macro.assemble_file(tmp_path / "a.macro")
    assert "a.macro -> b.macro -> a.macro" in str(caught.value)


def test_macros_that_expand_to_too_much_are_stopped():
    doubling = "".join(f".macro d{i}\n d{i + 1}\n d{i + 1}\n.end\n" for i in range(40))
    began = time.perf_counter()
    assert errors(doubling + ".macro d40\n.end\nd0") == ["163:1 the program expands to too many calls"]
    assert errors(doubling + ".macro d40\n nop\n.end\nd0") == ["164:1 the program is too long"]
    assert time.perf_counter() - began < 20


def test_macros_nested_too_deeply_are_stopped():
    source = "".join(f".macro d{i}\n d{i + 1}\n.end\n" for i in range(2000)) + "d0"
    assert errors(source) == ["191:2 macros are nested too deeply"]


PIECES = [
    *(one.name for one in DEFAULT.fields[::5]),
    *(".const", ".name", ".macro", ".end", ".record", ".row", ".table", ".picture", ".data", ".include", ".distinct"),
    *'=,:()+-*/%.;"\\ \n\n\n\0',
    *("s1", "v2", "m4", "i3", "s99", "R1", "1.5", "0x1F", "add", "vecmat", "load", "t", "t.a", "label", "頂点", "mul"),
]
SEEDS = [path.read_text() for path in (*EXAMPLES, *LIBRARY)]


def assembles_or_says_why(text: str) -> None:
    found: tuple = ()
    try:
        macro.assemble(text, "fuzz.macro")
    except SourceError as error:
        found = error.diagnostics or ("an error without diagnostics",)
    for one in found:
        assert "too many errors" in str(one) or (one.span is not None and "^" in str(one))


@settings(max_examples=150, deadline=None)
@given(st.lists(st.sampled_from(PIECES), max_size=40).map(" ".join))
def test_made_up_sources_never_crash(text):
    assembles_or_says_why(text)


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_damaged_sources_never_crash(data):
    text = data.draw(st.sampled_from(SEEDS))
    start = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(start, min(len(text), start + 60)))
    assembles_or_says_why(text[:start] + data.draw(st.sampled_from(PIECES)) + text[end:])
