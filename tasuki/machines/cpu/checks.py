"""Tables in LLVM, and the check of an index against its table."""

from __future__ import annotations

from dataclasses import dataclass

from tasuki.diagnostics import Span
from tasuki.ir.types import Record
from tasuki.machines.cpu.context import ERROR, ERROR_INDEX, STOP
from tasuki.machines.cpu.emit import Emitter, Leaf
from tasuki.machines.cpu.lanes import extract, first_lane


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
