"""YAML text as nodes that know their places: the part of YAML 1.2 that is data, and no more.

Scalars follow the core schema of YAML 1.2 (`no` is a word, `1e-3` a number). There are no tags, no merge keys, no
repeated keys. Nesting and what aliases expand to are limited, so that no file can exhaust the computer.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import yaml

from tasuki.diagnostics import Diagnostic, Note, Span
from tasuki.scene.source import SourceText, quote, scene_error
from tasuki.scene.tree import MOST_LEVELS

DEEPEST = 3 * MOST_LEVELS + 20
"""Levels of nesting: a node of a scene takes three, for its item, its body and its list of children."""

MOST_VALUES = 5_000_000
"""Values in a file, those that aliases repeat counted every time."""

_INTEGER = re.compile(r"[-+]?[0-9]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_WORDS: dict[str, Any] = {"": None, "~": None, "true": True, "True": True, "TRUE": True}
_WORDS |= {"null": None, "Null": None, "NULL": None, "false": False, "False": False, "FALSE": False}
_WORDS |= {sign + word: float(sign + "inf") for sign in ("", "+", "-") for word in (".inf", ".Inf", ".INF")}
_WORDS |= dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan"))


@dataclass(slots=True)
class Node:
    """A value and its place: a scalar, a list of nodes, or a dict from a key's text to its (key, value) nodes.

    `plain` is the same as plain Python data. Lines and columns count from 0; a parser's marks would take half of the
    memory that a large scene does.
    """

    value: Any
    text: str
    line: int
    column: int
    end_line: int
    end_column: int
    plain: Any
    size: int = 1
    closed: bool = False

    def span(self, file: str) -> Span:
        return Span(file, self.line + 1, self.column, self.end_line + 1, self.end_column)

    def describe(self) -> str:
        """The value as a message shows it."""
        if isinstance(self.value, list):
            return "a list" if self.value else "an empty list"
        if isinstance(self.value, dict):
            return "a mapping with " + ", ".join(self.value) if self.value else "an empty mapping"
        return "nothing" if self.value is None and not self.text else quote(self.text)


def compose(source: SourceText) -> Node | None:
    """The one document of `source`, None where it has none. SceneError where it is not YAML, or more than data."""
    return _Composer(source).document()


def resolve_scalar(text: str) -> Any:
    """What a plain scalar means in the core schema of YAML 1.2."""
    if text in _WORDS:
        return _WORDS[text]
    # Python refuses to read very long integers; as a number that no field can hold they are infinite.
    if _INTEGER.fullmatch(text) and len(text) < 300:
        return int(text)
    return float(text) if _FLOAT.fullmatch(text) else text


@dataclass
class _Composer:
    """Builds nodes from parse events, with a stack of its own: a recursive reader can be made to overflow."""

    source: SourceText
    open: list[Node] = field(default_factory=list)
    keys: list[Node | None] = field(default_factory=list)
    anchors: dict[str, Node] = field(default_factory=dict)
    root: Node | None = None

    def document(self) -> Node | None:
        documents = 0
        for event in self._events():
            # Most of a large scene are numbers: they take the shortest way.
            if type(event) is yaml.ScalarEvent and event.tag is None and event.anchor is None:
                self._attach(_scalar(event))
            elif isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    self._fail("a second document", event, "one scene in a file", "another after `---`")
            elif isinstance(event, yaml.NodeEvent):
                self._begin(event)
            elif isinstance(event, (yaml.SequenceEndEvent, yaml.MappingEndEvent)):
                self._close(event)
        return self.root

    def _events(self) -> Iterator[Any]:
        loader_class = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
        try:
            loader = loader_class(self.source.data.decode("utf-8"))
            while type(event := loader.get_event()) is not yaml.StreamEndEvent:
                yield event
        except yaml.MarkedYAMLError as error:
            raise self._syntax_error(error) from None
        except yaml.reader.ReaderError as error:
            span = self.source.span(len(self.source.data.decode("utf-8")[: error.position].encode()))
            problem = self.source.diagnostic("this is not YAML", span, "text", f"the character U+{ord_of(error):04X}")
            raise scene_error([problem]) from None

    def _begin(self, event: Any) -> None:
        if isinstance(event, yaml.AliasEvent):
            self._attach(self._anchored(event))
            return
        if event.tag is not None and event.tag != "!":
            self._fail("tags have no place in a scene", event, "plain data", quote(event.tag))
        if isinstance(event, yaml.ScalarEvent):
            node = _scalar(event)
        else:
            kind: type = list if isinstance(event, yaml.SequenceStartEvent) else dict
            node = _node(event, kind(), "", kind())
        if event.anchor:
            self.anchors[event.anchor] = node
        if node.closed:
            self._attach(node)
        elif len(self.open) == DEEPEST:
            self._fail("this is nested too deeply", event, f"at most {DEEPEST} levels", "one more")
        else:
            self.open.append(node)
            self.keys.append(None)

    def _close(self, event: Any) -> None:
        node = self.open.pop()
        self.keys.pop()
        node.closed = True
        node.end_line, node.end_column = event.end_mark.line, event.end_mark.column
        self._attach(node)

    def _anchored(self, event: Any) -> Node:
        node = self.anchors.get(event.anchor)
        if node is None:
            self._fail("no such anchor", event, f"`&{event.anchor}` further up", f"`*{event.anchor}` only")
        elif not node.closed:
            self._fail("a value cannot hold itself", event, "an anchor of another value", f"`*{event.anchor}`")
        assert node is not None
        return node

    def _attach(self, node: Node) -> None:
        """Put a complete node into the list or mapping that is open."""
        if not self.open:
            self.root = node
            return
        parent = self.open[-1]
        parent.size += node.size
        if parent.size > MOST_VALUES:
            self._fail("this scene is too large", node, f"at most {MOST_VALUES} values", "more, with its aliases")
        if type(parent.value) is list:
            parent.value.append(node)
            parent.plain.append(node.plain)
        elif self.keys[-1] is None:
            self._check_key(parent, node)
            self.keys[-1] = node
        else:
            key = self.keys[-1]
            parent.value[key.text] = (key, node)
            parent.plain[key.text] = node.plain
            self.keys[-1] = None

    def _check_key(self, parent: Node, key: Node) -> None:
        if isinstance(key.value, (list, dict)):
            self._fail("this cannot be a key", key, "a word", key.describe())
        if key.text in parent.value:
            first = Note("the first is here", parent.value[key.text][0].span(self.source.file))
            self._fail(f"the key {key.text!r} appears twice", key, "each key once", quote(key.text), first)

    def _fail(self, message: str, at: Any, expected: str, found: str, *notes: Note) -> None:
        span = (at if isinstance(at, Node) else _node(at, None, "", None)).span(self.source.file)
        raise scene_error([Diagnostic(message, span, expected, found, None, notes, self.source.shown)])

    def _syntax_error(self, error: yaml.MarkedYAMLError) -> Exception:
        mark = error.problem_mark or error.context_mark
        span = Span(self.source.file, mark.line + 1, mark.column) if mark else None
        notes: tuple[Note, ...] = ()
        if error.context and error.context_mark:
            place = Span(self.source.file, error.context_mark.line + 1, error.context_mark.column)
            notes = (Note(error.context, place),)
        message = f"this is not YAML: {error.problem or error.context}"
        return scene_error([Diagnostic(message, span, None, None, None, notes, self.source.shown)])


def _scalar(event: yaml.ScalarEvent) -> Node:
    text = event.value
    value = resolve_scalar(text) if event.implicit[0] else text
    node = _node(event, value, text, value)
    node.closed = True
    return node


def _node(event: Any, value: Any, text: str, plain: Any) -> Node:
    start, end = event.start_mark, event.end_mark
    return Node(value, text, start.line, start.column, end.line, end.column, plain)


def ord_of(error: yaml.reader.ReaderError) -> int:
    """The character that a reader refused; libyaml gives its number, the reader in Python the character."""
    character = error.character
    return ord(character) if isinstance(character, str) else int(character)
