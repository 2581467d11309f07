"""What a module costs: cycles per item on this processor, measured; steps on the processor unit, counted.

The module runs alone, on made-up arguments (`made_up`). A *cycle* is a tick of the counter that the processor keeps for
the purpose (`llvm.readcyclecounter`; on x86 the time stamp counter, which runs at a constant rate, whatever the clock
does). The arguments fit the processor's caches; one thread runs, in packets of the usual width; loading arguments and
storing results counts, binding them does not. What a module costs inside a renderer depends on the lanes that are
active: see `--profile`. *Steps* are those of the module and of all that it calls, without bringing arguments and taking
results.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from tasuki.diagnostics import LinkError
from tasuki.ir.types import Record, Table, Tuple, Type, Vector
from tasuki.language.declare import Module
from tasuki.machines.cpu.launch import Binding
from tasuki.machines.cpu.machine import Items
from tasuki.native.compile import Library, compile_object
from tasuki.programs import Filler, Options, executable, link_program

if TYPE_CHECKING:
    from tasuki.ir.nodes import Program
    from tasuki.machines.pu.lower.costs import Cost
    from tasuki.machines.pu.lower.machine import Schedule

ITEMS = 8192
PU_ITEMS = 256
"""The simulator counts: more of them only show rarer ways through a module."""
REPEATS = 40
"""Of which the fastest counts: others were disturbed."""
CALIBRATION_SECONDS = 0.05
SEED = 1986

READ_COUNTER = """
declare i64 @llvm.readcyclecounter()

define void @read_counter(ptr %to) {
  %ticks = call i64 @llvm.readcyclecounter()
  store i64 %ticks, ptr %to
  ret void
}
"""


def cycles_per_item(module: Module, fillers: Mapping[str, Filler]) -> float | None:
    """Cycles that `module` takes for one item, its sockets filled from `fillers`.

    None where it cannot run alone (`_alone`). Raises SourceError where the module is wrong.
    """
    if _alone(module, fillers) is None:
        return None
    types = module.signature.parameters
    leaves = _arguments(module, ITEMS)
    bound: Binding = "items"
    compiled = executable(module, Options((bound,) * len(types), checked=False), fillers)
    # A call that does nothing: entering compiled code takes as long as some thousand items of a small module.
    nothing = [Items([leaf[:0] for leaf in argument]) for argument in leaves]
    entering = compiled.seconds(nothing, 0, repeats=REPEATS)
    spent = compiled.seconds([Items(argument) for argument in leaves], ITEMS, repeats=REPEATS) - entering
    return max(0.0, spent) * counter_rate() / ITEMS


def pu_cost(module: Module, fillers: Mapping[str, Filler], schedule: Schedule) -> Cost | None:
    """What `module` takes on the processor unit, its sockets filled from `fillers`.

    None where it cannot run alone (`_alone`). Raises SourceError where the module is wrong, or needs what the processor
    unit has not.
    """
    from tasuki.machines.pu.lower.costs import module_cost

    program = _alone(module, fillers)
    return module_cost(program, _arguments(module, PU_ITEMS), PU_ITEMS, schedule=schedule) if program else None


def _alone(module: Module, fillers: Mapping[str, Filler]) -> Program | None:
    """The program of a module that can run on made-up arguments.

    None where a socket is left unfilled, or where it, or what it calls, reads tables.
    """
    try:
        program = link_program(module, fillers)
    except LinkError:
        return None
    has_tables = program.tables or any(isinstance(type_, Table) for type_ in module.signature.parameters)
    return None if has_tables else program


def _arguments(module: Module, items: int) -> list[list[np.ndarray]]:
    """Made-up arguments of so many items, the same each time."""
    random = np.random.default_rng(SEED)
    return [made_up(type_, items, random) for type_ in module.signature.parameters]


def made_up(type_: Type, items: int, random: np.random.Generator) -> list[np.ndarray]:
    """Leaves of `items` random values: numbers in 0..1, integers 0..3, vec3 of unit length; a record's fields too."""
    if isinstance(type_, Record | Tuple):
        return [leaf for _, member in type_.members for leaf in made_up(member, items, random)]
    if isinstance(type_, Vector) and type_.size == 3:
        vectors = random.normal(size=(3, items))
        return list((vectors / np.linalg.norm(vectors, axis=0)).astype(np.float32))
    draw = {
        "f32": lambda: random.random(items, dtype=np.float32),
        "i32": lambda: random.integers(0, 4, items, dtype=np.int32),
        "bool": lambda: random.random(items) < 0.5,
    }
    return [draw[scalar]() for scalar in type_.leaves]


@cache
def counter_rate() -> float:
    """Ticks of the processor's cycle counter in a second."""
    library = Library(compile_object(READ_COUNTER))
    read = library.function("read_counter", ctypes.c_void_p)
    ticks = ctypes.c_int64()

    def now() -> int:
        read(ctypes.addressof(ticks))
        return ticks.value

    first, started = now(), time.perf_counter()
    time.sleep(CALIBRATION_SECONDS)
    last, ended = now(), time.perf_counter()
    return (last - first) / (ended - started)
