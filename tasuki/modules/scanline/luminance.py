"""Luminance (module 13): flat, Gouraud's and Phong's shading of what shows, a pixel to a lane.

H. Gouraud, "Continuous Shading of Curved Surfaces", 1971; B. T. Phong, "Illumination for Computer Generated Pictures",
1975. Interpolation is that of the face in space, not on the screen.
"""

from tasuki.language import cross, dot, f32, i32, max, min, module, norm, normalize, reciprocal, select, socket, vec3
from tasuki.modules.records import DIRECTIONAL, Attribute, Pixel, attributes, picture, views
from tasuki.modules.scanline.records import (
    Face,
    FacePlane,
    Visible,
    face_planes,
    faces,
    frames,
    reference_lights,
    reference_normals,
    reference_vertices,
    visible_faces,
)
from tasuki.modules.scanline.reference import quads_across, sample_direction
from tasuki.modules.shading import shading


@socket
def luminance(face: i32, direction: vec3) -> vec3:
    """The light that comes from the point of a face seen in a direction with z = 1, in reference coordinates."""
    ...


@module
def nearness(plane: FacePlane, direction: vec3) -> f32:
    """1 / z of the point of a face in a direction with z = 1, which is within the bounds of everything's."""
    frame = frames[0]
    return min(max(dot(plane.slope, direction), frame.farthest), frame.nearest)


@module
def weights(face: Face, direction: vec3) -> vec3:
    """The share of each corner in the point of a face that is seen in a direction."""
    a = reference_vertices[face.a].position
    b = reference_vertices[face.b].position
    c = reference_vertices[face.c].position
    volumes = vec3(dot(direction, cross(b, c)), dot(direction, cross(c, a)), dot(direction, cross(a, b)))
    return volumes / (volumes.x + volumes.y + volumes.z)


@module
def facing_normal(plane: FacePlane) -> vec3:
    """The unit normal of a face, on the side where the eye is."""
    return -normalize(plane.slope)


@module
def smooth_normal(plane: FacePlane, direction: vec3) -> vec3:
    """The unit normal interpolated between the corners, on the side that is seen; the face's, where there is none."""
    normal = vec3(dot(plane.normal_x, direction), dot(plane.normal_y, direction), dot(plane.normal_z, direction))
    length = norm(normal)
    if length > 0.0:
        return normal * reciprocal(length)
    return facing_normal(plane)


@module
def light_from(attribute: Attribute, way: vec3, scale: f32, normal: vec3) -> vec3:
    """What all lights send from the point way / scale towards the eye: none from behind the surface, and no shadows."""
    result = attribute.ambient * attribute.colour
    direction = normalize(way)
    for n in range(len(reference_lights)):
        light = reference_lights[n]
        far_away = light.kind == DIRECTIONAL
        to_light = normalize(select(far_away, light.position, scale * light.position - way))
        if dot(normal, to_light) > 0.0:
            result = result + shading(attribute, normal, direction, to_light, light.colour)
    return result


@module(number=13, method="scanline", fills="luminance")
def phong_luminance(face: i32, direction: vec3) -> vec3:
    """The luminance with the normal interpolated between the corners."""
    plane = face_planes[face]
    return light_from(
        attributes[plane.attribute], direction, nearness(plane, direction), smooth_normal(plane, direction)
    )


@module
def corner_luminance(plane: FacePlane, corner: vec3, normal: vec3) -> vec3:
    """The luminance at a corner with this normal, which may point to either side."""
    outward = normalize(normal)
    facing = select(dot(facing_normal(plane), outward) < 0.0, -outward, outward)
    return light_from(attributes[plane.attribute], corner, 1.0, facing)


@module(number=13, method="scanline", fills="luminance")
def gouraud_luminance(face: i32, direction: vec3) -> vec3:
    """The luminances at the corners, interpolated."""
    corners = faces[face]
    plane = face_planes[face]
    share = weights(corners, direction)
    a, b, c = reference_vertices[corners.a], reference_vertices[corners.b], reference_vertices[corners.c]
    at_a = corner_luminance(plane, a.position, reference_normals[corners.normal_a].normal)
    at_b = corner_luminance(plane, b.position, reference_normals[corners.normal_b].normal)
    at_c = corner_luminance(plane, c.position, reference_normals[corners.normal_c].normal)
    return share.x * at_a + share.y * at_b + share.z * at_c


@module(number=13, method="scanline", fills="luminance")
def flat_luminance(face: i32, direction: vec3) -> vec3:
    """The luminance in the middle of the face, with the face's normal: one for all of it."""
    corners = faces[face]
    plane = face_planes[face]
    a, b, c = reference_vertices[corners.a], reference_vertices[corners.b], reference_vertices[corners.c]
    return light_from(attributes[plane.attribute], a.position + b.position + c.position, 3.0, facing_normal(plane))


@module
def one_of_four(four: Visible, number: i32) -> i32:
    """Of four pixels next to each other, number 0 to 3."""
    left = select(number & 1 == 0, four.a, four.b)
    right = select(number & 1 == 0, four.c, four.d)
    return select(number & 2 == 0, left, right)


@module
def draw_pixel(item: i32):
    """Add what a sample of one pixel shows to the picture; the first sample replaces what was there.

    A row's pixels begin at a multiple of 2**row_shift.
    """
    view = views[0]
    frame = frames[0]
    row = item >> frame.row_shift
    column = item & (1 << frame.row_shift) - 1
    if column < view.region_width:
        face = one_of_four(visible_faces[row * quads_across(view) + (column >> 2)], column & 3)
        colour = view.background
        coverage = 0.0
        if face >= 0:
            colour = luminance(face, sample_direction(view, frame, column, row))
            coverage = 1.0
        place = row * view.region_width + column
        shown = Pixel(frame.share * colour, frame.share * coverage)
        if frame.sample > 0:
            before = picture[place]
            shown = Pixel(before.colour + shown.colour, before.coverage + shown.coverage)
        picture[place] = shown
