"""The command line: thin, it calls the public interface.

Messages go to standard error. Exit codes: 0, 2 for anything wrong, 130 after Ctrl-C. Start-up matters: everything that
costs is imported inside the command that needs it.
"""

from __future__ import annotations

import json
import os
import re
import signal
import sys
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from tasuki.diagnostics import Diagnostic, MachineError, OutputError, TasukiError
from tasuki.version import __version__

WRONG = 2
INTERRUPTED = 130
BROKEN_PIPE = 141

app = typer.Typer(
    name="tasuki",
    help="A laboratory for image generation.",
    add_completion=False,
    no_args_is_help=True,
    # Plain help and errors: Rich's take twice as long to import as all of this.
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Debug = Annotated[bool, typer.Option("--debug", help="Show tracebacks of errors.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
SceneFile = Annotated[
    Path, typer.Argument(metavar="SCENE", help="A scene: .yaml, .nff, or a mesh.", show_default=False)
]
Microcode = Annotated[
    Path, typer.Argument(metavar="FILE", help="Microcode: a .macro or .meta file.", show_default=False)
]
WithFiles = Annotated[
    list[Path] | None,
    typer.Option("--with", metavar="FILE.py", help="Run this file first: what it registers is known. Repeatable."),
]

AllowOutside = Annotated[
    bool, typer.Option("--allow-outside", help="Let the scene name files outside its folder, such as meshes.")
]


def main() -> None:
    """What `tasuki` runs."""
    # The commands handle what goes wrong in them; this is for what happens before and after.
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    except OSError as error:
        _abandon_output()
        print(f"error: {error}", file=sys.stderr)
        sys.exit(WRONG)
    finally:
        # We are leaving: a second Ctrl-C would only change the exit code.
        signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def reported(debug: bool = False) -> Iterator[None]:
    """Whatever goes wrong inside becomes a message on standard error and an exit code; with `debug` a traceback."""
    try:
        yield
        if sys.stdout:
            sys.stdout.flush()
    except typer.Exit:
        raise
    except BrokenPipeError:
        # Whoever read our output has gone: no fault of ours, nor one to tell.
        _abandon_output()
        raise typer.Exit(BROKEN_PIPE) from None
    except KeyboardInterrupt:
        print("stopped", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None
    except Exception as error:
        if debug:
            traceback.print_exc()
        elif isinstance(error, TasukiError):
            print(error, file=sys.stderr)
        elif isinstance(error, OSError):
            _abandon_output()
            print(f"error: {error}", file=sys.stderr)
        else:
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            print(f"internal error: {reason}; run with --debug to see where", file=sys.stderr)
        raise typer.Exit(WRONG) from None


def _abandon_output() -> None:
    """What could not be written to standard output is given up, so that Python does not try, and complain, at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"tasuki {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    pass


@app.command()
def render(
    scene: SceneFile,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="OUT", help="A .png or .exr; by default SCENE.png in this folder."),
    ] = None,
    method: Annotated[str, typer.Option(metavar="raytrace|scanline")] = "raytrace",
    machine: Annotated[str, typer.Option(metavar="cpu|pu|python|gpu")] = "cpu",
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Pixels; by default what the scene says.")] = None,
    samples: Annotated[int, typer.Option(metavar="N", help="Rays through each pixel.")] = 1,
    depth: Annotated[int, typer.Option(metavar="N", help="Generations of rays, the eye ray counted.")] = 5,
    cutoff: Annotated[
        float, typer.Option(metavar="WEIGHT", help="Follow no ray that weighs this or less in its pixel.")
    ] = 0.0,
    threads: Annotated[int | None, typer.Option(metavar="N", help="By default one for each processor.")] = None,
    accelerator: Annotated[
        str, typer.Option(metavar="NAME", help="How rays find what they hit: bvh, extents, or yours.")
    ] = "bvh",
    region: Annotated[
        str | None, typer.Option(metavar="X,Y,W,H", help="Render this part only; in pixels, from the upper left.")
    ] = None,
    modules: Annotated[
        list[str] | None,
        typer.Option("--module", metavar="SOCKET=FILE.py:NAME", help="Fill a socket with your module. Repeatable."),
    ] = None,
    with_files: WithFiles = None,
    allow_outside: AllowOutside = False,
    unchecked: Annotated[bool, typer.Option(help="Do not check your modules' accesses to tables.")] = False,
    pus: Annotated[int, typer.Option(metavar="N", help="Machine pu: processor units.")] = 1,
    schedule: Annotated[
        str, typer.Option(metavar="macro|compact", help="Machine pu: each macro on its own, or overlapping.")
    ] = "compact",
    clock: Annotated[float, typer.Option(metavar="MHZ", help="Machine pu: million steps a second.")] = 5.0,
    distribution: Annotated[
        str, typer.Option(metavar="static|dynamic", help="Machine pu: how processor units come by their work.")
    ] = "dynamic",
    work: Annotated[
        str, typer.Option(metavar="N|scanline", help="Machine pu: pixels that a unit gets at a time.")
    ] = "4",
    microcode: Annotated[
        list[str] | None,
        typer.Option(metavar="MODULE=FILE", help="Machine pu: your microcode for a module. Repeatable."),
    ] = None,
    stats: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write counts and timings.")] = None,
    profile: Annotated[bool, typer.Option("--profile", help="Show the cycles, or steps, of each module.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")] = False,
    debug: Debug = False,
) -> None:
    """Render a scene into a picture."""
    arguments: dict[str, Any] = {
        "method": method,
        "machine": machine,
        "size": _numbers(size, r"(\d+)x(\d+)", "--size", "WxH, such as 512x512"),
        "region": _numbers(region, r"(\d+),(\d+),(\d+),(\d+)", "--region", "X,Y,W,H, such as 0,0,64,64"),
        "modules": _by_name(modules or [], "--module", "SOCKET=FILE.py:NAME", "socket {!r} is filled twice"),
        "with_files": with_files or [],
        "allow_outside": allow_outside,
        "accelerator": accelerator,
        "samples": samples,
        "depth": depth,
        "cutoff": cutoff,
        "threads": threads,
        "unchecked": unchecked,
        "profile": profile,
        "pus": pus,
        "schedule": schedule,
        "clock": clock,
        "distribution": distribution,
        "work": int(work) if work.isdecimal() else work,
        "microcode": _by_name(microcode or [], "--microcode", "MODULE=FILE", "two files stand in for {!r}"),
        "count": stats is not None,
    }
    with reported(debug):
        from tasuki.renderers.files import check_writable

        out = check_writable(output or Path(f"{scene.stem}.png"))
        if stats and check_writable(stats, suffixes=()).resolve() == out.resolve():
            raise OutputError(str(Diagnostic("the report would overwrite the picture", found=str(stats))))
        _render(scene, out, stats, arguments, quiet)


def _render(scene: Path, out: Path, stats: Path | None, arguments: dict[str, Any], quiet: bool) -> None:
    from tasuki.renderers.files import write_file
    from tasuki.renderers.render import Interrupted
    from tasuki.renderers.render import render as render_scene
    from tasuki.terminal import ProgressDisplay, print_profile, print_pu_profile, summary

    try:
        with ProgressDisplay(shown=not quiet) as progress:
            picture = render_scene(scene, progress=progress.tell, **arguments)
    except Interrupted as interrupted:
        partial = out.with_suffix(f".partial{out.suffix}")
        interrupted.picture.save(partial)
        print(f"stopped; what was done is in {partial}", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None
    if not quiet:
        print(*picture.stats["scene"]["warnings"], sep="\n", end="", file=sys.stderr)
    picture.save(out)
    picture.stats["seconds"]["total"] = process_seconds()
    if stats:
        write_file(stats, json.dumps(picture.stats, indent=2).encode() + b"\n")
    if arguments["profile"] and picture.stats["pu"]:
        print_pu_profile(picture.stats["pu"])
    elif arguments["profile"]:
        print_profile(picture.stats["profile"])
    if not quiet:
        print(summary(out, picture.width, picture.height, picture.stats))


@app.command()
def info(
    scene: SceneFile,
    with_files: WithFiles = None,
    allow_outside: AllowOutside = False,
    as_json: AsJson = False,
    debug: Debug = False,
) -> None:
    """Say what is in a scene."""
    with reported(debug):
        from tasuki.renderers.extensions import load_extensions
        from tasuki.renderers.info import info as scene_info
        from tasuki.scene import load_scene
        from tasuki.terminal import print_info

        load_extensions(with_files or [])
        content = scene_info(load_scene(scene, allow_outside=allow_outside))
        if as_json:
            print(json.dumps(content, indent=2))
        else:
            print_info(content)


@app.command()
def convert(
    scene: SceneFile,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="A .yaml, .glb, .stl or .obj file.", show_default=False)],
    tolerance: Annotated[
        float, typer.Option("--tolerance", metavar="SHARE", help="Of curved surfaces in meshes, of the scene's size.")
    ] = 1.0 / 4096.0,
    with_files: WithFiles = None,
    allow_outside: AllowOutside = False,
    debug: Debug = False,
) -> None:
    """Write a scene in another format: our own, or all that is bounded in it as a mesh."""
    with reported(debug):
        from tasuki.renderers.extensions import load_extensions
        from tasuki.renderers.files import check_writable, write_file
        from tasuki.scene import load_scene
        from tasuki.scene.exporters import FORMATS, exported

        if not 0.0 < tolerance < 1.0:
            expected = "more than 0, less than 1"
            raise TasukiError(f"error: --tolerance is out of range\n  expected: {expected}\n  found: {tolerance:g}")
        load_extensions(with_files or [])
        check_writable(out, FORMATS)
        content = exported(load_scene(scene, allow_outside=allow_outside), out, tolerance)
        write_file(out, content)
        print(f"{out}: {len(content):,} bytes")


@app.command()
def modules(
    as_json: AsJson = False,
    cycles: Annotated[bool, typer.Option("--cycles", help="Measure cycles and PU steps; --json does so too.")] = False,
    with_files: WithFiles = None,
    debug: Debug = False,
) -> None:
    """List all modules that are installed."""
    with reported(debug):
        from tasuki.catalogue import all_modules, describe
        from tasuki.terminal import ProgressDisplay, print_modules

        with ProgressDisplay() as progress:
            found = all_modules(with_files or [])
            rows = describe(
                found, measured=cycles or as_json, progress=lambda share: progress.tell("measuring modules", share)
            )
        if as_json:
            print(json.dumps(rows, indent=2))
        else:
            print_modules(rows, cycles)


@app.command()
def explain(
    module: Annotated[
        str, typer.Argument(metavar="MODULE", help="A name that `tasuki modules` lists, or FILE.py:NAME.")
    ],
    sections: Annotated[
        list[str] | None,
        typer.Option("--section", metavar="ir|lanes|llvm|assembly", help="Show this part only. Repeatable."),
    ] = None,
    with_files: WithFiles = None,
    debug: Debug = False,
) -> None:
    """Show a module's IR, what varies over lanes and why, and its code."""
    with reported(debug):
        from tasuki.catalogue import find_module
        from tasuki.explain import SECTIONS
        from tasuki.explain import explain as explanation

        unknown = ", ".join(repr(section) for section in sections or [] if section not in SECTIONS)
        if unknown:
            raise TasukiError(f"error: there is no section {unknown}\n  expected: {', '.join(SECTIONS)}")
        found = find_module(module, with_files or [])
        print(explanation(found, sections) if sections else explanation(found))


@app.command()
def macros(
    as_json: AsJson = False,
    values: Annotated[int, typer.Option(metavar="N", min=1, help="Operands to measure each macro on.")] = 1 << 20,
    debug: Debug = False,
) -> None:
    """Show Table 1: published steps, the steps that the simulator took, and measured errors."""
    with reported(debug):
        from tasuki.machines.pu.table1 import table
        from tasuki.terminal import ProgressDisplay, print_macros

        with ProgressDisplay() as progress:
            rows = table(values=values, progress=lambda share: progress.tell("running macros", share))
        if as_json:
            print(json.dumps(rows, indent=2))
        else:
            print_macros(rows)


@app.command()
def asm(
    file: Microcode,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="OUT", help="By default standard output.")
    ] = None,
    emit: Annotated[str, typer.Option(metavar="macro|meta|listing|hex|binary", help="What to write.")] = "listing",
    debug: Debug = False,
) -> None:
    """Assemble microcode."""
    with reported(debug):
        from tasuki.machines.pu.sources import assemble
        from tasuki.renderers.files import check_writable, write_file

        if output:
            check_writable(output, suffixes=())
        content = assemble(file).written(emit)
        if output:
            write_file(output, content)
        else:
            sys.stdout.buffer.write(content)


@app.command()
def run(
    file: Microcode,
    trace: Annotated[bool, typer.Option("--trace", help="Print what every step did.")] = False,
    vcd: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a value change dump, as for GTKWave.")] = None,
    limit: Annotated[int | None, typer.Option(metavar="N", min=1, help="Stop with an error after N steps.")] = None,
    memory: Annotated[
        str | None, typer.Option(metavar="FIRST,COUNT", help="Afterwards print these rows of data memory.")
    ] = None,
    debug: Debug = False,
) -> None:
    """Run microcode on the simulated processor unit; print its steps and how busy its units were."""
    rows = _numbers(memory, r"(\d+),(\d+)", "--memory", "FIRST,COUNT, such as 0,16")
    with reported(debug):
        from tasuki.machines.pu.simulate import run as simulate
        from tasuki.machines.pu.sources import assemble
        from tasuki.renderers.files import check_writable, written_aside
        from tasuki.terminal import print_rows

        if vcd:
            check_writable(vcd, suffixes=())
        program = assemble(file).program
        shown = sys.stdout if trace else None
        if vcd:
            trap = None
            with written_aside(vcd) as aside, aside.open("w", encoding="ascii") as dump:
                try:
                    outcome = simulate(program, limit=limit, trace=shown, vcd=dump)
                except MachineError as error:
                    trap = error  # after the dump has got its name: what led to a trap is what it is wanted for
            if trap:
                raise trap
        else:
            outcome = simulate(program, limit=limit, trace=shown)
        print(outcome.report())
        if rows:
            print_rows(outcome.state.memory, *rows)


@app.command()
def schema(with_files: WithFiles = None, debug: Debug = False) -> None:
    """Print the JSON Schema of the scene format."""
    with reported(debug):
        from tasuki.renderers.extensions import load_extensions
        from tasuki.scene.schema import scene_schema

        load_extensions(with_files or [])
        print(json.dumps(scene_schema(), indent=2))


# --- reading options --------------------------------------------------------------------------------------------------


def _numbers(text: str | None, pattern: str, option: str, expected: str) -> tuple[int, ...] | None:
    if text is None:
        return None
    found = re.fullmatch(pattern, text.strip(), re.ASCII)
    if not found:
        raise typer.BadParameter(f"expected {expected}; found {text!r}", param_hint=option)
    return tuple(int(number) for number in found.groups())


def _by_name(given: list[str], option: str, form: str, twice: str) -> dict[str, str]:
    """{name: value} of an `option` that is given as NAME=VALUE again and again; `twice` says that a name is."""
    values: dict[str, str] = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise typer.BadParameter(f"expected {form}; found {text!r}", param_hint=option)
        if name in values:
            raise typer.BadParameter(twice.format(name), param_hint=option)
        values[name] = value
    return values


def process_seconds() -> float:
    """Seconds since this process was started."""
    try:
        # The 22nd field of the line, counted after the name in parentheses, which may hold anything: clock ticks from
        # the start of the system to that of the process.
        fields = Path("/proc/self/stat").read_text().rpartition(")")[2].split()
        began = int(fields[19]) / os.sysconf("SC_CLK_TCK")
        return time.clock_gettime(time.CLOCK_BOOTTIME) - began
    except (OSError, ValueError, AttributeError):
        # No such file: since this module was imported, some milliseconds later.
        return time.perf_counter() - _IMPORTED


_IMPORTED = time.perf_counter()
