"""What modules cost on the processor unit: `python -m bench.module_costs` renews docs/module-costs.md and its charts.

One frame is traced under both schedules by the simulated processor unit (its steps do not depend on this machine), 1 to
256 units share its pixels, and every module that can run alone does so on made-up arguments. Cycles of the CPU are
measured on this machine. Writes `bench/results/module_costs.json` too; with `--report` it only writes the page, from
what stands there.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from bench.charts import bar_chart, efficiency_chart
from bench.measure import RESULTS, ROOT, SCENES, Table, machine, require
from tasuki.catalogue import all_modules, describe
from tasuki.machines.pu.system import draw, saturation
from tasuki.renderers.options import Distribution, RenderOptions, Schedule, Work
from tasuki.renderers.pu import MicrocodeTracer
from tasuki.renderers.raytrace import RayTracer
from tasuki.scene import load_scene

SIZE = 512
SCENE = "balls"
UNITS = (1, 2, 4, 8, 16, 32, 64, 128, 256)
SCHEDULES: tuple[Schedule, ...] = ("macro", "compact")
WAYS: tuple[tuple[Distribution, Work], ...] = (
    ("dynamic", 4),
    ("dynamic", 1),
    ("dynamic", "scanline"),
    ("static", 1),
    ("static", "scanline"),
)
SHOWN = 16
"""Modules in the chart."""
RESULT = RESULTS / "module_costs.json"
IMAGES = ROOT / "docs" / "images"
TEMPLATE = Path(__file__).parent / "module_costs.md"
PAGE = ROOT / "docs" / "module-costs.md"


def main() -> None:
    parser = argparse.ArgumentParser(description="Steps of modules on the processor unit, as a page with charts.")
    parser.add_argument("--report", action="store_true", help="write the page from the last results")
    if not parser.parse_args().report:
        RESULT.write_text(json.dumps(measured(), indent=1) + "\n")
    results = json.loads(RESULT.read_text())
    write_charts(results)
    write_page(results)


# --- measuring --------------------------------------------------------------------------------------------------------


def measured() -> dict[str, Any]:
    """All figures, as plain data."""
    path = require(SCENES / f"{SCENE}.nff")
    frames, tracer = {}, None
    for schedule in SCHEDULES:
        tracer = traced(path, schedule)
        frames[schedule] = tracer.report()
        print(f"{schedule}: {frames[schedule]['steps']:,} steps", flush=True)
    assert tracer
    return {
        "machine": machine(),
        "frames": frames,
        "shared": [shared(tracer, distribution, work) for distribution, work in WAYS],
        "modules": [_with_short_path(row) for row in describe(all_modules(), measured=True)],
    }


def _with_short_path(row: dict[str, Any]) -> dict[str, Any]:
    """What is said of a module, its file as seen from the root of the repository."""
    return {**row, "file": Path(row["file"]).relative_to(ROOT).as_posix()}


def traced(path: Path, schedule: Schedule) -> MicrocodeTracer:
    """The frame, on one processor unit."""
    tracer = RayTracer(load_scene(str(path)), RenderOptions(SIZE, SIZE, machine="pu", schedule=schedule))
    tracer.render()
    assert tracer.microcode
    return tracer.microcode


def shared(tracer: MicrocodeTracer, distribution: Distribution, work: Work) -> dict[str, Any]:
    """What 1 to 256 units make of the frame's pixels, with one way of distributing them."""
    tracer.options = replace(tracer.options, distribution=distribution, work=work)
    steps, rows = tracer.steps.reshape(-1), []
    for units in UNITS:
        frame = draw(steps, tracer.system(units))
        rows.append(
            {
                "units": units,
                "makespan": frame.total,
                "busy_share": frame.busy_share,
                "most_work": float(frame.worked.max() / frame.worked.mean()),
                "request": float(frame.waited_request.sum() / (units * frame.total)),
                "display": float(frame.waited_display.sum() / (units * frame.total)),
            }
        )
    for row in rows:
        row["efficiency"] = rows[0]["makespan"] / (row["units"] * row["makespan"])
    print(f"{distribution} {work}: {rows[-1]['efficiency']:.2%} with {UNITS[-1]}", flush=True)
    full = saturation(steps, tracer.system(1))
    return {"distribution": distribution, "work": work, "saturating_units": full, "rows": rows}


# --- the page ---------------------------------------------------------------------------------------------------------


def write_charts(results: dict[str, Any]) -> None:
    """The page's pictures."""
    frames = results["frames"]
    macro = {row["module"]: row for row in frames["macro"]["modules"]}
    rows = frames["compact"]["modules"][:SHOWN]
    names = [short(row["module"]) for row in rows]
    steps = {
        "macro": [macro[row["module"]]["steps"] / 1e6 for row in rows],
        "compact": [row["steps"] / 1e6 for row in rows],
    }
    bar_chart(IMAGES / "pu-steps.png", names, steps, "million steps, without the modules that are called")
    busy = {
        "macro": [macro[row["module"]]["fpp_busy"] for row in rows],
        "compact": [row["fpp_busy"] for row in rows],
    }
    bar_chart(IMAGES / "pu-busy.png", names, busy, "mean number of busy FPPs, of four", mark=(3.0, "QA-2"))
    ways = {way_name(way): way["rows"] for way in results["shared"]}
    efficiency_chart(IMAGES / "pu-efficiency.png", ways)


def write_page(results: dict[str, Any]) -> None:
    """The page: the template, with its tables filled in."""
    tables = {
        "frame": frame_table(results["frames"]),
        "modules": module_table(results["frames"]),
        "efficiency": efficiency_table(results["shared"]),
        "imbalance": imbalance_table(results["shared"]),
        "alone": alone_table(results["modules"]),
    }
    compact = results["frames"]["compact"]
    values = {
        "machine": "{processor}, {cores} cores, {lanes} lanes; load {load} when it began".format(**results["machine"]),
        "ratio": f"{results['frames']['macro']['steps'] / compact['steps']:.2f}",
        "busy": f"{compact['fpp_busy']:.2f}",
        "clock": f"{compact['clock_megahertz']:g}",
        "scene_rows": f"{compact['scene_rows']:,}",
        "rows_per_step": compact["rows_per_step"],
        "request_steps": compact["request_steps"],
        "display_steps": compact["display_steps"],
        "display_units": f"{compact['saturating_units']['display_memory']:,.0f}",
        "control_units": f"{way_of(results['shared'], 'dynamic', 1)['saturating_units']['control_processor']:,.0f}",
    }
    PAGE.write_text(TEMPLATE.read_text().format(**values, **{name: table.markdown() for name, table in tables.items()}))
    print(f"written: {PAGE.relative_to(ROOT)}")


def frame_table(frames: dict[str, Any]) -> Table:
    table = Table(f"{SCENE}, {SIZE} x {SIZE} pixels, depth 5, one processor unit", ["", *SCHEDULES])
    for name, value in (
        ("microinstructions", lambda frame: f"{frame['words']:,}"),
        ("steps", lambda frame: f"{frame['steps']:,}"),
        ("steps per pixel, least", lambda frame: f"{frame['steps_per_pixel']['min']:,}"),
        ("median", lambda frame: f"{frame['steps_per_pixel']['typical']:,.0f}"),
        ("mean", lambda frame: f"{frame['steps_per_pixel']['mean']:,.0f}"),
        ("most", lambda frame: f"{frame['steps_per_pixel']['max']:,}"),
        ("busy FPPs, of four", lambda frame: f"{frame['fpp_busy']:.2f}"),
        *((f"busy share: {unit}", lambda frame, unit=unit: f"{frame['busy'][unit]:.1%}") for unit in SHARES),
        ("seconds", lambda frame: f"{frame['seconds']:.0f}"),
    ):
        table.add(name, *(value(frames[schedule]) for schedule in SCHEDULES))
    return table


SHARES = ("x", "y", "z", "s", "alu", "tab", "ag", "mem")
"""Units of the processor unit whose busy share is shown."""


def module_table(frames: dict[str, Any]) -> Table:
    columns = ["module", "words", "steps, macro", "steps, compact", "ratio", "share", "busy FPPs, macro", "compact"]
    table = Table("Steps of the frame by module, without those of the modules that it calls", columns)
    macro = {row["module"]: row for row in frames["macro"]["modules"]}
    for row in frames["compact"]["modules"]:
        before = macro[row["module"]]
        if row["steps"]:
            ratio = f"{before['steps'] / row['steps']:.2f}"
            shown = (f"{row['words']:,}", f"{before['steps']:,}", f"{row['steps']:,}", ratio, f"{row['share']:.1%}")
            table.add(short(row["module"]), *shown, f"{before['fpp_busy']:.2f}", f"{row['fpp_busy']:.2f}")
    return table


def efficiency_table(shared: Sequence[dict[str, Any]]) -> Table:
    heads = [way_name(way) for way in shared]
    table = Table("Efficiency T(1) / (N T(N)), schedule compact", ["N", *heads])
    for i, units in enumerate(UNITS):
        table.add(units, *(f"{way['rows'][i]['efficiency']:.2%}" for way in shared))
    return table


def imbalance_table(shared: Sequence[dict[str, Any]]) -> Table:
    columns = ["distribution", "most work / mean", "of the time: working", "asking the CP", "at the display memory"]
    table = Table(f"Where the time of {UNITS[-1]} units goes", columns)
    for way in shared:
        row = way["rows"][-1]
        shares = (f"{row[name]:.2%}" for name in ("busy_share", "request", "display"))
        table.add(way_name(way), f"{row['most_work']:.3f}", *shares)
    return table


def alone_table(modules: Sequence[dict[str, Any]]) -> Table:
    columns = ["module", "no.", "words", "steps: least", "typical", "most", "compact: words", "typical", "CPU cycles"]
    table = Table("Modules alone", columns)
    for row in modules:
        macro, compact = row["pu"], row["pu"]["compact"]
        if macro["words"] is None:
            continue
        steps = (macro["steps"][name] for name in ("min", "typical", "max"))
        number = "" if row["number"] is None else f"{row['number']} ({row['method']})"
        fast = (compact["words"], compact["steps"]["typical"], f"{row['cpu']['cycles']:.1f}")
        table.add(short(row["qualified_name"]), number, macro["words"], *steps, *fast)
    return table


def way_of(shared: Sequence[dict[str, Any]], distribution: Distribution, work: Work) -> dict[str, Any]:
    """What one way of distributing work came to."""
    return next(way for way in shared if (way["distribution"], way["work"]) == (distribution, work))


def way_name(way: dict[str, Any]) -> str:
    """One way of distributing work, for people."""
    return f"{way['distribution']}, {way['work']}{'' if way['work'] == 'scanline' else ' px'}"


def short(module: str) -> str:
    return module.removeprefix("tasuki.modules.") or "from pixel to pixel"


if __name__ == "__main__":
    main()
