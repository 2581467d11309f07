"""What is wrong with a scene, as messages that name the file, the place, and the path in the tree."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import islice
from typing import Any

from tasuki.diagnostics import Diagnostic, Span
from tasuki.scene.formula_text import FormulaError
from tasuki.scene.problem import Path, Problem, dotted
from tasuki.scene.schema import known_keys
from tasuki.scene.schema_fields import TAG, Model
from tasuki.scene.schema_nodes import node_models
from tasuki.scene.source import BROUGHT, SourceText, quote, suggestion
from tasuki.scene.yaml_format.nodes import Node

MOST_STEPS = 24
"""Steps of a path that a message shows; of a longer one it leaves out the middle."""

# What each kind of pydantic error expects; {name} is filled from the error's context.
EXPECTED = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "finite_number": "a finite number",
    "string_type": "a word",
    "bool_type": "true or false",
    "list_type": "a list",
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "greater_than": "more than {gt}",
    "greater_than_equal": "{ge} or more",
    "less_than": "less than {lt}",
    "literal_error": "{expected}",
    "expected": "{expected}",
    "string_pattern_mismatch": "a letter or underscore, then letters, digits and underscores",
}

_OPEN = {"points": "or more points", "normals": "or more normals", "children": "or more nodes"}
_OPEN |= {"parts": "or more parts", "matrix": "rows", "texture": "key, the kind of texture"}
"""What lists and mappings hold whose length varies; all others are vectors."""


class Places:
    """Translates paths of the data into places of the file."""

    def __init__(self, source: SourceText, root: Node) -> None:
        self.source = source
        self.root = root
        self.models = node_models()

    def follow(self, path: Path) -> tuple[Node, Path]:
        """The YAML node at `path`, or the deepest on the way there that exists; and the path as the file has it.

        A path may leave out the key that says what a node is, and the `children` of a list that stands alone.
        """
        node, way = self.root, list[str | int]()
        for number, step in enumerate(path):
            node, way = self._into_body(node, step, way)
            step = _as_in_file(node, step, way)
            following = _child(node, step)
            if following is None and step == "children" and isinstance(node.value, list):
                continue
            if following is None:
                return node, (*way, *path[number:])
            node = following
            way.append(step)
        return node, tuple(way)

    def _into_body(self, node: Node, step: str | int, way: list[str | int]) -> tuple[Node, list[str | int]]:
        """Enter a definition by the name that an instance gives, and a node's body by its one key."""
        if way[-1:] == ["of"] and isinstance(node.value, str):
            named = _child(_child(self.root, "definitions") or node, node.text)
            if named is not None:
                node, way = named, ["definitions", node.text]
        is_body = way and way[-1] in self.models and way[-2:-1] not in (["definitions"], ["parts"])
        if not is_body and self.is_item(node) and step not in node.value:
            ((key, (_, body)),) = node.value.items()
            return body, [*way, key]
        return node, way

    def is_item(self, node: Node) -> bool:
        """Whether a YAML node has the one key, a known one, that every node of a scene has."""
        return isinstance(node.value, dict) and len(node.value) == 1 and next(iter(node.value)) in self.models

    def plain(self, key: str, kind: type) -> Any:
        """What stands under a `key` of the scene, as plain data; nothing where it is not of the right `kind`."""
        found = _child(self.root, key)
        return found.plain if found is not None and isinstance(found.value, kind) else kind()

    def diagnostic(
        self,
        path: Path,
        message: str,
        expected: str | None,
        found: str | None,
        hint: str | None = None,
        span: Span | None = None,
    ) -> Diagnostic:
        """A message about what stands at `path`, which is drawn unless `span` is given."""
        node, way = self.follow(path)
        text = f"{shown(way)}: {message}" if way else message
        span = span or node.span(self.source.file)
        return Diagnostic(text, span, expected, found, hint, source=self.source.shown)

    def explain(self, error: Any, prefix: Path, model: type[Model]) -> Diagnostic:
        """A pydantic error of a `model` that stands at `prefix` as a diagnostic."""
        kind, location = error["type"], error["loc"]
        path = prefix + tuple(step for step in location if not str(step).startswith(TAG))
        context = {
            name: f"{value:g}" if isinstance(value, float) else value for name, value in error.get("ctx", {}).items()
        }
        if kind == "extra_forbidden":
            # Whatever it is, the last step is the key.
            path = path[: len(path) - (not str(location[-1]).startswith(TAG))]
            return self._unknown_key((*path, location[-1]), known_keys(model, location[:-1]))
        if path[-1:] == ("[key]",):
            key = self.follow(path[:-2])[0].value[path[-2]][0]
            span = key.span(self.source.file)
            return self.diagnostic(path[:-1], "this cannot be a name", EXPECTED[kind], quote(key.text), span=span)
        if kind == "missing":
            parent = self.follow(path[:-1])[0]
            return self.diagnostic(path, "this is missing", f"a key {path[-1]!r}", parent.describe())
        node = self.follow(path)[0]
        if kind in ("too_short", "too_long"):
            expected, found = _length(context, path[-1])
            noun = "mapping" if isinstance(node.value, dict) else "list"
            return self.diagnostic(path, f"this {noun} has the wrong length", expected, found)
        message = re.sub(r"^Input should be", "this should be", error["msg"])
        expected = EXPECTED.get(kind, message).format(**context)
        found = context.get("found") or node.describe()
        if kind.endswith("_type"):
            message = "this is of the wrong type"
        return self.diagnostic(path, message, expected, found)

    def locate(self, problem: Problem) -> Diagnostic:
        """A problem of the scene as a diagnostic."""
        return self.diagnostic(problem.path, problem.message, problem.expected, problem.found)

    def unknown(self, path: Path, key: str, name: str, known: Sequence[str], noun: str | None = None) -> Diagnostic:
        """Under `key` of the node at `path` stands the `name` of a thing, `noun`, that is none of the `known` ones."""
        noun = noun or key
        expected = "one of " + ", ".join(known) if known else f"no {noun}: the scene has none"
        return self.diagnostic((*path, key), f"no such {noun}", expected, quote(name), suggestion(name, known))

    def formula(self, path: Path, error: FormulaError) -> Diagnostic:
        """What is wrong with the formula at `path`, with a caret inside its text."""
        span = self._inside(self.follow(path)[0], error)
        return self.diagnostic(path, error.message, error.expected, error.found, error.hint, span)

    def _inside(self, node: Node, error: FormulaError) -> Span:
        """The place of a formula's characters. Those that are not blank stand in the file in the same order, whatever
        the scalar's style folds between them; only a backslash in double quotes is written twice."""
        if not node.text.strip():
            return node.span(self.source.file)
        before = "".join(node.text[: error.column].split())
        lines = self.source.shown.splitlines()
        line, column = node.line, node.column
        opening = lines[line][column]
        number = len(before) + (before.count("\\") if opening == '"' else 0)
        if opening in "|>":
            line, column = line + 1, 0
        elif opening in "'\"":
            column += 1
        letters = (
            (row, place)
            for row in range(line, node.end_line + 1)
            for place, sign in enumerate(lines[row] if row < len(lines) else "")
            if not sign.isspace() and (row > line or place >= column)
        )
        is_after = error.column >= len(node.text.rstrip())
        row, place = next(islice(letters, number - is_after, None), (line, column))
        place += is_after
        return Span(self.source.file, row + 1, place, row + 1, place + error.end - error.column)

    def _unknown_key(self, path: Path, known: list[str]) -> Diagnostic:
        key, _ = self.follow(path[:-1])[0].value[path[-1]]
        hint = suggestion(str(path[-1]), known)
        span = key.span(self.source.file)
        return self.diagnostic(path, "there is no such key", f"one of {', '.join(known)}", quote(key.text), hint, span)

    def unknown_node(self, path: Path, node: Node) -> Diagnostic:
        """What stands at `path`, `node`, has not the one key that a node has."""
        known = list(self.models)
        expected = f"one of {', '.join(known)}"
        if not isinstance(node.value, dict) or len(node.value) != 1:
            return self.diagnostic(path, "a node has one key", f"one key, {expected}", node.describe())
        ((name, (key, _)),) = node.value.items()
        span, hint = key.span(self.source.file), suggestion(name, known) or BROUGHT
        return self.diagnostic(path, "there is no such node", expected, quote(name), hint, span)


def shown(path: Path) -> str:
    """A path as messages show it: shapes[3].sphere.radius."""
    half = MOST_STEPS // 2
    return dotted(path) if len(path) <= MOST_STEPS else f"{dotted(path[:half])} ... {dotted(path[-half:])}"


def _as_in_file(node: Node, step: str | int, way: Sequence[str | int]) -> str | int:
    """A step from the mapping `node` as the file has it, where it is known by another word in Python."""
    if not isinstance(node.value, dict) or step in node.value:
        return step
    if isinstance(step, int) and step < len(node.value):
        name: str = list(node.value)[step]
        return name
    if way[-1:] == ["texture"] and len(node.value) == 1:
        (kind,) = node.value
        return str(kind)
    # A batch holds cylinders as cones.
    is_cylinder = str(step).endswith("_radius") and "radius" in node.value
    return "radius" if is_cylinder else step


def _child(node: Node, step: str | int) -> Node | None:
    """What stands under `step` in a mapping or a list."""
    if isinstance(node.value, dict) and step in node.value:
        child: Node = node.value[step][1]
        return child
    if isinstance(node.value, list) and isinstance(step, int) and step < len(node.value):
        item: Node = node.value[step]
        return item
    return None


def _length(context: dict[str, Any], name: str | int) -> tuple[str, str]:
    """What was expected and found of a list or mapping under `name`, which has the wrong length."""
    number = context.get("min_length") or context.get("max_length")
    return f"{number} {_OPEN.get(str(name), 'numbers')}", str(context["actual_length"])
