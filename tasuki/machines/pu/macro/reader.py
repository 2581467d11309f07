"""The first pass of the macro assembler: files and includes, to macros, names, memory, and statements.

Constants, names of registers, records and tables are computed where they stand, so that they must stand above their
use; labels and macros may be used before they are defined.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from tasuki.diagnostics import Note, SourceError
from tasuki.machines.pu.isa import DEFAULT, float_bits
from tasuki.machines.pu.macro.operands import (
    ATTRIBUTES,
    KINDS,
    Operand,
    Record,
    Table,
    attribute,
    kind_of,
    register,
    register_fault,
)
from tasuki.machines.pu.meta.expressions import Register, Value, ValueFault, evaluate
from tasuki.machines.pu.meta.source import Errors, Source, Token, read_source, tokenize
from tasuki.machines.pu.meta.symbols import PREDEFINED, close_match

MAX_INCLUDES = 64
"""Files that include each other, one in the next."""
MAX_ROWS = 1 << 24
"""The largest data or display memory, in rows."""
_BANKS = (8, 4, 2, 1)


@dataclass(frozen=True)
class Statement:
    """A line's work: a label (one token), a macro call, a microinstruction, or `.distinct`."""

    sort: Literal["label", "call", "fields", "distinct"]
    tokens: list[Token]


@dataclass(frozen=True, eq=False)
class Macro:
    """A macro: its parameters with their kinds, and its statements. `library` macros see library macros only."""

    name: Token
    parameters: tuple[tuple[Token, str], ...]
    body: list[Statement]
    library: bool

    def __str__(self) -> str:
        return f"{self.name.text} {', '.join(f'{name.text}:{kind}' for name, kind in self.parameters)}".rstrip()


@dataclass
class _Open:
    """A `.macro` or `.record` whose `.end` has not come yet."""

    head: Token
    macro: Macro | None = None
    record: str = ""
    fields: dict[str, tuple[int, int]] = field(default_factory=dict)
    rows: int = 0
    labels: dict[str, Token] = field(default_factory=dict)


def split(tokens: list[Token]) -> list[list[Token]]:
    """The parts between commas that stand in no parentheses; nothing gives no parts."""
    if not tokens:
        return []
    parts: list[list[Token]] = [[]]
    depth = 0
    for token in tokens:
        depth += (token.text == "(") - (token.text == ")")
        if token.text == "," and depth <= 0:
            parts.append([])
        else:
            parts[-1].append(token)
    return parts


def _without_include(line: str, tokens: list[Token]) -> str:
    """A line as it stands in the joined text: an include becomes a comment, behind which the file's lines follow."""
    column = next((token.column for token in tokens if token.text == ".include"), None)
    return line if column is None else f"{line[:column]}; {line[column:]}"


class Reader:
    """What the first pass finds. Errors gather in `errors`; `text` is all that was read, includes put in."""

    def __init__(self, errors: Errors) -> None:
        self.errors = errors
        self.macros: dict[str, list[Macro]] = {}
        self.library: dict[str, list[Macro]] = {}
        self.names: dict[str, tuple[Token, Operand]] = {}
        self.records: dict[str, tuple[Token, Record]] = {}
        self.labels: dict[str, Token] = {}
        self.statements: list[Statement] = []
        self.tables: list[Table] = []
        self.memory: dict[int, tuple[int, Token]] = {}
        self.sizes: dict[str, int] = {}
        self.text: list[str] = []
        self._active: list[Path] = []
        self._done: set[Path] = set()
        self._open: _Open | None = None
        self._in_library = False
        self._directives: dict[str, Callable[[Token, list[Token]], None]] = {
            ".macro": self._macro,
            ".record": self._record,
            ".row": self._row,
            ".end": self._end,
            ".const": self._const,
            ".name": self._name,
            ".table": self._table,
            ".picture": self._picture,
            ".data": self._data,
            ".memory": self._size,
            ".display": self._size,
            ".include": self._include,
            ".distinct": self._distinct,
        }

    # --- files --------------------------------------------------------------------------------------------------------

    def read_library(self, paths: list[Path]) -> None:
        """Reads the library, whose macros the program's may hide."""
        self._in_library = True
        for path in paths:
            self.read(read_source(path), path)
        self._in_library = False
        self.text.clear()

    def use_library(self, other: Reader) -> None:
        """Takes over the library, and its constants, as another has read it."""
        self.library = other.library
        self.names.update(other.names)

    def read(self, source: Source, path: Path | None) -> None:
        """Reads one text and what it includes."""
        self._active.append(path.resolve() if path else Path(source.name))
        line = 1
        while line <= len(source.lines):
            tokens = tokenize(source, line, self.errors)
            self.text.append(_without_include(source.lines[line - 1], tokens))
            # A line that ends in a backslash goes on in the next.
            while tokens and tokens[-1].text == "\\":
                tokens.pop()
                line += 1
                if line <= len(source.lines):
                    tokens += tokenize(source, line, self.errors)
                    self.text.append(source.lines[line - 1])
            self._statement(tokens)
            line += 1
        if self._open:
            self.errors.add(f"{self._open.head.text} without its .end", self._open.head)
            self._open = None
        self._done.add(self._active.pop())

    def _include(self, head: Token, rest: list[Token]) -> None:
        if len(rest) != 1 or rest[0].kind != "string":
            return self._malformed(head, rest, '.include "FILE"')
        try:
            path = self._active[-1].parent / rest[0].text[1:-1]
            real = path.resolve()
            if real in self._active:
                chain = " -> ".join(one.name for one in [*self._active[self._active.index(real) :], real])
                self.errors.add("the file includes itself", rest[0], found=chain)
            elif len(self._active) > MAX_INCLUDES:
                self.errors.add("includes are nested too deeply", rest[0], expected=f"at most {MAX_INCLUDES} levels")
            elif real not in self._done:
                self.read(read_source(path), path)
        except SourceError as error:
            first = error.diagnostics[0]
            self.errors.add(first.message, rest[0], expected=first.expected, found=first.found)
        except (OSError, ValueError, RuntimeError):
            self.errors.add("this is no name of a file", rest[0])
        return None

    # --- statements ---------------------------------------------------------------------------------------------------

    def _statement(self, tokens: list[Token]) -> None:
        while len(tokens) >= 2 and tokens[0].kind == "name" and tokens[1].text == ":":
            self._label(tokens[0])
            tokens = tokens[2:]
        if not tokens:
            return
        head = tokens[0]
        if head.kind == "directive":
            directive = self._directives.get(head.text)
            if directive is None:
                near = close_match(head.text, self._directives) or ", ".join(self._directives)
                self.errors.add(f"'{head.text}' is not a directive", head, expected=near)
            elif self._open and head.text not in self._inside():
                expected = f"{', '.join(self._inside())} inside {self._open.head.text}"
                self.errors.add(f"{head.text} cannot stand here", head, expected=expected)
            else:
                directive(head, tokens[1:])
        elif head.kind != "name":
            self.errors.add(f"unexpected '{head.text}'", head, expected="an instruction, field=value, or a directive")
        else:
            sort: Literal["call", "fields"] = "fields" if len(tokens) > 1 and tokens[1].text == "=" else "call"
            self._add(Statement(sort, tokens))

    def _inside(self) -> tuple[str, ...]:
        assert self._open
        return (".end", ".distinct") if self._open.macro else (".end", ".row")

    def _add(self, statement: Statement) -> None:
        if self._open and self._open.record:
            expected = f"{', '.join(self._inside())} inside .record"
            self.errors.add("an instruction cannot stand here", statement.tokens, expected=expected)
        elif self._open and self._open.macro:
            self._open.macro.body.append(statement)
        else:
            self.statements.append(statement)

    def _label(self, name: Token) -> None:
        macro = self._open.macro if self._open else None
        if macro:
            assert self._open
            earlier = self._open.labels.setdefault(name.text, name)
            if earlier is not name:
                self._twice(name, earlier)
            elif any(parameter.text == name.text for parameter, _ in macro.parameters):
                self.errors.add(f"'{name.text}' is a parameter", name, hint="choose another name")
            else:
                self._add(Statement("label", [name]))
        elif self.declare(name):
            self.labels[name.text] = name
            self._add(Statement("label", [name]))

    def _distinct(self, head: Token, rest: list[Token]) -> None:
        if self._open is None or not self._open.macro or len(split(rest)) != 2 or len(rest) != 3:
            return self._malformed(head, rest, ".distinct PARAMETER, PARAMETER inside .macro")
        return self._add(Statement("distinct", [head, *rest]))

    # --- names --------------------------------------------------------------------------------------------------------

    def declare(self, name: Token) -> bool:
        """Whether `name` is free; where it is not, an error is added."""
        text = name.text
        if register(text) or text in PREDEFINED or text in DEFAULT.by_name:
            self.errors.add(f"'{text}' is predefined", name, hint="choose another name")
        elif "." in text:
            self.errors.add("a name that is defined here has no dots", name)
        elif text in self.names or text in self.labels:
            self._twice(name, self.labels[text] if text in self.labels else self.names[text][0])
        else:
            return True
        return False

    def _twice(self, name: Token, earlier: Token) -> None:
        notes = [Note("first defined here", earlier.span)]
        self.errors.add(f"'{name.text}' is defined twice", name, notes=notes)

    def resolve(self, token: Token) -> Operand:
        """What a name stands for, outside macros, labels excepted. Raises ValueFault."""
        text = token.text
        if text in self.names:
            return self.names[text][1]
        if text in PREDEFINED:
            return PREDEFINED[text]
        found = register(text)
        if found:
            fault = register_fault(found)
            if fault:
                raise ValueFault(f"there is no register {text}", [token], fault.removeprefix("expected "))
            return found
        head, _, last = text.partition(".")
        if head in self.names:
            value = attribute(self.names[head][1], last)
            if value is not None:
                return value
            one = self.names[head][1]
            fields = ", ".join(one.record.fields) if isinstance(one, Table) else None
            raise ValueFault(f"'{head}' has no '{last}'", [token], fields)
        raise ValueFault(f"'{text}' is not defined", [token], close_match(text, self.names))

    def value(self, token: Token) -> Value:
        """What a name stands for in arithmetic: a table is its first row. Raises ValueFault."""
        return number_or_register(self.resolve(token), token)

    def _whole(self, tokens: list[Token], low: int, high: int) -> int:
        """A whole number within bounds. Raises ValueFault."""
        value = evaluate(tokens, self.value)
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            raise ValueFault("this number is out of range", tokens, f"a whole number from {low} to {high}")
        return value

    def _const(self, head: Token, rest: list[Token]) -> None:
        if len(rest) < 3 or rest[0].kind != "name" or rest[1].text != "=":
            return self._malformed(head, rest, f"{head.text} NAME = VALUE")
        try:
            value = evaluate(rest[2:], self.value)
        except ValueFault as fault:
            return self.report(fault, rest[0])
        if isinstance(value, Register) != (head.text == ".name"):
            wanted = "a register" if head.text == ".name" else "a number"
            return self.errors.add(f"{head.text} names {wanted}", rest[2:], found=str(value))
        if self.declare(rest[0]):
            self.names[rest[0].text] = rest[0], value
        return None

    _name = _const

    # --- macros and records -------------------------------------------------------------------------------------------

    def _macro(self, head: Token, rest: list[Token]) -> None:
        # Whatever is wrong with its head, the body belongs to it.
        name = rest[0] if rest and rest[0].kind == "name" else head
        parameters: list[tuple[Token, str]] = []
        for part in split(rest[1:]):
            if len(part) != 3 or part[0].kind != "name" or part[1].text != ":" or "." in part[0].text:
                self._malformed(head, rest, ".macro NAME PARAMETER:KIND, ...")
            elif part[2].text not in KINDS:
                self.errors.add(f"there is no kind '{part[2].text}'", part[2], expected=", ".join(KINDS))
            elif any(part[0].text == earlier.text for earlier, _ in parameters):
                self.errors.add(f"the parameter '{part[0].text}' stands twice", part[0])
            else:
                parameters.append((part[0], part[2].text))
        macro = Macro(name, tuple(parameters), [], self._in_library)
        self._open = _Open(head, macro)
        if name is head or "." in name.text:
            return self._malformed(head, rest, ".macro NAME PARAMETER:KIND, ...")
        same = (self.library if self._in_library else self.macros).setdefault(name.text, [])
        kinds = [kind for _, kind in parameters]
        earlier = [one for one in same if [kind for _, kind in one.parameters] == kinds]
        if earlier:
            self._twice(name, earlier[0].name)
        same.append(macro)
        return None

    def _record(self, head: Token, rest: list[Token]) -> None:
        name = rest[0] if len(rest) == 1 and rest[0].kind == "name" else None
        self._open = _Open(head, record=name.text if name else "?")
        if name is None:
            return self._malformed(head, rest, ".record NAME")
        if name.text in self.records:
            self._twice(name, self.records[name.text][0])
        self.records[name.text] = name, Record(0, {})
        return None

    def _row(self, head: Token, rest: list[Token]) -> None:
        form = ".row NAME: FIELD FIELD FIELD FIELD inside .record, for the banks X, Y, Z, S; - for a bank without one"
        fields = rest[2:]
        named = all(token.kind == "name" or token.text == "-" for token in fields)
        if self._open is None or len(rest) != 6 or rest[0].kind != "name" or rest[1].text != ":" or not named:
            return self._malformed(head, rest, form)
        banks = [bank for bank, token in zip(_BANKS, fields, strict=True) if token.kind == "name"]
        pairs = [(rest[0], sum(banks)), *zip((token for token in fields if token.kind == "name"), banks, strict=True)]
        for token, mask in pairs:
            if token.text in self._open.fields:
                self.errors.add(f"the field '{token.text}' stands twice", token)
            elif token.text in ATTRIBUTES["table"]:
                self.errors.add(f"'{token.text}' is predefined", token, hint="choose another name")
            self._open.fields[token.text] = self._open.rows, mask
        self._open.rows += 1
        return None

    def _end(self, head: Token, rest: list[Token]) -> None:
        if rest or self._open is None:
            return self._malformed(head, rest, ".end after .macro or .record")
        if self._open.record:
            if not self._open.rows:
                self.errors.add("a record without rows", self._open.head)
            if self._open.record in self.records:
                token = self.records[self._open.record][0]
                self.records[token.text] = token, Record(max(1, self._open.rows), self._open.fields)
        self._open = None
        return None

    # --- memory -------------------------------------------------------------------------------------------------------

    def _table(self, head: Token, rest: list[Token]) -> None:
        parts = split(rest)
        if len(parts) not in (3, 4) or any(len(part) != 1 or part[0].kind != "name" for part in parts[:2]):
            return self._malformed(head, rest, ".table NAME, RECORD, COUNT, or .table NAME, RECORD, COUNT, FIRST ROW")
        name, record = parts[0][0], parts[1][0]
        if record.text not in self.records:
            near = close_match(record.text, self.records)
            return self.errors.add(f"there is no record '{record.text}'", record, expected=near)
        try:
            count = self._whole(parts[2], 1, MAX_ROWS)
            base = self._whole(parts[3], 0, MAX_ROWS) if len(parts) == 4 else self._free_row()
        except ValueFault as fault:
            return self.report(fault, name)
        unit = max((one.unit + (2 if one.width else 1) for one in self.tables), default=0)
        return self._place(name, Table(name.text, self.records[record.text][1], base, count, unit))

    def _picture(self, head: Token, rest: list[Token]) -> None:
        parts = split(rest)
        if len(parts) not in (3, 4) or len(parts[0]) != 1 or parts[0][0].kind != "name":
            return self._malformed(head, rest, ".picture NAME, WIDTH, HEIGHT, or .picture NAME, WIDTH, HEIGHT, ROW")
        try:
            width, height = self._whole(parts[1], 1, MAX_ROWS), self._whole(parts[2], 1, MAX_ROWS)
            base = self._whole(parts[3], 0, MAX_ROWS) if len(parts) == 4 else self._free_row()
        except ValueFault as fault:
            return self.report(fault, parts[0][0])
        # The two-dimensional mode takes a register and its partner, so an even number.
        unit = max((one.unit + (2 if one.width else 1) for one in self.tables), default=0)
        pixel = Record(1, {"pixel": (0, sum(_BANKS))})
        return self._place(parts[0][0], Table(parts[0][0].text, pixel, base, height, unit + unit % 2, width))

    def _free_row(self) -> int:
        return max((one.base + one.rows for one in self.tables), default=0)

    def _place(self, name: Token, table: Table) -> None:
        units = DEFAULT.register_counts["br"]
        if table.unit + (1 if table.width else 0) >= units:
            self.errors.add("there are too many tables", name, expected=f"at most {units}; a picture counts twice")
        if table.base + table.rows > MAX_ROWS:
            return self.errors.add("the table does not fit data memory", name, expected=f"rows below {MAX_ROWS}")
        for other in self.tables:
            if table.base < other.base + other.rows and other.base < table.base + table.rows:
                rows = f"rows {table.base} to {table.base + table.rows - 1}"
                notes = [Note("this one", self.names[other.name][0].span)]
                self.errors.add(f"'{name.text}' lies over '{other.name}'", name, found=rows, notes=notes)
        if self.declare(name):
            self.tables.append(table)
            self.names[name.text] = name, table
        return None

    def _data(self, head: Token, rest: list[Token]) -> None:
        colon = next((i for i, token in enumerate(rest) if token.text == ":"), 0)
        words = split(rest[colon + 1 :])
        if not colon or not words or not all(words):
            return self._malformed(head, rest, ".data ROW: WORD, ...")
        try:
            first = 4 * self._whole(rest[:colon], 0, MAX_ROWS - 1)
            for place, tokens in enumerate(words, first):
                if place in self.memory:
                    notes = [Note("first given here", self.memory[place][1].span)]
                    self.errors.add(f"row {place // 4} is given twice", tokens, notes=notes)
                self.memory[place] = self._datum(tokens), tokens[0]
        except ValueFault as fault:
            self.report(fault, head)
        return None

    def _datum(self, tokens: list[Token]) -> int:
        value = evaluate(tokens, self.value)
        if isinstance(value, Register):
            raise ValueFault("a register is no word of memory", tokens)
        if isinstance(value, float):
            return float_bits(value)
        return self._whole(tokens, -(1 << 31), (1 << 32) - 1) & 0xFFFFFFFF

    def _size(self, head: Token, rest: list[Token]) -> None:
        if not rest or head.text in self.sizes:
            return self._malformed(head, rest, f"{head.text} ROWS, once")
        try:
            self.sizes[head.text] = self._whole(rest, 1, MAX_ROWS)
        except ValueFault as fault:
            self.report(fault, head)
        return None

    # --- errors -------------------------------------------------------------------------------------------------------

    def report(self, fault: ValueFault, fallback: Token, notes: list[Note] | None = None) -> None:
        """A fault of a value, as a diagnostic."""
        where = list(fault.tokens) or fallback
        self.errors.add(fault.message, where, expected=fault.expected, notes=notes or ())

    def _malformed(self, head: Token, rest: list[Token], form: str) -> None:
        self.errors.add(f"{head.text} is malformed", [head, *rest], expected=form)


def number_or_register(operand: Operand, token: Token) -> Value:
    """An operand as a term of arithmetic: a table is its first row. Raises ValueFault for what has no value."""
    if isinstance(operand, Table):
        return operand.base
    if isinstance(operand, int | float | Register):
        return operand
    raise ValueFault(f"there is no arithmetic with a {kind_of(operand)}", [token], "a number or a register")
