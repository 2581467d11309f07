"""What all benchmarks share: alternating measurements, medians, the machine, reports as tables and as JSON.

Clocks drift and neighbours come and go, so nothing is measured on its own: each contender is measured once in each
round, in turn (A B C A B C ...), a figure is the median over the rounds, and a ratio the median of the rounds' ratios.
"""

from __future__ import annotations

import json
import os
import platform
import statistics
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SCENES = ROOT / ".." / "shared" / "spd"
RESULTS = ROOT / "bench" / "results"
LEAST_ROUNDS = 5

Samples = dict[str, list[float]]
"""Of each contender, one figure for each round."""


@dataclass
class Table:
    """Rows of text under column heads."""

    title: str
    columns: list[str]
    rows: list[list[str]] = field(default_factory=list)

    def add(self, *cells: object) -> None:
        self.rows.append([str(cell) for cell in cells])

    def markdown(self) -> str:
        """As a Markdown table: first column to the left, numbers to the right."""
        alignment = ["---", *["---:"] * (len(self.columns) - 1)]
        lines = [self.columns, alignment, *self.rows]
        return f"**{self.title}**\n\n" + "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"

    def text(self) -> str:
        """For a terminal."""
        widths = [max(len(cell) for cell in column) for column in zip(self.columns, *self.rows, strict=True)]
        lines = [
            [cell.rjust(width) for cell, width in zip(row, widths, strict=True)] for row in [self.columns, *self.rows]
        ]
        lines = [[row[0].strip().ljust(widths[0]), *row[1:]] for row in lines]
        return "\n".join([self.title, *("  ".join(row) for row in lines)])


@dataclass
class Report:
    """What one benchmark found: tables to read, samples to check them by."""

    name: str
    rounds: int
    tables: list[Table] = field(default_factory=list)
    samples: dict[str, Samples] = field(default_factory=dict)
    command: str = field(default_factory=lambda: command())
    machine: dict[str, str] = field(default_factory=lambda: machine())

    def publish(self, folder: Path = RESULTS) -> None:
        """Print the tables, and write everything to `folder`/NAME.json."""
        for table in self.tables:
            print("\n" + table.text())
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{self.name}.json"
        path.write_text(json.dumps(asdict(self), indent=1) + "\n")
        print(f"\nwritten: {os.path.relpath(path)}")

    @classmethod
    def read(cls, path: Path) -> Report:
        data = json.loads(path.read_text())
        return cls(**{**data, "tables": [Table(**table) for table in data["tables"]]})


def alternate(contenders: Mapping[str, Callable[[], float]], rounds: int, *, warm_up: int = 1) -> Samples:
    """Measure every contender once in each of `rounds` rounds, in turn, after `warm_up` rounds that are not counted."""
    samples: Samples = {name: [] for name in contenders}
    for number in range(warm_up + rounds):
        for name, measure in contenders.items():
            figure = measure()
            if number >= warm_up:
                samples[name].append(figure)
    return samples


def ratio(numerator: Sequence[float], denominator: Sequence[float]) -> float:
    """The median of the rounds' ratios."""
    return statistics.median(a / b for a, b in zip(numerator, denominator, strict=True))


def spread(samples: Sequence[float]) -> float:
    """Half of what lies between the quartiles, as a share of the median: how noisy the figure is."""
    low, middle, high = statistics.quantiles(samples, n=4)
    return (high - low) / (2.0 * middle)


def rounds_argument(value: str) -> int:
    """For argparse: a number of rounds that a median deserves."""
    rounds = int(value)
    if rounds < LEAST_ROUNDS:
        raise ValueError(f"fewer than {LEAST_ROUNDS} rounds")
    return rounds


def command() -> str:
    """How this process was started, as one would type it."""
    module = Path(sys.argv[0]).stem
    return " ".join(["python -m", f"bench.{module}", *sys.argv[1:]])


def machine() -> dict[str, str]:
    """The machine and what runs on it; `load` tells whether others were using it when the benchmark began."""
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    models = {line.partition(":")[2].strip() for line in lines if line.startswith("model name")}
    return {
        "processor": ", ".join(sorted(models)) or platform.processor() or platform.machine(),
        "cores": str(os.cpu_count()),
        "lanes": _lanes(),
        "system": platform.system(),
        "python": platform.python_version(),
        **{package: _version(package) for package in ("numpy", "llvmlite", "embreex")},
        "load": f"{os.getloadavg()[0]:.2f}",
    }


def _lanes() -> str:
    from tasuki.native.compile import lanes

    return str(lanes())


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"


def require(path: Path) -> Path:
    """`path`, or the end of the program where it is absent."""
    if not path.exists():
        raise SystemExit(f"cannot measure: {os.path.relpath(path)} is absent")
    return path
