"""The two caches on disk: what recompiles and what does not, and that nothing broken or stale is ever trusted.

Each run is a process of its own, as a user's is, with a cache folder of its own.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

DRIVER = """
import json, sys
import numpy as np
from tasuki import programs
from tasuki.language import load_modules
from tasuki.mapping import map_module
[entry] = [thing for thing in load_modules(sys.argv[1]) if getattr(thing, "name", "") == "entry"]
x = np.arange(40, dtype=np.float32)
result = map_module(entry, x, machine="cpu", width=8)
report = programs.REPORT
print(json.dumps({"result": result.tolist(), "linked": report.linked, "compiled": report.compiled}))
"""
MODULE = """
from tasuki.language import f32, i32, module

SCALE = 3.0

@module
def entry(x: f32) -> f32:
    \"\"\"Some sum.\"\"\"
    total = 0.0
    for k in range(4):
        total += x * SCALE + f32(k)
    return total
"""


def start(folder: Path, cache: Path | str, file: str = "user.py", **environment: str) -> subprocess.Popen:
    """A process that maps `entry` of `file` over 0..39."""
    variables = {**os.environ, "TASUKI_CACHE": str(cache), **environment}
    return subprocess.Popen(
        [sys.executable, "-c", DRIVER, str(folder / file)],
        env=variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(process: subprocess.Popen) -> dict:
    out, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    return json.loads(out)


def run(folder: Path, cache: Path | str, **options: str) -> dict:
    return finish(start(folder, cache, **options))


def expected(scale: float = 3.0) -> list[float]:
    return (np.arange(40) * scale * 4 + 6).tolist()


@pytest.fixture
def user(tmp_path: Path) -> Path:
    """A folder with a user's file; its cache is the folder `cache` within."""
    (tmp_path / "user.py").write_text(MODULE)
    return tmp_path


def entries(cache: Path, kind: str) -> list[Path]:
    return sorted(cache.glob(f"{kind}-*"))


def test_a_second_run_neither_links_nor_compiles(user):
    cache = user / "cache"
    first = run(user, cache)
    assert first == {"result": expected(), "linked": 1, "compiled": 1}
    assert len(entries(cache, "program")) == len(entries(cache, "object")) == 1
    assert run(user, cache) == {"result": expected(), "linked": 0, "compiled": 0}


@pytest.mark.parametrize(
    ("old", "new"),
    [("total", "sum_of_all"), ("    total = 0.0", "\n\n    total = 0.0  # moved"), ("Some sum.", "The sum.")],
    ids=["variable", "lines", "docstring"],
)
def test_what_changes_no_instruction_compiles_nothing(user, old, new):
    cache = user / "cache"
    run(user, cache)
    (user / "user.py").write_text(MODULE.replace(old, new))
    assert run(user, cache) == {"result": expected(), "linked": 1, "compiled": 0}


def test_a_changed_constant_compiles_anew(user):
    cache = user / "cache"
    run(user, cache)
    (user / "user.py").write_text(MODULE.replace("SCALE = 3.0", "SCALE = 5.0"))
    assert run(user, cache) == {"result": expected(5.0), "linked": 1, "compiled": 1}
    # Both are kept.
    (user / "user.py").write_text(MODULE)
    assert run(user, cache) == {"result": expected(), "linked": 0, "compiled": 0}


def truncate(data: bytes) -> bytes:
    return data[: len(data) // 2]


def flip(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 0x10]) + data[middle + 1 :]


def garbage(data: bytes) -> bytes:
    return np.random.default_rng(0).bytes(len(data))


def empty(data: bytes) -> bytes:
    return b""


@pytest.mark.parametrize("damage", [truncate, flip, garbage, empty])
@pytest.mark.parametrize("kind", ["program", "object"])
def test_broken_entries_are_made_anew(user, kind, damage):
    cache = user / "cache"
    run(user, cache)
    [entry] = entries(cache, kind)
    whole = entry.read_bytes()
    entry.write_bytes(damage(whole))
    found = run(user, cache)
    assert found == {"result": expected(), "linked": 1, "compiled": 1 if kind == "object" else 0}
    assert entry.read_bytes() == whole
    assert run(user, cache) == {"result": expected(), "linked": 0, "compiled": 0}


def test_an_entry_that_is_a_folder_is_no_entry(user):
    cache = user / "cache"
    run(user, cache)
    [entry] = entries(cache, "object")
    entry.unlink()
    entry.mkdir()
    assert run(user, cache)["result"] == expected()


def test_processes_race_on_an_empty_folder(user):
    cache = user / "cache"
    racing = [start(user, cache) for _ in range(4)]
    assert [finish(process)["result"] for process in racing] == [expected()] * 4
    assert len(entries(cache, "program")) == len(entries(cache, "object")) == 1
    assert list(cache.glob(".new-*")) == []
    assert run(user, cache)["compiled"] == 0


def test_a_folder_that_cannot_be_written_keeps_nothing_and_is_no_error(user):
    file = user / "file"
    file.write_text("not a folder")
    for cache in (file, file / "below", "/dev/null/tasuki", "/proc/tasuki"):
        assert run(user, cache) == {"result": expected(), "linked": 1, "compiled": 1}
    assert file.read_text() == "not a folder"


def test_the_folder_is_the_users_cache_where_none_is_chosen(user):
    home = user / "home"
    home.mkdir()
    run(user, "", XDG_CACHE_HOME="", HOME=str(home))
    assert entries(home / ".cache" / "tasuki", "object")
    run(user, "", XDG_CACHE_HOME=str(user / "other"))
    assert entries(user / "other" / "tasuki", "object")


# --- what a user's file takes from elsewhere --------------------------------------------------------------------------


def takes_from_elsewhere(folder: Path, imports: str, body: str, other: str) -> None:
    head = "import sys\nfrom pathlib import Path\nsys.path.insert(0, str(Path(__file__).parent))\n"
    head += "from tasuki.language import f32, i32, module, record, Table\n"
    (folder / "user.py").write_text(f"{head}{imports}\n\n@module\ndef entry(x: f32) -> f32:\n    {body}\n")
    (folder / "elsewhere.py").write_text(other)


CONSTANT = "SCALE = {}\n"
HELPER = "from tasuki.language import f32, module\n\n@module\ndef scaled(x: f32) -> f32:\n    return x * {}\n"
CHOICE = "FAST = {} > 4\n"
RECORD = "from tasuki.language import f32, record\n\n@record\nclass Pair:\n    {}\n"


@pytest.mark.parametrize(
    ("imports", "body", "other"),
    [
        ("from elsewhere import SCALE", "return x * SCALE", CONSTANT),
        ("import elsewhere", "return x * elsewhere.SCALE", CONSTANT),
        ("import elsewhere\nSCALE = elsewhere.SCALE", "return x * SCALE", CONSTANT),
        ("from elsewhere import SCALE as OTHER\nSCALE = OTHER + 0.0", "return x * SCALE", CONSTANT),
        ("from elsewhere import scaled", "return scaled(x)", HELPER),
        ("import elsewhere\nscaled = elsewhere.scaled", "return scaled(x)", HELPER),
        (
            "from elsewhere import FAST\nif FAST:\n    SCALE = 5.0\nelse:\n    SCALE = 3.0",
            "return x * SCALE",
            CHOICE,
        ),
        (
            "from elsewhere import FAST\n@module\ndef three(x: f32) -> f32:\n    return x * 3.0\n"
            "@module\ndef five(x: f32) -> f32:\n    return x * 5.0\nscaled = five if FAST else three",
            "return scaled(x)",
            CHOICE,
        ),
    ],
    ids=["imported", "member", "copied", "computed", "module", "module copied", "chosen", "module chosen"],
)
def test_what_comes_from_another_file_is_never_stale(user, imports, body, other):
    cache = user / "cache"
    takes_from_elsewhere(user, imports, body, other.format(3.0))
    for _ in range(2):
        assert run(user, cache)["result"] == [3.0 * k for k in range(40)]
    # A file is read anew where its size or its time of change differs.
    (user / "elsewhere.py").write_text(other.format(5.00))
    os.utime(user / "elsewhere.py", (1e9, 1e9))
    assert run(user, cache)["result"] == [5.0 * k for k in range(40)]


def test_a_record_from_another_file_is_never_stale(user):
    """The order of its fields decides what the module computes."""
    cache = user / "cache"
    body = "pair = Pair(x, 2.0 * x)\n    return pair.first - pair.second"
    takes_from_elsewhere(user, "from elsewhere import Pair", body, RECORD.format("first: f32\n    second: f32"))
    for _ in range(2):
        assert run(user, cache)["result"] == [-float(k) for k in range(40)]
    (user / "elsewhere.py").write_text(RECORD.format("second: f32\n    first: f32"))
    os.utime(user / "elsewhere.py", (1e9, 1e9))
    assert run(user, cache)["result"] == [float(k) for k in range(40)]


def test_a_constant_bound_anew_within_a_process_counts():
    """As in a notebook: a module means what its names stand for when it is used."""
    from tasuki.mapping import map_module

    x = np.arange(5, dtype=np.float32)
    try:
        for value in (2.0, 7.0):
            globals()["FACTOR"] = value
            np.testing.assert_array_equal(map_module(by_a_factor, x), x * np.float32(value))
    finally:
        globals()["FACTOR"] = 2.0


def test_only_what_was_not_used_for_longest_goes(tmp_path, monkeypatch):
    from tasuki.native import cache

    monkeypatch.setenv("TASUKI_CACHE", str(tmp_path))
    monkeypatch.setattr(cache, "LIMIT_BYTES", 5000)
    for k in range(4):
        cache.write(f"entry-{k}", bytes(1000))
        os.utime(tmp_path / f"entry-{k}", (1000 + k, 1000 + k))
    # Reading makes an entry young again.
    assert cache.read("entry-0") == bytes(1000)
    cache.write("entry-4", bytes(1000))
    cache.write("entry-5", bytes(1000))
    assert [cache.read(f"entry-{k}") is not None for k in range(6)] == [True, False, False, True, True, True]


from tasuki.language import f32, module  # noqa: E402  (the module below is part of the test above)

FACTOR = 2.0


@module
def by_a_factor(x: f32) -> f32:
    return x * FACTOR
