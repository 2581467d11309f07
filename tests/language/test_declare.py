"""Declarations: what modules, sockets, records and tables know about themselves, before and after they are checked."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

import tasuki.language as language
from tasuki.diagnostics import SourceError
from tasuki.ir import types as ir
from tasuki.ir.nodes import Signature
from tasuki.language import Table, f32, i32, link, mat4, module, record, socket, vec3, vec4
from tasuki.language.names import VOCABULARY
from tasuki.modules.records import Quadric, Triangle, quadrics


@record
class Leaf:
    """A nested record that begins in the middle of a row."""

    weight: f32
    open: bool


@record
class Everything:
    """One field of every kind."""

    number: f32
    count: i32
    leaf: Leaf
    direction: vec3
    after: i32
    plane: vec4
    matrix: mat4
    last: bool


things = Table(Everything)
named_by_hand = Table(Leaf, name="leaves")


@module(number=7, method="raytrace", fills="shading")
def example(count: i32, table: Table[Leaf], pair: Leaf) -> tuple[f32, bool]:
    """The first line.

    More.
    """
    return f32(count) * table[0].weight, pair.open


@socket
def shading(point: vec3) -> vec3: ...


def test_a_module_knows_itself():
    assert example.name == "example"
    assert example.qualified_name == "tests.language.test_declare:example"
    assert (example.number, example.method, example.fills) == (7, "raytrace", "shading")
    assert example.doc == "The first line.\n\nMore."
    assert example.file == __file__
    assert Path(__file__).read_text().splitlines()[example.line - 1].startswith("@module(number=7")
    assert example.parameters == ("count", "table", "pair")
    assert example.signature == Signature((ir.I32, ir.Table(Leaf.ir), Leaf.ir), ir.Tuple((ir.F32, ir.BOOL)))
    assert example.source_digest == hashlib.sha256(Path(__file__).read_bytes()).hexdigest()


def test_fills_takes_the_socket_itself():
    @module(fills=shading)
    def plain(point: vec3) -> vec3:
        return point

    assert plain.fills == "shading"
    assert plain.qualified_name == "tests.language.test_declare:test_fills_takes_the_socket_itself.plain"


def test_declaring_parses_nothing():
    source = "@module\ndef f(x: f32) -> f32:\n    return x\n"
    namespace = {"module": module, "f32": f32, "__name__": "nowhere"}
    exec(compile(source, "<no text to be had>", "exec"), namespace)
    assert str(namespace["f"].signature) == "(f32) -> f32"
    with pytest.raises(SourceError, match="the source of module `f` cannot be read"):
        namespace["f"].check()


def test_a_record_is_a_type_and_a_python_class():
    assert isinstance(Everything, type)
    assert Everything.__doc__ == "One field of every kind."
    assert str(Everything.ir) == "Everything"
    assert [name for name, _ in Everything.ir.fields] == [
        "number", "count", "leaf", "direction", "after", "plane", "matrix", "last",
    ]  # fmt: skip
    leaf = Leaf(1, open=True)
    assert leaf == Leaf(weight=1.0, open=True)
    assert leaf != Leaf(2.0, True)
    assert repr(leaf) == "Leaf(weight=1.0, open=True)"
    for wrong in [(1.0,), (1.0, True, 2)]:
        with pytest.raises(TypeError, match="weight: f32, open: bool"):
            Leaf(*wrong)
    with pytest.raises(TypeError):
        Leaf(1.0, True, weight=2.0)


def test_numpy_dtype_lies_as_the_layout_says():
    """Every leaf of the structured array stands in the row and bank of `Record.layout`."""
    dtype = Everything.numpy_dtype()
    rows = Everything.ir.rows
    assert dtype.itemsize == rows * 16
    one = np.zeros(1, dtype)
    one["number"], one["count"] = 1.5, 2
    one["leaf"]["weight"], one["leaf"]["open"] = 3.5, 1
    one["direction"] = [4.5, 5.5, 6.5]
    one["after"] = 7
    one["plane"] = [8.5, 9.5, 10.5, 11.5]
    one["matrix"] = np.arange(12, 28).reshape(4, 4)
    one["last"] = 1
    expected = [1.5, 2, 3.5, 1, 4.5, 5.5, 6.5, 7, 8.5, 9.5, 10.5, 11.5, *range(12, 28), 1]
    words = one.view(np.float32).reshape(rows, 4)
    for leaf, (row, bank), value in zip(Everything.ir.leaves, Everything.ir.layout, expected, strict=True):
        found = words[row, bank] if leaf == "f32" else words.view(np.int32)[row, bank]
        assert found == value


@pytest.mark.parametrize(("cls", "rows"), [(Quadric, 5), (Triangle, 7)])
def test_records_of_the_paper_have_their_rows(cls, rows):
    assert cls.numpy_dtype().itemsize == rows * 16


def test_a_table_is_called_as_the_variable_that_holds_it():
    alias = things
    assert alias.name == "things"
    assert quadrics.name == "quadrics"
    assert named_by_hand.name == "leaves"

    @module
    def through_an_alias(i: i32) -> i32:
        return alias[i].count

    assert through_an_alias.check().tables == {"things": Everything.ir}


def test_a_table_without_a_global_takes_the_name_by_which_it_is_met():
    local = Table(Leaf)
    assert local.name is None

    @module
    def reads(i: i32) -> f32:
        return local[i].weight

    assert reads.check().tables == {"local": Leaf.ir}
    assert local.name == "local"


def test_all_exported_names_exist_and_the_vocabulary_is_among_them():
    assert all(hasattr(language, name) for name in language.__all__)
    assert set(VOCABULARY) <= set(language.__all__)
    assert language.__all__ == sorted(language.__all__)


def test_a_linked_program_can_be_made_of_an_imported_record():
    @module
    def constant(quadric: Quadric) -> f32:
        return quadric.constant

    assert link(constant).functions[constant.qualified_name].parameters[0].type == Quadric.ir


def test_a_module_is_made_by_def():
    async def waits(x: f32) -> f32:
        return x

    for thing, found in ((lambda x: x, "a lambda"), (waits, "an `async def`"), (3, "3, of type int")):
        with pytest.raises(SourceError, match=f"@module goes before a function(.|\n)*found: {found}"):
            module(thing)
