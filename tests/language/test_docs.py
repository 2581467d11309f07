"""`docs/language.md` tells the truth: its examples check, its error is the error, no name is left out."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tasuki.diagnostics import SourceError
from tasuki.ir.verify import verify
from tasuki.language import Case, Module, link, load_modules
from tasuki.language.names import VOCABULARY

PAGE = (Path(__file__).parents[2] / "docs" / "language.md").read_text(encoding="utf-8")
EXAMPLES = [text for text in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL) if "def wrong" not in text]
WRONG = next(text for text in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL) if "def wrong" in text)
COMPLAINT = re.search(r"```text\n(.*?)\n```", PAGE, re.DOTALL)


def test_every_example_links(tmp_path):
    path = tmp_path / "examples.py"
    path.write_text("\n\n".join(EXAMPLES))
    found = {thing.name: thing for thing in load_modules(path) if not isinstance(thing, type)}
    fillers = {
        "shading": found["flat"],
        "weight_of": [Case(0, found["node_weight"], found["nodes"], "nodes")],
    }
    for thing in found.values():
        if isinstance(thing, Module):
            verify(link(thing, fillers))


def test_the_error_that_is_shown(tmp_path):
    path = tmp_path / "language.md"
    path.write_text("from tasuki.language import f32, i32, module\n\n" + WRONG)
    with pytest.raises(SourceError) as caught:
        link(load_modules(path)[0])
    assert COMPLAINT.group(1) in str(caught.value).replace(f"{tmp_path}/", "")


def test_every_word_of_the_vocabulary_is_explained():
    explained = set(re.findall(r"`(\w+)", PAGE))
    assert set(VOCABULARY) - explained == set()
