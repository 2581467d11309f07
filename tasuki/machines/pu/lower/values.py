"""Computing with parts: the operations of the IR as macro calls.

A value is a list of operands, one for each part (`parts`): places of registers, and numbers where it is constant. A
number where a vector is wanted stands for all of its components.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from tasuki.ir.types import BOOL, F32, VEC4, Type, Vector
from tasuki.machines.pu.lower.code import Code, Operand, Place, Register, Word
from tasuki.machines.pu.lower.macros import COMMUTATIVE, unit_of
from tasuki.machines.pu.lower.parts import banks_of

Value = list[Operand]

FLOAT = {"add": "add", "subtract": "sub", "multiply": "mul", "minimum": "min", "maximum": "max", "copysign": "sign"}
FLOAT |= {"negate": "neg", "absolute": "abs", "floor": "floor"}
"""Primitive of the IR -> macro on floats; with the number of components behind it, on vectors."""
INTEGER = {"add": "iadd", "subtract": "isub", "multiply": "imul", "minimum": "imin", "maximum": "imax"}
INTEGER |= {"bit_and": "iand", "bit_or": "ior", "bit_xor": "ixor", "shift_left": "ishl", "shift_right": "isar"}
"""Primitive of the IR -> macro on integers and truth values (0 and 1)."""
COMPARISONS = {
    "less": ("lt", False, True),
    "less_equal": ("le", False, True),
    "greater": ("lt", True, True),
    "greater_equal": ("le", True, True),
    "equal": ("eq", False, True),
    "not_equal": ("eq", False, False),
}
"""Comparison -> flag, whether the operands are exchanged, whether the flag must be set."""
OVER_ONE_LANE = ("any_lane", "all_lanes", "count_lanes", "same_lanes")
"""Operations that on a packet of one lane are their argument (True is 1)."""
TURNS = ("turn_x", "turn_y", "turn_z", "turn_s")
"""Macros that make a row of a matrix into a vector, one for each bank."""


def kind_of(operand: Operand) -> str:
    """The kind of an operand, as macros name kinds."""
    if isinstance(operand, Word):
        return operand.kind
    if isinstance(operand, Place):
        return operand.banks if len(operand.banks) == 1 else "v"
    return "float" if isinstance(operand, float) else "integer"


class Arithmetic:
    """Emits the operations of the IR on values. `into`: where a single result may go if that is convenient."""

    def __init__(self, code: Code) -> None:
        self.code = code

    # --- places -------------------------------------------------------------------------------------------------------

    def fresh(self, banks: str) -> Place:
        return Register(banks).place

    def placed(self, operand: Operand, part: Type) -> Place:
        """The operand in a register of its own kind: a number is loaded."""
        if isinstance(operand, Place):
            return operand
        return self.move(self.fresh(banks_of(part)), operand)

    def scalar_in_s(self, operand: Operand) -> Place:
        """A scalar f32 in bank S, where tables and the S bus reach it."""
        if isinstance(operand, Place) and operand.banks == "s":
            return operand
        return self.move(self.fresh("s"), operand)

    def move(self, result: Place, operand: Operand) -> Place:
        """A copy, bit for bit."""
        if result == operand:
            return result
        suffix = str(len(result.banks)) if len(result.banks) > 1 else ""
        return self.code.emit(f"move{suffix}", result, operand)

    # --- conditions ---------------------------------------------------------------------------------------------------

    def compare(self, operation: str, a: Operand, b: Operand) -> tuple[Word, bool]:
        """Sets flags; the condition in which the comparison shows, and whether it must hold."""
        flag, exchanged, positive = COMPARISONS[operation]
        if exchanged:
            a, b = b, a
        if not isinstance(a, Place) and not isinstance(b, Place):
            a = self.placed(a, F32 if isinstance(a, float) else BOOL)
        self.code.effect("compare", a, b)
        integer = "i" in (kind_of(a), kind_of(b))
        unit = "alu" if integer else unit_of(None, [kind_of(a), kind_of(b)])
        return Word(f"{unit}.{flag}", "condition"), positive

    def holds(self, operand: Operand) -> tuple[Word, bool]:
        """The condition in which a truth value shows."""
        return self.compare("not_equal", self.placed(operand, BOOL), 0)

    def truth(self, condition: tuple[Word, bool], into: Place | None = None) -> Place:
        """A condition as 0 or 1."""
        word, positive = condition
        return self.code.emit("test" if positive else "test_not", into or self.fresh("i"), word)

    def pick(self, part: Type, condition: tuple[Word, bool], a: Operand, b: Operand, into: Place | None) -> Operand:
        """a where the condition holds, else b."""
        word, positive = condition
        if not positive:
            a, b = b, a
        if not isinstance(a, Place) and not isinstance(b, Place):
            # Loading a number changes no flags.
            a = self.placed(a, part)
        if isinstance(part, Vector):
            a, b = self.as_row(a, part), self.as_row(b, part)
            return self.code.emit(f"pick{part.size}", into or self.fresh(banks_of(part)), a, b, word)
        banks = banks_of(part) if str(part) != "f32" else self.natural_bank([a, b])
        return self.code.emit("pick", into or self.fresh(banks), a, b, word)

    # --- primitives ---------------------------------------------------------------------------------------------------

    def primitive(self, name: str, part: Type, arguments: Sequence[Operand], into: Place | None) -> Operand:
        """One part of the result of a primitive; a scalar goes with every component of a vector."""
        if isinstance(part, Vector):
            return self.vector(name, part, arguments, into)
        special = _CONVERSIONS.get(name)
        if special:
            return special(self, arguments[0], into)
        if str(part) == "f32":
            return self.scalar(name, arguments, into)
        return self.integer(name, part, arguments, into)

    def natural_bank(self, operands: Sequence[Operand]) -> str:
        """The bank in which all scalars lie, or S."""
        banks = {one.banks for one in operands if isinstance(one, Place)}
        return banks.pop() if len(banks) == 1 else "s"

    def scalar(self, name: str, arguments: Sequence[Operand], into: Place | None) -> Operand:
        if name == "fma":
            # No fused operation on this machine: a product and a sum.
            return self.scalar("add", [self.scalar("multiply", arguments[:2], None), arguments[2]], into)
        if name == "divide":
            if arguments[0] == 1.0:
                return self.function("rcp", arguments[1], into)
            return self.result_in_s("div", [self.scalar_in_s(one) for one in arguments], into)
        if name == "sqrt":
            return self.function("sqrt", arguments[0], into)
        if not any(isinstance(one, Place) for one in arguments):
            arguments = [self.placed(arguments[0], F32), *arguments[1:]]
        return self.code.emit(FLOAT[name], into or self.fresh(self.natural_bank(arguments)), *arguments)

    def function(self, macro: str, argument: Operand, into: Place | None) -> Operand:
        """A macro that takes and gives a scalar of bank S."""
        return self.result_in_s(macro, [self.scalar_in_s(argument)], into)

    def result_in_s(self, macro: str, arguments: Sequence[Operand], into: Place | None) -> Operand:
        result = into if into and into.banks == "s" else self.fresh("s")
        return self.code.emit(macro, result, *arguments)

    def integer(self, name: str, part: Type, arguments: Sequence[Operand], into: Place | None) -> Operand:
        result = into or self.fresh("i")
        if name == "negate":
            return self.code.emit("isub", result, 0, self.placed(arguments[0], part))
        if name == "absolute":
            value = self.placed(arguments[0], part)
            return self.code.emit("imax", result, value, self.integer("negate", part, [value], None))
        if name == "bit_not":
            return self.code.emit("ixor", result, self.placed(arguments[0], part), 1 if part == BOOL else -1)
        if name in ("floor_divide", "modulo"):
            return self.quotient(name, part, arguments, result)
        if not isinstance(arguments[1], Place):
            arguments = [self.placed(arguments[0], part), arguments[1]]
        return self.code.emit(INTEGER[name], result, *arguments)

    def quotient(self, name: str, part: Type, arguments: Sequence[Operand], result: Place) -> Operand:
        """Quotient or remainder towards minus infinity; the macro makes both, and needs registers to work in."""
        a, b = (self.placed(one, part) for one in arguments)
        quotient, remainder, size, sign = (self.fresh("i") for _ in range(4))
        self.code.undefined(size)
        self.code.undefined(sign)
        self.code.emit("idivide", quotient, a, b, size, sign, also=remainder, distinct=True)
        return self.move(result, quotient if name == "floor_divide" else remainder)

    def to_float(self, argument: Operand, into: Place | None) -> Operand:
        if not isinstance(argument, Place):
            argument = self.placed(argument, BOOL)
        return self.result_in_s("itof", [argument], into)

    def to_integer(self, argument: Operand, into: Place | None) -> Operand:
        return self.code.emit("ftoi", into or self.fresh("i"), self.placed(argument, F32))

    def bits(self, argument: Operand, into: Place | None) -> Operand:
        return self.code.emit("move", into or self.fresh("i"), self.placed(argument, F32))

    def from_bits(self, argument: Operand, into: Place | None) -> Operand:
        return self.code.emit("move", into or self.fresh("s"), self.placed(argument, BOOL))

    def itself(self, argument: Operand, into: Place | None) -> Operand:
        return argument

    # --- vectors ------------------------------------------------------------------------------------------------------

    def as_row(self, operand: Operand, part: Vector) -> Operand:
        """A vector, or a number for all components; a scalar register is copied to all of them."""
        if not isinstance(operand, Place) or operand.banks == banks_of(part):
            return operand
        return self.code.emit(f"move{part.size}", self.fresh(banks_of(part)), self.scalar_in_s(operand))

    def row_or_scalar(self, operand: Operand, part: Vector) -> Operand:
        """An operand of a vector macro: a row, a number, or a scalar in bank S."""
        if not isinstance(operand, Place) or len(operand.banks) > 1:
            return operand
        return self.scalar_in_s(operand)

    def vector(self, name: str, part: Vector, arguments: Sequence[Operand], into: Place | None) -> Operand:
        if name == "fma":
            product = self.vector("multiply", part, arguments[:2], None)
            return self.vector("add", part, [product, arguments[2]], into)
        if name == "divide":
            return self.vector_quotient(part, arguments, into)
        if name == "sqrt":
            return self.by_components("sqrt", part, arguments)
        macro = FLOAT[name]
        operands = [self.row_or_scalar(one, part) for one in arguments]
        scalars = sum(isinstance(one, Place) and one.banks == "s" for one in operands)
        has_row = any(isinstance(one, Place) and len(one.banks) > 1 for one in operands)
        if scalars > 1 or (scalars and part == VEC4 and not (has_row and macro in COMMUTATIVE)):
            operands = [self.as_row(one, part) for one in operands]
        if not any(isinstance(one, Place) for one in operands):
            operands[0] = self.placed(operands[0], part)
        return self.code.emit(f"{macro}{part.size}", into or self.fresh(banks_of(part)), *operands)

    def vector_quotient(self, part: Vector, arguments: Sequence[Operand], into: Place | None) -> Operand:
        a, b = arguments
        if not isinstance(b, Place) or len(b.banks) == 1:
            inverse = self.scalar("divide", [1.0, b], None)
            return self.vector("multiply", part, [self.row_or_scalar(a, part), inverse], into)
        macro = "vdiv" if part == VEC4 else "vdiv15"
        row = self.placed(self.as_row(a, part), part)
        return self.code.emit(macro, into or self.fresh(banks_of(part)), row, b)

    def by_components(self, name: str, part: Vector, arguments: Sequence[Operand]) -> Operand:
        """Component by component, in bank S."""
        result = self.fresh(banks_of(part))
        self.code.undefined(result)
        for bank in result.banks:
            operands = [self.component(one, bank) for one in arguments]
            self.move(result.bank(bank), self.scalar(name, operands, None))
        return result

    def component(self, operand: Operand, bank: str) -> Operand:
        """Component of a vector; of a number or scalar, itself."""
        return operand.bank(bank) if isinstance(operand, Place) and len(operand.banks) > 1 else operand

    def composed(self, part: Vector, components: Sequence[Operand], into: Place | None) -> Operand:
        """A vector of scalars."""
        own = into is None or any(isinstance(one, Place) and one.register is into.register for one in components)
        result = self.fresh(banks_of(part)) if own or into is None else into
        if not result.is_part:
            self.code.undefined(result)
        for bank, component in zip(result.banks, components, strict=True):
            self.move(result.bank(bank), component)
        return result

    # --- composites ---------------------------------------------------------------------------------------------------

    def composite(self, name: str, types: Sequence[Type], arguments: Sequence[Value], into: Place | None) -> Value:
        """`types` are those of the arguments."""
        return _COMPOSITES[name](self, types, arguments, into)

    def reciprocal(self, types: Sequence[Type], arguments: Sequence[Value], into: Place | None) -> Value:
        return [self.function("rcp", arguments[0][0], into)]

    def sine(self, types: Sequence[Type], arguments: Sequence[Value], into: Place | None) -> Value:
        return [self.function("sin", arguments[0][0], into)]

    def cosine(self, types: Sequence[Type], arguments: Sequence[Value], into: Place | None) -> Value:
        return [self.function("cos", arguments[0][0], into)]

    def dot(self, types: Sequence[Type], arguments: Sequence[Value], into: Place | None) -> Value:
        a, b = (self.placed(value[0], part) for value, part in zip(arguments, types, strict=True))
        return [self.inner_product(into or self.fresh("s"), a, b)]

    def inner_product(self, result: Place, a: Place, b: Place) -> Place:
        return self.code.emit("dot3" if len(a.banks) == 3 else "dot4", result, a, b)

    def norm(self, types: Sequence[Type], arguments: Sequence[Value], into: Place | None) -> Value:
        a = self.placed(arguments[0][0], types[0])
        if types[0] != VEC4:
            return [self.result_in_s("norm", [a], into)]
        return [self.function("sqrt", self.inner_product(self.fresh("s"), a, a), into)]

    def normalize(self, types: Sequence[Type], arguments: Sequence[Value], into: Place | None) -> Value:
        a = self.placed(arguments[0][0], types[0])
        if types[0] != VEC4:
            return [self.code.emit("normalize3", into or self.fresh("xyz"), a)]
        [length] = self.norm(types, [[a]], None)
        return [self.vector("multiply", VEC4, [a, self.function("rcp", length, None)], into)]

    def cross(self, types: Sequence[Type], arguments: Sequence[Value], into: Place | None) -> Value:
        a, b = (self.placed(value[0], part) for value, part in zip(arguments, types, strict=True))
        return [self.code.emit("cross", into or self.fresh("xyz"), a, b)]

    def transform(self, types: Sequence[Type], arguments: Sequence[Value], into: Place | None) -> Value:
        row = self.placed(arguments[0][0], VEC4)
        return [self.row_times(row, self.columns(arguments[1]))]

    def columns(self, matrix: Value) -> list[Place]:
        return [self.placed(column, VEC4) for column in matrix]

    def row_times(self, row: Place, columns: Sequence[Place]) -> Place:
        """A row vector times a matrix: an inner product with each column, each in the unit of its element."""
        result = self.fresh("xyzs")
        self.code.undefined(result)
        for bank, column in zip("xyzs", columns, strict=True):
            self.inner_product(result.bank(bank), row, column)
        return result

    def transpose(self, types: Sequence[Type], arguments: Sequence[Value], into: Place | None) -> Value:
        columns = self.columns(arguments[0])
        return [self.code.emit(turn, self.fresh("xyzs"), *columns, distinct=True) for turn in TURNS]

    def compose(self, types: Sequence[Type], arguments: Sequence[Value], into: Place | None) -> Value:
        """Each row of a, turned from its bank into a vector, times b; the elements land in the row's bank."""
        a, b = self.columns(arguments[0]), self.columns(arguments[1])
        result = [self.fresh("xyzs") for _ in b]
        for column in result:
            self.code.undefined(column)
        for bank, turn in zip("xyzs", TURNS, strict=True):
            row = self.code.emit(turn, self.fresh("xyzs"), *a, distinct=True)
            for column, factor in zip(result, b, strict=True):
                self.inner_product(column.bank(bank), row, factor)
        return list(result)


_CONVERSIONS: dict[str, Callable[[Arithmetic, Operand, Place | None], Operand]] = {
    "to_f32": Arithmetic.to_float,
    "to_i32": Arithmetic.to_integer,
    "bits": Arithmetic.bits,
    "from_bits": Arithmetic.from_bits,
    "bool_to_i32": Arithmetic.itself,
}


_COMPOSITES: dict[str, Callable[[Arithmetic, Sequence[Type], Sequence[Value], Place | None], Value]] = {
    "reciprocal": Arithmetic.reciprocal,
    "sin": Arithmetic.sine,
    "cos": Arithmetic.cosine,
    "dot": Arithmetic.dot,
    "norm": Arithmetic.norm,
    "normalize": Arithmetic.normalize,
    "cross": Arithmetic.cross,
    "transform": Arithmetic.transform,
    "transpose": Arithmetic.transpose,
    "compose": Arithmetic.compose,
}
