"""What a module costs on this processor: cycles per item, measured.

A *cycle* is a tick of the counter that the processor keeps for the purpose (`llvm.readcyclecounter`; on x86 the time
stamp counter, which runs at a constant rate, whatever the clock does). The module runs alone, over made-up arguments
that fit the processor's caches, on one thread, in packets of the usual width; loading arguments and storing results
counts, binding them does not. What it costs inside a renderer depends on the lanes that are active: see `--profile`.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Mapping
from functools import cache

import numpy as np

from tasuki.diagnostics import LinkError
from tasuki.ir.types import Record, Table, Tuple, Type, Vector
from tasuki.language.declare import Module
from tasuki.machines.cpu.launch import Binding
from tasuki.machines.cpu.machine import Items
from tasuki.native.compile import Library, compile_object
from tasuki.programs import Filler, Options, executable, link_program

ITEMS = 8192
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

    None where it cannot run on made-up arguments: a socket is left unfilled, or it, or what it calls, reads tables.
    Raises SourceError where the module is wrong.
    """
    try:
        program = link_program(module, fillers)
    except LinkError:
        return None
    types = module.signature.parameters
    if program.tables or any(isinstance(type_, Table) for type_ in types):
        return None
    random = np.random.default_rng(SEED)
    leaves = [made_up(type_, ITEMS, random) for type_ in types]
    bound: Binding = "items"
    compiled = executable(module, Options((bound,) * len(types), checked=False), fillers)
    # A call that does nothing: entering compiled code takes as long as some thousand items of a small module.
    nothing = [Items([leaf[:0] for leaf in argument]) for argument in leaves]
    entering = compiled.seconds(nothing, 0, repeats=REPEATS)
    spent = compiled.seconds([Items(argument) for argument in leaves], ITEMS, repeats=REPEATS) - entering
    return max(0.0, spent) * counter_rate() / ITEMS


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
