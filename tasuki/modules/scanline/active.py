"""The active edge table: the edges that a row crosses, in the place of those of their band that began before.

Initialisation (module 10), update from row to row (11), and sort (12). A band's entries of the sorted edge table stand
together; as rows go on, the front of that range becomes the active edge table.
"""

from tasuki.language import i32, max, module, select
from tasuki.modules.records import View
from tasuki.modules.scanline.edges import end_row
from tasuki.modules.scanline.fixed import first_from
from tasuki.modules.scanline.records import Edge, Frame, columns, links, marks, row_buckets, sorted_edges


@module(number=12, method="scanline")
def sort_active_edge(place: i32, edge: Edge, first_column: i32, view: View, frame: Frame):
    """Enter an active edge at the first pixel of the row behind it, among all others there.

    A distribution sort: pixels are few, and the places of all edges on a row take one step each. Edges behind the last
    pixel bound nothing that shows.
    """
    column = max(first_from(edge.x + i32(edge.rest > 0), frame.sample_x) - view.region_x, 0)
    if column < view.region_width:
        marks[first_column + column >> 2].met = 1
        links[place].next = columns[first_column + column].edge
        columns[first_column + column].edge = place + 1


@module(number=11, method="scanline")
def update_active_edge(edge: Edge) -> Edge:
    """An edge on the next row."""
    rest = edge.rest + edge.step_rest
    over = rest >= edge.height
    stepped = edge
    stepped.x = edge.x + edge.step + i32(over)
    stepped.rest = select(over, rest - edge.height, rest)
    return stepped


@module(number=10, method="scanline")
def begin_active_edges(place: i32, row: i32, first_column: i32, view: View, frame: Frame) -> i32:
    """Append the edges that begin on a row to the active edge table, which ends at `place`; its new end."""
    end = place
    for entry in range(row_buckets[row].begin, row_buckets[row].end):
        edge = sorted_edges[entry]
        sorted_edges[end] = edge
        sort_active_edge(end, edge, first_column, view, frame)
        end += 1
    return end


@module
def continue_active_edges(first: i32, end: i32, row: i32, first_column: i32, view: View, frame: Frame) -> i32:
    """Bring the active edges `first` .. `end` - 1 to row `row` of the region; without those that ended, the new end."""
    kept = first
    for place in range(first, end):
        edge = sorted_edges[place]
        if end_row(edge) > view.region_y + row:
            stepped = update_active_edge(edge)
            sorted_edges[kept] = stepped
            sort_active_edge(kept, stepped, first_column, view, frame)
            kept += 1
    return kept
