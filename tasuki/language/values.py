"""The values of the language in plain Python, computed in float32, so that a module can run under a debugger.

`F32` is a `float` and `I32` an `int` whose operators are the operations of `tasuki.ir.ops`, performed by their
references; a truth value is Python's own `bool`. `Vec3`, `Vec4` and `Mat4` hold their leaves. All are immutable. A
Python number that meets a value is a literal: it takes the value's type, as in the language (an int may become f32, a
float never becomes i32).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from ctypes import c_float
from typing import Any, ClassVar, NoReturn
from weakref import WeakValueDictionary

import numpy as np

from tasuki.ir import types
from tasuki.ir.expansions import Term
from tasuki.ir.ops import OPERATIONS, Operation

OPERATION_NAMES = {"min": "minimum", "max": "maximum", "abs": "absolute"}
"""What the language calls an operation of the table, where the table has another name for it."""

_FOLDED = {"minimum", "maximum"}
"""Operations that take any number of arguments, two at a time from the left."""

_COMPONENTS = "xyzw"


# --- operators ------------------------------------------------------------------------------------------------------

Method = Callable[..., Any]


def _operator(name: str) -> tuple[Method, Method]:
    """The methods of an operator that is the operation `name`: for a value on the left, and on the right."""

    def forward(self: Any, other: Any) -> Any:
        return evaluate(name, self, other) if _is_operand(other) else NotImplemented

    def reflected(self: Any, other: Any) -> Any:
        return evaluate(name, other, self) if _is_operand(other) else NotImplemented

    return forward, reflected


def _equality(name: str) -> Method:
    """`==` or `!=`; unlike other operators it must answer, not raise, where the operation has no meaning."""

    def method(self: Any, other: Any) -> Any:
        return evaluate(name, self, other) if _may_equal(self, other) else NotImplemented

    return method


def _refused(symbol: str, hint: str) -> tuple[Method, Method]:
    """The methods of an operator of Python's numbers that the language leaves out."""

    def refuse(*_: Any) -> NoReturn:
        raise TypeError(f"{symbol} is not part of the language: {hint}")

    return refuse, refuse


class _Arithmetic:
    """The operators that numbers, vectors and matrices share."""

    __slots__ = ()

    __add__, __radd__ = _operator("add")
    __sub__, __rsub__ = _operator("subtract")
    __mul__, __rmul__ = _operator("multiply")
    __truediv__, __rtruediv__ = _operator("divide")

    def __neg__(self) -> Any:
        return evaluate("negate", self)

    def __pos__(self) -> Any:
        return self

    def __abs__(self) -> Any:
        return evaluate("absolute", self)


class _Number(_Arithmetic):
    """What f32 and i32 share beyond arithmetic: order."""

    __slots__ = ()

    # Python itself turns `1 < x` into `x > 1`: comparisons have no reflected methods.
    __lt__ = _operator("less")[0]
    __le__ = _operator("less_equal")[0]
    __gt__ = _operator("greater")[0]
    __ge__ = _operator("greater_equal")[0]
    __eq__ = _equality("equal")
    __ne__ = _equality("not_equal")
    __pow__, __rpow__ = _refused("**", "write x * x")
    __divmod__, __rdivmod__ = _refused("divmod", "write // and %")


class F32(_Number, float):  # type: ignore[misc]
    """A float32: a `float` that float32 can represent. What it is made of is rounded once, to nearest even."""

    __slots__ = ()
    ir: ClassVar[types.Type] = types.F32

    def __new__(cls, value: Any = 0.0) -> F32:
        # C's conversion rounds once and overflows to infinity in silence, at a tenth of the cost of NumPy's.
        return float.__new__(cls, c_float(value).value)

    __floordiv__, __rfloordiv__ = _refused("// on f32", "write floor(a / b)")
    __mod__, __rmod__ = _refused("% on f32", "write a - floor(a / b) * b")

    def __str__(self) -> str:
        return str(np.float32(self))

    def __repr__(self) -> str:
        return f"F32({self})"

    __hash__ = float.__hash__


class I32(_Number, int):  # type: ignore[misc]
    """A 32-bit integer in two's complement; what it is made of wraps."""

    __slots__ = ()
    ir: ClassVar[types.Type] = types.I32

    def __new__(cls, value: Any = 0) -> I32:
        return int.__new__(cls, (int(value) + 2**31) % 2**32 - 2**31)

    __truediv__, __rtruediv__ = _refused("/ on i32", "write a // b, or f32(a) / f32(b)")
    __floordiv__, __rfloordiv__ = _operator("floor_divide")
    __mod__, __rmod__ = _operator("modulo")
    __and__, __rand__ = _operator("bit_and")
    __or__, __ror__ = _operator("bit_or")
    __xor__, __rxor__ = _operator("bit_xor")
    __lshift__, __rlshift__ = _operator("shift_left")
    __rshift__, __rrshift__ = _operator("shift_right")

    def __invert__(self) -> Any:
        return evaluate("bit_not", self)

    def __str__(self) -> str:
        return int.__repr__(self)

    def __repr__(self) -> str:
        return f"I32({self})"

    __hash__ = int.__hash__


class _Compound(_Arithmetic):
    """A vector or matrix: f32 leaves that never change."""

    __slots__ = ("_leaves",)
    ir: ClassVar[types.Type]
    _leaves: tuple[F32, ...]

    def __init__(self, *parts: Any) -> None:
        object.__setattr__(self, "_leaves", _compound_leaves(self.ir, parts))

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        raise AttributeError(f"a {self.ir} never changes; only a variable of a module may have its {name} assigned")

    def __delattr__(self, name: str) -> NoReturn:
        self.__setattr__(name, None)

    def __eq__(self, other: Any) -> Any:
        return self._leaves == other._leaves if type(other) is type(self) else NotImplemented

    def __hash__(self) -> int:
        return hash((type(self), self._leaves))

    def __reduce__(self) -> tuple[Any, ...]:
        return from_leaves, (self.ir, self._leaves)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(list(self), dtype or np.float32)

    def __iter__(self) -> Iterator[Any]:
        raise NotImplementedError


class _Vector(_Compound):
    """Components by name, and swizzles of three and four of them."""

    __slots__ = ()

    def __getattr__(self, name: str) -> Any:
        names = _COMPONENTS[: len(self._leaves)] if name != "_leaves" else ""
        if name and all(letter in names for letter in name):
            picked = tuple(self._leaves[names.index(letter)] for letter in name)
            if len(picked) == 1:
                return picked[0]
            if len(picked) in (3, 4):
                return from_leaves(types.VEC3 if len(picked) == 3 else types.VEC4, picked)
        raise AttributeError(f"a {self.ir} has no {name!r}; its components are {', '.join(names)}")

    def __iter__(self) -> Iterator[F32]:
        return iter(self._leaves)

    def __len__(self) -> int:
        return len(self._leaves)

    __matmul__ = _operator("transform")[0]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(map(str, self._leaves))})"


class Vec3(_Vector):
    """Three f32: `Vec3(x, y, z)`, `Vec3(all)`."""

    __slots__ = ()
    ir: ClassVar[types.Type] = types.VEC3


class Vec4(_Vector):
    """Four f32: `Vec4(x, y, z, w)`, `Vec4(xyz, w)`, `Vec4(all)`."""

    __slots__ = ()
    ir: ClassVar[types.Type] = types.VEC4


class Mat4(_Compound):
    """Four by four f32, made of its *columns*, as they stand in memory (paper, Figure 4). Iterates over its rows."""

    __slots__ = ()
    ir: ClassVar[types.Type] = types.MAT4

    def column(self, index: int) -> Vec4:
        """Column `index`, from 0."""
        if not 0 <= index < 4:
            raise IndexError(f"a mat4 has columns 0 to 3, not {index}")
        return from_leaves(types.VEC4, self._leaves[4 * index : 4 * index + 4])

    def __iter__(self) -> Iterator[Vec4]:
        return (from_leaves(types.VEC4, self._leaves[row::4]) for row in range(4))

    def __len__(self) -> int:
        return 4

    __matmul__ = _operator("compose")[0]

    def __repr__(self) -> str:
        return f"Mat4({', '.join(repr(self.column(i)) for i in range(4))})"


_CLASSES: dict[types.Type, Any] = {cls.ir: cls for cls in (F32, I32, Vec3, Vec4, Mat4)} | {types.BOOL: bool}


def _compound_leaves(type_: types.Type, parts: tuple[Any, ...]) -> tuple[F32, ...]:
    """What a constructor's arguments give: one scalar for all leaves, or scalars and vectors in a row."""
    count = len(type_.leaves)
    flat: list[F32] = []
    for part in parts:
        if isinstance(part, _Compound):
            flat += part._leaves
        else:
            flat.append(scalar_of(types.F32, part))
    if len(parts) == 1 and len(flat) == 1:
        return tuple(flat * count)
    if len(flat) != count:
        raise TypeError(f"{type_} takes {count} numbers, or one for all; found {len(flat)}")
    return tuple(flat)


# --- operations -----------------------------------------------------------------------------------------------------


def evaluate(name: str, *args: Any) -> Any:
    """The operation `name` of `tasuki.ir.ops` (or of the language: "min", "abs", ...) on values; also casts and
    constructors ("f32", "i32", "vec3", "vec4", "mat4").

    Python numbers among the arguments are literals. Lane operations see one lane, which is active. Raises TypeError
    where the operation does not take these types, or means something only inside a module.
    """
    if name in _CONSTRUCTORS:
        return _CONSTRUCTORS[name](*args)
    operation = OPERATIONS.get(OPERATION_NAMES.get(name, name))
    if operation is None:
        raise TypeError(f"{name} is no operation on values: it has a meaning only inside a module")
    if operation.name in _FOLDED and len(args) > 2:
        args = tuple(_operands(args))
        return evaluate(name, evaluate(name, *args[:-1]), args[-1])
    operands, result = _resolve(name, operation, args)
    if operation.sort == "lanes":
        return I32(operands[0]) if operation.name == "count_lanes" else operands[0]
    if operation.name == "select" and type_of(operands[1]) == type_of(operands[2]):
        return operands[1] if operands[0] else operands[2]
    with np.errstate(all="ignore"):
        if operation.sort == "composite":
            return _expand(operation, operands, result)
        return _apply(operation, operands, result)


def _resolve(name: str, operation: Operation, args: Sequence[Any]) -> tuple[list[Any], types.Type]:
    """The arguments with literals given their types, and the type of the result."""
    operands = _operands(args)
    result = operation.result(list(map(type_of, operands)))
    if result is None and any(type(arg) is int for arg in args):
        operands = _operands(args, floating=True)
        result = operation.result(list(map(type_of, operands)))
    if result is None:
        takes = " or ".join(dict.fromkeys(f"({', '.join(map(str, p))})" for p, _ in operation.signatures))
        found = ", ".join(str(type_of(operand)) for operand in _operands(args))
        raise TypeError(f"{name} takes {takes}, not ({found}); nothing is converted but by f32(x) and i32(x)")
    return operands, result


def _operands(args: Sequence[Any], floating: bool | None = None) -> list[Any]:
    """Literals become I32, or F32 where an argument is floating."""
    if floating is None:
        floating = any(isinstance(arg, float | np.floating | _Compound) for arg in args)
    return [_literal(arg, floating) for arg in args]


def _literal(arg: Any, floating: bool) -> Any:
    if isinstance(arg, np.bool_):
        return bool(arg)
    if isinstance(arg, bool | F32 | I32):
        return arg
    if isinstance(arg, float | np.floating) or (floating and isinstance(arg, int | np.integer)):
        return F32(arg)
    return _fitting_i32(arg) if isinstance(arg, int | np.integer) else arg


def _fitting_i32(number: Any) -> I32:
    """A Python integer as an I32. TypeError where it would have to wrap: only operations wrap."""
    if not -(2**31) <= int(number) < 2**31:
        raise TypeError(f"{number} does not fit i32")
    return I32(number)


def _apply(operation: Operation, operands: Sequence[Any], result: types.Type) -> Any:
    """A primitive, element by element: NumPy's broadcasting gives a scalar to every element."""
    assert operation.reference is not None
    elements = operation.reference(*map(_to_numpy, operands))
    return from_leaves(result, np.asarray(elements).reshape(-1).tolist())


def _expand(operation: Operation, operands: Sequence[Any], result: types.Type) -> Any:
    """A composite: its primitives in their stated order, on NumPy scalars."""
    assert operation.expansion is not None
    terms = [
        [
            Term(_to_numpy(leaf), scalar, _apply_primitive, _numpy_literal)
            for leaf, scalar in zip(leaves(operand), type_of(operand).leaves, strict=True)
        ]
        for operand in operands
    ]
    return from_leaves(result, [term.value.item() for term in operation.expansion(*terms)])


def _apply_primitive(name: str, values: Sequence[Any], _: Sequence[str]) -> Any:
    reference = OPERATIONS[name].reference
    assert reference is not None
    return reference(*values)


def _numpy_literal(number: float | int, scalar: str) -> Any:
    return np.float32(number) if scalar == "f32" else np.int32(number)


def _to_numpy(value: Any) -> Any:
    if isinstance(value, F32):
        return np.float32(value)
    if isinstance(value, I32):
        return np.int32(value)
    if isinstance(value, bool):
        return np.bool_(value)
    return np.array(leaves(value), np.float32)


def _cast(target: str, operations: Mapping[types.Type, str], value: Any) -> Any:
    value = _literal(value, floating=target == "f32")
    source = type_of(value)
    if str(source) == target:
        return value
    if source not in operations:
        raise TypeError(f"{target}(x) converts {' and '.join(map(str, operations))}, not {source}")
    return evaluate(operations[source], value)


def _cast_f32(value: Any) -> Any:
    return _cast("f32", {types.I32: "to_f32", types.BOOL: "to_f32"}, value)


def _cast_i32(value: Any) -> Any:
    return _cast("i32", {types.F32: "to_i32", types.BOOL: "bool_to_i32"}, value)


_CONSTRUCTORS: dict[str, Any] = {"f32": _cast_f32, "i32": _cast_i32, "vec3": Vec3, "vec4": Vec4, "mat4": Mat4}


def _is_operand(value: Any) -> bool:
    return isinstance(value, int | float | np.floating | np.integer | np.bool_ | _Compound)


def _may_equal(left: Any, right: Any) -> bool:
    """Whether `==` has a meaning for both."""
    if isinstance(right, bool) or not isinstance(right, int | float | np.floating | np.integer):
        return False
    if isinstance(right, F32 | I32):
        return type(left) is type(right)
    return isinstance(left, F32) or isinstance(right, int | np.integer)


# --- types, leaves --------------------------------------------------------------------------------------

# The Python class of every record type that `@record` has made: values of a record are built from leaves alone.
_record_classes: WeakValueDictionary[types.Record, type] = WeakValueDictionary()


def register_record(record: types.Record, cls: type) -> None:
    """Values of `record` are instances of `cls` from now on: `cls(*fields)`, with `cls.ir` equal to `record`."""
    _record_classes[record] = cls


def type_of(value: Any) -> types.Type:
    """The type of a value. Raises TypeError for anything that is not a value of the language."""
    if value is None:
        return types.VOID
    if isinstance(value, bool):
        return types.BOOL
    if isinstance(value, tuple):
        return types.Tuple(tuple(type_of(item) for item in value))
    found = getattr(type(value), "ir", None)
    if not isinstance(found, types.Type):
        raise TypeError(f"{value!r} ({type(value).__name__}) is not a value of the language")
    return found


def scalar_of(type_: types.Scalar, value: Any) -> Any:
    """`value` as a scalar of `type_`; a number of Python's is a literal. TypeError where it is none."""
    if isinstance(value, np.ndarray) and value.shape == ():
        value = value[()]
    if isinstance(value, bool | np.bool_):
        if type_ == types.BOOL:
            return bool(value)
    elif type_ == types.F32 and isinstance(value, int | float | np.integer | np.floating):
        if not isinstance(value, I32):
            return value if isinstance(value, F32) else F32(value)
    elif type_ == types.I32 and isinstance(value, int | np.integer):
        return value if isinstance(value, I32) else _fitting_i32(value)
    raise TypeError(f"expected {type_}, found {described(value)}")


def type_of_or_none(value: Any) -> types.Type | None:
    """`type_of`, or None for what is not a value of the language."""
    try:
        return type_of(value)
    except TypeError:
        return None


def described(value: Any) -> str:
    """`value` as messages call it: its type, where it is a value of the language, and what it is."""
    found = type_of_or_none(value)
    return f"{found} {value!r}" if found else f"{type(value).__name__} {value!r}"


def leaves(value: Any) -> list[Any]:
    """The scalars (F32, I32, bool) that a value consists of, in the order of its type's leaves."""
    if value is None:
        return []
    if isinstance(value, bool | F32 | I32):
        return [value]
    if isinstance(value, _Compound):
        return list(value._leaves)
    if isinstance(value, tuple):
        return [leaf for item in value for leaf in leaves(item)]
    return [leaf for name, _ in type_of(value).members for leaf in leaves(getattr(value, name))]


def from_leaves(type_: types.Type, flat: Sequence[Any]) -> Any:
    """The value of `type_` that consists of these scalars: what `leaves` undoes. Their types are not checked."""
    if type_ == types.VOID:
        return None
    if isinstance(type_, types.Scalar):
        return _CLASSES[type_](flat[0])
    if isinstance(type_, types.Vector | types.Matrix):
        value = object.__new__(_CLASSES[type_])
        object.__setattr__(value, "_leaves", tuple(map(F32, flat)))
        return value
    parts = []
    for _, member in type_.members:
        count = len(member.leaves)
        parts.append(from_leaves(member, flat[:count]))
        flat = flat[count:]
    return tuple(parts) if isinstance(type_, types.Tuple) else new_record(type_, parts)


def new_record(type_: types.Type, fields: Sequence[Any]) -> Any:
    """The value of a record type with these fields. TypeError where no class is known for it."""
    if not isinstance(type_, types.Record) or type_ not in _record_classes:
        raise TypeError(f"no Python class is known for {type_}; declare it with @record")
    return _record_classes[type_](*fields)
