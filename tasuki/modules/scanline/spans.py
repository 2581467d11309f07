"""Spans: which face shows between neighbouring active edges. Runs on one lane for each band of rows.

An edge divides the faces that it bounds: passing it, a span leaves one and enters the other. So the faces in which a
span lies are those that were entered an odd number of times, whichever way they turn, and every pixel whose sample lies
between two edges of a face is drawn with it once, without any rule for shared edges but where a row crosses them.
"""

from tasuki.language import f32, i32, max, min, module, record
from tasuki.modules.records import View, views
from tasuki.modules.scanline.active import begin_active_edges, continue_active_edges
from tasuki.modules.scanline.layers import NOWHERE, Room, end_layers, enter_layer, find_layer, leave_layer
from tasuki.modules.scanline.records import (
    Edge,
    Frame,
    Layer,
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
LOOK_AHEAD = 6
"""How many more of the edges at one pixel are looked at for one that bounds the face that shows."""


@record
class Span:
    """Where a row has come to. It lies in the faces of `layers` up to, not including, `end`.

    Face `shown` is the nearest of them, at most until pixel `until`; NOTHING: not known. In one face, as most spans
    are, or in none it has no layers: `shown` is that face, or NOTHING.
    """

    shown: i32
    end: i32
    until: i32


@record
class Row:
    """What is the same all along a row: y of the direction to it, x of that to its first pixel, and from one pixel to
    the next; the pixel behind its last.
    """

    y: f32
    x: f32
    step: f32
    last: i32


@module
def row_of(row: i32, view: View, frame: Frame) -> Row:
    """A row of the region."""
    direction = sample_direction(view, frame, 0, row)
    return Row(direction.y, direction.x, frame.pixel, 4 * quads_across(view))


@module
def layer_of(face: i32, row: Row) -> Layer:
    """A face as a layer of a row."""
    slope = face_planes[face].slope
    return Layer(face, slope.y * row.y + slope.z, slope.x)


@module
def is_nearer(layer: Layer, than: Layer, x: f32) -> bool:
    """Whether a layer lies before another; at equal depth the face with the lower number does."""
    depth = layer.depth + layer.slope * x
    other = than.depth + than.slope * x
    return depth > other or (depth == other and layer.face < than.face)


@module
def overtaken(nearest: Layer, layer: Layer, column: i32, row: Row, until: i32) -> i32:
    """The first pixel behind `column`, before `until`, at which a layer may be before the nearest; else `until`.

    1 / z is linear along a row. Rounded down, so that the faces are compared again rather too early.
    """
    x = row.x + row.step * f32(column)
    gap = nearest.depth - layer.depth + (nearest.slope - layer.slope) * x
    closing = row.step * (layer.slope - nearest.slope)
    if gap >= closing * f32(until - column):
        return until
    return column + max(i32(gap / closing), 1)


@module
def decide(span: Span, first: i32, column: i32, row: Row) -> Span:
    """The span with the nearest of all its layers found, and until where it is."""
    x = row.x + row.step * f32(column)
    nearest = layers[first]
    for place in range(first + 1, span.end):
        if is_nearer(layers[place], nearest, x):
            nearest = layers[place]
    until = row.last
    for place in range(first, span.end):
        if layers[place].face != nearest.face:
            until = overtaken(nearest, layers[place], column, row, until)
    return Span(nearest.face, span.end, until)


@module
def challenge(span: Span, layer: Layer, column: i32, row: Row) -> Span:
    """The span after a face was entered: all others stay behind the one that showed for as long as was known."""
    shown = layer_of(span.shown, row)
    if is_nearer(layer, shown, row.x + row.step * f32(column)):
        return Span(layer.face, span.end, overtaken(layer, shown, column, row, span.until))
    return Span(span.shown, span.end, overtaken(shown, layer, column, row, span.until))


@module
def toggle(span: Span, face: i32, column: i32, row: Row, room: Room) -> Span:
    """Leave a face if the span lies in it, else enter it."""
    place = find_layer(face, span.end, room)
    if place != NOWHERE:
        leave_layer(place, span.end, room)
        return Span(NOTHING if face == span.shown else span.shown, span.end - 1, span.until)
    layer = layer_of(face, row)
    enter_layer(layer, span.end, room)
    entered = Span(span.shown, span.end + 1, span.until)
    if span.shown == NOTHING:
        return entered
    return challenge(entered, layer, column, row)


@module
def pass_edge(span: Span, edge: Edge, column: i32, row: Row, room: Room) -> Span:
    """The span behind an edge, by which it leaves or enters the faces on both sides, of which some are layers."""
    passed = span
    if span.end == room.first and span.shown != NOTHING:
        enter_layer(layer_of(span.shown, row), span.end, room)
        passed = Span(span.shown, span.end + 1, row.last)
    if edge.first != NOTHING:
        passed = toggle(passed, edge.first, column, row, room)
    if edge.second != NOTHING:
        passed = toggle(passed, edge.second, column, row, room)
    if passed.end > room.first + 1:
        return passed
    return Span(layers[room.first].face if passed.end > room.first else NOTHING, room.first, row.last)


@module
def bounds(edge: i32, face: i32) -> bool:
    """Whether an active edge bounds a face; with face NOTHING, whether it bounds one only."""
    return sorted_edges[edge - 1].first == face or sorted_edges[edge - 1].second == face


@module
def bring_forward(edge: i32, face: i32) -> i32:
    """A list of edges, with one that bounds a face before its first, if one of the next few does.

    At one pixel edges stand in any order. From neighbour to neighbour a span never lies in several faces.
    """
    before = edge
    for _ in range(LOOK_AHEAD):
        following = links[before - 1].next
        if following == 0:
            return edge
        if bounds(following, face):
            links[before - 1].next = links[following - 1].next
            links[following - 1].next = edge
            return following
        before = following
    return edge


@module
def pass_edges(span: Span, edge: i32, column: i32, row: Row, room: Room) -> Span:
    """The span behind all edges that are met at one pixel."""
    while edge != 0:
        if span.end == room.first:
            if not bounds(edge, span.shown):
                edge = bring_forward(edge, span.shown)
        passed = sorted_edges[edge - 1]
        if span.end == room.first and (passed.first == span.shown or passed.second == span.shown):
            # From the face on one side to that on the other, whichever is which.
            span.shown = span.shown ^ passed.first ^ passed.second
        else:
            span = pass_edge(span, passed, column, row, room)
        edge = links[edge - 1].next
    if span.end > room.first and (span.shown == NOTHING or span.until <= column):
        return decide(span, room.first, column, row)
    return span


@module
def draw_row(number: i32, room: Room, first_column: i32, view: View, frame: Frame):
    """The faces that show on one row of the region, four pixels at a time; its active edges have been sorted."""
    row = row_of(number, view, frame)
    quads = quads_across(view)
    span = Span(NOTHING, room.first, row.last)
    for quad in range(quads):
        mark = (first_column >> 2) + quad
        four = Visible(span.shown, span.shown, span.shown, span.shown)
        if marks[mark].met != 0 or span.until < 4 * quad + 4:
            marks[mark].met = 0
            for column in range(4 * quad, 4 * quad + 4):
                edge = columns[first_column + column].edge
                if edge != 0 or column == span.until:
                    columns[first_column + column].edge = 0
                    span = pass_edges(span, edge, column, row, room)
                four = Visible(four.b, four.c, four.d, span.shown)
        visible_faces[number * quads + quad] = four
    end_layers(span.end, room)


@module
def draw_band(band: i32):
    """Decide what shows on the rows of one band: Figure 10's loop over scanlines."""
    view = views[0]
    frame = frames[0]
    top = band << frame.band_shift
    bottom = min(top + (1 << frame.band_shift), view.region_height)
    first_column = band * quads_across(view) * 4
    first = row_buckets[top].begin
    room = Room(first, 2 * (row_buckets[bottom - 1].end - first))
    end = first
    for row in range(top, bottom):
        end = continue_active_edges(first, end, row, first_column, view, frame)
        end = begin_active_edges(end, row, first_column, view, frame)
        draw_row(row, room, first_column, view, frame)
