"""Every file in `errors/` is wrong; what a user is told about it stands beside it.

`pytest --update-golden` writes these texts anew.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tasuki.diagnostics import TasukiError
from tasuki.language import Module, link, load_modules

ERRORS = Path(__file__).parent / "errors"
FILES = sorted(ERRORS.glob("*.py"))


def complaint(path: Path) -> str:
    """The error of loading the file and linking its last module."""
    with pytest.raises(TasukiError) as caught:
        link([thing for thing in load_modules(path) if isinstance(thing, Module)][-1])
    return str(caught.value).replace(f"{ERRORS}/", "") + "\n"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_what_a_user_is_told(path, golden):
    golden(path.with_suffix(".txt"), complaint(path))


def test_no_text_stands_alone():
    assert {path.stem for path in ERRORS.glob("*.txt")} == {path.stem for path in FILES}
