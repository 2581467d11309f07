"""Charts of the reports in docs/, by matplotlib (extra `bench`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot

WIDTH = 8.0
DOTS_PER_INCH = 110
COLOURS = ("#b8b4a7", "#1f5a7a", "#c2571a", "#5d7f3a", "#7a4a7f")


def bar_chart(
    path: Path,
    names: Sequence[str],
    groups: Mapping[str, Sequence[float]],
    label: str,
    mark: tuple[float, str] | None = None,
) -> None:
    """Horizontal bars, a group of them for each name; `mark` is a value to compare with, and what it is called."""
    figure, axes = pyplot.subplots(figsize=(WIDTH, 0.8 + 0.32 * len(names)), layout="constrained")
    thick = 0.8 / len(groups)
    for i, (group, values) in enumerate(groups.items()):
        places = [name + (i - (len(groups) - 1) / 2) * thick for name in range(len(names))]
        axes.barh(places, values, thick, label=group, color=COLOURS[i])
    if mark:
        axes.axvline(mark[0], color=COLOURS[2], linestyle="--", label=mark[1])
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.set_xlabel(label)
    figure.legend(loc="outside upper center", ncols=len(groups) + 1, frameon=False)
    _save(figure, path)


def efficiency_chart(path: Path, ways: Mapping[str, Sequence[Mapping[str, Any]]]) -> None:
    """Speed-up and efficiency over the number of units, a line for each way of distributing work."""
    figure, (speed, share) = pyplot.subplots(1, 2, figsize=(WIDTH, 3.6), layout="constrained")
    for colour, (way, rows) in zip(COLOURS[1:] + COLOURS[:1], ways.items(), strict=True):
        units = [row["units"] for row in rows]
        speed.plot(units, [row["units"] * row["efficiency"] for row in rows], marker="o", ms=3, color=colour, label=way)
        share.plot(units, [100 * row["efficiency"] for row in rows], marker="o", ms=3, color=colour, label=way)
    for axes in (speed, share):
        axes.set_xscale("log", base=2)
        axes.set_xlabel("processor units")
        axes.set_xticks(units, [str(count) for count in units])
    speed.set_yscale("log", base=2)
    speed.set_ylabel("speed-up")
    share.set_ylabel("efficiency, %")
    speed.legend(frameon=False)
    _save(figure, path)


def _save(figure: Any, path: Path) -> None:
    # No software version, so that equal figures make equal files.
    figure.savefig(path, dpi=DOTS_PER_INCH, metadata={"Software": None})
    pyplot.close(figure)
