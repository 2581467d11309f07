"""From a module to running code: linking, lowering and compiling, each skipped where a cache knows the outcome.

Two levels on disk. The first goes from everything that a program is made of (sources, sockets and what fills them,
options, this package, this processor) to what the host must know and the key of the object: a warm start neither parses
nor checks a module. The second goes from the digest of the canonical IR to object code: what changes no meaning, such
as the name of a variable, compiles nothing. Imported by `mapping`, the renderers and the command line.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from tasuki.diagnostics import SourceError
from tasuki.language.declare import Case, Module
from tasuki.language.identity import Identities
from tasuki.native import cache as disk
from tasuki.native.compile import compile_object, host, lanes
from tasuki.version import __version__

if TYPE_CHECKING:
    from tasuki.ir.nodes import Program
    from tasuki.machines.cpu.launch import Binding
    from tasuki.machines.cpu.machine import Executable

Filler = Module | Sequence[Case]
COMPILER = ("ir", "native", "machines")
"""Folders whose sources decide what machine code a checked program becomes."""


@dataclass(frozen=True)
class Options:
    """How a program is compiled for the CPU."""

    bindings: tuple[Binding, ...]
    """For each parameter of the entry how items reach it; see `tasuki.machines.cpu.launch`."""
    width: int = 0
    """Lanes of a packet; 0: what suits this processor."""
    checked: bool = True
    """Whether every access to a table is checked."""
    profile: bool = False
    """Whether modules stay calls, and are timed; in packets of one lane they are counted only."""


@dataclass
class CompileReport:
    """What compiling took, in seconds, and how often a cache made it unnecessary; summed over a process."""

    seconds: float = 0.0
    programs: int = 0
    linked: int = 0
    compiled: int = 0


REPORT = CompileReport()
_loaded: dict[str, Executable] = {}


def executable(entry: Module, options: Options, fillers: Mapping[str, Filler] | None = None) -> Executable:
    """The compiled program of `entry` with its sockets filled. Raises SourceError or LinkError where it is wrong."""
    started = perf_counter()
    request = _Request(entry, options, dict(fillers or {}))
    key = request.key()
    if key is None or key not in _loaded:
        made = request.from_cache(key) if key else None
        made = made or request.build(key)
        REPORT.programs += 1
        if key is None:
            return made
        _loaded[key] = made
    REPORT.seconds += perf_counter() - started
    return _loaded[key]


def link_program(entry: Module, fillers: Mapping[str, Filler]) -> Program:
    """The verified program of `entry`."""
    from tasuki.ir.verify import verify
    from tasuki.language.link import link

    program = link(entry, fillers)
    verify(program)
    return program


@dataclass
class _Request:
    entry: Module
    options: Options
    fillers: dict[str, Filler]
    width: int = field(init=False)

    def __post_init__(self) -> None:
        self.width = self.options.width or lanes()

    def key(self) -> str | None:
        """The name of the first level's entry; None where a module is wrong: building it will say all that is."""
        identities = Identities()
        try:
            entry = identities.of(self.entry)
            fillers = {name: _describe(filler, identities) for name, filler in sorted(self.fillers.items())}
        except SourceError:
            return None
        parts = {
            "version": __version__,
            "package": package_digest(*COMPILER, "language", "modules"),
            "host": asdict(host()),
            "options": asdict(self.options) | {"width": self.width},
            "entry": entry,
            "fillers": fillers,
        }
        return "program-" + hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()

    def object_key(self, program: Program) -> str:
        """The name of the second level's entry: what the machine code of a program depends on, and nothing else."""
        from tasuki.ir.canonical import digest

        parts = [digest(program), package_digest(*COMPILER), asdict(host()), asdict(self.options), self.width]
        return "object-" + hashlib.sha256(json.dumps(parts).encode()).hexdigest()

    def from_cache(self, key: str) -> Executable | None:
        from tasuki.machines.cpu.machine import Executable, Shape

        data = disk.read(key)
        if data is None:
            return None
        known = json.loads(data)
        code = disk.read(known["object"])
        return Executable(code, Shape.from_json(known["shape"])) if code else None

    def build(self, key: str | None) -> Executable:
        from tasuki.machines.cpu.launch import Kernel, emit_kernel, sorted_tables
        from tasuki.machines.cpu.machine import Executable, Shape

        program = link_program(self.entry, self.fillers)
        REPORT.linked += 1
        options = self.options
        object_key = self.object_key(program)
        code = disk.read(object_key)
        kernel = Kernel("", [], [])
        if code is None or options.checked or options.profile:
            # Known code, too, must be lowered for the places of its checks, which stand in the source as it is now.
            kernel = emit_kernel(
                program, options.bindings, self.width, checked=options.checked, profile=options.profile
            )
        if code is None:
            code = compile_object(kernel.text)
            REPORT.compiled += 1
            disk.write(object_key, code)
        function = program.functions[program.entry]
        shape = Shape(
            [_binding_of(p.type) for p in function.parameters],
            list(function.result.leaves),
            {name: program.tables[name].rows for name in sorted_tables(program)},
            self.width,
            kernel.sites,
            kernel.profiled,
        )
        if key is not None:
            known = {"object": object_key, "shape": shape.to_json()}
            disk.write(key, json.dumps(known).encode())
        return Executable(code, shape)


@cache
def package_digest(*folders: str) -> str:
    """Digest of the package's own sources in these folders."""
    root = Path(__file__).parent
    digest = hashlib.sha256()
    for file in [root / "programs.py", *(file for folder in folders for file in sorted((root / folder).rglob("*.py")))]:
        digest.update(str(file.relative_to(root)).encode() + file.read_bytes())
    return digest.hexdigest()


def _binding_of(type_: object) -> list[str] | int:
    """The leaves of a parameter, or of a table the rows of one record: see `machine.Shape`."""
    from tasuki.ir.types import Table, Type

    assert isinstance(type_, Type)
    return type_.record.rows if isinstance(type_, Table) else list(type_.leaves)


def _describe(filler: Filler, identities: Identities) -> list:
    if isinstance(filler, Module):
        return identities.of(filler)
    return [[case.number, identities.of(case.module), identities.of(case.table), case.table_name] for case in filler]
