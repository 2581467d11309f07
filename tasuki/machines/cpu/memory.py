"""Access to tables; their indices have been checked, or need no check.

A uniform index becomes scalar loads. A varying one becomes a gather, but where two or more words of a row are wanted
each lane's whole row is loaded at once (a row is 16 aligned bytes) and the rows are transposed: one row load and half a
shuffle per lane beat two gathers on every machine that we measured.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from tasuki.ir.types import BANKS, Record
from tasuki.machines.cpu.checks import TableValue
from tasuki.machines.cpu.emit import STORED, Emitter, Leaf
from tasuki.machines.cpu.lanes import extract, first_lane, gather, scatter
from tasuki.machines.cpu.primitives import lower_primitive
from tasuki.machines.cpu.rows import as_leaf, load_rows, row_addresses, store_row

LEAST_SHARED = 6
"""From this many words on it pays to see first whether all lanes want the same record."""


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
    texts = [e.value(f"load {e.type_of(s, True)}, ptr {slot}") for s, slot in zip(scalars, slots, strict=True)]
    return [Leaf(scalar, True, text) for scalar, text in zip(scalars, texts, strict=True)]


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
        lanes = lanes or row_addresses(e, table, safe)
        banks = load_rows(e, lanes, row)
        for leaf in leaves:
            loaded[leaf] = as_leaf(e, banks[table.record.layout[leaf][1]], table.record.leaves[leaf])
    return [loaded[leaf] for leaf in wanted]


def store_table(e: Emitter, table: TableValue, index: Leaf, wanted: range, leaves: Sequence[Leaf], mask: str) -> None:
    """The leaves `wanted` of the record at `index` become `leaves` in the active lanes."""
    stored = dict(zip(wanted, leaves, strict=True))
    rows = whole_rows(table.record, wanted) if index.varying and e.width >= 4 else {}
    if rows:
        # Whole rows go out, one store for each lane: scatters, word by word, take several times as long.
        addresses = _active_addresses(e, table, index, mask)
        for row, banks in rows.items():
            store_row(e, addresses, row, [None if leaf is None else stored.pop(leaf) for leaf in banks])
    _store_words(e, table, index, list(stored), list(stored.values()), mask)


def _active_addresses(e: Emitter, table: TableValue, index: Leaf, mask: str) -> list[str]:
    """For each active lane a pointer to its record; the others may store to a place that nobody reads."""
    spare = e.slot(f"[{table.record.rows * BANKS} x i32]")
    addresses = []
    for lane, address in enumerate(row_addresses(e, table, index)):
        active = e.value(f"extractelement {e.mask_type} {mask}, i32 {lane}")
        addresses.append(e.value(f"select i1 {active}, ptr {address}, ptr {spare}"))
    return addresses


def whole_rows(record: Record, wanted: Sequence[int]) -> dict[int, list[int | None]]:
    """The rows of a record of which all words that mean something are wanted: the leaf in each bank, or None.

    A row with a single word is none of them: to scatter that takes less.
    """
    rows: dict[int, list[int | None]] = defaultdict(lambda: [None] * BANKS)
    for leaf, (row, bank) in enumerate(record.layout):
        rows[row][bank] = leaf
    chosen = set(wanted)
    return {
        row: banks
        for row, banks in rows.items()
        if sum(leaf is not None for leaf in banks) > 1 and chosen.issuperset(leaf for leaf in banks if leaf is not None)
    }


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


def word_pointers(e: Emitter, table: TableValue, index: Leaf, leaf: int) -> str:
    """Pointers, one for each lane, to a leaf of the record at `index`."""
    return _word_addresses(e, table, e.broadcast(index), leaf)


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


