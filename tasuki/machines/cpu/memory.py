"""Access to tables and local arrays, checked and unchecked.

A uniform index becomes scalar loads. A varying one becomes a gather, but where two or more words of a row are wanted
each
lane's whole row is loaded at once (a row is 16 aligned bytes) and the rows are transposed: one row load and half a
shuffle per lane beat two gathers on every machine that we measured.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from tasuki.diagnostics import Span
from tasuki.ir.types import BANKS, Array, Record
from tasuki.machines.cpu.context import ERROR, ERROR_INDEX, STOP
from tasuki.machines.cpu.emit import STORED, VECTOR_ALIGN, Emitter, Leaf
from tasuki.machines.cpu.primitives import lower_primitive

ROW_ALIGN = 16
MOST_CLEARING_STORES = 64
LEAST_SHARED = 6
"""From this many words on it pays to see first whether all lanes want the same record."""


@dataclass(frozen=True)
class TableValue:
    """A table in LLVM: where its first row is, how many records it has, and what it is called in errors."""

    name: str
    record: Record
    base: str
    count: str


@dataclass(frozen=True)
class AccessSite:
    """A checked access, for the error message."""

    table: str
    function: str
    span: Span | None


@dataclass(frozen=True)
class ArrayValue:
    """A local array: a slot for each leaf of its elements, of `length` scalars or vectors."""

    type: Array
    slots: tuple[str, ...]
    varying: tuple[bool, ...]


class Checker:
    """Emits the check of an index against its table and numbers the sites; emits nothing when `enabled` is false."""

    def __init__(self, enabled: bool) -> None:
        self.enabled = enabled
        self.sites: list[AccessSite] = []

    def check(self, e: Emitter, index: Leaf, table: TableValue, mask: str, function: str, span: Span | None) -> Leaf:
        """The index, or row 0 in its stead where it lies outside (and the failure is on record)."""
        if not self.enabled:
            return index
        self.sites.append(AccessSite(table.name, function, span))
        count = e.together(index, Leaf("i32", False, table.count))[1]
        inside = Leaf("bool", index.varying, e.value(f"icmp ult {e.typed(index)}, {count.text}"))
        if index.varying:
            outside = e.value(f"xor {e.typed(inside)}, splat (i1 true)")
            failed = e.any_lane(e.value(f"and {e.mask_type} {outside}, {mask}"))
        else:
            failed = e.value(f"xor i1 {inside.text}, true")
        report, go_on = e.fresh("bad"), e.fresh("ok")
        e.branch(failed, report, go_on)
        e.label(report)
        wrong = self._first_failing(e, index, inside, mask)
        e.line(f"call void @report(ptr %context, i64 {len(self.sites)}, i32 {wrong})")
        e.label(go_on)
        return e.select(inside, index, e.constant(0, "i32"))

    def _first_failing(self, e: Emitter, index: Leaf, inside: Leaf, mask: str) -> str:
        if not index.varying:
            return index.text
        outside = e.value(f"xor {e.typed(inside)}, splat (i1 true)")
        failing = e.value(f"and {e.mask_type} {outside}, {mask}")
        return extract(e, index, first_lane(e, failing))


REPORT = f"""define internal void @report(ptr %context, i64 %site, i32 %index) noinline cold {{
  %stop = getelementptr i64, ptr %context, i64 {STOP}
  store volatile i64 1, ptr %stop, align 8
  %error = getelementptr i64, ptr %context, i64 {ERROR}
  %exchange = cmpxchg ptr %error, i64 0, i64 %site seq_cst seq_cst
  %first = extractvalue {{i64, i1}} %exchange, 1
  br i1 %first, label %note, label %done
note:
  %where = getelementptr i64, ptr %context, i64 {ERROR_INDEX}
  %wide = sext i32 %index to i64
  store i64 %wide, ptr %where, align 8
  br label %done
done:
  ret void
}}
"""
"""The first failing access of a run is noted; every thread then stops."""


def first_lane(e: Emitter, mask: str) -> str:
    """An i32: the number of the first set lane of a mask that is not empty."""
    bits = e.value(f"bitcast {e.mask_type} {mask} to i{e.width}")
    lane = e.intrinsic(f"llvm.cttz.i{e.width}", f"i{e.width}", [(f"i{e.width}", bits), ("i1", "true")])
    return lane if e.width == 32 else e.value(f"zext i{e.width} {lane} to i32")


def extract(e: Emitter, leaf: Leaf, lane: str) -> str:
    return e.value(f"extractelement {e.typed(leaf)}, i32 {lane}")


# --- tables -----------------------------------------------------------------------------------------------------------


def load_table(e: Emitter, table: TableValue, index: Leaf, wanted: range, mask: str) -> list[Leaf]:
    """The leaves `wanted` of the record at `index`, which has been checked."""
    if not index.varying:
        return [_load_word(e, table, index, leaf) for leaf in wanted]
    if len(wanted) < LEAST_SHARED:
        return _load_each(e, table, index, wanted, mask)
    return _load_shared_or_each(e, table, index, wanted, mask)


def _load_shared_or_each(e: Emitter, table: TableValue, index: Leaf, wanted: range, mask: str) -> list[Leaf]:
    """Rays that travel together often want one record: then it is loaded once for all active lanes."""
    scalars = [table.record.leaves[leaf] for leaf in wanted]
    slots = [e.slot(e.type_of(scalar, True)) for scalar in scalars]
    first = Leaf("i32", False, extract(e, index, first_lane(e, mask)))
    differs = e.value(f"icmp ne {e.typed(index)}, {e.broadcast(first).text}")
    shared, each, done = e.fresh("shared"), e.fresh("each"), e.fresh("loaded")
    e.branch(e.any_lane(e.value(f"and {e.mask_type} {differs}, {mask}")), each, shared)
    for label, load in (
        (shared, lambda: [e.broadcast(_load_word(e, table, first, leaf)) for leaf in wanted]),
        (each, lambda: _load_each(e, table, index, wanted, mask)),
    ):
        e.label(label)
        for slot, leaf in zip(slots, load(), strict=True):
            e.line(f"store {e.typed(leaf)}, ptr {slot}")
        e.jump(done)
    e.label(done)
    return [Leaf(s, True, e.value(f"load {e.type_of(s, True)}, ptr {slot}")) for s, slot in zip(scalars, slots, strict=True)]


def _load_each(e: Emitter, table: TableValue, index: Leaf, wanted: range, mask: str) -> list[Leaf]:
    """Every lane's own record: whole rows, transposed, where two or more words of one are wanted."""
    by_row: dict[int, list[int]] = defaultdict(list)
    for leaf in wanted:
        by_row[table.record.layout[leaf][0]].append(leaf)
    loaded: dict[int, Leaf] = {}
    safe = e.blend(mask, index, e.constant(0, "i32"))
    lanes: list[str] | None = None
    for row, leaves in by_row.items():
        if len(leaves) == 1 or e.width < 4:
            loaded.update((leaf, _gather_word(e, table, index, leaf, mask)) for leaf in leaves)
            continue
        lanes = lanes or _row_addresses(e, table, safe)
        banks = _transpose_rows(e, lanes, row)
        for leaf in leaves:
            loaded[leaf] = _as_leaf(e, banks[table.record.layout[leaf][1]], table.record.leaves[leaf])
    return [loaded[leaf] for leaf in wanted]


def store_table(e: Emitter, table: TableValue, index: Leaf, wanted: range, leaves: Sequence[Leaf], mask: str) -> None:
    """The leaves `wanted` of the record at `index` become `leaves` in the active lanes."""
    rows = whole_rows(table.record, wanted) if index.varying and e.width >= 4 else {}
    if not rows:
        _store_words(e, table, index, wanted, leaves, mask)
        return
    # With all lanes active whole rows go out, one store for each lane; else word by word.
    full, partial, done = e.fresh("full"), e.fresh("partial"), e.fresh("stored")
    missing = e.value(f"xor {e.mask_type} {mask}, splat (i1 true)")
    e.branch(e.any_lane(missing), partial, full)
    e.label(full)
    stored = dict(zip(wanted, leaves, strict=True))
    addresses = _row_addresses(e, table, index)
    for row, members in rows.items():
        _store_row(e, addresses, row, [stored.pop(leaf) for leaf in members])
    _store_words(e, table, index, list(stored), list(stored.values()), mask)
    e.jump(done)
    e.label(partial)
    _store_words(e, table, index, wanted, leaves, mask)
    e.label(done)


def whole_rows(record: Record, wanted: Sequence[int]) -> dict[int, list[int]]:
    """The rows of a record of which all four words are wanted, each with its leaves by bank."""
    rows: dict[int, list[int]] = defaultdict(list)
    for leaf in sorted(wanted, key=lambda leaf: record.layout[leaf]):
        rows[record.layout[leaf][0]].append(leaf)
    return {row: leaves for row, leaves in rows.items() if len(leaves) == BANKS}


def _store_words(
    e: Emitter, table: TableValue, index: Leaf, wanted: Sequence[int], leaves: Sequence[Leaf], mask: str
) -> None:
    for position, leaf in zip(wanted, leaves, strict=True):
        if not index.varying and not leaf.varying:
            address = _word_address(e, table, index, position)
            e.line(f"store {STORED[leaf.scalar]} {e.to_stored(leaf)}, ptr {address}, align 4")
            continue
        vector = e.broadcast(leaf)
        addresses = _word_addresses(e, table, e.broadcast(index), position)
        type_ = e.stored_type(leaf.scalar, True)
        scatter(e, leaf.scalar, [(type_, e.to_stored(vector))], addresses, mask)


def _store_row(e: Emitter, addresses: Sequence[str], row: int, leaves: Sequence[Leaf]) -> None:
    """The inverse of `_transpose_rows`: four vectors, one for each bank, become a row for each lane."""
    banks = [_as_floats(e, leaf) for leaf in leaves]
    low01, high01 = _interleave(e, banks[0], banks[1], (0, 1)), _interleave(e, banks[0], banks[1], (2, 3))
    low23, high23 = _interleave(e, banks[2], banks[3], (0, 1)), _interleave(e, banks[2], banks[3], (2, 3))
    columns = [_join(e, low01, low23, 0), _join(e, low01, low23, 2), _join(e, high01, high23, 0), _join(e, high01, high23, 2)]
    for lane, address in enumerate(addresses):
        place = e.value(f"getelementptr inbounds i8, ptr {address}, i64 {row * ROW_ALIGN}")
        part = range(lane // 4 * 4, lane // 4 * 4 + 4)
        words = _shuffle(e, e.width, columns[lane % 4], "poison", part)
        e.line(f"store <4 x float> {words}, ptr {place}, align {ROW_ALIGN}")


def _as_floats(e: Emitter, leaf: Leaf) -> str:
    vector = e.broadcast(leaf)
    if vector.scalar == "f32":
        return vector.text
    return e.value(f"bitcast <{e.width} x i32> {e.to_stored(vector)} to <{e.width} x float>")


def word_pointers(e: Emitter, table: TableValue, index: Leaf, leaf: int) -> str:
    """Pointers, one for each lane, to a leaf of the record at `index`."""
    return _word_addresses(e, table, e.broadcast(index), leaf)


def word_pointer(e: Emitter, table: TableValue, index: Leaf, leaf: int) -> str:
    return _word_address(e, table, index, leaf)


def _word_offset(table: TableValue, leaf: int) -> int:
    row, bank = table.record.layout[leaf]
    return row * BANKS + bank


def _word_address(e: Emitter, table: TableValue, index: Leaf, leaf: int) -> str:
    wide = e.value(f"sext i32 {index.text} to i64")
    record = e.value(f"getelementptr inbounds [{table.record.rows * BANKS} x i32], ptr {table.base}, i64 {wide}")
    return e.value(f"getelementptr inbounds i32, ptr {record}, i64 {_word_offset(table, leaf)}")


def _load_word(e: Emitter, table: TableValue, index: Leaf, leaf: int) -> Leaf:
    scalar = table.record.leaves[leaf]
    address = _word_address(e, table, index, leaf)
    text = e.value(f"load {STORED[scalar]}, ptr {address}, align 4")
    return e.from_stored(scalar, False, text)


def _word_addresses(e: Emitter, table: TableValue, index: Leaf, leaf: int) -> str:
    """Vector of pointers; offsets stay 32 bits wide (a memory image has fewer than 2**31 words), as gathers want them.
    """
    stride = e.broadcast(e.constant(table.record.rows * BANKS, "i32"))
    words = lower_primitive(e, "multiply", [index, stride])
    offset = e.broadcast(e.constant(_word_offset(table, leaf), "i32"))
    words = lower_primitive(e, "add", [words, offset])
    return e.value(f"getelementptr i32, ptr {table.base}, {e.typed(words)}")


def _gather_word(e: Emitter, table: TableValue, index: Leaf, leaf: int, mask: str) -> Leaf:
    scalar = table.record.leaves[leaf]
    return e.from_stored(scalar, True, gather(e, scalar, _word_addresses(e, table, index, leaf), mask))


def _row_addresses(e: Emitter, table: TableValue, index: Leaf) -> list[str]:
    """For each lane a pointer to its record."""
    words = table.record.rows * BANKS
    addresses = []
    for lane in range(e.width):
        wide = e.value(f"sext i32 {extract(e, index, str(lane))} to i64")
        addresses.append(e.value(f"getelementptr inbounds [{words} x i32], ptr {table.base}, i64 {wide}"))
    return addresses


def _transpose_rows(e: Emitter, lanes: Sequence[str], row: int) -> list[str]:
    """Load row `row` of every lane's record; give the four banks as vectors of floats.

    Register j collects the rows of lanes j, j+4, j+8, ...; then a 4x4 transposition within each 128-bit part leaves the
    lanes in order.
    """
    rows = []
    for address in lanes:
        place = e.value(f"getelementptr inbounds i8, ptr {address}, i64 {row * ROW_ALIGN}")
        rows.append(e.value(f"load <4 x float>, ptr {place}, align {ROW_ALIGN}"))
    columns = [_concatenate(e, rows[j::4]) for j in range(4)]
    low01 = _interleave(e, columns[0], columns[1], (0, 1))
    high01 = _interleave(e, columns[0], columns[1], (2, 3))
    low23 = _interleave(e, columns[2], columns[3], (0, 1))
    high23 = _interleave(e, columns[2], columns[3], (2, 3))
    return [_join(e, low01, low23, 0), _join(e, low01, low23, 2), _join(e, high01, high23, 0), _join(e, high01, high23, 2)]


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


def _as_leaf(e: Emitter, floats: str, scalar: str) -> Leaf:
    if scalar == "f32":
        return Leaf("f32", True, floats)
    words = e.value(f"bitcast <{e.width} x float> {floats} to <{e.width} x i32>")
    return e.from_stored(scalar, True, words)


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


# --- local arrays -----------------------------------------------------------------------------------------------------


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
        e.line(f"store {e.stored_type(leaf.scalar, varying)} {e.to_stored(leaf)}, ptr {pointer}, align {_align(varying)}")


def _align(varying: bool) -> int:
    # A vector of fewer than 16 words is only as aligned as its size; 16 bytes hold for every width of 4 or more.
    return ROW_ALIGN if varying else 4


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

