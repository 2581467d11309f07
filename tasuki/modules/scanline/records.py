"""The scanline method's data (paper, Figure 11), and the named tables that hold it.

The scene's part stays from frame to frame: vertices, normals, faces that point to them, and the edges between faces.
The frame's part is computed anew: the *reference coordinate system* has the eye at its origin, x to the right of the
picture, y down, and z along the view. Screen coordinates are whole numbers of subpixels (`fixed.SUBPIXEL` of a pixel)
from the picture's upper left corner.
"""

from tasuki.language import Table, f32, i32, mat4, record, vec3
from tasuki.modules.records import Light

HIDDEN, WHOLE, PARTIAL = 0, 1, 2
"""States of a face: it does not show, it lies within the view whole, or it must be clipped."""


@record
class Vertex:
    """A corner of faces, in the object's coordinates."""

    position: vec3


@record
class VertexNormal:
    """A normal of any length, in the object's coordinates."""

    normal: vec3


@record
class Face:
    """A triangle: its vertices, counterclockwise as seen from the front, the normals there, and its attribute."""

    a: i32
    b: i32
    c: i32
    attribute: i32
    normal_a: i32
    normal_b: i32
    normal_c: i32
    flags: i32


@record
class FaceEdge:
    """An edge between two vertices, and the faces that meet there; `second` is -1 where there is only one."""

    a: i32
    b: i32
    first: i32
    second: i32


@record
class Frame:
    """What one pass over the picture is made with. Module 1 computes the last three matrices, the host the rest.

    `pixel` is the side of a pixel at distance 1 from the eye. In pass `sample` each pixel is looked at in one point,
    `sample_x`, `sample_y` subpixels from its upper left corner, which counts with weight `share`. Nothing nearer than
    z = `near` shows; 1 / z of what shows lies between `farthest` and `nearest`. A band has 2**band_shift rows; the
    first pixels of neighbouring rows have numbers 2**row_shift apart.
    """

    scene_from_object: mat4
    reference_from_scene: mat4
    reference_from_object: mat4
    reference_from_normal: mat4
    pixel: f32
    near: f32
    nearest: f32
    farthest: f32
    share: f32
    sample_x: i32
    sample_y: i32
    band_shift: i32
    row_shift: i32
    sample: i32


@record
class ReferenceVertex:
    """A vertex in reference coordinates, and the sides of the view that it lies beyond, as bits."""

    position: vec3
    outcode: i32


@record
class ScreenVertex:
    """A vertex on the screen, in subpixels; not defined outside the view."""

    x: i32
    y: i32


@record
class FacePlane:
    """What is linear over the screen: in direction d = (x, y, 1) the face has depth z with 1 / z = slope . d.

    The normal there, on the side that is seen and of any length, is (normal_x . d, normal_y . d, normal_z . d). Only
    `state` is defined of a face that is hidden.
    """

    slope: vec3
    state: i32
    normal_x: vec3
    attribute: i32
    normal_y: vec3
    normal_z: vec3


@record
class Partial:
    """A face that must be clipped."""

    face: i32


@record
class Edge:
    """An edge on the screen, on the rows `rows` // 65536 up to, not including, `rows` % 65536.

    It crosses the first of them (later: the current one) at x + rest / height subpixels, and each row after that
    step + step_rest / height further. `first` and `second` are the faces that it bounds; -1: none.
    """

    x: i32
    rest: i32
    step: i32
    step_rest: i32
    height: i32
    rows: i32
    first: i32
    second: i32


@record
class RowBucket:
    """Of the sorted edge table: how many edges begin on a row, the place of the first, and that after the last."""

    count: i32
    begin: i32
    end: i32


@record
class FrameCounts:
    """Faces that must be clipped, and the length of the sorted edge table."""

    partial: i32
    sorted: i32


@record
class Column:
    """The active edges that a row meets at one pixel: one more than the first one's place; 0: none."""

    edge: i32


@record
class Mark:
    """Whether a row meets active edges at any of four pixels next to each other: not 0."""

    met: i32


@record
class Link:
    """After an active edge: the next one at the same pixel, as `Column.edge`."""

    next: i32


@record
class Layer:
    """A face that a span lies in, and its 1 / z on the row: depth + slope * x in direction (x, y, 1)."""

    face: i32
    depth: f32
    slope: f32


@record
class FaceSlot:
    """A slot of a hash table: one more than the face, and its place in `layers`; face 0: empty."""

    face: i32
    place: i32


@record
class Visible:
    """The faces that show in four pixels next to each other; -1: none."""

    a: i32
    b: i32
    c: i32
    d: i32


vertices = Table(Vertex)
vertex_normals = Table(VertexNormal)
faces = Table(Face)
face_edges = Table(FaceEdge)
frames = Table(Frame)
frame_counts = Table(FrameCounts)
reference_vertices = Table(ReferenceVertex)
reference_normals = Table(VertexNormal)
reference_lights = Table(Light)
screen_vertices = Table(ScreenVertex)
face_planes = Table(FacePlane)
partial_faces = Table(Partial)
edges = Table(Edge)
row_buckets = Table(RowBucket)
sorted_edges = Table(Edge)
columns = Table(Column)
marks = Table(Mark)
links = Table(Link)
layers = Table(Layer)
face_slots = Table(FaceSlot)
visible_faces = Table(Visible)
