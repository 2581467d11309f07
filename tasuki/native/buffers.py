"""NumPy arrays that begin at a 64-byte boundary, as vector loads and stores want them."""

from __future__ import annotations

from math import prod

import numpy as np

ALIGNMENT = 64


def aligned_zeros(shape: int | tuple[int, ...], dtype: np.dtype | type) -> np.ndarray:
    """A zeroed array whose first element lies at a multiple of 64 bytes. Pages are touched only when written."""
    dtype = np.dtype(dtype)
    size = (shape if isinstance(shape, int) else prod(shape)) * dtype.itemsize
    raw = np.zeros(size + ALIGNMENT, np.uint8)
    start = -raw.ctypes.data % ALIGNMENT
    return raw[start : start + size].view(dtype).reshape(shape)
