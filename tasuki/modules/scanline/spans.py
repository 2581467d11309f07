"""Spans: which face shows between neighbouring active edges. Runs on one lane for each band of rows.

An edge divides the faces that it bounds: passing it, a span leaves one and enters the other. So the faces in which a
span lies are those that were entered an odd number of times, whichever way they turn, and every pixel whose sample lies
between two edges of a face is drawn with it once, without any rule for shared edges but where a row crosses them.
"""

from tasuki.language import dot, i32, min, module
from tasuki.modules.records import View, views
from tasuki.modules.scanline.active import begin_active_edges, continue_active_edges
from tasuki.modules.scanline.records import (
    Frame,
    Visible,
    columns,
    face_planes,
    frames,
    layers,
    links,
    marks,
    row_buckets,
    sorted_edges,
    visible_faces,
)
from tasuki.modules.scanline.reference import quads_across, sample_direction

NOTHING = -1


@module
def toggle(face: i32, first: i32, end: i32) -> i32:
    """Leave a face if the span lies in it, else enter it; the new end of the layers, which begin at `first`."""
    place = first
    while place < end:
        if layers[place].face == face:
            layers[place] = layers[end - 1]
            return end - 1
        place += 1
    layers[end].face = face
    return end + 1


@module
def pass_edges(edge: i32, first: i32, end: i32, alone: i32) -> tuple[i32, i32]:
    """The layers behind all edges that are met at one pixel: their end, and the face that is alone.

    A span in one face, as most are, or in none has no layers; the face, or -1, is `alone`.
    """
    while edge != 0:
        passed = sorted_edges[edge - 1]
        if end == first and (passed.first == alone or passed.second == alone):
            # From the face on one side to that on the other, whichever is which.
            alone = alone ^ passed.first ^ passed.second
        else:
            if end == first and alone != NOTHING:
                end = toggle(alone, first, end)
            if passed.first != NOTHING:
                end = toggle(passed.first, first, end)
            if passed.second != NOTHING:
                end = toggle(passed.second, first, end)
            if end <= first + 1:
                alone = layers[first].face if end > first else NOTHING
                end = first
        edge = links[edge - 1].next
    return end, alone


@module
def nearest_face(first: i32, end: i32, column: i32, row: i32, view: View, frame: Frame) -> i32:
    """Of the layers, the face that is nearest at a pixel; of several, that with the least number."""
    direction = sample_direction(view, frame, column, row)
    nearest = layers[first].face
    height = dot(face_planes[nearest].slope, direction)
    for place in range(first + 1, end):
        face = layers[place].face
        other = dot(face_planes[face].slope, direction)
        if other > height or (other == height and face < nearest):
            nearest = face
            height = other
    return nearest


@module
def next_edge(column: i32, first_column: i32, width: i32) -> i32:
    """The first pixel after `column` at which an edge is met, or the end of the row."""
    following = column + 1
    while following < width:
        if following & 3 == 0 and marks[first_column + following >> 2].met == 0:
            following += 4
        elif columns[first_column + following].edge != 0:
            return following
        else:
            following += 1
    return min(following, width)


@module
def nearest_until(
    first: i32, end: i32, column: i32, row: i32, first_column: i32, view: View, frame: Frame
) -> tuple[i32, i32]:
    """The layer that is nearest from a pixel on, and the first pixel, at most the next edge, where another may be.

    Depth is linear in 1 / z along a row: a face that is nearest at both ends of a span is nearest in all of it. Where
    it is not, faces cross, and the last pixel where it still is is found by bisection.
    """
    nearest = nearest_face(first, end, column, row, view, frame)
    known = column
    beyond = next_edge(column, first_column, view.region_width)
    probe = beyond - 1
    while known + 1 < beyond:
        if nearest_face(first, end, probe, row, view, frame) == nearest:
            known = probe
        else:
            beyond = probe
        probe = known + beyond >> 1
    return nearest, beyond


@module
def draw_row(row: i32, first: i32, first_column: i32, view: View, frame: Frame):
    """The faces that show on one row of the region, four pixels at a time; its active edges have been sorted."""
    quads = quads_across(view)
    end = first
    alone = NOTHING
    shown = NOTHING
    until = 4 * quads
    for quad in range(quads):
        mark = (first_column >> 2) + quad
        four = Visible(shown, shown, shown, shown)
        if marks[mark].met != 0 or until < 4 * quad + 4:
            marks[mark].met = 0
            for column in range(4 * quad, 4 * quad + 4):
                edge = columns[first_column + column].edge
                if edge != 0 or column == until:
                    columns[first_column + column].edge = 0
                    end, alone = pass_edges(edge, first, end, alone)
                    shown = alone
                    until = 4 * quads
                    if end > first:
                        shown, until = nearest_until(first, end, column, row, first_column, view, frame)
                four = Visible(four.b, four.c, four.d, shown)
        visible_faces[row * quads + quad] = four


@module
def draw_band(band: i32):
    """Decide what shows on the rows of one band: Figure 10's loop over scanlines."""
    view = views[0]
    frame = frames[0]
    top = band << frame.band_shift
    bottom = min(top + (1 << frame.band_shift), view.region_height)
    first_column = band * quads_across(view) * 4
    first = row_buckets[top].begin
    end = first
    for row in range(top, bottom):
        end = continue_active_edges(first, end, row, first_column, view, frame)
        end = begin_active_edges(end, row, first_column, view, frame)
        draw_row(row, first, first_column, view, frame)
