"""Writing one LLVM function as text: fresh names, labels, stack slots, and leaves that are scalars or vectors of lanes.

Knows LLVM's syntax and nothing of the IR; `lower` and its neighbours are written in terms of it. Stack slots (`alloca`)
stand in the entry block, one for each variable, and LLVM's SROA turns them into registers: no SSA is built by hand.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

SCALAR = {"f32": "float", "i32": "i32", "bool": "i1"}
STORED = {"f32": "float", "i32": "i32", "bool": "i32"}
"""How a leaf lies in memory and in local arrays: a bool takes a word."""
VECTOR_ALIGN = 64


@dataclass(frozen=True, slots=True)
class Leaf:
    """A scalar value of the program in LLVM: one register for all lanes, or (`varying`) one element for each."""

    scalar: str
    varying: bool
    text: str

    @property
    def is_constant(self) -> bool:
        return not self.text.startswith("%")


class Declarations:
    """The intrinsics that a module of LLVM uses, declared once."""

    def __init__(self) -> None:
        self.lines: dict[str, str] = {}

    def declare(self, name: str, result: str, parameters: Sequence[str]) -> None:
        self.lines[name] = f"declare {result} @{name}({', '.join(parameters)})"


class Emitter:
    """One LLVM function being written, for packets of `width` lanes."""

    def __init__(self, width: int, declarations: Declarations) -> None:
        self.width = width
        self.declarations = declarations
        self.slots: list[str] = []
        self.body: list[str] = []
        self.names = 0
        self.open = True
        """Whether the current block still lacks its terminator; text after one is dropped."""

    # --- text ---------------------------------------------------------------------------------------------------------

    def fresh(self, prefix: str = "v") -> str:
        self.names += 1
        return f"{prefix}{self.names}"

    def line(self, text: str) -> None:
        if self.open:
            self.body.append("  " + text)

    def value(self, text: str) -> str:
        """A new register that holds what `text` computes."""
        name = "%" + self.fresh()
        self.line(f"{name} = {text}")
        return name

    def label(self, name: str) -> None:
        """Begin block `name`; the block before falls through to it."""
        self.jump(name)
        self.body.append(f"{name}:")
        self.open = True

    def jump(self, label: str) -> None:
        self.line(f"br label %{label}")
        self.open = False

    def branch(self, condition: str, then: str, otherwise: str) -> None:
        self.line(f"br i1 {condition}, label %{then}, label %{otherwise}")
        self.open = False

    def slot(self, type_: str, align: int = VECTOR_ALIGN) -> str:
        name = "%" + self.fresh("s")
        self.slots.append(f"  {name} = alloca {type_}, align {align}")
        return name

    def intrinsic(self, name: str, result: str, arguments: Sequence[tuple[str, str]]) -> str:
        """Call an intrinsic; `arguments` are (type, text). Returns its register ("" for void)."""
        self.declarations.declare(name, result, [type_ for type_, _ in arguments])
        call = f"call {result} @{name}({', '.join(f'{t} {x}' for t, x in arguments)})"
        if result == "void":
            self.line(call)
            return ""
        return self.value(call)

    # --- leaves -------------------------------------------------------------------------------------------------------

    def type_of(self, scalar: str, varying: bool) -> str:
        return f"<{self.width} x {SCALAR[scalar]}>" if varying else SCALAR[scalar]

    def stored_type(self, scalar: str, varying: bool) -> str:
        return f"<{self.width} x {STORED[scalar]}>" if varying else STORED[scalar]

    def typed(self, leaf: Leaf) -> str:
        """`type text`, as an operand."""
        return f"{self.type_of(leaf.scalar, leaf.varying)} {leaf.text}"

    def suffix(self, leaf: Leaf) -> str:
        """The overload of an intrinsic, as in `llvm.sqrt.v16f32`."""
        element = {"f32": "f32", "i32": "i32", "bool": "i1"}[leaf.scalar]
        return f"v{self.width}{element}" if leaf.varying else element

    @property
    def mask_type(self) -> str:
        return f"<{self.width} x i1>"

    def constant(self, value: float | int | bool, scalar: str) -> Leaf:
        return Leaf(scalar, False, constant_text(value, scalar))

    def broadcast(self, leaf: Leaf) -> Leaf:
        """The leaf as one element for each lane."""
        if leaf.varying:
            return leaf
        element = f"{SCALAR[leaf.scalar]} {leaf.text}"
        if leaf.is_constant:
            return Leaf(leaf.scalar, True, f"splat ({element})")
        vector = self.type_of(leaf.scalar, True)
        lane0 = self.value(f"insertelement {vector} poison, {element}, i64 0")
        zeros = f"<{self.width} x i32> zeroinitializer"
        return Leaf(leaf.scalar, True, self.value(f"shufflevector {vector} {lane0}, {vector} poison, {zeros}"))

    def together(self, *leaves: Leaf) -> list[Leaf]:
        """All as vectors if any is one."""
        if any(leaf.varying for leaf in leaves):
            return [self.broadcast(leaf) for leaf in leaves]
        return list(leaves)

    def select(self, condition: Leaf, a: Leaf, b: Leaf) -> Leaf:
        if condition.varying:
            a, b = self.broadcast(a), self.broadcast(b)
        else:
            a, b = self.together(a, b)
        text = self.value(f"select {self.typed(condition)}, {self.typed(a)}, {self.typed(b)}")
        return Leaf(a.scalar, a.varying, text)

    def blend(self, mask: str, new: Leaf, old: Leaf) -> Leaf:
        return self.select(Leaf("bool", True, mask), new, old)

    def to_stored(self, leaf: Leaf) -> str:
        """The leaf's text as it lies in memory."""
        if leaf.scalar != "bool":
            return leaf.text
        return self.value(f"zext {self.typed(leaf)} to {self.stored_type('bool', leaf.varying)}")

    def from_stored(self, scalar: str, varying: bool, text: str) -> Leaf:
        if scalar == "bool":
            type_ = self.stored_type("bool", varying)
            text = self.value(f"icmp ne {type_} {text}, {'zeroinitializer' if varying else '0'}")
        return Leaf(scalar, varying, text)

    # --- masks --------------------------------------------------------------------------------------------------------

    def any_lane(self, mask: str) -> str:
        """An i1: whether any element of the mask is set."""
        bits = self.value(f"bitcast {self.mask_type} {mask} to i{self.width}")
        return self.value(f"icmp ne i{self.width} {bits}, 0")

    def count_lanes(self, mask: str) -> str:
        """An i32: how many elements of the mask are set."""
        bits = self.value(f"bitcast {self.mask_type} {mask} to i{self.width}")
        count = self.intrinsic(f"llvm.ctpop.i{self.width}", f"i{self.width}", [(f"i{self.width}", bits)])
        return count if self.width == 32 else self.value(f"zext i{self.width} {count} to i32")

    def lane_numbers(self) -> str:
        return "<" + ", ".join(f"i32 {lane}" for lane in range(self.width)) + ">"


def result_type(e: Emitter, shape: Sequence[tuple[str, bool]]) -> str:
    """The aggregate that a lowered function returns: (scalar, varying) of each leaf."""
    return "{" + ", ".join(e.type_of(scalar, varying) for scalar, varying in shape) + "}"


def constant_text(value: float | int | bool, scalar: str) -> str:
    if scalar == "f32":
        with np.errstate(over="ignore"):
            wide = float(np.float32(value))
        return f"0x{struct.unpack('<Q', struct.pack('<d', wide))[0]:016X}"
    if scalar == "bool":
        return "true" if value else "false"
    return str(int(value))
