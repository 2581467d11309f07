"""Neutral File Format, version 3.9 (Eric Haines): one-letter entities followed by numbers.

The file is a stream of words and numbers parted by white space; a line break means nothing, except that it ends a
comment. So both layouts of `c`, on one line or on three, are the same. The whole file is cut into tokens and converted
with a handful of array operations; places are worked out only for shapes and for what is wrong.

Beyond the text of the format: shapes and lights may stand before the view; `hither` may be missing; equal materials are
one; a shape without any `f` before it is white, with a warning. Ks weighs the highlight and the mirrored ray both.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tasuki.diagnostics import Diagnostic, Note, SceneError, Span
from tasuki.scene.check import Problem, problems
from tasuki.scene.model import Camera, Material, PointLight, Scene, Vector
from tasuki.scene.shapes import CONE, POLYGON, SPHERE, Cones, Polygons, Shapes, Spheres
from tasuki.scene.source import MOST_ERRORS, SourceText, quote, scene_error, suggestion


@dataclass(frozen=True)
class Entity:
    """What a word of the format means and the numbers that follow it."""

    word: str
    meaning: str
    counts: tuple[int, ...]
    numbers: str


ENTITIES = (
    Entity("v", "view", (0,), "no numbers; `from`, `at`, ... follow"),
    Entity("from", "eye", (3,), "x y z"),
    Entity("at", "point looked at", (3,), "x y z"),
    Entity("up", "up vector", (3,), "x y z"),
    Entity("angle", "field of view", (1,), "degrees"),
    Entity("hither", "front plane", (1,), "distance"),
    Entity("resolution", "resolution", (2,), "width height"),
    Entity("b", "background", (3,), "red green blue"),
    Entity("l", "light", (3, 6), "x y z, or x y z red green blue"),
    Entity("f", "material", (8,), "red green blue Kd Ks Shine T index"),
    Entity("c", "cone or cylinder", (8,), "base x y z, base radius, apex x y z, apex radius"),
    Entity("s", "sphere", (4,), "centre x y z, radius"),
    Entity("p", "polygon", (), "number of points, then x y z of each"),
    Entity("pp", "patch", (), "number of points, then x y z and normal x y z of each"),
)
NUMBER = {entity.word: number for number, entity in enumerate(ENTITIES)}
VIEW = ("from", "at", "up", "angle", "resolution")
UNKNOWN = -1
BAD_COUNT = -1

# Where a field of the model stands among the numbers of its entity, and how many numbers it takes. "reflection" is the
# Ks of "specular".
FIELDS: dict[str, tuple[int, int]] = {
    "position": (0, 3),
    "colour": (0, 3),
    "diffuse": (3, 1),
    "specular": (4, 1),
    "exponent": (5, 1),
    "reflection": (4, 1),
    "transmission": (6, 1),
    "index": (7, 1),
    "radius": (3, 1),
    "base_radius": (3, 1),
    "apex": (4, 3),
}

# Bytes that may begin a number. Any other token is a word.
_NUMERIC = np.zeros(256, bool)
_NUMERIC[list(b"0123456789+-.")] = True

# Number of the entity for every word of one or two characters, read as a little-endian integer.
_SHORT_WORDS = np.full(1 << 16, UNKNOWN, np.int8)
for _word, _number in NUMBER.items():
    if len(_word) <= 2:
        _SHORT_WORDS[int.from_bytes(_word.encode(), "little")] = _number


def read(source: SourceText) -> Scene:
    """The scene in `source`; SceneError with everything that is wrong with it."""
    if source.data.startswith(b"\xef\xbb\xbf"):
        source = SourceText(source.file, b"   " + source.data[3:])
    return Builder(Layout(Tokens(source))).scene()


class Tokens:
    """The file cut at white space: words (entities) and numbers, each with its place."""

    def __init__(self, source: SourceText) -> None:
        self.source = source
        text = source.data
        if b"#" in text:
            text = re.sub(rb"#[^\n]*", lambda comment: b" " * len(comment[0]), text)
        self.bytes = np.frombuffer(text, np.uint8)
        inside = np.concatenate(([False], self.bytes > ord(" "), [False]))
        edges = np.flatnonzero(inside[1:] != inside[:-1])
        self.starts, self.ends = edges[0::2], edges[1::2]
        numeric = _NUMERIC[self.bytes[self.starts]]
        self.words = np.flatnonzero(~numeric)
        self.numbers = np.flatnonzero(numeric)

    def __len__(self) -> int:
        return len(self.starts)

    def text(self, token: int) -> str:
        return self.bytes[self.starts[token] : self.ends[token]].tobytes().decode("utf-8", errors="replace")

    def span(self, token: int, count: int = 1) -> Span:
        """The place of `count` tokens, as far as they stand on the line of the first; past the last: the file's end."""
        if token >= len(self):
            return self.source.span(max(len(self.source.data.rstrip()) - 1, 0))
        start, end = int(self.starts[token]), int(self.ends[token + count - 1])
        together = self.source.lines(np.array([start, end - 1]))
        return self.source.span(start, end if together[0] == together[1] else int(self.ends[token]))

    def describe(self, token: int) -> str:
        """A token as a message shows it."""
        return quote(self.text(token)) if token < len(self) else "the end of the file"

    @cached_property
    def entities(self) -> np.ndarray:
        """Of each word, the number of its entity, or UNKNOWN."""
        starts = self.starts[self.words]
        lengths = self.ends[self.words] - starts
        padded = np.append(self.bytes, 0)
        short = padded[starts] | (np.where(lengths == 2, padded[starts + 1], 0).astype(np.int32) << 8)
        entities = np.where(lengths <= 2, _SHORT_WORDS[short], UNKNOWN)
        for word in np.flatnonzero(lengths > 2):
            entities[word] = NUMBER.get(self.text(int(self.words[word])), UNKNOWN)
        return entities

    @cached_property
    def values(self) -> np.ndarray:
        """Every number of the file, float64; NaN where a token that looks like one is none."""
        text = self.bytes.copy()
        starts, ends = self.starts[self.words], self.ends[self.words]
        for start, end in zip(starts[ends - starts > 2], ends[ends - starts > 2], strict=True):
            text[start:end] = ord(" ")
        text[starts] = ord(" ")
        text[ends - 1] = ord(" ")
        if not len(self.numbers):
            return np.zeros(0)
        try:
            values = np.fromstring(text.tobytes(), dtype=np.float64, sep=" ")
        except ValueError:
            values = np.zeros(0)
        # One number for each token, or some token is not a number: then find out which.
        if len(values) == len(self.numbers):
            return values
        return np.array([_float(self.text(token), default=np.nan) for token in self.numbers.tolist()])


class Layout:
    """Which numbers belong to which word: `arguments[i]` numbers follow word i, from `values[first[i]]` on.

    `needed` is the most numbers that the word can take, or BAD_COUNT for a polygon whose count of points is none;
    `good` says whether it is a known word with the right number of finite numbers. `faults` holds all else.
    """

    def __init__(self, tokens: Tokens) -> None:
        self.tokens = tokens
        self.source = tokens.source
        self.entities = tokens.entities
        self.values = tokens.values
        self.arguments = np.diff(np.append(tokens.words, len(tokens))) - 1
        self.first = tokens.words - np.arange(len(tokens.words))
        self.needed = self._needed()
        colourless = (self.entities == NUMBER["l"]) & (self.arguments == 3)
        self.complete = (self.arguments == self.needed) | colourless
        self.faults: list[Diagnostic] = []
        self._find_faults()
        self.good = self.complete & self._finite()

    def members(self, *words: str) -> np.ndarray:
        """The words, by number, that are well-formed entities of these names."""
        return np.flatnonzero(np.isin(self.entities, [NUMBER[word] for word in words]) & self.good)

    def table(self, members: np.ndarray, columns: int) -> np.ndarray:
        """The first `columns` numbers after each of `members`, (n, columns)."""
        return self.values[self.first[members, None] + np.arange(columns)]

    def span(self, word: int, argument: int | None = None, count: int = 1) -> Span:
        """The place of a word, or of `count` numbers after it, from number `argument` (0 is the first)."""
        token = int(self.tokens.words[word])
        return self.tokens.span(token if argument is None else token + 1 + argument, count)

    def fault(self, message: str, span: Span, expected: str, found: str, hint: str | None = None, *notes: Note) -> None:
        self.faults.append(Diagnostic(message, span, expected, found, hint, notes, self.source.shown))

    def _needed(self) -> np.ndarray:
        needed = np.array([max(entity.counts, default=0) for entity in ENTITIES] + [UNKNOWN])[self.entities]
        for word, stride in (("p", 3), ("pp", 6)):
            members = np.flatnonzero(self.entities == NUMBER[word])
            # Without even the count of its points it needs at least that.
            counted = self.arguments[members] > 0
            needed[members[~counted]] = 1
            members = members[counted]
            counts = self.values[self.first[members]]
            whole = (counts >= 3) & (counts < 2**31) & (counts == np.floor(counts))
            needed[members] = np.where(whole, 1 + stride * np.where(whole, counts, 0), BAD_COUNT)
        return needed

    def _finite(self) -> np.ndarray:
        """Which words are followed by finite numbers only."""
        not_finite = np.concatenate(([0], np.cumsum(~np.isfinite(self.values))))
        return not_finite[self.first + self.arguments] == not_finite[self.first]

    def _find_faults(self) -> None:
        # The first few of each class suffice: no more than MOST_ERRORS are shown.
        if not len(self.tokens.words) or self.tokens.words[0] > 0:
            place, found = self.tokens.span(0), self.tokens.describe(0)
            self.fault("a number before any entity", place, "an entity: v, b, l, f, c, s, p or pp", found)
        unknown = self.entities == UNKNOWN
        bad_count = (self.needed == BAD_COUNT) & ~unknown
        short = ~unknown & ~bad_count & ~self.complete & (self.arguments < self.needed)
        surplus = ~unknown & ~bad_count & ~self.complete & (self.arguments > self.needed)
        instead_of_number = self._stand_for_numbers(unknown, short)
        for word in _some(unknown):
            self._unknown_word(word, after_short=bool(instead_of_number[word]))
        for word in _some(bad_count & self._finite()):
            self._bad_count(word)
        # A word where a number should be has been reported itself.
        for word in _some(short & ~np.append(instead_of_number[1:], False)):
            self._too_short(word)
        for word in _some(surplus):
            self._too_long(word)
        for number in _some(~np.isfinite(self.values)):
            self._not_finite(int(self.tokens.numbers[number]))

    def _stand_for_numbers(self, unknown: np.ndarray, short: np.ndarray) -> np.ndarray:
        """Which unknown words stand where the entity before them lacks a number, rather than begin an entity.

        Those that do not open a line, and those that would be numbers if they were finite.
        """
        candidates = np.flatnonzero(unknown & np.concatenate(([False], short[:-1])))
        tokens = self.tokens.words[candidates]
        lines = self.source.lines(self.tokens.starts[np.stack([tokens, tokens - 1])])
        result = np.zeros(len(unknown), bool)
        result[candidates] = lines[0] == lines[1]
        for word in candidates[lines[0] != lines[1]][: MOST_ERRORS + 1].tolist():
            result[word] = _float(self.tokens.text(int(self.tokens.words[word])), default=None) is not None
        return result

    def _unknown_word(self, word: int, *, after_short: bool) -> None:
        token = int(self.tokens.words[word])
        found = self.tokens.describe(token)
        if after_short:
            entity = ENTITIES[self.entities[word - 1]]
            expected = f"a number: {entity.numbers} (of the {entity.meaning})"
            self.fault("this is not a number", self.span(word), expected, found)
        else:
            words = [entity.word for entity in ENTITIES]
            hint = suggestion(self.tokens.text(token), words)
            self.fault("no such entity", self.span(word), f"one of {', '.join(words)}", found, hint)

    def _bad_count(self, word: int) -> None:
        message = f"no such number of points for a {ENTITIES[self.entities[word]].meaning}"
        found = self.tokens.describe(int(self.tokens.words[word]) + 1)
        self.fault(message, self.span(word, 0), "a whole number, 3 or more", found)

    def _too_short(self, word: int) -> None:
        entity, given = ENTITIES[self.entities[word]], int(self.arguments[word])
        following = int(self.tokens.words[word]) + 1 + given
        found = f"{_plural(given, 'number')}, then {self.tokens.describe(following)}"
        start = Note(f"the {entity.meaning} begins here", self.span(word))
        message = f"this {entity.meaning} ends too early"
        self.fault(message, self.tokens.span(following), self._form(word), found, None, start)

    def _too_long(self, word: int) -> None:
        needed = int(self.needed[word])
        message = f"this {ENTITIES[self.entities[word]].meaning} has too many numbers"
        found = f"{_plural(int(self.arguments[word]), 'number')}, the first surplus one here"
        self.fault(message, self.span(word, needed), self._form(word), found)

    def _form(self, word: int) -> str:
        """How the entity should look."""
        entity = ENTITIES[self.entities[word]]
        if entity.counts or self.needed[word] == 1:
            return f"`{entity.word}` and {entity.numbers}"
        return f"`{entity.word}` and {_plural(int(self.needed[word]), 'number')}: {entity.numbers}"

    def _not_finite(self, token: int) -> None:
        text = self.tokens.text(token)
        message = "this is not a number" if _float(text, default=None) is None else "this number is not finite"
        self.fault(message, self.tokens.span(token), "a finite number", self.tokens.describe(token))


class Builder:
    """Makes the scene from a layout, and finds what is wrong with it as a scene."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.source = layout.source
        self.shape_words = layout.members("s", "c", "p", "pp")
        self.materials, self.material_words, self.material_of_fill = self._fills()

    def scene(self) -> Scene:
        if not len(self.layout.tokens):
            found = "comments only" if self.source.data.strip() else "nothing"
            raise SceneError(str(Diagnostic(f"{self.source.file!r} is empty", None, "a scene in NFF", found)))
        shapes, warnings = self._shapes()
        rows = self.layout.table(self.layout.members("b"), 3)[-1:].tolist()
        background = _vector(rows[0]) if rows else (0.0, 0.0, 0.0)
        scene = Scene(self._camera(), shapes, self._lights(), background, warnings)
        found_at = {self._place(problem): problem for problem in reversed(problems(scene))}
        for place, problem in found_at.items():
            self.layout.fault(problem.message, place, problem.expected, problem.found)
        if self.layout.faults:
            raise scene_error(self.layout.faults)
        return scene

    def _camera(self) -> Camera:
        """The view. What it lacks becomes an error; right values take the place, so that the rest is checked."""
        for word in ("v", *VIEW, "hither"):
            self._only_once(word)
        self._report_missing_view()
        given = {}
        for word in (*VIEW, "hither"):
            members = self.layout.members(word)[:1]
            if len(members):
                given[word] = self.layout.table(members, ENTITIES[NUMBER[word]].counts[0])[0].tolist()
        if not {"from", "at", "up"} <= set(given):
            given |= {"from": (0.0, 0.0, 1.0), "at": (0.0, 0.0, 0.0), "up": (0.0, 1.0, 0.0)}
        width, height = given.get("resolution", (1.0, 1.0))
        if not (width.is_integer() and height.is_integer()):
            place = self._place_of_view("resolution")
            self.layout.fault("a picture has whole pixels", place, "two whole numbers", f"{width:g} {height:g}")
        return Camera(
            eye=_vector(given["from"]),
            at=_vector(given["at"]),
            up=_vector(given["up"]),
            angle=given.get("angle", [45.0])[0],
            resolution=(int(width), int(height)),
            hither=given.get("hither", [0.0])[0],
            angle_between="centres",
        )

    def _only_once(self, word: str) -> None:
        members = self.layout.members(word)
        if len(members) > 1:
            first = Note("the first is here", self.layout.span(members[0]))
            place = self.layout.span(members[1])
            self.layout.fault(f"a second `{word}`", place, "one view", f"{len(members)} times `{word}`", None, first)

    def _report_missing_view(self) -> None:
        """Report what the view lacks. A line that is there, but wrong, has an error of its own."""
        present = set(self.layout.entities.tolist())
        missing = [f"`{word}`" for word in ("v", *VIEW) if NUMBER[word] not in present]
        if not missing:
            return
        views = np.flatnonzero(self.layout.entities == NUMBER["v"])
        place = self.layout.span(views[0]) if len(views) else Span(self.source.file, 1)
        message = "the view is incomplete" if len(views) else "the scene has no view"
        expected = "`v` with " + ", ".join(f"`{word}`" for word in VIEW)
        self.layout.fault(message, place, expected, "no " + ", no ".join(missing))

    def _lights(self) -> list[PointLight]:
        lights = []
        for word in self.layout.members("l"):
            count = int(self.layout.arguments[word])
            values = self.layout.table(np.array([word]), count)[0].tolist()
            lights.append(PointLight(_vector(values[:3]), _vector(values[3:]) if count == 6 else None))
        return lights

    def _fills(self) -> tuple[list[Material], list[int], np.ndarray]:
        """The distinct materials in order, the word where each stands first, and the material of every `f`.

        The last of these is one more than there are `f`: for shapes before any, the number after the last material.
        """
        fills = self.layout.members("f")
        distinct: dict[tuple[float, ...], int] = {}
        words: list[int] = []
        numbers = []
        for word, row in zip(fills, self.layout.table(fills, 8).tolist(), strict=True):
            numbers.append(distinct.setdefault(tuple(row), len(distinct)))
            if len(distinct) > len(words):
                words.append(word)
        materials = [_material(f"material {number + 1}", *row) for row, number in distinct.items()]
        return materials, words, np.array([*numbers, len(materials)], np.int32)

    # Where a problem of the scene stands in the file

    def _place(self, problem: Problem) -> Span:
        group, *path = problem.path
        if group == "camera":
            return self._place_of_view(str(path[0]))
        if group == "background":
            return self.layout.span(self.layout.members("b")[-1], int(path[0]))
        lights = self.layout.members("l").tolist()
        words = {"lights": lights, "materials": self.material_words, "shapes": self.shape_words.tolist()}
        word = words[str(group)][int(path[0])]
        if len(path) == 1:
            return self.layout.span(word)
        offset, count = FIELDS[str(path[1])]
        if len(path) == 2:
            return self.layout.span(word, offset, count)
        return self.layout.span(word, offset + int(path[2]))

    def _place_of_view(self, field: str) -> Span:
        word = {"eye": "from"}.get(field, field)
        return self.layout.span(self.layout.members(word)[0], 0, ENTITIES[NUMBER[word]].counts[0])

    # Shapes

    def _shapes(self) -> tuple[Shapes, list[str]]:
        layout, words = self.layout, self.shape_words
        sort_of_entity = np.zeros(len(ENTITIES), np.uint8)
        for name, sort in (("s", SPHERE), ("c", CONE), ("p", POLYGON), ("pp", POLYGON)):
            sort_of_entity[NUMBER[name]] = sort
        sorts = sort_of_entity[layout.entities[words]]
        fills = np.cumsum((layout.entities == NUMBER["f"]) & layout.good) - 1
        material = self.material_of_fill[fills[words]]
        line = self.source.lines(layout.tokens.starts[layout.tokens.words[words]])
        materials, warnings = self.materials, []
        if len(words) and fills[words[0]] < 0:
            warnings.append(f"{self.source.file}:{line[0]}: warning: no material (`f`) before this shape: it is white")
            materials = [*materials, Material()]
        of_sort = [sorts == sort for sort in (SPHERE, CONE, POLYGON)]
        spheres, cones, polygons = ((material[here], line[here], words[here]) for here in of_sort)
        shapes = Shapes(
            materials, sorts, self._spheres(*spheres), self._cones(*cones), self._polygons(*polygons), self.source.file
        )
        return shapes, warnings

    def _spheres(self, material: np.ndarray, line: np.ndarray, words: np.ndarray) -> Spheres:
        values = self.layout.table(words, 4)
        return Spheres(material, line, values[:, :3], values[:, 3])

    def _cones(self, material: np.ndarray, line: np.ndarray, words: np.ndarray) -> Cones:
        values = self.layout.table(words, 8)
        return Cones(material, line, values[:, :3], values[:, 3], values[:, 4:7], values[:, 7])

    def _polygons(self, material: np.ndarray, line: np.ndarray, words: np.ndarray) -> Polygons:
        smooth = self.layout.entities[words] == NUMBER["pp"]
        sizes = self.layout.values[self.layout.first[words]].astype(np.intp)
        starts = np.concatenate(([0], np.cumsum(sizes)))
        # Of every point: its number within the polygon, and where its first coordinate stands.
        within = np.arange(starts[-1]) - np.repeat(starts[:-1], sizes)
        stride = np.repeat(np.where(smooth, 6, 3), sizes)
        first = np.repeat(self.layout.first[words] + 1, sizes) + within * stride
        points = self.layout.values[first[:, None] + np.arange(3)]
        normals = np.zeros_like(points)
        smooth_points = np.repeat(smooth, sizes)
        normals[smooth_points] = self.layout.values[first[smooth_points, None] + np.arange(3, 6)]
        return Polygons(material, line, points, normals, starts, smooth)


def _material(
    name: str, red: float, green: float, blue: float, kd: float, ks: float, shine: float, t: float, index: float
) -> Material:
    # Opaque materials are often written with an index of 0, which means nothing.
    return Material(
        name=name,
        colour=(red, green, blue),
        diffuse=kd,
        specular=ks,
        exponent=shine,
        reflection=ks,
        transmission=t,
        index=index if t > 0.0 or index > 0.0 else 1.0,
    )


def _vector(values: Iterable[float]) -> Vector:
    x, y, z = values
    return x, y, z


def _some(mask: np.ndarray) -> list[int]:
    """The first numbers where `mask` is true: one more than are shown."""
    return np.flatnonzero(mask)[: MOST_ERRORS + 1].tolist()


def _plural(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _float(text: str, default: float | None) -> float | None:
    """The number that `text` is, or `default`. Python's own additions to the notation of C are not numbers here."""
    try:
        return float(text) if "_" not in text and text.isascii() else default
    except ValueError:
        return default
