"""Pictures: linear light in arrays, written as PNG (clamped sRGB) or EXR (linear)."""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from tasuki.diagnostics import Diagnostic, MachineError, OutputError
from tasuki.renderers.files import check_writable, write_file, written_aside

PNG_COMPRESSION = 3
"""Of zlib's levels 0..9. Level 6 makes files 5 % smaller in three times the time."""


@dataclass(eq=False)
class Picture:
    """What a renderer made.

    `pixels` is (height, width, 4) float32: linear red, green, blue (1 is full), and coverage, the share of the pixel's
    samples that met a shape. It is a copy of what was given. `stats` is what `--stats` writes, as plain data; its
    "seconds" gain "write" when the picture is saved. A picture holds no NaN: MachineError where one is given.
    """

    pixels: np.ndarray
    stats: dict[str, Any] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        self.pixels = np.array(self.pixels, np.float32)
        if self.pixels.ndim != 3 or self.pixels.shape[2] != 4 or 0 in self.pixels.shape:
            raise ValueError(f"pixels: expected shape (height, width, 4), found {self.pixels.shape}")
        _refuse_nan(self.pixels)

    @property
    def width(self) -> int:
        """In pixels."""
        return self.pixels.shape[1]

    @property
    def height(self) -> int:
        """In pixels."""
        return self.pixels.shape[0]

    def save(self, path: str | Path) -> None:
        """Write the picture, in the format that the suffix of `path` names: .png or .exr. Whole or not at all.

        Equal pictures make equal files: no time stamps. Raises OutputError.
        """
        path = check_writable(path)
        started = perf_counter()
        if path.suffix.lower() == ".exr":
            with written_aside(path) as aside:
                self._write_exr(aside)
        else:
            write_file(path, self._repr_png_())
        self.stats.setdefault("seconds", {})["write"] = perf_counter() - started

    def srgb(self) -> np.ndarray:
        """(height, width, 3) uint8: clamped to 0..1, and through the transfer curve of IEC 61966-2-1 (sRGB)."""
        linear = np.clip(self.pixels[..., :3], 0.0, 1.0)
        curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** np.float32(1 / 2.4) - 0.055)
        return (curve * 255.0 + 0.5).astype(np.uint8)

    def _repr_png_(self) -> bytes:
        """The picture as PNG: how notebooks show it."""
        from PIL import Image

        buffer = io.BytesIO()
        Image.fromarray(self.srgb()).save(buffer, "PNG", compress_level=PNG_COMPRESSION)
        return buffer.getvalue()

    def _write_exr(self, path: Path) -> None:
        import OpenEXR

        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        colours = np.ascontiguousarray(self.pixels[..., :3])
        try:
            with OpenEXR.File(header, {"RGB": colours}) as file:
                file.write(str(path))
        except RuntimeError as error:
            raise OutputError(str(Diagnostic(f"cannot write the picture: {error}"))) from error

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """`pixels`, for NumPy and what builds on it."""
        return np.array(self.pixels, dtype=dtype, copy=copy)


def _refuse_nan(pixels: np.ndarray) -> None:
    bad = np.isnan(pixels).any(axis=-1)
    if not bad.any():
        return
    y, x = (int(index[0]) for index in np.nonzero(bad))
    problem = Diagnostic(
        f"{int(bad.sum())} of {bad.size} pixels are not a number, first pixel ({x}, {y}), from the upper left corner",
        expected="numbers",
        found=f"red, green, blue, coverage = {', '.join(f'{value:g}' for value in pixels[y, x])}",
        hint="a module divided 0 by 0, or took the root of a negative number",
    )
    raise MachineError(str(problem))
