"""Whatever the source: bits, or errors with a place. Whatever the word: source that gives it back."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasuki.diagnostics import SourceError
from tasuki.machines.pu import meta
from tasuki.machines.pu.isa import DEFAULT, Program

Result = TypeVar("Result")
ASM = Path(__file__).parent / "asm"
SEEDS = [path.read_text() for path in sorted(ASM.glob("*.meta"))]
PIECES = [
    *(one.name for one in DEFAULT.fields),
    *(".const", ".reg", ".define", ".value", ".include", ".memory", ".data", ".line", ".word"),
    *"=,:()+-*/%&|^~<>\\;\"'.#\0\t \n\n\n\x0b\x85\u2028",
    *("R1", "I2", "BR3", "R999", "1.5", "0x1F", "1e400", "1_", "0b", "mul", "reg", "own", "nop", "f", "g", "頂点"),
]


def attempt(work: Callable[[], Result]) -> Result | SourceError:
    """The result, or the errors: anything else that is raised fails the test."""
    try:
        return work()
    except SourceError as error:
        return error


def assembles_or_says_why(text: str) -> None:
    result = attempt(lambda: meta.assemble(text, "fuzz.meta"))
    if isinstance(result, SourceError):
        assert result.diagnostics
        for one in result.diagnostics:
            assert one.span is not None
            assert "^" in str(one)
    else:
        assert meta.assemble(meta.disassemble(result.program)).program.words == result.program.words


@given(st.text())
def test_any_text(text: str):
    assembles_or_says_why(text)


@given(st.lists(st.sampled_from(PIECES), max_size=60))
def test_pieces_of_the_language(pieces: list[str]):
    assembles_or_says_why("".join(pieces))


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(SEEDS), st.data())
def test_sources_with_parts_cut_out_and_put_in(text: str, data: st.DataObject):
    for _ in range(data.draw(st.integers(1, 5))):
        begin = data.draw(st.integers(0, len(text)))
        end = data.draw(st.integers(begin, min(len(text), begin + 20)))
        text = text[:begin] + data.draw(st.sampled_from(["", *PIECES])) + text[end:]
    if ".include" not in text:
        assembles_or_says_why(text)


@given(st.binary(max_size=64))
def test_any_file(tmp_path_factory: pytest.TempPathFactory, data: bytes):
    path = tmp_path_factory.mktemp("fuzz") / "any.meta"
    path.write_bytes(data)
    result = attempt(lambda: meta.assemble_file(path))
    assert not isinstance(result, SourceError) or "any.meta" in str(result)


@given(st.lists(st.integers(0, 2**256 - 1), max_size=5))
def test_any_words_come_back(words: list[int]):
    program = Program(tuple(words))
    assert meta.assemble(meta.disassemble(program)).program.words == program.words
    assert meta.from_hex(meta.to_hex(program)) == program.words
    assert meta.from_binary(meta.to_binary(program)) == program.words


def defined_words() -> st.SearchStrategy[int]:
    """Words whose every code has a meaning."""
    parts = [
        st.sampled_from([value.code for value in one.values]) if one.values else st.integers(0, one.mask)
        for one in DEFAULT.fields
    ]
    return st.tuples(*parts).map(
        lambda codes: sum(code << one.place for code, one in zip(codes, DEFAULT.fields, strict=True))
    )


@given(defined_words(), st.dictionaries(st.sampled_from(["a", "b.c", "頂点"]), st.integers(0, 1)))
def test_defined_words_come_back_with_their_labels(word: int, labels: dict[str, int]):
    program = Program((word,), labels=labels)
    text = meta.disassemble(program)
    again = meta.assemble(text).program
    assert again.words == program.words
    assert again.labels.items() >= labels.items()
    assert meta.disassemble(again) == text


@given(st.text(max_size=80))
def test_any_hex(text: str):
    result = attempt(lambda: meta.from_hex(text))
    assert not isinstance(result, SourceError) or result.diagnostics
