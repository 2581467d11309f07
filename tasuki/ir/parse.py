"""Reads the text form of programs (see `text`) back into nodes."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import NoReturn, TypeVar, cast

import numpy as np

from tasuki.diagnostics import Diagnostic, SourceError, Span
from tasuki.ir import nodes as n
from tasuki.ir.lex import Token, tokens
from tasuki.ir.ops import OPERATIONS
from tasuki.ir.paths import at_path
from tasuki.ir.text import COMPARISON, DECLARATIONS, INFIX, PREFIX, RESERVED
from tasuki.ir.types import BOOL, BUILTIN_TYPES, F32, I32, MAT4, VEC3, VEC4, VOID, Array, Record, Table, Tuple, Type

_Item = TypeVar("_Item")

_OPERATION_OF = {symbol: (name, tightness) for name, (symbol, tightness) in INFIX.items()}
_PREFIX_OF = {symbol: name for name, symbol in PREFIX.items()}
_BUILT = {"vec3": VEC3, "vec4": VEC4, "mat4": MAT4}


def parse_program(text: str, file: str = "<ir>") -> n.Program:
    """The program that `text` states; `file` is its name in errors and spans.

    Raises SourceError with every declaration's first error. The result has not been verified.
    """
    return _Parser(text, file).program()


class _Wrong(Exception):
    """Ends the declaration in which an error was found."""

    def __init__(self, diagnostic: Diagnostic) -> None:
        self.diagnostic = diagnostic


class _Parser:
    """Recursive descent. `_types` holds the locals of the function that is being read."""

    def __init__(self, text: str, file: str) -> None:
        self._source = text
        self._tokens = tokens(text, file)
        self._position = 0
        self._records: dict[str, Record] = {}
        self._tables: dict[str, Record] = {}
        self._functions: dict[str, n.Function] = {}
        self._entry: str | None = None
        self._types: dict[str, Type] = {}

    # --- declarations

    def program(self) -> n.Program:
        faults: list[Diagnostic] = []
        while self._next.kind != "end":
            try:
                self._declaration()
            except _Wrong as wrong:
                faults.append(wrong.diagnostic)
                self._skip_declaration()
        if self._entry is None and not faults:
            faults.append(self._diagnostic("the program names no entry", "entry NAME", "the end of the text"))
        if faults:
            raise SourceError(faults)
        return n.Program(self._functions, cast(str, self._entry), self._tables)

    def _skip_declaration(self) -> None:
        """Goes on to the next word at the start of a line that begins a declaration."""
        while self._next.kind != "end":
            self._advance()
            if self._next.text in DECLARATIONS and self._next.kind == "word" and self._next.span.column == 0:
                return

    def _declaration(self) -> None:
        word = self._next
        match word.text if word.kind == "word" else "":
            case "record":
                self._record()
            case "table":
                self._advance()
                name = self._name()
                self._expect(":")
                self._tables[name] = self._record_name()
            case "entry":
                self._advance()
                self._entry = self._name()
            case "function":
                function = self._function()
                if function.name in self._functions:
                    self._fail("a function is declared twice", at=word)
                self._functions[function.name] = function
            case _:
                self._fail("no declaration begins here", "record, table, entry, or function")

    def _record(self) -> None:
        self._advance()
        handle = self._next
        name = self._name(numbered=True)
        if handle.text in self._records:
            self._fail("a record is declared twice", at=handle)
        self._expect("{")
        fields: list[tuple[str, Type]] = []
        while not self._accept("}"):
            field = self._name(of_member=True)
            self._expect(":")
            fields.append((field, self._type()))
        self._records[handle.text] = Record(name, tuple(fields))

    def _function(self) -> n.Function:
        start = self._advance().span
        name = self._name()
        self._expect("(")
        parameters = tuple(self._list(")", self._parameter))
        result = self._type() if self._accept("->") else VOID
        self._expect("{")
        variables: dict[str, Type] = {}
        while self._accept("var"):
            declared = self._parameter()
            variables[declared.name] = declared.type
        self._types = {parameter.name: parameter.type for parameter in parameters} | variables
        return n.Function(name, parameters, result, variables, self._statements(), span=start)

    def _parameter(self) -> n.Parameter:
        span = self._next.span
        name = self._name()
        self._expect(":")
        return n.Parameter(name, self._type(), span=span)

    # --- types

    def _type(self) -> Type:
        word = self._next
        if word.kind == "word" and word.text in BUILTIN_TYPES:
            return BUILTIN_TYPES[self._advance().text]
        if self._accept("tuple"):
            self._expect("[")
            return Tuple(tuple(self._list("]", self._type)))
        if self._accept("array"):
            self._expect("[")
            item = self._type()
            self._expect(",")
            length = self._integer()
            self._expect("]")
            return Array(item, length)
        if self._accept("Table"):
            self._expect("[")
            record = self._record_name()
            self._expect("]")
            return Table(record)
        return self._record_name()

    def _record_name(self) -> Record:
        handle = self._next
        record = self._records.get(handle.text) if handle.kind in ("word", "string") else None
        if record is None:
            self._fail("no type of this name is declared", "a type")
        self._advance()
        return record

    # --- statements

    def _block(self) -> tuple[n.Statement, ...]:
        self._expect("{")
        return self._statements()

    def _statements(self) -> tuple[n.Statement, ...]:
        """Statements up to the closing brace, which is taken too."""
        found: list[n.Statement] = []
        while not self._accept("}"):
            found.append(self._statement())
        return tuple(found)

    def _statement(self) -> n.Statement:
        word = self._next
        span = word.span
        match word.text if word.kind == "word" else "":
            case "if":
                return self._if()
            case "loop" | "while":
                return self._loop()
            case "break":
                self._advance()
                return n.Break(span=span)
            case "continue":
                self._advance()
                return n.Continue(span=span)
            case "return":
                self._advance()
                is_bare = self._next.text == "}" or self._next.span.line != span.line
                return n.Return(None if is_bare else self._expression(), span=span)
            case "clear":
                self._advance()
                return n.Clear(self._name(), span=span)
            case "store":
                return self._store()
            case "atomic" | "call":
                return self._effect(None, span)
        return self._assignment()

    def _if(self) -> n.If:
        span = self._advance().span
        test = self._expression()
        then = self._block()
        orelse: tuple[n.Statement, ...] = ()
        if self._accept("else"):
            orelse = (self._if(),) if self._next.text == "if" and self._next.kind == "word" else self._block()
        return n.If(test, then, orelse, span=span)

    def _loop(self) -> n.Loop:
        span = self._next.span
        setup = self._block() if self._accept("loop") else ()
        self._expect("while")
        test = self._expression()
        body = self._block()
        step = self._block() if self._accept("step") else ()
        return n.Loop(test, body, setup, step, span=span)

    def _store(self) -> n.Store:
        span = self._advance().span
        table, index, path = self._place()
        self._expect("=")
        return n.Store(table, index, self._expression(), path, span=span)

    def _effect(self, target: str | None, span: Span) -> n.Statement:
        """A call or an atomic, whose result `target` receives."""
        if self._accept("call"):
            function = self._name()
            self._expect("(")
            return n.Call(target, function, tuple(self._list(")", self._expression)), span=span)
        self._expect("atomic")
        operation = cast(n.AtomicOperation, self._name())
        table, index, path = self._place()
        self._expect(",")
        return n.Atomic(target, operation, table, index, self._expression(), path, span=span)

    def _assignment(self) -> n.Statement:
        span = self._next.span
        name = self._name()
        if self._accept("["):
            index = self._expression()
            self._expect("]")
            path = self._path()
            self._expect("=")
            return n.SetElement(name, index, self._expression(), path, span=span)
        path = self._path()
        self._expect("=")
        if not path and self._next.kind == "word" and self._next.text in ("call", "atomic"):
            return self._effect(name, span)
        return n.Assign(name, self._expression(), path, span=span)

    def _place(self) -> tuple[n.Local | n.NamedTable, n.Expression, tuple[str, ...]]:
        """table[index].path"""
        table = self._table()
        self._expect("[")
        index = self._expression()
        self._expect("]")
        return table, index, self._path()

    def _path(self) -> tuple[str, ...]:
        names: list[str] = []
        while self._next.kind == "member":
            names.append(self._unquoted(self._advance().text[1:]))
        return tuple(names)

    def _table(self) -> n.Local | n.NamedTable:
        start = self._next
        if self._accept("@"):
            name = self._name()
            if name not in self._tables:
                self._fail("no table of this name is declared", at=start)
            return n.NamedTable(name, Table(self._tables[name]), span=start.span)
        local = self._local()
        if not isinstance(local.type, Table):
            self._fail("not a table", "a table", str(local.type), at=start)
        return local

    def _local(self) -> n.Local:
        start = self._next
        name = self._name()
        if name not in self._types:
            self._fail(f"`{name}` is not declared", at=start)
        return n.Local(name, self._types[name], span=start.span)

    # --- expressions

    def _expression(self, binding: int = COMPARISON) -> n.Expression:
        """An expression of operators that bind at least as tightly as `binding`."""
        left = self._unary()
        while self._next.kind == "symbol" and self._next.text in _OPERATION_OF:
            name, tightness = _OPERATION_OF[self._next.text]
            if tightness < binding:
                break
            operator = self._advance()
            right = self._expression(tightness + 1)
            left = self._operate(name, (left, right), operator)
            if tightness == COMPARISON:
                break
        return left

    def _operate(self, name: str, arguments: tuple[n.Expression, ...], at: Token) -> n.Operate:
        types = [argument.type for argument in arguments]
        result = OPERATIONS[name].result(types)
        if result is None:
            shown = ", ".join(map(str, types))
            self._fail(f"`{name}` does not take these arguments", found=f"({shown})", at=at)
        return n.Operate(name, arguments, result, span=at.span)

    def _unary(self) -> n.Expression:
        sign = self._next
        if sign.kind == "symbol" and sign.text in _PREFIX_OF:
            self._advance()
            if sign.text == "-" and (self._next.kind == "number" or self._next.text == "inf"):
                return self._number(sign)
            return self._operate(_PREFIX_OF[sign.text], (self._unary(),), sign)
        return self._postfix()

    def _postfix(self) -> n.Expression:
        node = self._primary()
        while self._next.kind == "member":
            token = self._advance()
            name = self._unquoted(token.text[1:])
            node = n.Member(node, name, self._type_at(node.type, (name,), token), span=token.span)
        return node

    def _primary(self) -> n.Expression:
        token = self._next
        if token.kind == "number" or (token.kind == "word" and token.text in ("inf", "nan")):
            return self._number(None)
        if self._accept("("):
            return self._parenthesised(token)
        if token.kind == "symbol" and token.text == "@":
            return self._load_or_table(self._table())
        if token.kind == "word":
            node = self._word(token)
            if node is not None:
                return node
        if token.kind not in ("word", "string"):
            self._fail("no expression begins here", "an expression")
        return self._load_or_table(self._local())

    def _word(self, token: Token) -> n.Expression | None:
        """What a word begins that is not a local's name."""
        word = token.text
        if word in ("true", "false"):
            return n.Constant(self._advance().text == "true", BOOL, span=token.span)
        if self._accept("length"):
            self._expect("(")
            length = n.Length(self._table(), I32, span=token.span)
            self._expect(")")
            return length
        if word in _BUILT or word == "new":
            self._advance()
            kind = _BUILT[word] if word in _BUILT else self._record_name()
            self._expect("(")
            return n.Construct(tuple(self._list(")", self._expression)), kind, span=token.span)
        if self._after_next.text == "(":
            if word not in OPERATIONS:
                self._fail(f"`{word}` is no operation")
            self._advance()
            self._expect("(")
            return self._operate(word, tuple(self._list(")", self._expression)), token)
        return None

    def _load_or_table(self, base: n.Local | n.NamedTable) -> n.Expression:
        """`base`, or where a bracket follows, what stands there in the table or array."""
        if self._next.text != "[" or self._next.kind != "symbol":
            return base
        bracket = self._advance()
        index = self._expression()
        self._expect("]")
        if isinstance(base.type, Array):
            return n.Element(base.name, index, base.type.item, span=base.span)
        if not isinstance(base.type, Table):
            self._fail("neither a table nor an array", "a table or array", str(base.type), at=bracket)
        path = self._path()
        return n.Load(base, index, path, self._type_at(base.type.record, path, bracket), span=base.span)

    def _parenthesised(self, start: Token) -> n.Expression:
        """An expression in parentheses, or with a comma (or nothing) a tuple."""
        items: list[n.Expression] = []
        while not self._accept(")"):
            items.append(self._expression())
            if self._accept(")"):
                if len(items) == 1:
                    return items[0]
                break
            self._expect(",")
        return n.Construct(tuple(items), Tuple(tuple(item.type for item in items)), span=start.span)

    def _number(self, sign: Token | None) -> n.Constant:
        token = self._advance()
        span = sign.span if sign else token.span
        factor = -1 if sign else 1
        if token.text == "nan":
            self._expect("(")
            pattern = self._integer()
            self._expect(")")
            if pattern >= 2**32:
                self._fail("more than 32 bits", "the bits of an f32", at=token)
            return n.Constant(float(np.uint32(pattern).view(np.float32)), F32, span=span)
        if token.text == "inf" or "." in token.text or "e" in token.text:
            with np.errstate(over="ignore"):
                return n.Constant(factor * float(np.float32(token.text)), F32, span=span)
        return n.Constant(factor * int(token.text, 0), I32, span=span)

    def _type_at(self, base: Type, path: tuple[str, ...], at: Token) -> Type:
        try:
            return at_path(base, path)[0]
        except KeyError as missing:
            self._fail(f"{base} has no member {missing}", at=at)

    # --- tokens

    @property
    def _next(self) -> Token:
        return self._tokens[self._position]

    @property
    def _after_next(self) -> Token:
        return self._tokens[min(self._position + 1, len(self._tokens) - 1)]

    def _advance(self) -> Token:
        token = self._next
        self._position = min(self._position + 1, len(self._tokens) - 1)
        return token

    def _accept(self, text: str) -> bool:
        """Takes the next token if it is this word or symbol."""
        if self._next.text == text and self._next.kind in ("word", "symbol"):
            self._advance()
            return True
        return False

    def _expect(self, text: str) -> None:
        if not self._accept(text):
            self._fail("something else is expected here", f"`{text}`")

    def _name(self, *, numbered: bool = False, of_member: bool = False) -> str:
        """A name in its own right; `numbered`: without the `~2` that tells records of one name apart."""
        token = self._next
        is_reserved = token.kind == "word" and token.text in RESERVED and not of_member
        if token.kind not in ("word", "string") or is_reserved:
            self._fail("a name is expected here", "a name (in double quotes, if it is reserved)")
        self._advance()
        return self._unquoted(re.sub(r"~\d+$", "", token.text) if numbered else token.text)

    def _unquoted(self, name: str) -> str:
        if not name.startswith('"'):
            return name
        try:
            return json.loads(name)
        except ValueError:
            self._fail("a quoted name is malformed", "a name in double quotes, with JSON's escapes")

    def _integer(self) -> int:
        if self._next.kind != "number" or not re.fullmatch(r"\d+|0x[0-9a-f]+", self._next.text):
            self._fail("a whole number is expected here", "a whole number")
        return int(self._advance().text, 0)

    def _list(self, closing: str, item: Callable[[], _Item]) -> list[_Item]:
        """Items with commas between them, up to `closing`, which is taken too."""
        items: list[_Item] = []
        while not self._accept(closing):
            if items:
                self._expect(",")
            items.append(item())
        return items

    def _fail(
        self, message: str, expected: str | None = None, found: str | None = None, at: Token | None = None
    ) -> NoReturn:
        token = at or self._next
        raise _Wrong(self._diagnostic(message, expected, found or token.shown(), token.span))

    def _diagnostic(self, message: str, expected: str | None, found: str, span: Span | None = None) -> Diagnostic:
        return Diagnostic(message, span or self._next.span, expected, found, source=self._source)
