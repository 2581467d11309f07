"""What the constructs of the language become: for every file in `lowering/`, the program in the IR's text form.

`pytest --update-golden` writes these texts anew.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tasuki.ir.text import print_program
from tasuki.ir.verify import verify
from tasuki.language import Module, link, load_modules

LOWERING = Path(__file__).parent / "lowering"
FILES = sorted(LOWERING.glob("*.py"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_lowering(path, golden):
    entry = [thing for thing in load_modules(path) if isinstance(thing, Module)][-1]
    program = link(entry)
    verify(program)
    python_module = entry.qualified_name.rpartition(":")[0]
    golden(path.with_suffix(".txt"), print_program(program).replace(f"{python_module}:", ""))
