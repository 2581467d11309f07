"""Reaching single lanes of a packet, and memory by one pointer for each lane."""

from __future__ import annotations

from collections.abc import Sequence

from tasuki.machines.cpu.emit import Emitter, Leaf


def first_lane(e: Emitter, mask: str) -> str:
    """An i32: the number of the first set lane of a mask that is not empty."""
    bits = e.value(f"bitcast {e.mask_type} {mask} to i{e.width}")
    lane = e.intrinsic(f"llvm.cttz.i{e.width}", f"i{e.width}", [(f"i{e.width}", bits), ("i1", "true")])
    return lane if e.width == 32 else e.value(f"zext i{e.width} {lane} to i32")


def extract(e: Emitter, leaf: Leaf, lane: str) -> str:
    return e.value(f"extractelement {e.typed(leaf)}, i32 {lane}")


def gather(e: Emitter, scalar: str, pointers: str, mask: str) -> str:
    type_ = e.stored_type(scalar, True)
    element = "f32" if scalar == "f32" else "i32"
    arguments = [(f"<{e.width} x ptr>", f"align 4 {pointers}"), (e.mask_type, mask), (type_, "zeroinitializer")]
    return _masked(e, f"llvm.masked.gather.v{e.width}{element}.v{e.width}p0", type_, arguments)


def scatter(e: Emitter, scalar: str, value: list[tuple[str, str]], pointers: str, mask: str) -> None:
    element = "f32" if scalar == "f32" else "i32"
    arguments = [*value, (f"<{e.width} x ptr>", f"align 4 {pointers}"), (e.mask_type, mask)]
    _masked(e, f"llvm.masked.scatter.v{e.width}{element}.v{e.width}p0", "void", arguments)


def _masked(e: Emitter, name: str, result: str, arguments: Sequence[tuple[str, str]]) -> str:
    return e.intrinsic(name, result, arguments)
