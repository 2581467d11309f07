"""Whatever Python a user writes: an error with a place, or a program that the verifier accepts. Never a crash.

Modules of the tests are damaged: expressions and statements are replaced by others, taken from anywhere.
"""

from __future__ import annotations

import ast
import copy
import linecache
from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasuki.diagnostics import TasukiError
from tasuki.ir.nodes import Program
from tasuki.ir.verify import verify
from tasuki.language import Module, link

HERE = Path(__file__).parent
UNUSABLE = {"syntax_error", "fails_while_running", "not_a_function"}
TREES = [
    ast.parse(path.read_text(encoding="utf-8"))
    for path in sorted([*HERE.glob("lowering/*.py"), *HERE.glob("errors/*.py")])
    if path.stem not in UNUSABLE
]


def functions(tree):
    return [node for node in tree.body if isinstance(node, ast.FunctionDef)]


def places(node: ast.AST) -> Iterator[tuple[object, str | int, ast.AST]]:
    """Every expression and statement under `node`: its holder, where it stands there, and itself."""
    for name, value in ast.iter_fields(node):
        if isinstance(value, ast.expr):
            yield node, name, value
        elif isinstance(value, list):
            yield from ((value, i, item) for i, item in enumerate(value) if isinstance(item, ast.expr | ast.stmt))
    for child in ast.iter_child_nodes(node):
        yield from places(child)


def inside(function: ast.FunctionDef) -> list[tuple[object, str | int, ast.AST]]:
    return list(places(ast.Module(function.body, [])))


PARTS = [part for tree in TREES for function in functions(tree) for _, _, part in inside(function)]
EXPRESSIONS = [part for part in PARTS if isinstance(part, ast.expr)]
STATEMENTS = [part for part in PARTS if isinstance(part, ast.stmt)]


def damaged(random: Random) -> str:
    """The text of a file in which one function is damaged; it may not even be Python."""
    tree = copy.deepcopy(random.choice(TREES))
    function = random.choice(functions(tree))
    for _ in range(random.randint(1, 3)):
        holder, where, old = random.choice(inside(function))
        new = copy.deepcopy(random.choice(EXPRESSIONS if isinstance(old, ast.expr) else STATEMENTS))
        if isinstance(holder, list):
            holder[where] = new
        else:
            setattr(holder, where, new)
    return ast.unparse(ast.fix_missing_locations(tree))


def linked(module: Module) -> Program | str:
    """The program, or what a user is told."""
    try:
        return link(module)
    except TasukiError as error:
        return str(error)


@pytest.mark.filterwarnings("ignore::SyntaxWarning")
@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32))
def test_an_error_or_a_verified_program(seed):
    try:
        text = damaged(Random(seed))
        name = f"<damaged {seed}>"
        code = compile(text, name, "exec")
    except (SyntaxError, ValueError, AttributeError, TypeError):  # no longer Python: nothing for the checker
        return
    linecache.cache[name] = (len(text), None, text.splitlines(keepends=True), name)
    namespace = {"__name__": "damaged"}
    exec(code, namespace)
    for thing in namespace.values():
        if isinstance(thing, Module) and thing.file == name:
            outcome = linked(thing)
            if isinstance(outcome, str):
                assert "error: " in outcome
            else:
                verify(outcome)
    del linecache.cache[name]
