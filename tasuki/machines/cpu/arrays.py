"""Local arrays: in stack slots, one for each leaf, of scalars or of vectors of lanes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tasuki.ir.types import Array
from tasuki.machines.cpu.emit import VECTOR_ALIGN, Emitter, Leaf
from tasuki.machines.cpu.lanes import gather, scatter
from tasuki.machines.cpu.primitives import lower_primitive

LEAST_ALIGN = 16
MOST_CLEARING_STORES = 64


@dataclass(frozen=True)
class ArrayValue:
    """A local array: a slot for each leaf of its elements, of `length` scalars or vectors."""

    type: Array
    slots: tuple[str, ...]
    varying: tuple[bool, ...]


def declare_array(e: Emitter, type_: Array, varying: Sequence[bool]) -> ArrayValue:
    slots = [
        e.slot(f"[{type_.length} x {e.stored_type(scalar, v)}]")
        for scalar, v in zip(type_.item.leaves, varying, strict=True)
    ]
    return ArrayValue(type_, tuple(slots), tuple(varying))


def clear_array(e: Emitter, array: ArrayValue, mask: str | None) -> None:
    """Every element becomes zero: in the lanes of `mask`, or, where no lanes have parted (None), in all."""
    if mask is not None:
        for position in range(array.type.length):
            index = e.constant(position, "i32")
            zeros = [e.constant(0, scalar) for scalar in array.type.item.leaves]
            store_array(e, array, index, range(len(zeros)), zeros, mask, parted=True)
        return
    for slot, varying in zip(array.slots, array.varying, strict=True):
        words = array.type.length * (e.width if varying else 1)
        if words % e.width == 0 and words // e.width <= MOST_CLEARING_STORES:
            # Plain stores: a call of memset would spill every register around it.
            for vector in range(words // e.width):
                place = e.value(f"getelementptr inbounds <{e.width} x i32>, ptr {slot}, i64 {vector}")
                e.line(f"store <{e.width} x i32> zeroinitializer, ptr {place}, align {min(4 * e.width, VECTOR_ALIGN)}")
            continue
        size = 4 * words
        arguments = [("ptr", slot), ("i8", "0"), ("i64", str(size)), ("i1", "false")]
        e.intrinsic("llvm.memset.p0.i64", "void", arguments)


def clamp(e: Emitter, index: Leaf, length: int) -> Leaf:
    low = lower_primitive(e, "maximum", [index, e.constant(0, "i32")])
    return lower_primitive(e, "minimum", [low, e.constant(length - 1, "i32")])


def load_array(e: Emitter, array: ArrayValue, index: Leaf, wanted: range, mask: str) -> list[Leaf]:
    index = clamp(e, index, array.type.length)
    return [_load_element(e, array, index, leaf, mask) for leaf in wanted]


def _load_element(e: Emitter, array: ArrayValue, index: Leaf, leaf: int, mask: str) -> Leaf:
    scalar, varying = array.type.item.leaves[leaf], array.varying[leaf]
    if index.varying:
        return e.from_stored(scalar, True, gather(e, scalar, _element_pointers(e, array, index, leaf), mask))
    type_ = e.stored_type(scalar, varying)
    pointer = _element_pointer(e, array, index, leaf)
    return e.from_stored(scalar, varying, e.value(f"load {type_}, ptr {pointer}, align {_align(varying)}"))


def store_array(
    e: Emitter, array: ArrayValue, index: Leaf, wanted: range, leaves: Sequence[Leaf], mask: str, parted: bool
) -> None:
    """Write an element; where lanes have parted since the array's home, the other lanes keep theirs."""
    index = clamp(e, index, array.type.length)
    for position, leaf in zip(wanted, leaves, strict=True):
        varying = array.varying[position]
        if index.varying:
            vector = e.broadcast(leaf)
            value = [(e.stored_type(leaf.scalar, True), e.to_stored(vector))]
            scatter(e, leaf.scalar, value, _element_pointers(e, array, index, position), mask)
            continue
        if varying:
            leaf = e.broadcast(leaf)
            if parted:
                leaf = e.blend(mask, leaf, _load_element(e, array, index, position, mask))
        pointer = _element_pointer(e, array, index, position)
        operand = f"{e.stored_type(leaf.scalar, varying)} {e.to_stored(leaf)}"
        e.line(f"store {operand}, ptr {pointer}, align {_align(varying)}")


def _align(varying: bool) -> int:
    # A vector of fewer than 16 words is only as aligned as its size; 16 bytes hold for every width of 4 or more.
    return LEAST_ALIGN if varying else 4


def _element_pointer(e: Emitter, array: ArrayValue, index: Leaf, leaf: int) -> str:
    type_ = e.stored_type(array.type.item.leaves[leaf], array.varying[leaf])
    wide = e.value(f"sext i32 {index.text} to i64")
    return e.value(f"getelementptr inbounds {type_}, ptr {array.slots[leaf]}, i64 {wide}")


def _element_pointers(e: Emitter, array: ArrayValue, index: Leaf, leaf: int) -> str:
    """Each lane's own element: at index * width + lane of a varying array; of a uniform one, at index."""
    if array.varying[leaf]:
        index = lower_primitive(e, "multiply", [index, e.constant(e.width, "i32")])
        index = lower_primitive(e, "add", [index, Leaf("i32", True, e.lane_numbers())])
    return e.value(f"getelementptr i32, ptr {array.slots[leaf]}, {e.typed(index)}")
