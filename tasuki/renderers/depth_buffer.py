"""What a depth buffer would do with the faces of a scanline picture: how many pixels it would read and write.

The scanline method writes each pixel once; a depth buffer writes it for every face that is nearer than those before
(paper, section 7). Faces come in the order of their numbers, with the edges, and so the coverage, of the edge table.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tasuki.modules.scanline.fixed import SUBPIXEL, SUBPIXEL_BITS

Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class DepthBuffer:
    """One look at every pixel: `tested` depths were compared, `passed` of them were nearer and written.

    `visible`, (height, width): the face that is left in each pixel; -1: none.
    """

    tested: int
    passed: int
    visible: Integers


def depth_buffer(edges: np.ndarray, planes: np.ndarray, view: np.void, frame: np.void) -> DepthBuffer:
    """Draw all faces of an edge table, one after another. The records are those of the scanline modules.

    `edges` are unsorted, `planes` has a FacePlane for each face. Depths are reckoned in float64.
    """
    height, width = int(view["region_height"]), int(view["region_width"])
    nearest = np.full((height, width), -np.inf)
    visible = np.full((height, width), -1, np.int64)
    x = _directions(view["region_x"], width, frame["sample_x"], view["width"], frame["pixel"])
    y = _directions(view["region_y"], height, frame["sample_y"], view["height"], frame["pixel"])
    slopes = planes["slope"].astype(np.float64)
    tested = passed = 0
    for face, row, begin, end in zip(*_spans(edges, view, frame), strict=True):
        slope = slopes[face]
        depth = slope[0] * x[begin:end] + (slope[1] * y[row] + slope[2])
        shows = depth > nearest[row, begin:end]
        nearest[row, begin:end][shows] = depth[shows]
        visible[row, begin:end][shows] = face
        tested += len(depth)
        passed += int(shows.sum())
    return DepthBuffer(tested, passed, visible)


def _directions(first: int, count: int, sample: int, size: int, pixel: float) -> npt.NDArray[np.floating]:
    """Along one axis of the screen, the coordinate of the directions to the samples where z is 1."""
    return (int(first) + np.arange(count) + int(sample) / SUBPIXEL - 0.5 * int(size)) * float(pixel)


def _spans(edges: np.ndarray, view: np.void, frame: np.void) -> tuple[Integers, Integers, Integers, Integers]:
    """The face, row, first column and the column behind the last of every span, by faces; rows, columns of the region.

    A face lies between its first and second edge on a row, its third and fourth, and so on.
    """
    edge, row, column = _crossings(edges, view, frame)
    faces = np.concatenate([edges[side][edge].astype(np.int64) for side in ("first", "second")])
    rows, columns = np.tile(row, 2), np.tile(column, 2)
    order = np.lexsort((columns, rows, faces))
    order = order[faces[order] >= 0]
    begins, ends = order[0::2], order[1::2]
    filled = columns[begins] < columns[ends]
    begins, ends = begins[filled], ends[filled]
    return faces[begins], rows[begins], columns[begins], columns[ends]


def _crossings(edges: np.ndarray, view: np.void, frame: np.void) -> tuple[Integers, Integers, Integers]:
    """For each edge and each row of the region that it crosses: edge, row, and the first column behind it."""
    rows = edges["rows"].astype(np.int64)
    first, behind = rows >> 16 & 65535, rows & 65535
    top = int(view["region_y"])
    begin, end = np.maximum(first, top), np.minimum(behind, top + int(view["region_height"]))
    counts = np.maximum(end - begin, 0)
    edge = np.repeat(np.arange(len(edges)), counts)
    row = np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts) + begin[edge]
    x, rest, step, step_rest, height = (
        edges[name][edge].astype(np.int64) for name in ("x", "rest", "step", "step_rest", "height")
    )
    steps = row - first[edge]
    part = rest + steps * step_rest
    place = x + steps * step + -(-part // height)
    column = (place - int(frame["sample_x"]) + SUBPIXEL - 1 >> SUBPIXEL_BITS) - int(view["region_x"])
    return edge, row - top, np.clip(column, 0, int(view["region_width"]))
