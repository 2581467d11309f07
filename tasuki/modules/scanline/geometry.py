"""Vertices and faces of a frame: transform (3), face normal (5), vertex normal (6), perspective (7)."""

from tasuki.language import abs, atomic_add, cross, dot, f32, i32, mat4, max, module, reciprocal, vec3, vec4
from tasuki.modules.records import INSIDE_ONLY, TWO_SIDED, View, views
from tasuki.modules.scanline.clipping import outcode
from tasuki.modules.scanline.fixed import fixed
from tasuki.modules.scanline.records import (
    HIDDEN,
    PARTIAL,
    WHOLE,
    FacePlane,
    Frame,
    ReferenceVertex,
    ScreenVertex,
    VertexNormal,
    face_planes,
    faces,
    frame_counts,
    frames,
    partial_faces,
    reference_normals,
    reference_vertices,
    screen_vertices,
    vertex_normals,
    vertices,
)

STEEPEST = 1e30
"""A face's slope beyond which it is seen on edge."""


@module(number=3, method="scanline")
def vertex_to_reference(position: vec3, reference_from_object: mat4) -> vec3:
    """A vertex in the reference system."""
    moved = vec4(position, 1.0) @ reference_from_object
    return moved.xyz


@module(number=5, method="scanline")
def face_normal(a: vec3, b: vec3, c: vec3) -> vec3:
    """The normal of a triangle, twice its area long, towards the side from which it is counterclockwise."""
    return cross(b - a, c - a)


@module(number=6, method="scanline")
def vertex_normal(normal: vec3, reference_from_normal: mat4) -> vec3:
    """A normal in the reference system; its length has no meaning."""
    turned = vec4(normal, 0.0) @ reference_from_normal
    return turned.xyz


@module
def homogeneous(position: vec3, view: View, frame: Frame) -> vec3:
    """(x, y, w) of a point in reference coordinates: x / w and y / w are its place on the screen, in pixels."""
    scale = reciprocal(frame.pixel)
    x = position.x * scale + 0.5 * f32(view.width) * position.z
    y = position.y * scale + 0.5 * f32(view.height) * position.z
    return vec3(x, y, position.z)


@module(number=7, method="scanline")
def perspective(point: vec3) -> ScreenVertex:
    """Where a homogeneous point within the view stands on the screen."""
    scale = reciprocal(point.z)
    return ScreenVertex(fixed(point.x * scale), fixed(point.y * scale))


@module
def transform_vertex(index: i32):
    """Modules 3 and 7 for one vertex, and the sides of the view that it lies beyond."""
    view = views[0]
    frame = frames[0]
    position = vertex_to_reference(vertices[index].position, frame.reference_from_object)
    point = homogeneous(position, view, frame)
    reference_vertices[index] = ReferenceVertex(position, outcode(point, view, frame))
    screen_vertices[index] = perspective(point)


@module
def transform_normal(index: i32):
    """Module 6 for one normal."""
    reference_normals[index] = VertexNormal(vertex_normal(vertex_normals[index].normal, frames[0].reference_from_normal))


@module
def face_state(outside_all: i32, outside_any: i32, flags: i32, away: bool) -> i32:
    """Whether a face shows whole, in part, or not; `away`: it turns its back to the eye."""
    turned = away != (flags & INSIDE_ONLY != 0)
    if outside_all != 0 or (turned and flags & TWO_SIDED == 0):
        return HIDDEN
    if outside_any != 0:
        return PARTIAL
    return WHOLE


@module
def place_face(index: i32):
    """The plane of one face by module 5, and whether it shows; a face that must be clipped is noted."""
    face = faces[index]
    a = reference_vertices[face.a]
    b = reference_vertices[face.b]
    c = reference_vertices[face.c]
    normal = face_normal(a.position, b.position, c.position)
    distance = dot(normal, a.position)
    slope = normal / distance
    state = face_state(
        a.outcode & b.outcode & c.outcode, a.outcode | b.outcode | c.outcode, face.flags, distance >= 0.0
    )
    steepest = max(max(abs(slope.x), abs(slope.y)), abs(slope.z))
    if not steepest < STEEPEST:
        state = HIDDEN
    face_planes[index] = FacePlane(slope, state)
    if state == PARTIAL:
        partial_faces[atomic_add(frame_counts[0].partial, 1)].face = index
