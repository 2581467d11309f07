"""The instruction set: its description is sound, encoding and decoding are inverse, rules see what they must."""

import dataclasses
import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tasuki.machines.pu import isa
from tasuki.machines.pu.isa import DEFAULT, InstructionSet, Widths


def words(machine: InstructionSet = DEFAULT) -> st.SearchStrategy[int]:
    return st.integers(0, (1 << machine.bits) - 1)


def test_the_default_is_256_bits_exactly():
    assert DEFAULT.bits == 256
    assert DEFAULT.fields[0].place + DEFAULT.fields[0].width == 256


def test_fields_fill_the_word_without_overlap():
    covered = [bit for one in DEFAULT.fields for bit in range(one.place, one.place + one.width)]
    assert sorted(covered) == list(range(256))
    assert len(DEFAULT.by_name) == len(DEFAULT.fields)


def test_the_machine_has_the_registers_of_the_paper():
    expected = {"x": 64, "y": 64, "z": 64, "s": 64, "alu": 32, "br": 32, "ir": 32, "ar": 32}
    assert DEFAULT.register_counts == expected
    assert DEFAULT.program_words == 16_384


@pytest.mark.parametrize("one", DEFAULT.fields, ids=lambda one: one.name)
def test_every_value_is_described_once(one: isa.Field):
    assert one.meaning.endswith(".")
    assert len(one.codes) == len(one.by_code) == len(one.values)
    assert all(value.meaning.endswith(".") or value.meaning.endswith(".)") for value in one.values)
    assert (one.kind == "choice") == bool(one.values)
    if one.values:
        assert one.values[0].code == 0


def test_widths_are_parameters():
    wider = InstructionSet(Widths(fpp_register=7, alu_register=6, program=16))
    assert wider.bits == 256 + 12 + 3 + 2
    assert wider.register_counts["x"] == 128
    word = isa.encode({"x.ra": 127, "seq.to": 65_535}, wider)
    assert isa.mnemonics(word, wider) == {"x.ra": 127, "seq.to": 65_535}


REGISTERS_AND_WORDS = ("alu_register", "fpp_register", "address_register", "program")


@pytest.mark.parametrize(
    "width", [one.name for one in dataclasses.fields(Widths) if one.name not in REGISTERS_AND_WORDS]
)
def test_widths_too_small_for_their_values_are_refused(width: str):
    narrow = 1 if getattr(Widths(), width) > 1 else 0
    with pytest.raises(ValueError, match="cannot hold"):
        InstructionSet(dataclasses.replace(Widths(), **{width: narrow}))


@given(words())
def test_decode_and_encode_are_inverse(word: int):
    fields = isa.decode(word)
    assert sum(code << DEFAULT.by_name[name].place for name, code in fields.items()) == word
    if not isa.undefined(fields):
        assert isa.encode(fields) == word
        assert isa.encode(isa.mnemonics(word)) == word
    else:
        with pytest.raises(isa.EncodingError):
            isa.encode(fields)


def test_encode_names_every_fault():
    with pytest.raises(isa.EncodingError) as caught:
        isa.encode({"x.op": "frob", "w.op": 1, "y.ra": 64, "z.op": 31, "s.ra": 1.0, "lit": 1 << 32})
    assert [name for name, _ in caught.value.problems] == ["x.op", "w.op", "y.ra", "z.op", "s.ra", "lit"]


@given(st.floats(width=32))
def test_float_bits(value: float):
    expected = 0x7FC00000 if math.isnan(value) else int.from_bytes(struct.pack(">f", value))
    assert isa.float_bits(value) == expected


def test_float_bits_round_to_nearest_and_saturate():
    assert isa.float_bits(16_777_217.0) == isa.float_bits(16_777_216.0)
    assert isa.float_bits(1e39) == 0x7F800000
    assert isa.float_bits(-1e39) == 0xFF800000


def problems(**settings: int | str) -> list[str]:
    fields = isa.decode(isa.encode({name.replace("_", ".", 1): value for name, value in settings.items()}))
    return [problem.message for problem in isa.conflicts(fields)]


def test_two_drivers_of_the_s_bus():
    assert "S bus" in problems(x_op="copy", x_a="s", y_op="copy", y_a="port")[0]
    assert "S bus" in problems(x_op="mul", x_a="s", x_b="port")[0]
    assert problems(x_op="copy", x_a="s", y_op="copy", y_a="s") == []
    assert problems(x_op="copy", x_a="port", y_op="mul", y_b="port", s_op="mul") == []


def test_selectors_of_operands_that_are_not_read_do_not_count():
    assert problems(x_op="copy", x_a="s", x_b="port", y_a="port", z_op="nop", z_b="port") == []


def test_two_writers_of_an_index_register():
    for load in ("ir_alu", "ir_lit"):
        for update in ("inc", "dec", "raster"):
            assert "index register 7" in problems(ag_load=load, ag_update=update, ag_ir=7)[0]
    assert problems(ag_load="br_lit", ag_update="inc") == []
    assert problems(ag_load="ar_alu", ag_update="raster") == []


def test_undefined_codes_are_found():
    fields = isa.decode(0) | {"x.op": 31, "tab.op": 7, "mem.op": 3}
    assert [problem.fields for problem in isa.undefined(fields)] == [("x.op",), ("tab.op",), ("mem.op",)]
    assert isa.undefined(isa.decode(0)) == []


def test_transfers_over_crossed_buses():
    word = isa.encode({"x.op": "add", "x.a": "own", "x.b": "y", "s.op": "add", "s.a": "x", "s.b": "z", "z.a": "s"})
    assert isa.transfers(isa.decode(word)) == [("y", "x"), ("x", "s"), ("z", "s")]
    assert isa.transfers(isa.decode(isa.encode({"y.op": "mul", "y.b": "port"}))) == [("s", "y")]


def test_every_vector_unit_hears_all_others():
    for unit in "xyz":
        heard = {value.bus for value in DEFAULT.by_name[f"{unit}.a"].values if value.bus}
        assert heard == set("xyzs") - {unit}
