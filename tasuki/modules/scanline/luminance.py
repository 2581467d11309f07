"""Luminance (module 13): flat, Gouraud's and Phong's shading of what shows, a pixel to a lane.

H. Gouraud, "Continuous Shading of Curved Surfaces", 1971; B. T. Phong, "Illumination for Computer Generated Pictures",
1975. Interpolation is that of the face in space, not on the screen.
"""

from tasuki.language import cross, dot, i32, max, min, module, norm, normalize, reciprocal, select, socket, vec3
from tasuki.modules.records import Attribute, Pixel, attributes, picture, views
from tasuki.modules.scanline.records import (
    Face,
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
def point_seen(face: i32, direction: vec3) -> vec3:
    """The point of a face in a direction with z = 1, no nearer and no farther than anything is."""
    frame = frames[0]
    height = dot(face_planes[face].slope, direction)
    return direction * min(max(reciprocal(height), frame.near), frame.far)


@module
def weights(face: Face, direction: vec3) -> tuple[vec3, bool]:
    """The share of each corner in the point seen in a direction; whether it is the back that is seen.

    Each is the volume between the eye, the direction and the opposite edge: no corner need lie before the eye.
    """
    a = reference_vertices[face.a].position
    b = reference_vertices[face.b].position
    c = reference_vertices[face.c].position
    volumes = vec3(dot(direction, cross(b, c)), dot(direction, cross(c, a)), dot(direction, cross(a, b)))
    whole = volumes.x + volumes.y + volumes.z
    return volumes / whole, whole > 0.0


@module
def facing_normal(face: i32) -> vec3:
    """The unit normal of a face, on the side where the eye is."""
    return -normalize(face_planes[face].slope)


@module
def smooth_normal(face: i32, share: vec3, back: bool) -> vec3:
    """The unit normal between those at the corners, on the side that is seen; the face's, where there is none."""
    corner = faces[face]
    normal = (
        share.x * reference_normals[corner.normal_a].normal
        + share.y * reference_normals[corner.normal_b].normal
        + share.z * reference_normals[corner.normal_c].normal
    )
    length = norm(normal)
    outward = normal * reciprocal(length)
    facing = select(back, -outward, outward)
    return select(length > 0.0, facing, facing_normal(face))


@module
def light_from(attribute: Attribute, point: vec3, normal: vec3) -> vec3:
    """What all lamps send from a point towards the eye. A lamp behind the surface sends nothing; none is in shadow."""
    result = attribute.ambient * attribute.colour
    direction = normalize(point)
    for n in range(len(reference_lights)):
        light = reference_lights[n]
        to_light = normalize(light.position - point)
        if dot(normal, to_light) > 0.0:
            result = result + shading(attribute, normal, direction, to_light, light.colour)
    return result


@module(number=13, method="scanline", fills="luminance")
def phong_luminance(face: i32, direction: vec3) -> vec3:
    """The luminance with the normal interpolated between the corners."""
    share, back = weights(faces[face], direction)
    normal = smooth_normal(face, share, back)
    return light_from(attributes[faces[face].attribute], point_seen(face, direction), normal)


@module(number=13, method="scanline", fills="luminance")
def gouraud_luminance(face: i32, direction: vec3) -> vec3:
    """The luminances at the corners, interpolated."""
    corners = faces[face]
    attribute = attributes[corners.attribute]
    share, back = weights(corners, direction)
    at_a = light_from(attribute, reference_vertices[corners.a].position, smooth_normal(face, vec3(1, 0, 0), back))
    at_b = light_from(attribute, reference_vertices[corners.b].position, smooth_normal(face, vec3(0, 1, 0), back))
    at_c = light_from(attribute, reference_vertices[corners.c].position, smooth_normal(face, vec3(0, 0, 1), back))
    return share.x * at_a + share.y * at_b + share.z * at_c


@module(number=13, method="scanline", fills="luminance")
def flat_luminance(face: i32, direction: vec3) -> vec3:
    """The luminance in the middle of the face, with the face's normal: one for all of it."""
    corners = faces[face]
    whole = (
        reference_vertices[corners.a].position
        + reference_vertices[corners.b].position
        + reference_vertices[corners.c].position
    )
    return light_from(attributes[corners.attribute], whole / 3.0, facing_normal(face))


@module
def one_of_four(four: Visible, number: i32) -> i32:
    """Of four pixels next to each other, number 0 to 3."""
    left = select(number & 1 == 0, four.a, four.b)
    right = select(number & 1 == 0, four.c, four.d)
    return select(number & 2 == 0, left, right)


@module
def draw_pixel(item: i32):
    """Add what a sample of one pixel shows to the picture; the first replaces what was there. A row's pixels begin at a multiple of 2**row_shift."""
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
