"""Registries: who may replace what, and that numbers stay."""

import pytest

from tasuki.diagnostics import SceneError
from tasuki.modules import records
from tasuki.scene import local_surfaces
from tasuki.scene.registry import Origin, Registry

MINE, YOURS = (Origin(f"/home/{name}.py", 7, False) for name in ("mine", "yours"))


def registry() -> Registry[str]:
    made: Registry[str] = Registry("accelerator", 3)
    for name in ("grid", "tree"):
        made.enter(name, f"first {name}", MINE)
    return made


def test_a_file_replaces_its_own_and_numbers_stay():
    found = registry()
    assert found.number("grid", MINE) == 0
    assert found.enter("grid", "second grid", MINE) == "second grid"
    assert list(found.items()) == [("grid", "second grid"), ("tree", "first tree")]
    assert found.number("octree", MINE) == 2


def test_another_file_is_told_who_was_first():
    with pytest.raises(SceneError) as caught:
        registry().enter("grid", "another", YOURS)
    assert "there is an accelerator 'grid' already" in str(caught.value)
    assert "/home/mine.py:7:1: note: it was registered here first" in str(caught.value)


def test_room_is_for_so_many_names():
    found = registry()
    found.enter("octree", "third", YOURS)
    found.enter("octree", "third again", YOURS)
    with pytest.raises(SceneError, match="no room for accelerator 'list': there are 3 already"):
        found.enter("list", "fourth", YOURS)


def test_a_copy_is_apart():
    found = registry()
    found.copy().enter("octree", "third", MINE)
    assert "octree" not in found


def test_in_a_notebook_the_namespace_is_the_file():
    cell = "def run(of_caller): return of_caller()\n"
    namespaces = [{"__name__": "__main__"}, {"__name__": "__main__"}, {"__name__": "mine", "__file__": "mine.py"}]
    origins = []
    for namespace in namespaces:
        exec(f"{cell}\ndef register(of_caller): return run(of_caller)\n", namespace)
        origins.append(namespace["register"](Origin.of_caller))
    assert origins[0] == origins[1] == Origin("__main__", 3, False)
    assert origins[2].file.endswith("/mine.py")


def test_the_flag_of_surfaces_is_that_of_the_modules():
    assert local_surfaces.SURFACE == records.SURFACE
    assert local_surfaces.TWO_SIDED == records.TWO_SIDED
