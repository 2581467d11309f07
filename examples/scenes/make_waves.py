"""Writes waves.png, one tile of seigaiha, the Japanese pattern of waves: arcs of circles that overlap like scales.

python examples/scenes/make_waves.py examples/scenes/waves.png
"""

import sys

import numpy as np
from PIL import Image

COLUMNS, ROWS = 256, 128
SAMPLES = 4
INDIGO = np.array([24, 44, 98])
CREAM = np.array([238, 228, 205])
RINGS = (0.08, 0.24, 0.36, 0.52, 0.64, 0.80, 0.92)
"""Radii where the colour changes, from the middle outwards; the circle's own radius is 1."""


def waves(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The share of cream at points of a tile 2 wide and 1 high, whose y axis points up.

    Circles stand in rows half a radius apart, every other row moved by a radius; the lower row lies in front.
    """
    share = np.zeros(x.shape)
    for row in range(3, -3, -1):
        middle = np.round((x - row) / 2.0) * 2.0 + row
        distance = np.hypot(x - middle, y - 0.5 * row)
        bands = np.searchsorted(RINGS, distance) % 2 == 1
        share = np.where(distance < 1.0, bands, share)
    return share


def tile() -> Image.Image:
    """The tile, averaged over SAMPLES x SAMPLES points of each pixel."""
    x = (np.arange(COLUMNS * SAMPLES) + 0.5) * 2.0 / (COLUMNS * SAMPLES)
    y = 1.0 - (np.arange(ROWS * SAMPLES) + 0.5) / (ROWS * SAMPLES)
    share = waves(*np.meshgrid(x, y)).reshape(ROWS, SAMPLES, COLUMNS, SAMPLES).mean(axis=(1, 3))[..., np.newaxis]
    return Image.fromarray(np.uint8(np.rint(INDIGO + share * (CREAM - INDIGO))))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python make_waves.py OUT.png")
    tile().save(sys.argv[1])
