"""The edge table: construction (module 8) and sort by the row on which edges begin (module 9), an address-calculation
sort. An edge that reaches into several bands gets an entry in each of them. Clipped faces bring edges of their own.
"""

from tasuki.language import abs, array, atomic_add, i32, max, min, module, select, vec3
from tasuki.modules.records import views
from tasuki.modules.scanline.clipping import MOST_CORNERS, SIDES, crossing, distance_inside
from tasuki.modules.scanline.fixed import SUBPIXEL, SUBPIXEL_BITS, first_from, multiple, quotient
from tasuki.modules.scanline.geometry import homogeneous, perspective
from tasuki.modules.scanline.records import (
    WHOLE,
    Edge,
    RowBucket,
    ScreenVertex,
    edges,
    face_edges,
    face_planes,
    frame_counts,
    frames,
    partial_faces,
    reference_vertices,
    row_buckets,
    screen_vertices,
    sorted_edges,
)
from tasuki.modules.scanline.records import faces as mesh_faces

ROW_BITS = 16
MOST_ROWS = (1 << ROW_BITS) - 1
SHORT = 1 << 17
"""In subpixels: 32 pixels."""


@module
def slope_multiple(n: i32, bits: i32, across: i32, height: i32) -> tuple[i32, i32]:
    """n * across / height, rounded down, and what remains; n has `bits` bits, 13 at most.

    The result must fit 28 bits. An edge that is short in both directions takes one division, any other longer.
    """
    if abs(across) < SHORT and height < SHORT:
        return quotient(n * across, height)
    slope = across // height
    return multiple(n, bits, slope, across - slope * height, height)


@module
def edge_between(a: ScreenVertex, b: ScreenVertex, first: i32, second: i32, sample_y: i32) -> Edge:
    """The edge between two vertices. Its upper end belongs to it, its lower one does not; level edges have no rows.

    Where it crosses a row is exact, and the same from whichever end it is given.
    """
    down = a.y < b.y
    top_x = select(down, a.x, b.x)
    top_y = select(down, a.y, b.y)
    across = select(down, b.x, a.x) - top_x
    bottom_y = select(down, b.y, a.y)
    height = bottom_y - top_y
    # What was clipped may be rounded to a little outside.
    begin = max(first_from(top_y, sample_y), 0)
    end = min(first_from(bottom_y, sample_y), MOST_ROWS)
    edge = Edge(top_x, 0, 0, 0, height, 0, first, second)
    if begin < end:
        edge.rows = begin << ROW_BITS | end
        # The first row lies not much more than a row below the upper end. An edge that crosses one only needs no step.
        way, edge.rest = slope_multiple(begin * SUBPIXEL + sample_y - top_y, SUBPIXEL_BITS + 1, across, height)
        edge.x = top_x + way
        if begin + 1 < end:
            edge.step, edge.step_rest = slope_multiple(SUBPIXEL, SUBPIXEL_BITS + 1, across, height)
    return edge


@module
def first_row(edge: Edge) -> i32:
    """The first row of the picture that an edge crosses."""
    return edge.rows >> ROW_BITS & 65535


@module
def end_row(edge: Edge) -> i32:
    """The row of the picture after the last that an edge crosses."""
    return edge.rows & 65535


@module
def next_piece(row: i32, band_shift: i32) -> i32:
    """The first row of the next band: an edge that reaches it has an entry there."""
    return (row >> band_shift) + 1 << band_shift


@module
def enter_edge(entry: i32, edge: Edge):
    """Write an entry of the edge table, and count it on every row on which it, or a piece of it in a band, begins."""
    view = views[0]
    edges[entry] = edge
    row = max(first_row(edge) - view.region_y, 0)
    end = min(end_row(edge) - view.region_y, view.region_height)
    while row < end:
        atomic_add(row_buckets[row].count, 1)
        row = next_piece(row, frames[0].band_shift)


@module
def whole(face: i32) -> i32:
    """The face, if there is one and it shows whole; else -1."""
    if face >= 0:
        if face_planes[face].state == WHOLE:
            return face
    return -1


@module(number=8, method="scanline")
def construct_edge(index: i32):
    """The entry of one edge of the mesh in the edge table; without rows where neither of its faces shows whole."""
    edge = face_edges[index]
    first = whole(edge.first)
    second = whole(edge.second)
    if first >= 0 or second >= 0:
        entry = edge_between(screen_vertices[edge.a], screen_vertices[edge.b], first, second, frames[0].sample_y)
        enter_edge(index, entry)
    else:
        edges[index].rows = 0


@module(number=4, method="scanline")
def clip_face(number: i32):
    """Clip face `number` of those that must be, and enter the edges of what is left of it behind the mesh's."""
    view = views[0]
    frame = frames[0]
    index = partial_faces[number].face
    face = mesh_faces[index]
    corners = array(vec3, MOST_CORNERS)
    corners[0] = homogeneous(reference_vertices[face.a].position, view, frame)
    corners[1] = homogeneous(reference_vertices[face.b].position, view, frame)
    corners[2] = homogeneous(reference_vertices[face.c].position, view, frame)
    count = 3
    clipped = array(vec3, MOST_CORNERS)
    for side in range(SIDES):
        kept = 0
        last = corners[count - 1]
        last_distance = distance_inside(last, side, view, frame)
        for n in range(count):
            point = corners[n]
            distance = distance_inside(point, side, view, frame)
            if (distance >= 0.0) != (last_distance >= 0.0):
                clipped[kept] = crossing(point, distance, last, last_distance)
                kept += 1
            if distance >= 0.0:
                clipped[kept] = point
                kept += 1
            last = point
            last_distance = distance
        count = kept
        for n in range(count):
            corners[n] = clipped[n]
    for n in range(MOST_CORNERS):
        entry = len(face_edges) + number * MOST_CORNERS + n
        if n < count:
            a = perspective(corners[n])
            b = perspective(corners[select(n + 1 < count, n + 1, 0)])
            enter_edge(entry, edge_between(a, b, index, -1, frame.sample_y))
        else:
            edges[entry].rows = 0


@module
def lay_out_buckets(item: i32):
    """From how many edges begin on each row: where in the sorted table its first one stands. Runs on one lane."""
    begin = 0
    for row in range(views[0].region_height):
        count = row_buckets[row].count
        row_buckets[row] = RowBucket(count, begin, begin)
        begin += count
    frame_counts[0].sorted = begin


@module(number=9, method="scanline")
def sort_edge(entry: i32):
    """Put one entry of the edge table, or its pieces by bands, among those that begin on the same row, in any order."""
    view = views[0]
    edge = edges[entry]
    begin = first_row(edge) - view.region_y
    row = max(begin, 0)
    end = min(end_row(edge) - view.region_y, view.region_height)
    while row < end:
        place = atomic_add(row_buckets[row].end, 1)
        piece = edge
        if row > begin:
            way, rest = multiple(row - begin, ROW_BITS, edge.step, edge.step_rest, edge.height)
            piece.x = edge.x + way + i32(edge.rest + rest >= edge.height)
            piece.rest = select(edge.rest + rest >= edge.height, edge.rest + rest - edge.height, edge.rest + rest)
        sorted_edges[place] = piece
        row = next_piece(row, frames[0].band_shift)
