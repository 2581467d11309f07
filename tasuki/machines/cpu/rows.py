"""Whole rows of memory, one for each lane, turned into vectors of lanes and back.

A row is 16 aligned bytes: one load, and half a shuffle, for four words of a lane.
"""

from __future__ import annotations

from collections.abc import Sequence

from tasuki.ir.types import BANKS
from tasuki.machines.cpu.checks import TableValue
from tasuki.machines.cpu.emit import Emitter, Leaf
from tasuki.machines.cpu.lanes import extract

ROW_ALIGN = 16


def row_addresses(e: Emitter, table: TableValue, index: Leaf) -> list[str]:
    """For each lane a pointer to its record.

    The number of its first word is computed for all lanes at once, and fits 32 bits without a sign: extracted, it needs
    neither extension nor shift, and becomes a part of the address.
    """
    stride = e.broadcast(e.constant(table.record.rows * BANKS, "i32"))
    words = Leaf("i32", True, e.value(f"mul {e.typed(index)}, {stride.text}"))
    addresses = []
    for lane in range(e.width):
        wide = e.value(f"zext i32 {extract(e, words, str(lane))} to i64")
        addresses.append(e.value(f"getelementptr inbounds i32, ptr {table.base}, i64 {wide}"))
    return addresses


def load_rows(e: Emitter, lanes: Sequence[str], row: int) -> list[str]:
    """Load row `row` of every lane's record; the four banks as vectors of floats.

    Register j collects the rows of lanes j, j+4, j+8, ...; then a 4x4 transposition within each 128-bit part leaves the
    lanes in order.
    """
    rows = []
    for address in lanes:
        place = e.value(f"getelementptr inbounds i8, ptr {address}, i64 {row * ROW_ALIGN}")
        rows.append(e.value(f"load <4 x float>, ptr {place}, align {ROW_ALIGN}"))
    return _transpose(e, [_concatenate(e, rows[j::4]) for j in range(4)])


def _transpose(e: Emitter, vectors: Sequence[str]) -> list[str]:
    """Four vectors as 4x4 matrices, one in each 128-bit part, transposed."""
    low01, high01 = (_interleave(e, vectors[0], vectors[1], half) for half in ((0, 1), (2, 3)))
    low23, high23 = (_interleave(e, vectors[2], vectors[3], half) for half in ((0, 1), (2, 3)))
    return [_join(e, *pair, start) for pair in ((low01, low23), (high01, high23)) for start in (0, 2)]


def _concatenate(e: Emitter, parts: Sequence[str]) -> str:
    size = 4
    while len(parts) > 1:
        pairs = zip(parts[::2], parts[1::2], strict=True)
        indices = range(2 * size)
        parts = [_shuffle(e, size, a, b, indices) for a, b in pairs]
        size *= 2
    return parts[0]


def _interleave(e: Emitter, a: str, b: str, banks: tuple[int, int]) -> str:
    """[a_k, b_k, a_l, b_l] in each 128-bit part, for banks k and l."""
    width = e.width
    indices = [part + bank + source for part in range(0, width, 4) for bank in banks for source in (0, width)]
    return _shuffle(e, width, a, b, indices)


def _join(e: Emitter, a: str, b: str, start: int) -> str:
    """[a_s, a_s+1, b_s, b_s+1] in each 128-bit part."""
    width = e.width
    offsets = (start, start + 1, start + width, start + 1 + width)
    return _shuffle(e, width, a, b, [part + offset for part in range(0, width, 4) for offset in offsets])


def _shuffle(e: Emitter, size: int, a: str, b: str, indices: Sequence[int]) -> str:
    picks = ", ".join(f"i32 {i}" for i in indices)
    return e.value(f"shufflevector <{size} x float> {a}, <{size} x float> {b}, <{len(indices)} x i32> <{picks}>")


def as_leaf(e: Emitter, floats: str, scalar: str) -> Leaf:
    if scalar == "f32":
        return Leaf("f32", True, floats)
    words = e.value(f"bitcast <{e.width} x float> {floats} to <{e.width} x i32>")
    return e.from_stored(scalar, True, words)


def store_row(e: Emitter, addresses: Sequence[str], row: int, leaves: Sequence[Leaf | None]) -> None:
    """The inverse of `load_rows`: four vectors, one for each bank, become a row for each lane. Where there is None the
    bank keeps its word.
    """
    zero = e.broadcast(e.constant(0.0, "f32"))
    columns = _transpose(e, [_as_floats(e, leaf or zero) for leaf in leaves])
    kept = ", ".join(f"i1 {'false' if leaf is None else 'true'}" for leaf in leaves)
    for lane, address in enumerate(addresses):
        place = e.value(f"getelementptr inbounds i8, ptr {address}, i64 {row * ROW_ALIGN}")
        part = range(lane // 4 * 4, lane // 4 * 4 + 4)
        words = _shuffle(e, e.width, columns[lane % 4], "poison", part)
        if None in leaves:
            arguments = [("<4 x float>", words), ("ptr", place), ("i32", str(ROW_ALIGN)), ("<4 x i1>", f"<{kept}>")]
            e.intrinsic("llvm.masked.store.v4f32.p0", "void", arguments)
        else:
            e.line(f"store <4 x float> {words}, ptr {place}, align {ROW_ALIGN}")


def _as_floats(e: Emitter, leaf: Leaf) -> str:
    vector = e.broadcast(leaf)
    if vector.scalar == "f32":
        return vector.text
    return e.value(f"bitcast <{e.width} x i32> {e.to_stored(vector)} to <{e.width} x float>")
