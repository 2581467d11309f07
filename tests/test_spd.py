"""The Standard Procedural Databases at the published settings: counts of rays as their authors published them."""

import re
from pathlib import Path

import pytest

import tasuki

SPD = Path(__file__).parents[2] / "shared" / "spd"
SCENES = ("balls", "gears", "mount", "rings", "teapot", "tetra", "tree")

pytestmark = pytest.mark.skipif(not SPD.is_dir(), reason=f"needs the databases in {SPD}")


def published() -> dict[str, dict[str, int]]:
    """The table of the databases' README: for each row its counts by scene."""
    rows = {}
    for line in (SPD / "README.md").read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|\n ").split("|")]
        if len(cells) == len(SCENES) + 1 and re.fullmatch(r"\d+", cells[1]):
            rows[cells[0]] = dict(zip(SCENES, map(int, cells[1:]), strict=True))
    return rows


@pytest.mark.parametrize("scene", SCENES)
def test_counts_of_rays(scene):
    rays = tasuki.render(SPD / f"{scene}.nff", size=(513, 513), depth=5).stats["rays"]
    table = {row: counts[scene] for row, counts in published().items()}
    assert rays["eye"] == 513 * 513
    assert near(rays["eye_hits"], 0.005, table["eye hits, Haines"], table["eye hits, Havran"])
    secondary = rays["reflection"] + rays["refraction"]
    one_by_one = near(rays["reflection"], 0.1, table["reflection, Haines"]) and near(
        rays["refraction"], 0.1, table["refraction, Haines"]
    )
    assert one_by_one or near(secondary, 0.1, table["reflection + refraction, Havran"])
    assert near(rays["shadow"], 0.1, table["shadow, Haines"], table["shadow, Havran"])


def near(found: int, share: float, *expected: int) -> bool:
    return any(abs(found - count) <= share * count for count in expected)
