"""The types of the language: scalars, vectors, matrices, records, tuples, local arrays, tables.

Every type flattens to *leaves*, the scalars that a value of it consists of, in a fixed order; machines and the
interpreter hold a value as its leaves. A record also has a *layout*: where its fields stand in rows of four banks.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

BANKS = 4
"""Words in one row of the data memory (paper, section 2)."""


class Type:
    """A type; equal types are equal values."""

    @cached_property
    def leaves(self) -> tuple[str, ...]:
        """Names of the scalars ("f32", "i32", "bool") that a value flattens to."""
        return tuple(leaf for _, member in self.members for leaf in member.leaves)

    @property
    def members(self) -> tuple[tuple[str, Type], ...]:
        """What `Member` can select: fields of a record, components of a vector, items of a tuple, columns of a matrix.
        """
        return ()

    def member(self, name: str) -> Type | None:
        return dict(self.members).get(name)

    def leaf_range(self, name: str) -> range:
        """The leaves that member `name` takes among this type's leaves."""
        start = 0
        for member_name, member in self.members:
            if member_name == name:
                return range(start, start + len(member.leaves))
            start += len(member.leaves)
        raise KeyError(name)


@dataclass(frozen=True)
class Scalar(Type):
    name: str

    @cached_property
    def leaves(self) -> tuple[str, ...]:
        return (self.name,)

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Vector(Type):
    size: int

    @property
    def members(self) -> tuple[tuple[str, Type], ...]:
        return tuple((name, F32) for name in "xyzw"[: self.size])

    def __str__(self) -> str:
        return f"vec{self.size}"


@dataclass(frozen=True)
class Matrix(Type):
    """Four by four. Members "0".."3" are its *columns*, as they stand in memory (paper, Figure 4)."""

    @property
    def members(self) -> tuple[tuple[str, Type], ...]:
        return tuple((str(column), VEC4) for column in range(4))

    def __str__(self) -> str:
        return "mat4"


@dataclass(frozen=True)
class Record(Type):
    name: str
    fields: tuple[tuple[str, Type], ...]

    @property
    def members(self) -> tuple[tuple[str, Type], ...]:
        return self.fields

    @cached_property
    def layout(self) -> tuple[tuple[int, int], ...]:
        """(row, bank) of every leaf. Scalars take the next free bank; a vector begins at bank 0 of a row."""
        places: list[tuple[int, int]] = []
        row, bank = 0, 0
        for _, member in self.fields:
            for part in _storage_parts(member):
                if bank + len(part.leaves) > BANKS or (len(part.leaves) > 1 and bank > 0):
                    row, bank = row + 1, 0
                places += [(row, bank + i) for i in range(len(part.leaves))]
                bank += len(part.leaves)
        return tuple(places)

    @property
    def rows(self) -> int:
        """Rows of memory that one record takes: the row stride of its table."""
        return self.layout[-1][0] + 1

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Tuple(Type):
    items: tuple[Type, ...]

    @property
    def members(self) -> tuple[tuple[str, Type], ...]:
        return tuple((str(i), item) for i, item in enumerate(self.items))

    def __str__(self) -> str:
        return f"tuple[{', '.join(map(str, self.items))}]"


@dataclass(frozen=True)
class Array(Type):
    """A local array of fixed length; its elements are zero where nothing was written. Never passed, returned or copied.
    """

    item: Type
    length: int

    @cached_property
    def leaves(self) -> tuple[str, ...]:
        raise TypeError("an array has no leaves; its elements have")

    def __str__(self) -> str:
        return f"array[{self.item}, {self.length}]"


@dataclass(frozen=True)
class Table(Type):
    """Records in the data memory: a base row and a count (paper, section 2: BR; the index is IR, the stride AR)."""

    record: Record

    @cached_property
    def leaves(self) -> tuple[str, ...]:
        raise TypeError("a table has no leaves; its records have")

    def __str__(self) -> str:
        return f"Table[{self.record}]"


F32 = Scalar("f32")
I32 = Scalar("i32")
BOOL = Scalar("bool")
VEC3 = Vector(3)
VEC4 = Vector(4)
MAT4 = Matrix()
VOID = Tuple(())
"""The result of a module that returns nothing."""

BUILTIN_TYPES: dict[str, Type] = {str(t): t for t in (F32, I32, BOOL, VEC3, VEC4, MAT4)}


def _storage_parts(member: Type) -> tuple[Type, ...]:
    """What is placed as a unit: scalars and vectors; a matrix is four columns, a nested record its own parts."""
    if isinstance(member, Scalar | Vector):
        return (member,)
    return tuple(part for _, inner in member.members for part in _storage_parts(inner))
