from __future__ import annotations

from tasuki.language import f32, module


@module
def wrong(a: Missing, b: f32) -> nonsense:
    c: whatever = b
    return c
