"""Table 1 of the paper, from running microcode: published steps, the steps that the simulator took, measured errors.

Every row's macro is put into a loop over many operands in data memory; the simulator counts its steps under a label of
its own, and what the loop stores is compared with float64. No cost stands in this file: the published steps are there
only to stand beside ours. ``python -m tasuki.machines.pu.table1 docs/table-1.md`` renews the page's table.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from tasuki.machines.pu import simulate
from tasuki.machines.pu.macro import assemble

Words = npt.NDArray[np.float32]
"""Operands: (values, rows, 4) for vectors and matrices, a scalar being in the last of the four."""
Wide = npt.NDArray[np.float64]
Machine = Literal["plain", "fast"]
Progress = Callable[[float], None]

VALUES = 1 << 20
"""Operands on which every macro is measured, besides those of `Row.whole`."""
CHUNK = 1 << 18
"""Values in data memory at a time."""
REGISTERS = {"v": ("v0", "v1"), "s": ("s0", "s1"), "m": ("m0", "m4")}
RESULT = {"v": "v8", "s": "s8", "m": "m8"}
SEED = 1986


@dataclass(frozen=True)
class Row:
    """A row of Table 1, or a macro that stands beside one.

    `operands` are the kinds of its operands ("s", "v", "m"), `result` that of its result. `exact` gives the result in
    float64, and the size that an ulp is taken of where that is not the result itself; `sample` makes operands of `n`
    values; `whole` yields operands that are tested besides, such as a whole octave. `lanes` is how many elements of a
    vector count, the last of the four for a scalar.
    """

    operation: str
    macro: str
    published: int | None
    operands: str
    result: str
    exact: Callable[..., Wide]
    sample: Callable[[np.random.Generator, int], list[Words]]
    note: str = ""
    size: Callable[..., Wide] | None = None
    absolute: bool = False
    lanes: int = 4
    whole: Callable[[], Iterator[list[Words]]] | None = None
    shorter: tuple[str, ...] = field(default=())

    @property
    def call(self) -> str:
        """The macro call on the registers that `program` uses."""
        given = [REGISTERS[kind][i] for i, kind in enumerate(self.operands)]
        return f"{self.macro} {', '.join([RESULT[self.result], *given])}"


# --- operands ---------------------------------------------------------------------------------------------------------


def scalars(values: Words) -> Words:
    """One row for each value, which stands in bank S."""
    rows = np.zeros((len(values), 1, 4), np.float32)
    rows[:, 0, 3] = values
    return rows


def _log_uniform(rng: np.random.Generator, shape: Sequence[int], low: int, high: int) -> Words:
    """Normal numbers of either sign, their exponents uniform from `low` to below `high`."""
    exponents = rng.integers(low, high, shape)
    fractions = 1 + rng.integers(0, 1 << 23, shape) / (1 << 23)
    return (rng.choice([-1.0, 1.0], shape) * np.ldexp(fractions, exponents)).astype(np.float32)


def _two_scalars(rng: np.random.Generator, n: int) -> list[Words]:
    return [scalars(_log_uniform(rng, (n,), -60, 60)) for _ in range(2)]


def _quotient_operands(rng: np.random.Generator, n: int) -> list[Words]:
    """Normal a and b over the whole range, |b| up to 2**125, such that a/b is normal."""
    b = _log_uniform(rng, (n,), -126, 125)
    exponents = np.frexp(b)[1].astype(np.int64)
    # a/b is between 1 and 4 times 2**(exponent of a - exponent of b as frexp has it).
    low, high = np.maximum(-126, -126 + exponents), np.minimum(128, 127 + exponents)
    a = np.ldexp(np.float32(1) + rng.random(n, np.float32) * np.float32(0.999), rng.integers(low, high))
    return [scalars(a.astype(np.float32)), scalars(b)]


def _reciprocal_operands(rng: np.random.Generator, n: int) -> list[Words]:
    """Every exponent whose reciprocal is normal: also of subnormal numbers above 2**-128."""
    numbers = _log_uniform(rng, (n,), -128, 126)
    overflowing = np.abs(numbers) <= np.float32(2.0**-128)
    return [scalars(np.where(overflowing, np.float32(2.0**-127), numbers))]


def _positive(rng: np.random.Generator, n: int) -> list[Words]:
    """Positive numbers over the whole range, subnormal ones among them."""
    return [scalars(rng.integers(1, 0x7F800000, n, dtype=np.uint32).view(np.float32))]


def _normal_positive(rng: np.random.Generator, n: int) -> list[Words]:
    return [scalars(np.abs(_log_uniform(rng, (n,), -126, 128)))]


def _angles(rng: np.random.Generator, n: int) -> list[Words]:
    turn = np.float32(2 * np.pi)
    return [scalars(rng.uniform(-turn, turn, n).astype(np.float32))]


def _octaves(*exponents: int) -> Callable[[], Iterator[list[Words]]]:
    """Every binary32 number from 2**e to below 2**(e+1), for each e."""

    def all_of_them() -> Iterator[list[Words]]:
        for exponent in exponents:
            first = (exponent + 127) << 23
            for start in range(first, first + (1 << 23), CHUNK):
                yield [scalars(np.arange(start, start + CHUNK, dtype=np.uint32).view(np.float32))]

    return all_of_them


def _vectors(count: int, rows: int = 1) -> Callable[[np.random.Generator, int], list[Words]]:
    def sample(rng: np.random.Generator, n: int) -> list[Words]:
        return [_log_uniform(rng, (n, rows, 4), -20, 20) for _ in range(count)]

    return sample


def _vector_and_scalar(rng: np.random.Generator, n: int) -> list[Words]:
    return [_log_uniform(rng, (n, 1, 4), -20, 20), scalars(_log_uniform(rng, (n,), -20, 20))]


def _vector_and_matrix(rng: np.random.Generator, n: int) -> list[Words]:
    return [_log_uniform(rng, (n, 1, 4), -20, 20), _log_uniform(rng, (n, 4, 4), -20, 20)]


# --- what is exact ----------------------------------------------------------------------------------------------------


def _dot(a: Wide, b: Wide) -> Wide:
    return np.sum((a * b)[..., :3], axis=-1, keepdims=True) * np.ones(4)


def _norm(a: Wide) -> Wide:
    return np.sqrt(_dot(a, a))


def _vector_times_matrix(a: Wide, m: Wide) -> Wide:
    # m[n, j] is column j: element j of the result is its inner product with a.
    return np.einsum("nk,njk->nj", a[:, 0], m)[:, None]


def _matrix_product(a: Wide, b: Wide) -> Wide:
    # Columns again: a[n, k, i] b[n, j, k], and the result [n, j, i].
    return np.einsum("nki,njk->nji", a, b)


ROWS: tuple[Row, ...] = (
    Row("add", "add", 1, "ss", "s", np.add, _two_scalars),
    Row("subtract", "sub", 1, "ss", "s", np.subtract, _two_scalars),
    Row("multiply", "mul", 1, "ss", "s", np.multiply, _two_scalars),
    Row(
        "divide",
        "div",
        6,
        "ss",
        "s",
        np.divide,
        _quotient_operands,
        "normal operands and results, |b| up to 2**125",
        shorter=("div5",),
    ),
    Row(
        "sqrt",
        "sqrt",
        9,
        "s",
        "s",
        np.sqrt,
        _positive,
        "every number from 1 to 4, and random ones over the whole range, subnormal ones among them",
        whole=_octaves(0, 1),
        shorter=("sqrt6",),
    ),
    Row(
        "reciprocal",
        "rcp",
        5,
        "s",
        "s",
        np.reciprocal,
        _reciprocal_operands,
        "every number from 1 to 2, and random ones over all whose reciprocal is normal",
        whole=_octaves(0),
        shorter=("rcp4",),
    ),
    Row("sin", "sin", 15, "s", "s", np.sin, _angles, "from -2 pi to 2 pi", absolute=True, shorter=("sin11",)),
    Row("vector add", "vadd", 1, "vv", "v", np.add, _vectors(2)),
    Row("vector subtract", "vsub", 1, "vv", "v", np.subtract, _vectors(2)),
    Row("vector multiply", "vmul", 1, "vv", "v", np.multiply, _vectors(2)),
    Row(
        "vector divide",
        "vdiv",
        None,
        "vv",
        "v",
        np.divide,
        _vectors(2),
        "the scan is damaged and reads 1; four quotients, which share one table",
        shorter=("vdiv15",),
    ),
    Row("vector times scalar", "vscale", 1, "vs", "v", lambda a, b: a * b[..., 3:], _vector_and_scalar),
    Row(
        "vector over scalar",
        "vover",
        None,
        "vs",
        "v",
        lambda a, b: a / b[..., 3:],
        _vector_and_scalar,
        "the scan is damaged and reads 1; held to reciprocal 5 + multiply 1",
    ),
    Row("dot", "dot", 3, "vv", "s", _dot, _vectors(2), size=lambda a, b: _dot(np.abs(a), np.abs(b))),
    Row("norm", "norm", 12, "v", "s", _norm, _vectors(1), shorter=("norm9",)),
    Row(
        "normalize",
        "normalize",
        18,
        "v",
        "v",
        lambda a: a / _norm(a),
        _vectors(1),
        lanes=3,
        shorter=("normalize11",),
    ),
    Row(
        "vector times matrix",
        "vecmat",
        12,
        "vm",
        "v",
        _vector_times_matrix,
        _vector_and_matrix,
        size=lambda a, m: _vector_times_matrix(np.abs(a), np.abs(m)),
    ),
    Row(
        "matrix times matrix",
        "matmat",
        64,
        "mm",
        "m",
        _matrix_product,
        _vectors(2, 4),
        size=lambda a, b: _matrix_product(np.abs(a), np.abs(b)),
        shorter=("matmat41",),
    ),
)
"""All rows of Table 1, in the paper's order."""

_LIMITS: dict[str, dict[str, Any]] = {
    "div5": {"note": "NaN where b is 0 or infinite"},
    "sqrt6": {"note": "normal operands only", "sample": _normal_positive},
    "rcp4": {"note": "NaN for 0 and infinity"},
    "sin11": {"note": "from -2 pi to 2 pi"},
    "vdiv15": {"note": "x, y, z only", "lanes": 3},
    "norm9": {"note": "where the square of the norm is normal"},
    "normalize11": {"note": "reciprocal square root in place of square root and reciprocal"},
    "matmat41": {"note": "the result must be neither operand"},
}
"""In which the shorter macros differ from the row beside which they stand."""


def shorter_rows(row: Row) -> list[Row]:
    """The shorter macros for the same operation, as rows of their own."""
    same = {name: getattr(row, name) for name in row.__dataclass_fields__}
    return [Row(**{**same, "macro": macro, "shorter": (), **_LIMITS[macro]}) for macro in row.shorter]


# --- running ----------------------------------------------------------------------------------------------------------


def _rows_of(kind: str) -> int:
    return 4 if kind == "m" else 1


def program(row: Row, count: int, call: str | None = None) -> str:
    """Macro assembler source: for each of `count` samples load the operands, run the macro, store the result."""
    sizes = [*(_rows_of(kind) for kind in row.operands), _rows_of(row.result)]
    lines = [".display 1", ".record sample"]
    lines += [f"    .row r{i}: x{i} y{i} z{i} s{i}" for i in range(sum(sizes))]
    lines += [".end", f".table samples, sample, {count}", "    open samples", f"    count {count}", "again:"]
    loads = [
        f"v{4 * i + k if kind == 'm' else i}" for i, kind in enumerate(row.operands) for k in range(_rows_of(kind))
    ]
    lines += [f"    load {register}, samples.r{i}" for i, register in enumerate(loads)]
    lines += ["measured:", f"    {call or row.call}", "rest:"]
    lines += [f"    store samples.r{len(loads) + k}, v{8 + k}" for k in range(_rows_of(row.result))]
    lines += ["    next samples", "    loop again", "    halt"]
    return "\n".join(lines) + "\n"


def run(row: Row, operands: Sequence[Words], machine: Machine = "fast") -> tuple[Words, float]:
    """The macro's results for the operands, of shape (values, rows, 4), and the steps that it took for each."""
    count = len(operands[0])
    columns = [*operands, np.zeros((count, _rows_of(row.result), 4), np.float32)]
    memory = np.concatenate(columns, axis=1)
    rows = memory.shape[1]
    made = assemble(program(row, count), f"<{row.macro}>").program
    outcome = simulate.run(made, memory=memory.reshape(-1, 4), machine=machine)
    after = outcome.state.memory[: count * rows].view(np.float32).reshape(count, rows, 4)
    return after[:, -_rows_of(row.result) :].copy(), outcome.labels["measured"].steps / count


def error(row: Row, operands: Sequence[Words], results: Words) -> float:
    """The greatest error: absolute, or in ulp of the exact result (of `Row.size`, where a sum may cancel)."""
    wide = [one.astype(np.float64) for one in operands]
    lanes = slice(3, 4) if row.result == "s" else slice(0, row.lanes)
    with np.errstate(divide="ignore", invalid="ignore"):
        exact = row.exact(*wide)[..., lanes]
        off = np.abs(results.astype(np.float64)[..., lanes] - exact)
        if not row.absolute:
            size = row.size(*wide)[..., lanes] if row.size else np.abs(exact)
            off = off / np.ldexp(1.0, np.maximum(np.frexp(size)[1] - 24, -149))
    return float(off.max())


def measure(row: Row, *, values: int = VALUES, machine: Machine = "fast", whole: bool = True) -> dict[str, Any]:
    """One row as `tasuki macros --json` gives it."""
    rng = np.random.default_rng(SEED)
    worst, steps, done = 0.0, set[float](), 0
    samples = (row.sample(rng, min(CHUNK, values - start)) for start in range(0, values, CHUNK))
    octaves = row.whole() if whole and row.whole else iter(())
    for operands in chain(octaves, samples):
        results, taken = run(row, operands, machine)
        steps.add(taken)
        done += len(results)
        # NaN where a number is expected is an infinite error.
        worst = max(worst, float(np.nan_to_num(error(row, operands, results), nan=np.inf)))
    (taken,) = steps
    unit = "absolute" if row.absolute else "ulp of the sum of magnitudes" if row.size else "ulp"
    return {
        "operation": row.operation,
        "macro": row.macro,
        "published": row.published,
        "steps": int(taken),
        "error": {"value": worst, "unit": unit},
        "values": done,
        "note": row.note,
    }


def table(
    *, values: int = VALUES, machine: Machine = "fast", whole: bool = True, progress: Progress | None = None
) -> list[dict[str, Any]]:
    """All rows of Table 1, each with its shorter macros under "shorter". `progress` hears the share that is done."""
    made = []
    for i, row in enumerate(ROWS):
        if progress:
            progress(i / len(ROWS))
        shorter = [measure(one, values=values, machine=machine, whole=whole) for one in shorter_rows(row)]
        made.append({**measure(row, values=values, machine=machine, whole=whole), "shorter": shorter})
    return made


# --- the page ---------------------------------------------------------------------------------------------------------

_SECTION = re.compile(r"(<!-- generated: table 1 -->\n).*?(<!-- end -->)", re.DOTALL)


def markdown(rows: Sequence[dict[str, Any]]) -> str:
    """`table` as a table of docs/table-1.md; shorter macros stand below the row that they belong to."""
    lines = ["operation | macro | published | ours | greatest error | values", "--- | --- | --: | --: | --- | --:"]
    for row in rows:
        for one in (row, *row["shorter"]):
            first = one is row
            published = ("damaged" if one["published"] is None else str(one["published"])) if first else ""
            value, unit = one["error"]["value"], one["error"]["unit"]
            error = f"{value:.2g} {unit}" if unit == "absolute" else f"{value:.2f} {unit}"
            name = row["operation"] if first else "- shorter"
            lines.append(f"{name} | `{one['macro']}` | {published} | {one['steps']} | {error} | {one['values']:,}")
    return "".join(f"| {line} |\n" for line in lines)


def renewed(page: str, rows: Sequence[dict[str, Any]]) -> str:
    """The page with its table made anew."""
    return _SECTION.sub(lambda found: f"{found[1]}{markdown(rows)}{found[2]}", page)


if __name__ == "__main__":
    for file in map(Path, sys.argv[1:]):
        file.write_text(renewed(file.read_text(), table()))
