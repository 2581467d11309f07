"""Files that a renderer writes: checked before any work is done, and never half-written."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tasuki.diagnostics import Diagnostic, OutputError

PICTURE_SUFFIXES = (".png", ".exr")


def check_writable(path: str | Path, suffixes: tuple[str, ...] = PICTURE_SUFFIXES) -> Path:
    """Make sure that `path` can be written, by writing beside it; the path itself stays as it is.

    `suffixes`: one of which the name must end in, whatever its case; empty: any name will do. Returns the path. Raises
    OutputError for another suffix, a directory, and a folder that is missing or does not let us write.
    """
    path = Path(path)
    if suffixes and path.suffix.lower() not in suffixes:
        expected = f"a name ending in {' or '.join(suffixes)}"
        found = repr(path.suffix) if path.suffix else "no suffix"
        raise _error(f"cannot tell the format of {str(path)!r} by its suffix", expected, found)
    if path.is_dir():
        raise _error(f"{str(path)!r} is a directory", "a file name", "a directory")
    if path.exists() and not path.is_file():
        raise _error(f"{str(path)!r} is not a regular file", "a file that may be replaced")
    if path.exists() and not os.access(path, os.W_OK):
        raise _error(f"{str(path)!r} may not be written", hint="it is read-only")
    with written_aside(path) as aside:
        aside.touch()
        # Not renamed into place: this was only to see whether it could be.
        aside.unlink()
    return path


@contextmanager
def written_aside(path: str | Path) -> Iterator[Path]:
    """A path in the folder of `path` to write to; renamed to `path` at the end, removed if anything goes wrong.

    OSError becomes OutputError. If nothing was written there, `path` stays as it is.
    """
    target = Path(os.path.realpath(path))
    aside = target.with_name(f".{target.name}.{os.getpid()}.new")
    try:
        yield aside
        if aside.exists():
            os.replace(aside, target)
    except OSError as error:
        raise _error(f"cannot write {str(path)!r}: {_reason(error, target)}") from error
    finally:
        with contextlib.suppress(OSError):
            aside.unlink(missing_ok=True)


def write_file(path: str | Path, content: bytes) -> None:
    """Write a file, whole or not at all. Raises OutputError."""
    with written_aside(path) as aside:
        aside.write_bytes(content)


def _reason(error: OSError, target: Path) -> str:
    if isinstance(error, FileNotFoundError) and not target.parent.is_dir():
        return f"there is no folder {str(target.parent)!r}"
    return error.strerror or str(error)


def _error(message: str, expected: str | None = None, found: str | None = None, hint: str | None = None) -> OutputError:
    return OutputError(str(Diagnostic(message, expected=expected, found=found, hint=hint)))
