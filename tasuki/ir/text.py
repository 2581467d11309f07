"""The text form of programs: complete (but for spans), readable, and read back by `parse`.

    record Sphere {
      centre: vec3
      radius: f32
    }
    table spheres: Sphere
    entry nearest
    function nearest(origin: vec3, limit: f32) -> tuple[f32, i32] {
      var best: i32
      var i: i32
      var stack: array[i32, 8]
      best = -1
      clear stack
      while i < length(@spheres) {
        if norm(@spheres[i].centre - origin) < limit {
          best = i
          stack[0] = i
        }
      } step {
        i = i + 1
      }
      return (limit, best)
    }

Operators bind as in Python; every other operation is written as a call. `@` marks a table that the program names;
`a[i]` is a load where `a` is a table, an element where it is an array. The names after a load's bracket are its path:
a `Member` of a load is written `(a[i]).x`. Constructions: `vec3(..)`, `mat4(..)`, `new Record(..)`, and `(a, b)` for
tuples. A loop with a setup is `loop { setup } while test { body } step { step }`. The other statements:
`store @t[i].path = value`, `x = atomic add @t[i].path, value`, `x = call f(..)`, `break`, `continue`, `return`. Names
that are no identifiers, or reserved, stand in double quotes. Different records of one name are told apart as `Name~2`.
f32 constants are the shortest decimals that read back to the same float32; NaNs show their bits.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence

import numpy as np

from tasuki.ir.nodes import (
    Assign,
    Atomic,
    Break,
    Call,
    Clear,
    Constant,
    Construct,
    Continue,
    Element,
    Expression,
    Function,
    If,
    Length,
    Load,
    Local,
    Loop,
    Member,
    NamedTable,
    Operate,
    Program,
    Return,
    SetElement,
    Statement,
    Store,
)
from tasuki.ir.types import BOOL, BUILTIN_TYPES, F32, VOID, Array, Record, Table, Tuple, Type

INFIX = {
    "less": ("<", 1),
    "less_equal": ("<=", 1),
    "greater": (">", 1),
    "greater_equal": (">=", 1),
    "equal": ("==", 1),
    "not_equal": ("!=", 1),
    "bit_or": ("|", 2),
    "bit_xor": ("^", 3),
    "bit_and": ("&", 4),
    "shift_left": ("<<", 5),
    "shift_right": (">>", 5),
    "add": ("+", 6),
    "subtract": ("-", 6),
    "multiply": ("*", 7),
    "divide": ("/", 7),
    "floor_divide": ("//", 7),
    "modulo": ("%", 7),
}
"""Operation -> symbol and how tightly it binds; comparisons do not chain, the others group from the left."""

PREFIX = {"negate": "-", "bit_not": "~"}
COMPARISON, UNARY, POSTFIX = 1, 8, 9

DECLARATIONS = frozenset({"record", "table", "entry", "function"})
_STATEMENTS = {"if", "else", "while", "loop", "step", "break", "continue", "return", "clear", "store", "call", "atomic"}
_IN_TYPES = {"var", "tuple", "array", "Table", *BUILTIN_TYPES}
_IN_EXPRESSIONS = {"true", "false", "inf", "nan", "new", "length"}
RESERVED = DECLARATIONS | _STATEMENTS | _IN_TYPES | _IN_EXPRESSIONS
"""Words that a name must be quoted to be told from."""

IDENTIFIER = r"(?:[^\W\d]|\$)[\w$]*"


def print_program(program: Program) -> str:
    """The whole program, records first, the functions in the program's order."""
    return Printer(Names()).program(program, list(program.functions.values()))


def print_function(function: Function) -> str:
    """One function, without the records and tables that it names."""
    return "\n".join(Printer(Names()).function(function)) + "\n"


def print_expression(expression: Expression) -> str:
    return Printer(Names()).expression(expression)


def quoted(name: str) -> str:
    """`name` as it is written where a name stands."""
    return name if re.fullmatch(IDENTIFIER, name) and name not in RESERVED else json.dumps(name, ensure_ascii=False)


def constant_text(node: Constant) -> str:
    """A literal that reads back to the same bits; its form shows the type."""
    if node.type == BOOL:
        return "true" if node.value else "false"
    if node.type != F32:
        return str(node.value)
    value = np.float32(node.value)
    if np.isnan(value):
        return f"nan(0x{int(value.view(np.uint32)):08x})"
    return str(value)


class Names:
    """How things are called in the text: here by their own names. `canonical` calls them by their order."""

    def __init__(self) -> None:
        self.records: dict[Record, str] = {}
        """Every record that was named so far, those that it contains before it."""

    def enter(self, function: Function) -> None:
        """The locals that follow belong to `function`."""

    def local(self, name: str) -> str:
        return quoted(name)

    def variables(self, function: Function) -> list[str]:
        """The variables to declare, in order; asked for after the body was printed."""
        return list(function.variables)

    def function(self, name: str) -> str:
        return quoted(name)

    def member(self, base: Type | None, name: str) -> str:
        """A member of a value of type `base`."""
        return name if re.fullmatch(r"[\w$]+", name) else json.dumps(name, ensure_ascii=False)

    def record_name(self, record: Record) -> str:
        return quoted(record.name)

    def record(self, record: Record) -> str:
        if record not in self.records:
            for _, inner in record.fields:
                self.type(inner)
            name = self.record_name(record)
            earlier = sum(self.record_name(other) == name for other in self.records)
            self.records[record] = f"{name}~{earlier + 1}" if earlier else name
        return self.records[record]

    def type(self, kind: Type) -> str:
        match kind:
            case Record():
                return self.record(kind)
            case Tuple():
                return f"tuple[{', '.join(map(self.type, kind.items))}]"
            case Array():
                return f"array[{self.type(kind.item)}, {kind.length}]"
            case Table():
                return f"Table[{self.record(kind.record)}]"
        return str(kind)


class Printer:
    """Prints nodes with the names that `names` gives them."""

    def __init__(self, names: Names) -> None:
        self.names = names
        self._types: dict[str, Type] = {}

    def program(self, program: Program, functions: Sequence[Function]) -> str:
        """`functions` of the program in the order in which they are to stand."""
        # Records print first but are known last: printing the rest finds them.
        entry = [f"entry {self.names.function(program.entry)}"]
        tables = [f"table {quoted(name)}: {self.names.type(record)}" for name, record in program.tables.items()]
        bodies = [self.function(function) for function in functions]
        records = [self._record(record, name) for record, name in self.names.records.items()]
        blocks = [*records, *([tables] if tables else []), entry, *bodies]
        return "\n\n".join("\n".join(block) for block in blocks) + "\n"

    def _record(self, record: Record, name: str) -> list[str]:
        fields = [f"  {self.names.member(record, field)}: {self.names.type(kind)}" for field, kind in record.fields]
        return [f"record {name} {{", *fields, "}"]

    def function(self, function: Function) -> list[str]:
        self.names.enter(function)
        self._types = {parameter.name: parameter.type for parameter in function.parameters} | dict(function.variables)
        parameters = ", ".join(f"{self.names.local(p.name)}: {self.names.type(p.type)}" for p in function.parameters)
        result = "" if function.result == VOID else f" -> {self.names.type(function.result)}"
        body = self._block(function.body)
        variables = [
            f"  var {self.names.local(name)}: {self.names.type(function.variables[name])}"
            for name in self.names.variables(function)
        ]
        return [f"function {self.names.function(function.name)}({parameters}){result} {{", *variables, *body, "}"]

    # --- statements: lines, indented below what contains them

    def _block(self, statements: Sequence[Statement]) -> list[str]:
        return ["  " + line for statement in statements for line in self.statement(statement)]

    def statement(self, node: Statement) -> list[str]:
        """The lines of one statement."""
        local = self.names.local
        match node:
            case Assign():
                path = self._path(self._types.get(node.target), node.path)
                return [f"{local(node.target)}{path} = {self.expression(node.value)}"]
            case SetElement():
                array = self._types.get(node.array)
                path = self._path(array.item if isinstance(array, Array) else None, node.path)
                return [f"{local(node.array)}[{self.expression(node.index)}]{path} = {self.expression(node.value)}"]
            case Clear():
                return [f"clear {local(node.array)}"]
            case Store():
                return [f"store {self._place(node)} = {self.expression(node.value)}"]
            case Atomic():
                update = f"atomic {node.operation} {self._place(node)}, {self.expression(node.value)}"
                return [update if node.target is None else f"{local(node.target)} = {update}"]
            case Call():
                call = f"call {self.names.function(node.function)}({self._list(node.arguments)})"
                return [call if node.target is None else f"{local(node.target)} = {call}"]
            case If():
                return self._if(node)
            case Loop():
                return self._loop(node)
            case Break():
                return ["break"]
            case Continue():
                return ["continue"]
            case Return():
                return ["return" if node.value is None else f"return {self.expression(node.value)}"]
        raise TypeError(f"{type(node).__name__} is not a statement")

    def _if(self, node: If) -> list[str]:
        head = [f"if {self.expression(node.test)} {{", *self._block(node.then)]
        if not node.orelse:
            return [*head, "}"]
        if len(node.orelse) == 1 and isinstance(node.orelse[0], If):
            first, *rest = self._if(node.orelse[0])
            return [*head, f"}} else {first}", *rest]
        return [*head, "} else {", *self._block(node.orelse), "}"]

    def _loop(self, node: Loop) -> list[str]:
        setup = self._block(node.setup)
        test = f"while {self.expression(node.test)} {{"
        head = ["loop {", *setup, f"}} {test}"] if setup else [test]
        step = ["} step {", *self._block(node.step), "}"] if node.step else ["}"]
        return [*head, *self._block(node.body), *step]

    # --- expressions

    def expression(self, node: Expression, binding: int = 0) -> str:
        """The text of `node` where its surroundings bind as tightly as `binding`."""
        match node:
            case Constant():
                return constant_text(node)
            case Local():
                return self.names.local(node.name)
            case NamedTable():
                return f"@{quoted(node.name)}"
            case Operate():
                return self._operate(node, binding)
            case Member():
                base = self.expression(node.base, POSTFIX)
                base = f"({base})" if isinstance(node.base, Load | Constant) else base
                return f"{base}{self._path(node.base.type, (node.name,))}"
            case Element():
                return f"{self.names.local(node.array)}[{self.expression(node.index)}]"
            case Construct():
                return self._construct(node)
            case Load():
                return self._place(node)
            case Length():
                return f"length({self.expression(node.table)})"
        raise TypeError(f"{type(node).__name__} is not an expression")

    def _operate(self, node: Operate, binding: int) -> str:
        if node.operation in INFIX and len(node.arguments) == 2:
            symbol, tightness = INFIX[node.operation]
            left, right = node.arguments
            left_text = self.expression(left, tightness + (tightness == COMPARISON))
            text = f"{left_text} {symbol} {self.expression(right, tightness + 1)}"
            return f"({text})" if tightness < binding else text
        # "-1.5" is a constant: the negation of one is written as a call.
        if node.operation in PREFIX and len(node.arguments) == 1 and not isinstance(node.arguments[0], Constant):
            text = f"{PREFIX[node.operation]}{self.expression(node.arguments[0], UNARY)}"
            return f"({text})" if binding > UNARY else text
        return f"{node.operation}({self._list(node.arguments)})"

    def _construct(self, node: Construct) -> str:
        arguments = self._list(node.arguments)
        if isinstance(node.type, Tuple):
            return f"({arguments},)" if len(node.arguments) == 1 else f"({arguments})"
        keyword = "new " if isinstance(node.type, Record) else ""
        return f"{keyword}{self.names.type(node.type)}({arguments})"

    def _list(self, nodes: Sequence[Expression]) -> str:
        return ", ".join(map(self.expression, nodes))

    def _place(self, node: Load | Store | Atomic) -> str:
        table = node.table.type
        path = self._path(table.record if isinstance(table, Table) else None, node.path)
        return f"{self.expression(node.table)}[{self.expression(node.index)}]{path}"

    def _path(self, base: Type | None, path: Sequence[str]) -> str:
        text = ""
        for name in path:
            text += f".{self.names.member(base, name)}"
            base = base.member(name) if base else None
        return text
