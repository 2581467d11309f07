"""Compile textual LLVM to object code for this processor, and load object code.

No -O2: inlining of what asks for it, SROA, CFG simplification and instruction combining give the whole speed of code
that was vectorised by its author, in a fraction of the compile time.
"""

from __future__ import annotations

import ctypes
import threading
from dataclasses import dataclass
from functools import cache
from typing import Any

_LOCK = threading.Lock()
"""LLVM as llvmlite binds it compiles one module at a time."""


@dataclass(frozen=True)
class Host:
    """What object code depends on beside its source."""

    llvm: str
    triple: str
    cpu: str
    features: str


@cache
def host() -> Host:
    import llvmlite
    import llvmlite.binding as llvm

    features = llvm.get_host_cpu_features().flatten()
    version = ".".join(map(str, llvm.llvm_version_info))
    return Host(f"{llvmlite.__version__}/{version}", llvm.get_process_triple(), llvm.get_host_cpu_name(), features)


@cache
def lanes() -> int:
    """The best packet width here: 16 with AVX-512 or AVX2 (two halves: measured faster than 8), 8 with AVX, else 4."""
    features = host().features.split(",")
    if "+avx512f" in features or "+avx2" in features:
        return 16
    return 8 if "+avx" in features else 4


@cache
def _binding() -> Any:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm


def _target_machine() -> Any:
    llvm = _binding()
    target = llvm.Target.from_triple(host().triple)
    return target.create_target_machine(cpu=host().cpu, features=host().features, opt=2, jit=True)


def _optimise(module: Any, machine: Any) -> None:
    llvm = _binding()
    builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=2))
    passes = llvm.create_new_module_pass_manager()
    # What is to be inlined is made small first.
    passes.add_sroa_pass()
    passes.add_simplify_cfg_pass()
    passes.add_always_inliner_pass()
    passes.add_global_dead_code_eliminate_pass()
    passes.add_sroa_pass()
    passes.add_simplify_cfg_pass()
    passes.add_instruction_combine_pass()
    passes.add_simplify_cfg_pass()
    passes.run(module, builder)


def _parse(text: str) -> Any:
    llvm = _binding()
    module = llvm.parse_assembly(f'target triple = "{host().triple}"\n{text}')
    module.verify()
    return module


def compile_object(text: str) -> bytes:
    """Object code of an LLVM module. Raises RuntimeError where the text is not valid LLVM (a fault of the caller)."""
    with _LOCK:
        machine = _target_machine()
        module = _parse(text)
        _optimise(module, machine)
        return machine.emit_object(module)


def assembly(text: str) -> str:
    """The same, as assembly language for a person to read."""
    with _LOCK:
        machine = _target_machine()
        module = _parse(text)
        _optimise(module, machine)
        return machine.emit_assembly(module)


class Library:
    """Loaded object code; keep it alive as long as its functions are used."""

    def __init__(self, data: bytes) -> None:
        llvm = _binding()
        with _LOCK:
            self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target_machine())
            self._engine.add_object_file(llvm.ObjectFileRef.from_data(data))
            self._engine.finalize_object()

    def function(self, name: str, *argument_types: Any) -> Any:
        """A callable that releases the interpreter lock while it runs; its result is void."""
        with _LOCK:
            address = self._engine.get_function_address(name)
        if not address:
            raise LookupError(f"no function {name} in the object")
        return ctypes.CFUNCTYPE(None, *argument_types)(address)
