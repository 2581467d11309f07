"""The vocabulary of the language: names of types and built-in functions, as objects that users import.

In a checked module they are recognised by identity, so that `from tasuki.language import dot as inner` works. Called
from plain Python they compute on the value types of `tasuki.language.values`.
"""

from __future__ import annotations

import builtins
from typing import Any

from tasuki.ir import types as ir
from tasuki.ir.ops import OPERATIONS


class TypeName:
    """A built-in type: an annotation, a conversion (`f32(n)`) and a constructor (`vec3(x, y, z)`)."""

    def __init__(self, type: ir.Type, doc: str) -> None:
        self.name = str(type)
        self.type = type
        self.__doc__ = doc

    def __call__(self, *arguments: Any) -> Any:
        from tasuki.language.values import evaluate

        return evaluate(self.name, *arguments)

    def __repr__(self) -> str:
        return self.name


class Builtin:
    """A built-in function: an operation of `tasuki.ir.ops` under the name that users write."""

    def __init__(self, name: str, operation: str | None = None, doc: str | None = None) -> None:
        self.name = name
        self.operation = operation or name
        self.__doc__ = doc or OPERATIONS[self.operation].doc

    def __call__(self, *arguments: Any) -> Any:
        from tasuki.language.values import evaluate

        return evaluate(self.name, *arguments)

    def __repr__(self) -> str:
        return f"<built-in {self.name}>"


class AtomicName(Builtin):
    """`atomic_add(table[i].field, value)`: one indivisible change of an i32 in memory; gives the value from before."""


class ArrayName(Builtin):
    """`array(item type, length)`: a local array, zero when its life begins."""


f32 = TypeName(ir.F32, "IEEE 754 binary32. `f32(x)` converts an i32 or a bool, rounding to nearest.")
i32 = TypeName(ir.I32, "32 bits, wrapping. `i32(x)` truncates an f32 (saturating, NaN is 0); of a bool, 1 or 0.")
vec3 = TypeName(ir.VEC3, "Three f32: `vec3(x, y, z)`, or `vec3(s)` with s in every component.")
vec4 = TypeName(ir.VEC4, "Four f32: `vec4(x, y, z, w)`, `vec4(v, w)` with a vec3 v, or `vec4(s)`.")
mat4 = TypeName(ir.MAT4, "Four by four f32, from four columns: `mat4(a, b, c, d)`.")

min = Builtin("min", "minimum")
max = Builtin("max", "maximum")
abs = Builtin("abs", "absolute")
sqrt = Builtin("sqrt")
floor = Builtin("floor")
fma = Builtin("fma")
copysign = Builtin("copysign")
dot = Builtin("dot")
cross = Builtin("cross")
norm = Builtin("norm")
normalize = Builtin("normalize")
reciprocal = Builtin("reciprocal")
transpose = Builtin("transpose")
sin = Builtin("sin")
cos = Builtin("cos")
select = Builtin("select")
any_lane = Builtin("any_lane")
all_lanes = Builtin("all_lanes")
count_lanes = Builtin("count_lanes")
same_lanes = Builtin("same_lanes")
bits = Builtin("bits")
from_bits = Builtin("from_bits")

atomic_add = AtomicName("atomic_add", "add", "Adds to an i32 in memory; gives the value from before.")
atomic_min = AtomicName("atomic_min", "minimum", "Lowers an i32 in memory to `value`; gives the value from before.")
atomic_max = AtomicName("atomic_max", "maximum", "Raises an i32 in memory to `value`; gives the value from before.")

array = ArrayName("array", doc=ArrayName.__doc__)

VOCABULARY: dict[str, TypeName | Builtin] = {
    thing.name: thing for thing in list(globals().values()) if isinstance(thing, TypeName | Builtin)
}
"""Every name above, for suggestions and for the documentation's test."""

PYTHON_TWINS: dict[Any, Builtin] = {builtins.min: min, builtins.max: max, builtins.abs: abs}
"""Python's own functions that mean one of ours: a user who forgot to import `min` gets what was meant."""
