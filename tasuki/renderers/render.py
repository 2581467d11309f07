"""`tasuki.render`: from a scene, or the file that it stands in, to a picture and a report of how it was made.

Nothing expensive is imported before the arguments have been checked.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from tasuki.diagnostics import Diagnostic, LinkError, SceneError
from tasuki.renderers.options import Region, RenderOptions
from tasuki.version import __version__

if TYPE_CHECKING:
    from tasuki.language.declare import Module, Socket
    from tasuki.machines.cpu.machine import EdgeProfile
    from tasuki.programs import Filler
    from tasuki.renderers.picture import Picture
    from tasuki.renderers.raytrace import RayTracer
    from tasuki.renderers.scanline import ScanlineRenderer
    from tasuki.scene.model import Scene

METHODS = {"raytrace": True, "scanline": True}
"""The methods, and whether this version has them."""
MACHINES = {"cpu": True, "python": True, "pu": True, "gpu": False}
"""The machines, and whether this version has them."""
PROFILED = ("cpu", "pu")
"""The machines that can say what each module cost."""

Progress = Callable[[str, float | None], None]
"""Called now and then with what is being done ("loading", "preparing", "rendering"), and the share of it done, 0..1."""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C while pixels were being rendered. `picture` has those that are done; the others are black, coverage 0."""

    def __init__(self, picture: Picture) -> None:
        super().__init__()
        self.picture = picture


def render(
    scene: Scene | str | Path,
    *,
    method: str = "raytrace",
    machine: str = "cpu",
    size: tuple[int, int] | None = None,
    samples: int = 1,
    depth: int = 5,
    cutoff: float = 0.0,
    threads: int | None = None,
    region: Region | tuple[int, int, int, int] | None = None,
    modules: Mapping[str, Module | str] | None = None,
    with_files: Sequence[str | Path] = (),
    allow_outside: bool = False,
    accelerator: str = "bvh",
    unchecked: bool = False,
    profile: bool = False,
    count: bool = False,
    pus: int = 1,
    schedule: str = "compact",
    clock: float = 5.0,
    distribution: str = "dynamic",
    work: int | str = 4,
    microcode: Mapping[str, str | Path] | None = None,
    progress: Progress | None = None,
) -> Picture:
    """A picture of a scene, or of the scene in a file.

    `method` "scanline" decides row by row what shows, faster than rays find it: shadows, mirrors and glass are left
    out; what is no polygon becomes triangles (`tasuki.scene.tessellate`), for which it must be bounded.
    `size` is (width, height) in pixels, by default the scene's resolution; `region` (x, y, width, height) is the part
    of it that is rendered, counted from the upper left corner. `samples` rays go through each pixel, and `depth`
    generations of rays are followed, the eye ray counted; not those whose weight is `cutoff` or less, which makes
    pictures with much glass far faster (1/500 is not seen in 8 bits). `threads`: by default one for each processor;
    their number does not change the picture. `machine` "python" runs the modules' own source, one pixel after another:
    slow, and open to any debugger; the picture is the same. `machine` "pu" is the paper's: `pus` processor units,
    simulated, of `clock` million steps a second; the `schedule` of their microcode is "macro" or "compact"; they get
    `work`, so many pixels or a "scanline" at a time, by "static" or "dynamic" `distribution`; for the modules that
    `microcode` names, files of macro assembler text stand in (docs/pu-compiler.md, "By hand"). `modules` fills
    sockets, by name, with modules of yours, given as they are or as "FILE.py:NAME". `with_files` are run first: they
    register solids, surfaces, textures and accelerators of yours. The files that a scene's file names lie in its
    folder, or deeper, unless `allow_outside`. `accelerator` keeps the search for hits short; it does not change the
    picture. Where modules of yours take part, accesses to tables are checked unless `unchecked`. `profile`
    tells what modules cost: on the CPU it times them, on one thread. `count`: afterwards some pixels are traced once
    more, by the CPU, to count the intersection tests and the steps that a ray takes (`stats["search"]`, see
    `tasuki.renderers.search_counts`).

    `Picture.stats` tells what was made of what, how many rays were sent, and where the time went. Raises SceneError,
    LinkError, SourceError or MachineError, and `Interrupted` on Ctrl-C.
    """
    started = perf_counter()
    _check_known("method", method, METHODS)
    _check_known("machine", machine, MACHINES)
    if profile and machine not in PROFILED:
        expected = " or ".join(PROFILED)
        raise SceneError(str(Diagnostic("this machine cannot be profiled", expected=expected, found=machine)))
    options_for = partial(
        _options,
        machine=machine,
        samples=samples,
        depth=depth,
        cutoff=cutoff,
        threads=threads,
        region=region,
        unchecked=unchecked,
        profile=profile,
        count=count,
        accelerator=accelerator,
        pus=pus,
        schedule=schedule,
        clock=clock,
        distribution=distribution,
        work=work,
        microcode={name: Path(file) for name, file in (microcode or {}).items()},
    )
    # A size that was given is checked before anything is loaded.
    options = options_for(size) if size else None
    _bring(with_files, accelerator)
    fillers = _resolve(modules or {}, method)
    tell = progress or (lambda doing, share: None)
    tell("loading", None)
    loaded, loading = _load(scene, allow_outside)
    options = options or options_for(loaded.camera.resolution)
    tell("preparing", None)
    try:
        picture = _make(method, loaded, options, fillers, tell)
    except MemoryError:
        message = f"not enough memory for {options.region.width} x {options.region.height} pixels and the scene"
        raise SceneError(str(Diagnostic(message, hint="render it in parts, with a region"))) from None
    picture.stats["scene"]["file"] = None if loaded is scene else str(scene)
    picture.stats["seconds"] |= {"load": loading, "total": perf_counter() - started}
    return picture


def _options(size: tuple[int, int], *, region: Any, threads: int | None, **others: Any) -> RenderOptions:
    width, height = _numbers("size", size, "(width, height)", 2)
    if threads is not None and not (isinstance(threads, int) and threads >= 1):
        raise SceneError(str(Diagnostic("threads is out of range", expected="1 or more", found=str(threads))))
    part = region
    if region is not None and not isinstance(region, Region):
        part = Region(*_numbers("region", region, "(x, y, width, height)", 4))
    if part is None:
        return RenderOptions(width, height, threads=threads or 0, **others)
    if part.width < 1 or part.height < 1:
        expected, found = "a width and height of 1 or more", f"{part.x},{part.y},{part.width},{part.height}"
        raise SceneError(str(Diagnostic("the region is empty", expected=expected, found=found)))
    return RenderOptions(width, height, threads=threads or 0, region=part, **others)


def _numbers(what: str, given: Any, expected: str, count: int) -> Sequence[int]:
    """`given` as it is; whether its members are numbers is checked by who takes them."""
    if not (isinstance(given, Sequence) and not isinstance(given, str) and len(given) == count):
        raise SceneError(str(Diagnostic(f"this is no {what}", expected=expected, found=repr(given))))
    return given


def _check_known(what: str, name: str, known: Mapping[str, bool]) -> None:
    available = ", ".join(one for one, here in known.items() if here)
    if name not in known:
        raise SceneError(str(Diagnostic(f"unknown {what} {name!r}", expected=available, found=repr(name))))
    if not known[name]:
        message = f"this version of Tasuki has not the {what} {name!r} yet"
        raise SceneError(str(Diagnostic(message, expected=available, found=name)))


def _bring(files: Sequence[str | Path], accelerator: str) -> None:
    """Have what users bring registered; SceneError where there is no such accelerator then."""
    if files:
        from tasuki.renderers.extensions import load_extensions

        load_extensions(files)
    from tasuki.renderers.accelerators import lookup

    lookup(accelerator)


def _load(scene: Scene | str | Path, allow_outside: bool) -> tuple[Scene, float]:
    """The scene, and the seconds that reading it took; importing what reads it is not counted."""
    from tasuki.scene.importers import load_scene
    from tasuki.scene.model import Scene

    if isinstance(scene, Scene):
        return scene, 0.0
    if not isinstance(scene, str | Path):
        expected = "a Scene, or the name of a file"
        raise SceneError(str(Diagnostic("this is no scene", expected=expected, found=repr(scene))))

    started = perf_counter()
    return load_scene(scene, allow_outside=allow_outside), perf_counter() - started


# --- modules that fill sockets ----------------------------------------------------------------------------------------


def _resolve(given: Mapping[str, Module | str], method: str) -> dict[str, Module]:
    """The modules that are to fill sockets, each held against its socket. LinkError with all that do not fit."""
    if not given:
        return {}
    from tasuki.language.declare import Module
    from tasuki.language.link import mismatch
    from tasuki.language.load import resolve_module

    modules = {name: resolve_module(one) if isinstance(one, str) else one for name, one in given.items()}
    for name, one in modules.items():
        if not isinstance(one, Module):
            expected = "a module, or FILE.py:NAME"
            raise LinkError(str(Diagnostic(f"this cannot fill socket `{name}`", expected=expected, found=repr(one))))
    sockets = _sockets(method, modules)
    fillable = ", ".join(sorted(name for name, socket in sockets.items() if not socket.dispatch))
    problems: list[Diagnostic] = []
    for name, module in modules.items():
        socket = sockets.get(name)
        if socket is None:
            message = f"there is no socket `{name}` for `{module.name}` to fill"
            problems.append(Diagnostic(message, expected=fillable, found=name))
        elif socket.dispatch:
            message = f"socket `{name}` takes a module for each kind of primitive, and `{module.name}` is only one"
            problems.append(Diagnostic(message, module.place, expected=fillable, found=name))
        elif (found := mismatch(module, socket)) is not None:
            problems.append(found)
    if problems:
        raise LinkError("\n\n".join(map(str, problems)))
    return modules


def _sockets(method: str, modules: Mapping[str, Module]) -> Mapping[str, Socket]:
    """The sockets that a method's modules reach, by name, where `modules` fill some of them."""
    from tasuki.language.link import reached_sockets

    if method == "scanline":
        from tasuki.modules.scanline.luminance import draw_pixel
        from tasuki.renderers.scanline import FILLERS

        return reached_sockets(draw_pixel, {**FILLERS, **modules})

    from tasuki.modules.raytrace import trace_pixel
    from tasuki.renderers.fillers import Traits, default_fillers
    from tasuki.scene.kinds import kinds

    return reached_sockets(trace_pixel, {**default_fillers(Traits.of_all(kinds())), **modules})


# --- one picture ------------------------------------------------------------------------------------------------------


def _make(method: str, scene: Scene, options: RenderOptions, fillers: Mapping[str, Module], tell: Progress) -> Picture:
    from tasuki.programs import REPORT
    from tasuki.renderers.picture import Picture

    compiled_before = REPORT.seconds
    renderer = _renderer(method, options.machine)(scene, options, fillers)
    compiling = REPORT.seconds - compiled_before
    try:
        pixels = renderer.render(lambda share: tell("rendering", share))
        search = _search(renderer, tell)
    except KeyboardInterrupt:
        raise Interrupted(Picture(renderer.pixels())) from None
    picture = Picture(pixels, _stats(method, renderer) | search)
    picture.stats["seconds"] = {
        "load": None,
        "build": renderer.seconds["build"],
        "compile": compiling,
        "render": renderer.seconds["render"],
        "write": None,
        "total": None,
    }
    return picture


def _renderer(method: str, machine: str) -> type[RayTracer] | type[ScanlineRenderer]:
    if (method, machine) == ("scanline", "pu"):
        from tasuki.renderers.scanline_pu import MicrocodeScanline

        return MicrocodeScanline

    if method == "scanline":
        from tasuki.renderers.scanline import ScanlineRenderer

        return ScanlineRenderer

    from tasuki.renderers.raytrace import RayTracer

    return RayTracer


def _search(renderer: RayTracer | ScanlineRenderer, tell: Progress) -> dict[str, Any]:
    """What is to be reported of the search for hits, if that is to be counted, and there is one.

    The CPU counts, and traces into the same picture: nothing changes where it has made the picture itself.
    """
    from tasuki.renderers.raytrace import RayTracer

    if not (renderer.options.count and isinstance(renderer, RayTracer)) or renderer.microcode:
        return {}
    from tasuki.renderers.search_counts import search_counts

    tell("counting", None)
    return {"search": search_counts(renderer)}


def _stats(method: str, renderer: RayTracer | ScanlineRenderer) -> dict[str, Any]:
    """What the report says of the scene, the rays, the machine and the modules."""
    scene, options, region = renderer.scene, renderer.options, renderer.options.region
    stats: dict[str, Any] = {
        "version": __version__,
        "method": method,
        "scene": {
            "file": None,
            "size": [options.width, options.height],
            "region": [region.x, region.y, region.width, region.height],
            "samples": options.samples,
            "depth": options.depth,
            "shapes": len(scene.shapes),
            "lights": len(scene.lights),
            "materials": len(scene.materials),
            "warnings": list(scene.warnings),
            **renderer.counts(),
        },
        "rays": renderer.ray_counts(),
        "machine": _machine(renderer),
        "modules": _modules(renderer.fillers()),
        "pu": _processor_units(renderer),
    }
    if options.profile and options.machine == "cpu":
        stats["profile"] = profile_rows(renderer.profile())
    return stats


def _machine(renderer: RayTracer | ScanlineRenderer) -> dict[str, Any]:
    from tasuki.native.compile import host, lanes

    options = renderer.options
    if options.machine == "python":
        return {"name": "python", "version": sys.version.split()[0], "lanes": 1, "threads": 1}
    if options.machine == "pu":
        return {"name": "pu", "processor": "processor unit", "lanes": 1, "threads": 1}
    threads = 1 if options.profile else options.threads
    return {"name": "cpu", "processor": host().cpu, "lanes": lanes(), "threads": threads}


def _processor_units(renderer: RayTracer | ScanlineRenderer) -> dict[str, Any] | None:
    """What the picture took on processor units, if it was made by them."""
    if renderer.options.machine != "pu":
        return None
    from tasuki.renderers.raytrace import RayTracer
    from tasuki.renderers.scanline_pu import MicrocodeScanline

    if isinstance(renderer, MicrocodeScanline):
        return renderer.report()
    assert isinstance(renderer, RayTracer)
    assert renderer.microcode
    return renderer.microcode.report()


def _modules(fillers: Mapping[str, Filler]) -> list[dict[str, Any]]:
    """The modules that filled sockets, and the kind of primitive where there is one for each."""
    from tasuki.modules.search import OBJECT
    from tasuki.scene.kinds import kinds

    rows = []
    names = {kind.number: kind.name for kind in kinds()} | {OBJECT: "object"}
    for socket, filler in sorted(fillers.items()):
        pairs: list[tuple[Module, str | None]]
        if isinstance(filler, Sequence):
            pairs = [(case.module, names.get(case.number)) for case in filler]
        else:
            pairs = [(filler, None)]
        for module, kind in pairs:
            row = {"socket": socket, "kind": kind, "name": module.name, "file": module.file}
            rows.append({"number": module.number, "method": module.method, **row})
    return rows


def profile_rows(edges: Sequence[EdgeProfile]) -> list[dict[str, Any]]:
    """What a profiled run spent in each module, the most expensive first.

    `cycles` are those of the module and all that it calls; `own` is the share of the whole that it spent itself.
    `lanes` counts the lanes that were active in all calls together. The entry is not called by a module: left out.
    """
    rows: dict[str, dict[str, Any]] = {}
    own: dict[str, int] = {}
    for edge in edges:
        row = rows.setdefault(edge.callee, {"module": edge.callee, "calls": 0, "lanes": 0, "cycles": 0})
        row["calls"] += edge.calls
        row["lanes"] += edge.lanes
        row["cycles"] += edge.cycles
        own[edge.callee] = own.get(edge.callee, 0) + edge.cycles
        own[edge.caller] = own.get(edge.caller, 0) - edge.cycles
    total = sum(own[name] for name in rows) or 1
    for name, row in rows.items():
        row["own"] = own[name] / total
    return sorted((row for row in rows.values() if row["calls"]), key=lambda row: -row["own"])
