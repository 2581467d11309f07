"""The README keeps its promises: its module is the one in examples/, and it replaces the shading module."""

import re
from pathlib import Path

import numpy as np

import tasuki
from tasuki.language.load import resolve_module

ROOT = Path(__file__).parent.parent
SCENE = ROOT / "tests/data/still_life.nff"
TOON = ROOT / "examples/toon.py"


def test_the_module_in_the_readme_is_the_example():
    shown = re.search(r"```python\n(from tasuki.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert shown is not None
    example = TOON.read_text().split('"""\n\n', 1)[1]
    assert shown[1] == example


def test_a_users_file_replaces_the_shading_module():
    plain = tasuki.render(SCENE, size=(64, 48))
    toon = tasuki.render(SCENE, size=(64, 48), modules={"shading": f"{TOON}:toon"})
    assert toon.stats["rays"] == plain.stats["rays"]
    assert not np.array_equal(np.asarray(toon), np.asarray(plain))
    names = [one["name"] if isinstance(one, dict) else one for one in toon.stats["modules"]]
    assert any("toon" in name for name in names)


def test_the_example_gives_three_flat_steps():
    toon = resolve_module(f"{TOON}:toon")
    attribute = dict.fromkeys(("ambient", "specular", "exponent", "reflection", "transmission", "index"), 0.0)
    attribute |= {
        "colour": [1.0, 1.0, 1.0],
        "flags": 0,
        "texture": -1,
        "diffuse": 1.0,
        "transmittance": [0.0, 0.0, 0.0],
    }
    angles = np.linspace(0.0, np.pi / 2, 1000)
    to_light = np.stack([np.sin(angles), np.zeros_like(angles), np.cos(angles)], axis=1)
    up = [0.0, 0.0, 1.0]
    light = toon.map(attribute, up, [0.0, 0.0, -1.0], to_light, [1.0, 1.0, 1.0])
    assert np.unique(light[:, 0]).tolist() == np.float32([0, 1, 2, 3] / np.float32(3)).tolist()
