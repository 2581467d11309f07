"""Paths: the member of a value that a statement or a load names, as leaves of the whole value."""

from __future__ import annotations

from collections.abc import Sequence

from tasuki.ir.types import Array, Table, Type


def at_path(base: Type, path: Sequence[str]) -> tuple[Type, range]:
    """The type of the member of `base` that `path` leads to, and which of `base`'s leaves it takes.

    The empty path is the whole value. Raises KeyError, with the name at fault, where a member does not exist.
    """
    if isinstance(base, Array | Table):
        raise KeyError(str(base))
    found, start = base, 0
    for name in path:
        member = found.member(name)
        if member is None:
            raise KeyError(name)
        start += found.leaf_range(name).start
        found = member
    return found, range(start, start + len(found.leaves))
