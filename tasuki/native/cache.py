"""A cache on disk of what was expensive to make. Entries are checked when read; a broken one counts as absent.

Several processes may share the folder: an entry is written aside and renamed into place, whole or not at all. The
folder is `$TASUKI_CACHE`, or `tasuki` in the user's cache folder; where it cannot be written nothing is kept, silently.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from pathlib import Path

DIGEST_BYTES = 32
LIMIT_BYTES = 256 << 20
"""When the folder grows past this, the entries that were not used for longest go."""


def cache_folder() -> Path:
    """Where entries are kept."""
    chosen = os.environ.get("TASUKI_CACHE")
    if chosen:
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(base) / "tasuki"


def read(key: str) -> bytes | None:
    """The entry under `key`, or None if there is none or it is damaged."""
    path = cache_folder() / key
    try:
        data = path.read_bytes()
    except OSError:
        return None
    digest, payload = data[:DIGEST_BYTES], data[DIGEST_BYTES:]
    if hashlib.sha256(payload).digest() != digest:
        return None
    with contextlib.suppress(OSError):
        os.utime(path)
    return payload


def write(key: str, payload: bytes) -> None:
    """Keep `payload` under `key`, a file name. Failing to is no error."""
    folder = cache_folder()
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        handle, aside = tempfile.mkstemp(dir=folder, prefix=".new-")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(hashlib.sha256(payload).digest() + payload)
            os.replace(aside, folder / key)
        except OSError:
            os.unlink(aside)
            raise
        _shrink(folder)


def _shrink(folder: Path) -> None:
    entries = [(entry.stat(), entry.path) for entry in os.scandir(folder) if entry.is_file()]
    total = sum(stat.st_size for stat, _ in entries)
    for stat, path in sorted(entries, key=lambda e: e[0].st_mtime):
        if total <= LIMIT_BYTES:
            return
        with contextlib.suppress(OSError):
            os.unlink(path)
        total -= stat.st_size
