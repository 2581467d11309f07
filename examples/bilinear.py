"""A surface of one's own, the bilinear patch: `tasuki render examples/bilinear.yaml --with examples/bilinear.py`."""

from tasuki.language import Table, cross, dot, f32, i32, max, min, module, normalize, record, select, vec3
from tasuki.modules.crossing import NOWHERE, first_crossing, quadratic_crossings
from tasuki.scene.kinds import PrimitiveKind, register


@record
class Bilinear:
    """What two families of lines cover between four corners that do not lie in a plane: counterclockwise from the
    front, a at (0, 0) of the patch, b at (1, 0), c at (1, 1), d at (0, 1).
    """

    kind: i32
    attribute: i32
    matrix: i32
    flags: i32
    a: vec3
    b: vec3
    c: vec3
    d: vec3


@record
class Frame:
    """The sides of a patch from its first corner, what c lies off their parallelogram, and the volume of the three."""

    across: vec3
    up: vec3
    twist: vec3
    volume: f32


@module
def frame_of(patch: Bilinear) -> Frame:
    """The patch's point at (x, y) is a + x across + y up + x y twist."""
    across, up, twist = patch.b - patch.a, patch.d - patch.a, patch.a - patch.b + patch.c - patch.d
    return Frame(across, up, twist, dot(across, cross(up, twist)))


@module
def in_frame(frame: Frame, vector: vec3) -> vec3:
    """A vector as so much of the three directions: a patch is where z = x y, for x and y from 0 to 1."""
    x = dot(vector, cross(frame.up, frame.twist))
    y = dot(vector, cross(frame.twist, frame.across))
    return vec3(x, y, dot(vector, cross(frame.across, frame.up))) / frame.volume


@module
def crossing_within(origin: vec3, direction: vec3, t: f32) -> f32:
    """A crossing t of a ray, in the frame, if it lies between the patch's sides; else NOWHERE."""
    x, y = origin.x + t * direction.x, origin.y + t * direction.y
    within = min(x, y) >= 0.0 and max(x, y) <= 1.0
    return select(within and t == t, t, NOWHERE)


@module
def bilinear_hit(patch: Bilinear, origin: vec3, direction: vec3, leaving: bool) -> f32:
    """The first visible crossing with t > 0, NOWHERE if there is none: a quadratic, from the ray's middle.

    `leaving`: the ray begins on the patch, so that one crossing is at exactly 0, which makes the constant term 0.
    """
    frame = frame_of(patch)
    shift = 0.0 if leaving else dot(0.5 * (patch.a + patch.c) - origin, direction) / dot(direction, direction)
    o, d = in_frame(frame, origin + shift * direction - patch.a), in_frame(frame, direction)
    front = select(frame.volume > 0.0, 1.0, -1.0)
    c = 0.0 if leaving else front * (o.z - o.x * o.y)
    falls, rises = quadratic_crossings(-front * d.x * d.y, 0.5 * front * (d.z - o.x * d.y - o.y * d.x), c)
    return first_crossing(patch.flags, crossing_within(o, d, falls) + shift, crossing_within(o, d, rises) + shift)


@module
def bilinear_surface(patch: Bilinear, origin: vec3, direction: vec3, point: vec3) -> tuple[vec3, vec3, i32, i32]:
    """At a point of the patch: the unit normal, as geometry and for shading; the attribute and the matrix."""
    frame = frame_of(patch)
    at = in_frame(frame, point - patch.a)
    normal = normalize(cross(frame.across + at.y * frame.twist, frame.up + at.x * frame.twist))
    return normal, normal, patch.attribute, patch.matrix


@module
def bilinear_bounds(patch: Bilinear) -> tuple[vec3, vec3]:
    """The corners of the box around its corners, within which it lies."""
    return min(min(patch.a, patch.b), min(patch.c, patch.d)), max(max(patch.a, patch.b), max(patch.c, patch.d))


patches = Table(Bilinear)
register(
    PrimitiveKind("bilinear", "surface", patches, bilinear_bounds, hit=bilinear_hit, surface=bilinear_surface, cost=2.0)
)
