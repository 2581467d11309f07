"""Writes menger.yaml: the sponge of K. Menger (1926), of depth 3, as one box minus 219 bars.

python examples/scenes/make_menger.py > examples/scenes/menger.yaml
"""

import sys
from collections.abc import Iterator

DEPTH = 3
SIDE = 3**DEPTH
REACH = 1
"""By so much bars stand out of the box at both ends."""

HEAD = """\
# The sponge of K. Menger, of depth 3: one difference, of a box and 219 bars. Each depth colours the walls of its bars.
# Written by make_menger.py.
version: 1
camera: {eye: [-33, -58, 47], at: [0.6, 0.6, -2.2], angle: 33, resolution: [800, 600]}
background: [0.62, 0.7, 0.8]
lights:
  - {position: [-40, -60, 80], colour: [0.62, 0.6, 0.55]}
  - {direction: [-3, 1.4, -1.6], colour: [0.2, 0.25, 0.34]}
materials:
  floor: {colour: [0.5, 0.53, 0.56], diffuse: 0.85, ambient: 0.35, reflection: 0.06}
  box: {colour: [0.86, 0.8, 0.68], diffuse: 0.85, ambient: 0.3}
  bar1: {colour: [0.78, 0.24, 0.1], diffuse: 0.85, ambient: 0.3}
  bar2: {colour: [0.85, 0.52, 0.12], diffuse: 0.85, ambient: 0.3}
  bar3: {colour: [0.3, 0.4, 0.5], diffuse: 0.85, ambient: 0.3}
shapes:
  - half_space: {point: [0, 0, -13.5], normal: [0, 0, 1], material: floor}
  - difference:
      name: sponge
      material: box
      transform: [{translate: [-13.5, -13.5, -13.5]}]
      children:
"""


def box(low: tuple[int, ...], high: tuple[int, ...], material: str | None = None) -> str:
    suffix = f", material: {material}" if material else ""
    return f"        - box: {{low: {list(low)}, high: {list(high)}{suffix}}}\n"


def bars(depth: int) -> Iterator[str]:
    """Bars of one depth along every axis, but none inside of a thicker one."""
    cell = SIDE // 3**depth
    middles = range(cell, SIDE, 3 * cell)
    for axis in range(3):
        for u in middles:
            for v in middles:
                if not in_thicker(u // cell, v // cell):
                    low, high = [u, v], [u + cell, v + cell]
                    low.insert(axis, -REACH)
                    high.insert(axis, SIDE + REACH)
                    yield box(tuple(low), tuple(high), f"bar{depth}")


def in_thicker(u: int, v: int) -> bool:
    """Whether a cell lies in the middle cell of a ninth, at any size above its own."""
    while u > 2 or v > 2:
        u, v = u // 3, v // 3
        if u % 3 == 1 and v % 3 == 1:
            return True
    return False


def sponge() -> str:
    lines = [bar for depth in range(1, DEPTH + 1) for bar in bars(depth)]
    return HEAD + box((0, 0, 0), (SIDE, SIDE, SIDE)) + "".join(lines)


if __name__ == "__main__":
    sys.stdout.write(sponge())
