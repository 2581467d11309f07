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
def transform(index: i32):
    """Modules 3 and 7 for one vertex, with the sides of the view that it lies beyond; module 6 for one normal."""
    view = views[0]
    frame = frames[0]
    if index < len(vertices):
        position = vertex_to_reference(vertices[index].position, frame.reference_from_object)
        point = homogeneous(position, view, frame)
        reference_vertices[index] = ReferenceVertex(position, outcode(point, view, frame))
        screen_vertices[index] = perspective(point)
    if index < len(vertex_normals):
        normal = vertex_normal(vertex_normals[index].normal, frame.reference_from_normal)
        reference_normals[index] = VertexNormal(normal)


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
def plane_of(a: vec3, b: vec3, c: vec3, normal_a: vec3, normal_b: vec3, normal_c: vec3) -> FacePlane:
    """The plane of a triangle, by module 5, and the normal over it; `state` and `attribute` are left to be filled in.

    A corner weighs as much in a direction as the tetrahedron of the eye, the direction and the opposite edge is large,
    so that no corner need lie before the eye.
    """
    normal = face_normal(a, b, c)
    distance = dot(normal, a)
    scale = -reciprocal(abs(distance))
    at_a = scale * cross(b, c)
    at_b = scale * cross(c, a)
    at_c = scale * cross(a, b)
    normal_x = normal_a.x * at_a + normal_b.x * at_b + normal_c.x * at_c
    normal_y = normal_a.y * at_a + normal_b.y * at_b + normal_c.y * at_c
    normal_z = normal_a.z * at_a + normal_b.z * at_b + normal_c.z * at_c
    return FacePlane(normal / distance, HIDDEN, normal_x, 0, normal_y, normal_z)


@module
def place_face(index: i32):
    """Whether one face shows, and if so its plane; a face that must be clipped is noted."""
    face = faces[index]
    a = reference_vertices[face.a]
    b = reference_vertices[face.b]
    c = reference_vertices[face.c]
    away = dot(face_normal(a.position, b.position, c.position), a.position) >= 0.0
    state = face_state(a.outcode & b.outcode & c.outcode, a.outcode | b.outcode | c.outcode, face.flags, away)
    if state != HIDDEN:
        normal_a = reference_normals[face.normal_a].normal
        normal_b = reference_normals[face.normal_b].normal
        normal_c = reference_normals[face.normal_c].normal
        plane = plane_of(a.position, b.position, c.position, normal_a, normal_b, normal_c)
        steepest = max(max(abs(plane.slope.x), abs(plane.slope.y)), abs(plane.slope.z))
        if not steepest < STEEPEST:
            state = HIDDEN
        plane.state = state
        plane.attribute = face.attribute
        face_planes[index] = plane
        if state == PARTIAL:
            partial_faces[atomic_add(frame_counts[0].partial, 1)].face = index
    else:
        face_planes[index].state = HIDDEN
