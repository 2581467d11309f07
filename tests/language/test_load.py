"""Users' own files: what is found in them, and what is said about files that do not load."""

from __future__ import annotations

import pytest

from tasuki.diagnostics import SourceError
from tasuki.language import Module, Table, load_modules, resolve_module

TEXT = '''from tasuki.language import Table, f32, module, record, sqrt, vec3
from tasuki.modules.records import quadrics
from neighbour import EPSILON


@record
class Light:
    position: vec3


lights = Table(Light)


@module(fills="shading")
def fancy(x: f32) -> f32:
    """Fancy."""
    return sqrt(x) + EPSILON
'''


@pytest.fixture
def file(tmp_path):
    (tmp_path / "neighbour.py").write_text("EPSILON = 0.25\n")
    path = tmp_path / "my shading.py"
    path.write_text(TEXT)
    return path


def test_a_file_gives_what_it_declares_and_not_what_it_imports(file):
    found = load_modules(file)
    assert [getattr(thing, "name", None) or thing.__name__ for thing in found] == ["Light", "lights", "fancy"]
    light, lights, fancy = found
    assert isinstance(lights, Table)
    assert lights.record is light
    assert fancy.fills == "shading"
    assert fancy.check().function.signature == fancy.signature


def test_an_unchanged_file_runs_once_and_a_changed_one_again(file):
    first = load_modules(file)
    assert load_modules(str(file)) == first
    file.write_text(TEXT.replace("sqrt(x)", "x"))
    again = load_modules(file)
    assert again[2] is not first[2]
    assert again[2].check().function != first[2].check().function


def test_resolve_module(file):
    assert isinstance(resolve_module(f"{file}:fancy"), Module)
    assert resolve_module("tasuki.modules.elementary:exp2").name == "exp2"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("fancier", r"has no module `fancier`\n  expected: fancy\n  hint: did you mean `fancy`"),
        ("Light", r"`Light` in .* is not a module\n  expected: fancy"),
    ],
)
def test_names_that_are_no_modules(file, name, message):
    with pytest.raises(SourceError, match=message):
        resolve_module(f"{file}:{name}")


@pytest.mark.parametrize("spec", ["fancy", ":fancy", "file.py:", "", "file.py"])
def test_specs_that_are_none(spec):
    with pytest.raises(SourceError, match=r"names no module\n  expected: FILE.py:NAME"):
        resolve_module(spec)


def test_a_python_module_that_does_not_exist():
    with pytest.raises(SourceError, match=r"there is no Python module `no\.such\.thing`"):
        resolve_module("no.such.thing:f")


def test_a_python_module_that_fails(tmp_path, monkeypatch):
    (tmp_path / "failing_neighbour.py").write_text("import no_such_module\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(SourceError, match="`failing_neighbour` cannot be imported: ModuleNotFoundError"):
        resolve_module("failing_neighbour:f")


def test_files_that_cannot_be_read(tmp_path):
    (tmp_path / "binary.py").write_bytes(b"x = '\xff\xfe'\n")
    (tmp_path / "null.py").write_bytes(b"x = 1\x00\n")
    for name, message in [
        ("missing.py", "there is no file"),
        ("", "is a folder"),
        ("binary.py", "is not text\n  expected: Python source in UTF-8"),
        ("null.py", "is not text"),
    ]:
        with pytest.raises(SourceError, match=message):
            load_modules(tmp_path / name)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\nimport no_such_module\n", r"f.py:2:1: error: .*ModuleNotFoundError: No module named 'no_such_module'"),
        ("x = 1\n\ndef f():\n    return 1 // 0\n\nf()\n", r"f.py:4:1: error: .*ZeroDivisionError"),
        ("import sys\nsys.exit(3)\n", r"f.py:2:1: error: .*SystemExit: 3"),
        ("def f(:\n", r"f.py:1:7: error: this is not Python"),
        ("  x = 1\n", r"f.py:1:2: error: this is not Python: unexpected indent"),
        ("from tasuki.language import nothing\n", r"f.py:1:1: error: .*ImportError: cannot import name 'nothing'"),
    ],
)
def test_files_that_fail(tmp_path, text, message):
    path = tmp_path / "f.py"
    path.write_text(text)
    with pytest.raises(SourceError, match=message):
        load_modules(path)


def test_an_empty_file_declares_nothing(tmp_path):
    (tmp_path / "empty.py").write_text("")
    assert load_modules(tmp_path / "empty.py") == []
