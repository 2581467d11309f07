"""What the command line shows: progress, one-line summaries, tables. Rich is imported only where something is drawn."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

QUIET_SECONDS = 1.0
"""Shorter work shows no progress."""
REFRESH_SECONDS = 0.1
MOST_SHOWN = 20
"""Of lights and of materials in what `tasuki info` prints."""
LONGEST_SILENCE = 60.0
"""Seconds between two lines of progress, where standard error is not a terminal; it begins with one and doubles."""


class ProgressDisplay:
    """Shows, on standard error, what is being done and the time left, once it has taken more than a second.

    A bar on a terminal, else a plain line now and then. Used as a context; `tell` is the callback of `tasuki.render`.
    It draws from a thread of its own, so that it lives while the main thread waits in compiled code.
    """

    def __init__(self, shown: bool = True) -> None:
        self._doing = ""
        self._share: float | None = None
        self._phase_began = time.perf_counter()
        self._finished = threading.Event()
        self._thread = threading.Thread(target=self._show, daemon=True) if shown else None

    def __enter__(self) -> ProgressDisplay:
        if self._thread:
            self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._finished.set()
        if self._thread:
            self._thread.join()

    def tell(self, doing: str, share: float | None = None) -> None:
        """What is being done, and the share of it that is done, 0..1, where that is known."""
        if doing != self._doing:
            self._phase_began = time.perf_counter()
        self._doing, self._share = doing, share

    def _show(self) -> None:
        # A terminal that has gone away must not end the work.
        with contextlib.suppress(OSError, ValueError):
            if self._finished.wait(QUIET_SECONDS):
                return
            if sys.stderr.isatty():
                self._show_bar()
            else:
                self._show_lines()

    def _show_bar(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

        doing, left = TextColumn("{task.description}"), TextColumn("{task.fields[left]}")
        console = Console(stderr=True)
        with Progress(doing, BarColumn(), TaskProgressColumn(), left, console=console, transient=True) as bar:
            task = bar.add_task(self._doing, total=None, left="")
            while not self._finished.wait(REFRESH_SECONDS):
                share = self._share
                total = None if share is None else 1.0
                bar.update(task, description=self._doing, completed=share or 0.0, total=total, left=self._left())

    def _show_lines(self) -> None:
        silence = QUIET_SECONDS
        while True:
            share = self._share
            done = "" if share is None else f": {share:.0%}"
            left = self._left()
            print(f"{self._doing}{done}{', ' + left if left else ''}", file=sys.stderr, flush=True)
            if self._finished.wait(silence):
                return
            silence = min(2.0 * silence, LONGEST_SILENCE)

    def _left(self) -> str:
        share = self._share
        if not share:
            return ""
        seconds = (time.perf_counter() - self._phase_began) * (1.0 - share) / share
        return f"about {duration(seconds)} left"


def duration(seconds: float) -> str:
    """Seconds as people say them: 0.4 s, 12 s, 3 min 20 s, 2 h 5 min."""
    if seconds < 10.0:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


def summary(path: Path, width: int, height: int, stats: dict[str, Any]) -> str:
    """One line: the picture, its size, rays or triangles per second, and where the time went."""
    seconds = {name: spent or 0.0 for name, spent in stats["seconds"].items()}
    total = seconds.pop("total")
    seconds["other"] = max(0.0, total - sum(seconds.values()))
    work, unit = _work(stats)
    speed = work / 1e6 / seconds["render"] if seconds["render"] else 0.0
    spent = ", ".join(f"{name} {amount:.2f}" for name, amount in seconds.items())
    return f"{path}: {width}x{height}, {work:,} {unit}, {speed:.1f} million/s; {total:.2f} s ({spent})"


def _work(stats: dict[str, Any]) -> tuple[int, str]:
    """What a picture took: rays, or triangles, of which each sample takes all."""
    rays = stats["rays"]
    if rays is None:
        return stats["scene"]["primitives"]["triangle"] * stats["scene"]["samples"], "triangles"
    return sum(rays[sort] for sort in ("eye", "reflection", "refraction", "shadow")), "rays"


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], numeric: Sequence[str]) -> None:
    """A table on standard output; columns named in `numeric` are set to the right. Cut off by a terminal only."""
    from rich.console import Console
    from rich.table import Table

    console = Console()
    if not console.is_terminal:
        console = Console(width=500)
    table = Table(title=title or None, title_justify="left", box=None, pad_edge=False)
    for column in columns:
        table.add_column(column, justify="right" if column in numeric else "left", no_wrap=column in numeric)
    for row in rows:
        table.add_row(*row)
    console.print(table)


def print_profile(rows: Sequence[dict[str, Any]]) -> None:
    """Where the cycles of a profiled run went, module by module."""
    table = [
        [
            row["module"].removeprefix("tasuki.modules."),
            f"{row['calls']:,}",
            f"{row['lanes']:,}",
            f"{row['cycles']:,}",
            f"{row['cycles'] / row['lanes']:.1f}" if row["lanes"] else "",
            f"{row['own']:.1%}",
        ]
        for row in rows
    ]
    columns = ["module", "calls", "lanes", "cycles", "cycles per lane", "own share"]
    print_table("cycles include the modules called, own shares do not; one thread", columns, table, columns[1:])


def print_pu_profile(content: dict[str, Any]) -> None:
    """Where the steps of a picture on processor units went: the units of one of them, the PUs together, the modules."""
    print(f"schedule {content['schedule']}: {content['words']:,} microinstructions")
    print(f"{content['steps']:,} steps", end="")
    if "passes" in content:
        print(f"; {content['seconds']:.3g} s at {content['clock_megahertz']:g} MHz")
    else:
        per_pixel = content["steps_per_pixel"]
        print(f"; a pixel takes {per_pixel['min']:,} to {per_pixel['max']:,}, {per_pixel['mean']:,.0f} on average")
    busy = ", ".join(f"{unit} {share:.0%}" for unit, share in content["busy"].items())
    print(f"busy: {content['fpp_busy']:.2f} of 4 FPPs; {busy}")
    if "passes" in content:
        _print_passes(content)
    else:
        _print_units(content)
    columns = ["module", "words", "steps", "share", "busy FPPs"]
    table = [
        [
            row["module"].removeprefix("tasuki.modules.") or "(from item to item)",
            f"{row['words']:,}",
            f"{row['steps']:,}",
            f"{row['share']:.1%}",
            f"{row['fpp_busy']:.2f}",
        ]
        for row in content["modules"]
        if row["steps"]
    ]
    print_table("", columns, table, columns[1:])


def _print_units(content: dict[str, Any]) -> None:
    """What the processor units took together, and what held them up."""
    work = content["work"] if content["work"] == "scanline" else f"{content['work']:,} pixels"
    print(f"{content['pus']:,} PUs, {content['distribution']} distribution, {work} at a time: ", end="")
    print(f"{content['makespan']:,} steps, efficiency {content['efficiency']:.2%}, ", end="")
    print(f"{content['seconds']:.3g} s at {content['clock_megahertz']:g} MHz")
    room = content["makespan"] * content["pus"]
    spent = {"broadcast": content["broadcast"] / content["makespan"]}
    spent |= {name: sum(steps) / room for name, steps in content["units"].items()}
    spent["idle"] = 1.0 - sum(spent.values())
    print(f"of the PUs' time: {', '.join(f'{name} {share:.2%}' for name, share in spent.items())}")
    for name, units in content["saturating_units"].items():
        if units is not None:
            print(f"from {units:,.0f} PUs on the {name.replace('_', ' ')} holds them up")


def _print_passes(content: dict[str, Any]) -> None:
    """The passes of the scanline method, and what the display memory is spared."""
    display = content["display"]
    print(f"display memory: {display['writes']:,} pixels written, once each; a depth buffer would write ", end="")
    print(f"{display['depth_buffer_writes']:,} and read {display['depth_buffer_reads']:,}")
    columns = ["pass", "words", "items", "steps"]
    table = [[row["entry"], *(f"{row[name]:,}" for name in columns[1:])] for row in content["passes"]]
    print_table("", columns, table, columns[1:])


def print_info(content: dict[str, Any]) -> None:
    """What is in a scene, as `tasuki.scene.info.info` gives it."""
    camera, bounds = content["camera"], content["bounds"]
    shapes = dict(content["shapes"])
    total = shapes.pop("total")
    width, height = camera["resolution"]
    print(f"shapes      {total:,}{': ' if total else ''}{_counts(shapes)}")
    print(f"primitives  {_counts(content['primitives']) or 'none'}")
    formulas = content["formulas"]
    if formulas["literals"]:
        print(f"formulas    {formulas['literals']:,} literals on {formulas['surfaces']:,} surfaces", end="")
        print(f", {formulas['merged']:,} of them merged" if formulas["merged"] else "")
    print(f"bounds      {_numbers(bounds['low'])} to {_numbers(bounds['high'])}" if bounds else "bounds      none")
    print(f"camera      at {_numbers(camera['eye'])}, looks at {_numbers(camera['at'])}, up {_numbers(camera['up'])}")
    print(f"            {camera['angle']:g} degrees between {camera['angle_between']}, {width}x{height} pixels")
    print(f"background  {_numbers(content['background'])}")
    print(f"lights      {len(content['lights'])}")
    _print_some(
        [
            f"{'at ' if 'position' in light else 'along '}{_numbers(light.get('position') or light['direction'])}, "
            f"colour {_numbers(light['colour'])}"
            for light in content["lights"]
        ]
    )
    print(f"materials   {len(content['materials'])}")
    _print_some([_material(material) for material in content["materials"]])
    for warning in content["warnings"]:
        print(warning)


def _print_some(lines: Sequence[str]) -> None:
    for line in lines[:MOST_SHOWN]:
        print(f"            {line}")
    if len(lines) > MOST_SHOWN:
        print(f"            and {len(lines) - MOST_SHOWN:,} more, which --json shows")


def _material(material: dict[str, Any]) -> str:
    """A material's name, the number of its shapes, and its properties; those left to their defaults are not shown."""
    others = [
        f"{name} {_shown(value)}"
        for name, value in material.items()
        if name not in ("name", "shapes") and value is not None
    ]
    return f"{material['name'] or 'unnamed'}, {material['shapes']:,} shapes: {', '.join(others)}"


def _shown(value: Any) -> str:
    """A property of a material: a number, a colour, or a texture, by its kind."""
    if isinstance(value, dict):
        return str(value["kind"])
    return _numbers(value) if isinstance(value, list | tuple) else f"{value:g}"


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{count:,} {name}" for name, count in counts.items())


def _numbers(values: Sequence[float]) -> str:
    return "(" + ", ".join(f"{value:g}" for value in values) + ")"


def print_modules(rows: Sequence[dict[str, Any]], cycles: bool) -> None:
    """The list of modules; if `cycles`, with what they cost on this processor, and on the PU under both schedules."""
    costs = ["cycles", "macro steps", "compact steps"] if cycles else []
    table = []
    for row in rows:
        number = "" if row["number"] is None else str(row["number"])
        spent = _costs(row) if cycles else []
        table.append([number, row["method"] or "", row["name"], row["socket"] or "", *spent, _short(row["file"])])
    print_table("", ["number", "method", "module", "socket", *costs, "file"], table, ["number", *costs])


def _costs(row: dict[str, Any]) -> list[str]:
    """Cycles of the CPU, and typical steps of the PU under both schedules, of a module; empty where not known."""
    macro, compact = (part["steps"]["typical"] for part in (row["pu"], row["pu"]["compact"]))
    spent = row["cpu"]["cycles"]
    return ["" if spent is None else f"{spent:.1f}", *("" if one is None else f"{one:,}" for one in (macro, compact))]


def print_macros(rows: Sequence[dict[str, Any]]) -> None:
    """Table 1, each row followed by the shorter macros for the same operation."""
    table = []
    for row in rows:
        for one in (row, *row["shorter"]):
            first = one is row
            published = ("damaged" if row["published"] is None else str(row["published"])) if first else ""
            error = one["error"]
            note = one["note"] if first else f"shorter; {one['note']}"
            measured = f"{error['value']:.2g}" if error["unit"] == "absolute" else f"{error['value']:.2f}"
            name = row["operation"] if first else ""
            table.append([name, one["macro"], published, str(one["steps"]), measured, error["unit"], note])
    columns = ["operation", "macro", "published", "steps", "error", "unit", "note"]
    print_table("", columns, table, ["published", "steps", "error"])


def print_rows(memory: Any, first: int, count: int) -> None:
    """Rows of the processor unit's data memory, each word as bits and as the float that they are."""
    for number in range(first, min(first + count, len(memory))):
        words = memory[number : number + 1].view("float32")[0]
        cells = "  ".join(f"{bits:08x} {value:<14.7g}" for bits, value in zip(memory[number], words, strict=True))
        print(f"{number:8}  {cells.rstrip()}")


def _short(file: str) -> str:
    """A path as seen from the folder that holds the package, where it is inside."""
    path, packages = Path(file), Path(__file__).parents[1]
    return str(path.relative_to(packages)) if path.is_relative_to(packages) else file
