"""The registry of primitive kinds."""

import pytest

from tasuki.diagnostics import SceneError
from tasuki.language.declare import Module
from tasuki.scene import kinds
from tasuki.scene.kinds import PrimitiveKind, lookup, register, resolve


@pytest.fixture
def registry(monkeypatch):
    monkeypatch.setattr(kinds, "_KINDS", kinds._KINDS.copy())


def surface(name):
    return PrimitiveKind(name, "surface", table="tasuki.modules.records:cones", hit="a:b", surface="a:b", box="a:b")


def test_built_in_kinds_name_what_exists():
    assert [(kind.name, kind.number) for kind in kinds.kinds()][:4] == [
        ("plane", 0),
        ("quadric", 1),
        ("cone", 2),
        ("triangle", 3),
    ]
    for kind in kinds.kinds()[:4]:
        assert kind.table_name == f"{kind.name}s"
        assert kind.record.__name__.lower() == kind.name
        roles = ["hit", "surface", "box"] + (["span", "normal", "inside"] if kind.sort == "solid" else [])
        assert all(isinstance(kind.resolve(role), Module) for role in roles)


@pytest.mark.usefixtures("registry")
def test_a_new_kind_gets_the_next_number_and_its_modules_are_found_later():
    kind = register(surface("torus"))
    assert kind.number == len(kinds.kinds()) - 1
    assert lookup("torus") is kind
    with pytest.raises(SceneError, match="cannot find 'a:b'"):
        kind.resolve("hit")


@pytest.mark.usefixtures("registry")
def test_what_cannot_be_registered():
    with pytest.raises(SceneError, match="there is a primitive kind 'cone' already"):
        register(surface("cone"))
    solid = PrimitiveKind("torus", "solid", "a:b", "a:b", span="a:b", normal="a:b")
    with pytest.raises(SceneError, match=r"(?s)a solid has the modules span, normal, inside, box.*no inside"):
        register(solid)
    for number in range(len(kinds.kinds()), kinds.MOST_KINDS):
        register(surface(f"kind {number}"))
    with pytest.raises(SceneError, match="no room"):
        register(surface("one too many"))


def test_an_unknown_kind_suggests_a_known_one():
    with pytest.raises(SceneError, match="did you mean 'quadric'"):
        lookup("quadrics")


def test_names_that_lead_nowhere():
    for name in ("no.such.module:thing", "tasuki.modules.records:nothing", "tasuki"):
        with pytest.raises(SceneError, match="cannot find"):
            resolve(name)
