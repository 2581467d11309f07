"""Value change dumps (IEEE 1364, section 18), as GTKWave and other waveform viewers open them. One step is one ns.

Scopes: `pu`, and within it a scope for each unit. Outputs of FPPs, of the table and of the data latches stand twice: as
32 bits, and as the real number that they are (`_real`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TextIO

from tasuki.machines.pu.simulate.instruction import BANKS, FPP
from tasuki.machines.pu.simulate.state import State, as_float, register_name


@dataclass(frozen=True)
class Signal:
    """One variable: its scope, its name, its width in bits; 0 stands for a real number."""

    scope: str
    name: str
    width: int


def _signals(state: State) -> Iterator[Signal]:
    """Every signal, in the order of `_words`."""
    yield Signal("sequencer", "address", 32)
    yield Signal("sequencer", "halted", 1)
    yield Signal("sequencer", "call_depth", 8)
    yield Signal("sequencer", "loop_depth", 8)
    yield Signal("sequencer", "loop_count", 32)
    for unit in FPP:
        yield from _both(f"fpp{unit}", "output")
        yield from (Signal(f"fpp{unit}", flag, 1) for flag in state.flags[unit])
        yield from _file(f"fpp{unit}", unit, state)
    yield from _both("table", "output")
    yield Signal("table", "special", 1)
    yield Signal("alu", "output", 32)
    yield from (Signal("alu", flag, 1) for flag in state.flags["alu"])
    yield from _file("alu", "alu", state)
    for bank in BANKS:
        yield from _both("memory", f"latch_{bank}")
    yield Signal("address_generator", "row", 32)
    for file in ("br", "ir", "ar"):
        yield from _file("address_generator", file, state)
    yield Signal("display", "frames", 32)


def _both(scope: str, name: str) -> Iterator[Signal]:
    yield Signal(scope, name, 32)
    yield Signal(scope, f"{name}_real", 0)


def _file(scope: str, file: str, state: State) -> Iterator[Signal]:
    for number in range(len(state.registers[file])):
        yield Signal(scope, register_name(file, number).rpartition(".")[2], 32)


def _words(state: State) -> list[int]:
    """Every signal's word now. Apart from `_signals`, because this is done after each step."""
    loops = state.loop_stack
    words = [state.address, int(state.halted), len(state.call_stack), len(loops), loops[-1] if loops else 0]
    for unit in FPP:
        output = state.output[unit]
        words += (output, output, *map(int, state.flags[unit].values()), *state.registers[unit])
    words += (state.output["table"], state.output["table"], int(state.special), state.output["alu"])
    words += (*map(int, state.flags["alu"].values()), *state.registers["alu"])
    for bank in BANKS:
        words += (state.latch[bank], state.latch[bank])
    words.append(state.row)
    for file in ("br", "ir", "ar"):
        words += state.registers[file]
    words.append(state.frames)
    return words


def _identifier(number: int) -> str:
    """The short name of a signal in the file: printable characters, the fewest first."""
    name = ""
    while True:
        number, digit = divmod(number, 94)
        name += chr(33 + digit)
        if number == 0:
            return name
        number -= 1


class VcdWriter:
    """Writes a dump to an open text file. `sample` a state before the first step, and then after each step."""

    def __init__(self, file: TextIO) -> None:
        self._file = file
        self._last: list[int] | None = None
        self._signals: list[Signal] = []

    def sample(self, state: State) -> None:
        """Write what changed since the last sample, at the time `state.steps`."""
        words = _words(state)
        if self._last is None:
            self._signals = list(_signals(state))
            self._header()
            self._write(f"#{state.steps}", "$dumpvars", *map(self._change, range(len(words)), words), "$end")
        else:
            changes = [i for i, (old, new) in enumerate(zip(self._last, words, strict=True)) if old != new]
            self._write(f"#{state.steps}", *(self._change(i, words[i]) for i in changes))
        self._last = words

    def _write(self, *lines: str) -> None:
        self._file.write("\n".join(lines) + "\n")

    def _header(self) -> None:
        self._write("$version Tasuki, processor unit $end", "$comment one step is 1 ns $end", "$timescale 1 ns $end")
        self._write("$scope module pu $end")
        scope = ""
        for number, signal in enumerate(self._signals):
            if signal.scope != scope:
                self._write(*(["$upscope $end"] if scope else []), f"$scope module {signal.scope} $end")
                scope = signal.scope
            kind = f"wire {signal.width}" if signal.width else "real 64"
            vector = f" [{signal.width - 1}:0]" if signal.width > 1 else ""
            self._write(f"$var {kind} {_identifier(number)} {signal.name}{vector} $end")
        self._write("$upscope $end", "$upscope $end", "$enddefinitions $end")

    def _change(self, number: int, word: int) -> str:
        name, width = _identifier(number), self._signals[number].width
        if width == 0:
            return f"r{as_float(word):.9g} {name}"
        return f"{word}{name}" if width == 1 else f"b{word:b} {name}"
