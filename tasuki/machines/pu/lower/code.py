"""Code before registers are chosen: macro calls on virtual registers, labels, jumps.

A `Register` stands for a register of one number in one or more banks; how many there are does not matter yet. A `Place`
is a register or some of its banks: component x of a vector is its place in bank X, which a macro may read and write
like any scalar. An `Instruction` is a macro call: its name, its operands as they will be written, and which of them it
writes and reads.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

from tasuki.diagnostics import Span

SCALAR_BANKS = "xyzs"
"""Banks whose registers hold floats; "i" is the register file of the ALU."""


@dataclass(eq=False)
class Register:
    """A virtual register: of one bank ("x", "y", "z", "s", "i"), or of one number in several ("xyz", "xyzs").

    `age` counts registers as they are made: what is chosen among them never depends on where they lie in memory.
    """

    banks: str
    age: int = field(default_factory=itertools.count().__next__, init=False, repr=False)

    @property
    def place(self) -> Place:
        """The whole of it."""
        return Place(self, self.banks)


@dataclass(frozen=True)
class Place:
    """A register, or its part in some of its banks."""

    register: Register
    banks: str

    @property
    def is_part(self) -> bool:
        """Whether the register has banks besides these: then writing here keeps what stands there."""
        return self.banks != self.register.banks

    def bank(self, name: str) -> Place:
        """The part in one bank."""
        assert name in self.banks
        return Place(self.register, name)


@dataclass(frozen=True)
class Word:
    """A word of macro source that is neither a register nor a number: a label, a field, a table, a condition."""

    text: str
    kind: str


Operand = Place | float | int | Word


@dataclass(frozen=True)
class Origin:
    """Where code comes from: the module that its steps count for, and the place in the source."""

    module: str
    span: Span | None


@dataclass(eq=False)
class Instruction:
    """A macro call. `effect`: it does more than write registers, so that it stays even where nobody reads these.

    `distinct`: the macro reads operands after it has begun to write, so that they must not share a register with what
    it writes. `target`: the label that control may go to; `ends`: control never reaches the next instruction.
    """

    name: str
    operands: tuple[Operand, ...]
    writes: tuple[Place, ...]
    reads: tuple[Place, ...]
    origin: Origin
    effect: bool = False
    distinct: bool = False
    target: str | None = None
    ends: bool = False


@dataclass(eq=False)
class CallSite(Instruction):
    """A call of a subroutine. `routine` is its label; `arguments` go to its parameters, its results to `writes`."""

    routine: str = ""
    arguments: tuple[Operand, ...] = ()


@dataclass(eq=False)
class Label:
    """A place that jumps lead to."""

    name: str


Item = Instruction | Label


@dataclass
class Code:
    """Instructions in order, as they are made."""

    items: list[Item] = field(default_factory=list)
    origin: Origin = Origin("", None)

    def emit(
        self, name: str, result: Place, *operands: Operand, also: Place | None = None, distinct: bool = False
    ) -> Place:
        """A macro whose first operand is written and whose others are read; the place that is written.

        `also` is written too, and stands second.
        """
        results = (result,) if also is None else (result, also)
        self._add(name, (*results, *operands), results, operands, distinct=distinct)
        return result

    def effect(self, name: str, *operands: Operand, target: str | None = None, ends: bool = False) -> None:
        """A macro that writes no register, or none that the allocator knows."""
        self._add(name, operands, (), operands, effect=True, target=target, ends=ends)

    def label(self, name: str) -> None:
        """Jumps to `name` lead here."""
        self.items.append(Label(name))

    def jump(self, name: str) -> None:
        """Control goes on at `name`."""
        self.effect("jump", Word(name, "label"), target=name, ends=True)

    def call(self, routine: str, arguments: Sequence[Operand], results: Sequence[Place]) -> None:
        """Control goes to the subroutine `routine` and comes back."""
        reads = _places(arguments)
        self.items.append(
            CallSite(
                "call", (), tuple(results), reads, self.origin, effect=True, routine=routine, arguments=tuple(arguments)
            )
        )

    def undefined(self, result: Place) -> None:
        """The register begins its life here, whatever it holds: what is written to its parts comes next."""
        self._add("undefined", (result,), (result,), ())

    def _add(
        self,
        name: str,
        operands: Sequence[Operand],
        writes: Sequence[Place],
        sources: Sequence[Operand],
        **facts: object,
    ) -> None:
        # Who writes a part of a register hands on the rest.
        kept = tuple(place.register.place for place in writes if place.is_part)
        reads = (*_places(sources), *kept)
        self.items.append(Instruction(name, tuple(operands), tuple(writes), reads, self.origin, **facts))  # type: ignore[arg-type]


def _places(operands: Sequence[Operand]) -> tuple[Place, ...]:
    return tuple(one for one in operands if isinstance(one, Place))
