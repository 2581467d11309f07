"""`tasuki explain`: what becomes of a module. Its IR, what varies over the lanes of a packet and why, its machine code.

Every parameter is taken to vary, as it does under `.map`; sockets are filled with what the ray tracer fills them by
default. Imported by the command line.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from tasuki.diagnostics import Span
from tasuki.ir.text import print_function
from tasuki.ir.types import Array, Table, Type
from tasuki.language.declare import Module
from tasuki.language.load import resolve_module
from tasuki.machines.cpu.launch import emit_kernel, pattern
from tasuki.machines.cpu.variance import Leaves, Variance, VarianceAnalysis
from tasuki.native.compile import assembly, lanes
from tasuki.programs import link_program

if TYPE_CHECKING:
    from tasuki.ir.nodes import Program

SECTIONS = ("ir", "lanes", "llvm", "assembly")


def explain(name: str | Module, sections: Sequence[str] = ("ir", "lanes", "assembly")) -> str:
    """The report on a module, given as it is, or as "name", "package.module:name" or "FILE.py:NAME".

    `sections` chooses among SECTIONS. Raises LinkError where there is no such module, SourceError where it is wrong.
    """
    from tasuki.renderers.fillers import Traits, default_fillers
    from tasuki.scene.kinds import kinds

    module = name if isinstance(name, Module) else resolve_module(name)
    program = link_program(module, default_fillers(Traits.of_all(kinds())))
    parts = [_head(module)]
    for section in sections:
        parts.append("\n".join([f"--- {_TITLES[section]}", *_REPORTS[section](program)]))
    return "\n\n".join(parts)


def _head(module: Module) -> str:
    number = f"module {module.number} of {module.method}" if module.number else "module"
    fills = f", fills socket `{module.fills}`" if module.fills else ""
    return "\n".join([f"{module.name}{module.signature}", f"{number}{fills}, {module.place}", "", module.doc])


def _ir(program: Program) -> Iterator[str]:
    yield print_function(program.functions[program.entry])


def _lanes(program: Program) -> Iterator[str]:
    """For every parameter and variable whether it varies, and the chain of reasons."""
    function = program.functions[program.entry]
    bindings = ["items"] * len(function.parameters)
    variance = VarianceAnalysis(program).analyse(program.entry, pattern(function, bindings, width=2))  # type: ignore[arg-type]
    types: dict[str, Type] = {p.name: p.type for p in function.parameters} | dict(function.variables)
    for variable, type_ in types.items():
        if not variable.startswith("$") and not isinstance(type_, Table):
            yield from _variable(variable, type_, variance.variables[variable])
    yield from _variable("(result)", function.result, variance.result)
    yield from _partings(variance)


def _variable(name: str, type_: Type, leaves: Leaves) -> Iterator[str]:
    reasons = [reason for reason in leaves if reason is not None]
    if not leaves:
        return
    label = f"{name}: {type_.item if isinstance(type_, Array) else type_}"
    if not reasons:
        yield f"{label} is uniform"
        return
    share = "" if len(reasons) == len(leaves) else f" in {len(reasons)} of {len(leaves)} leaves"
    yield f"{label} varies{share}"
    for reason in reasons[0].chain():
        yield f"    {_place(reason.span)}{reason.message}"


def _partings(variance: Variance) -> Iterator[str]:
    if not variance.parted:
        yield "lanes never part"
    for reason in variance.parted.values():
        yield f"lanes part at {_place(reason.span)}{reason.message}"


def _place(span: Span | None) -> str:
    return f"line {span.line}: " if span else ""


def _llvm(program: Program) -> Iterator[str]:
    function = program.functions[program.entry]
    bindings = ["items"] * len(function.parameters)
    yield emit_kernel(program, bindings, lanes(), checked=False, profile=False).text  # type: ignore[arg-type]


def _assembly(program: Program) -> Iterator[str]:
    for text in _llvm(program):
        code = assembly(text)
        instructions = [line for line in code.splitlines() if line.startswith("\t") and not line.startswith("\t.")]
        yield f"{len(instructions)} instructions for {lanes()} lanes, with the loop over items around them"
        yield code


_TITLES = {
    "ir": "intermediate representation",
    "lanes": "over the lanes of a packet",
    "llvm": "LLVM, before its passes",
    "assembly": "CPU",
}
_REPORTS = {"ir": _ir, "lanes": _lanes, "llvm": _llvm, "assembly": _assembly}
