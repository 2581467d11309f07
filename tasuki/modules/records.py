"""The records of the four-bank memory (paper, Figures 7 and 8), and the named tables that hold them.

The first row of every primitive is the same: kind, attribute, matrix, flags. Pointers to records of one table are
indices into it. Words that the paper leaves free carry our additions: flags, the highlight's exponent, a quadric's
linear term.
"""

from tasuki.language import Table, f32, i32, mat4, record, vec3

TWO_SIDED = 1
"""Flag: the surface shows from both sides; without it only from outside (n.d < 0)."""
INSIDE_ONLY = 2
"""Flag: only the inside of the surface shows."""


SPHERE = 4
"""Flag of a quadric: Q is the unit matrix and there is no linear term."""
UNION = 8
"""Flag of an object, and of a token: its operation is a union."""
SHEET = 16
"""Flag of an object: a polygon, the part of its first literal's plane that lies within the others."""
SURFACE = 32
"""Flag of an object: a surface of a user's kind, which has no inside; it is the object's one literal."""


POINT = 0
DIRECTIONAL = 1
"""Kinds of lights."""


LEAF_SHIFT = 3
LEAF_MASK = 7
"""A leaf of the BVH has its first place above, and its number of primitives less one in these bits."""


@record
class Plane:
    """normal . P + d = 0; IN where it is negative. The normal has unit length."""

    kind: i32
    attribute: i32
    matrix: i32
    flags: i32
    normal: vec3
    d: f32


@record
class Quadric:
    """(P-p)^T Q (P-p) + l . (P-p) = r; IN where the left side is less. `qi` is the i-th column of the symmetric Q."""

    kind: i32
    attribute: i32
    matrix: i32
    flags: i32
    centre: vec3
    constant: f32
    q1: vec3
    l1: f32
    q2: vec3
    l2: f32
    q3: vec3
    l3: f32


@record
class Cone:
    """An open cone or cylinder without caps: at height h above the base along the unit axis, radius + slope * h."""

    kind: i32
    attribute: i32
    matrix: i32
    flags: i32
    base: vec3
    radius: f32
    axis: vec3
    length: f32
    slope: f32


@record
class Triangle:
    """Corners counterclockwise as seen from the front, and a normal of any length at each."""

    kind: i32
    attribute: i32
    matrix: i32
    flags: i32
    a: vec3
    b: vec3
    c: vec3
    normal_a: vec3
    normal_b: vec3
    normal_c: vec3


@record
class Quad:
    """A flat convex quadrilateral: corners counterclockwise as seen from the front, and a normal of any length at each.
    """

    kind: i32
    attribute: i32
    matrix: i32
    flags: i32
    a: vec3
    b: vec3
    c: vec3
    d: vec3
    normal_a: vec3
    normal_b: vec3
    normal_c: vec3
    normal_d: vec3


@record
class Object:
    """Primitives combined by set operations: tokens `first` .. `end` - 1 are the formula, the box its bounds.

    `attribute` is the medium inside. Flag UNION: the formula's outermost operation is a union, else an intersection;
    flag SHEET: only its first literal shows.
    """

    kind: i32
    attribute: i32
    matrix: i32
    flags: i32
    low: vec3
    first: i32
    high: vec3
    end: i32


@record
class Token:
    """One token of a formula; see `tasuki.modules.formula` for how they are read.

    `operand`: the code of a literal's surface, or the index of bounds (-1: none). `skip` is the row that is read next
    where this token settles what follows. `rank` tells literals in the order in which they were written; `ranked` is
    the row of the literal whose rank is this token's place in its formula.
    """

    operator: i32
    operand: i32
    skip: i32
    rank: i32
    attribute: i32
    matrix: i32
    ranked: i32


@record
class Bounds:
    """The box around a part of a formula."""

    low: vec3
    high: vec3


@record
class Matrix:
    """From the coordinates in memory to local ones: a point is (x, y, z, 1) @ `m`."""

    m: mat4


@record
class Medium:
    """A transparent solid that meets others: its code, and the box around it."""

    low: vec3
    code: i32
    high: vec3
    attribute: i32


@record
class Attribute:
    """What a surface is made of (paper, Figure 8). `texture` is a texture's index * 32 + its kind, or -1."""

    colour: vec3
    flags: i32
    ambient: f32
    diffuse: f32
    specular: f32
    exponent: f32
    reflection: f32
    transmission: f32
    index: f32
    texture: i32
    transmittance: vec3


@record
class Light:
    """A light. `position` is where a POINT light is, and the unit vector to a DIRECTIONAL one."""

    position: vec3
    kind: i32
    colour: vec3


@record
class View:
    """What is drawn: sample (x, y) of the picture lies in direction corner + x * right + y * down from the eye.

    Places in memory count from `origin`: a module that wants a point in the scene's own coordinates adds it. Rays whose
    weight is not above `cutoff` in any colour are not followed.
    """

    eye: vec3
    width: i32
    corner: vec3
    height: i32
    right: vec3
    samples: i32
    down: vec3
    depth: i32
    background: vec3
    cutoff: f32
    origin: vec3
    region_x: i32
    region_y: i32
    region_width: i32
    region_height: i32


@record
class BVHNode:
    """Two boxes and where they lead: to a node's index, or to -1 - (8 * place + count - 1), a leaf.

    A leaf is `count` primitives, those of `references` from `place` on.
    """

    left_low: vec3
    left: i32
    left_high: vec3
    right: i32
    right_low: vec3
    right_high: vec3


@record
class Box:
    """Bounds of one primitive, or of a part of it, its code (index * 32 + kind), and what it costs to intersect (a
    triangle: 1).
    """

    low: vec3
    code: i32
    high: vec3
    cost: f32


@record
class ExtentNode:
    """A node of the scene tree in preorder: the sphere around it (radius negative: it has none), the index of the node
    that comes after all that it holds, and the code of the thing that it is (-1: a group).
    """

    centre: vec3
    radius: f32
    skip: i32
    code: i32


@record
class Pixel:
    """Linear colour of one pixel."""

    colour: vec3
    coverage: f32


@record
class RayCounts:
    """Rays that one pixel sent."""

    eye_hits: i32
    reflection: i32
    refraction: i32
    shadow: i32


planes = Table(Plane)
quadrics = Table(Quadric)
cones = Table(Cone)
triangles = Table(Triangle)
quads = Table(Quad)
objects = Table(Object)
tokens = Table(Token)
bounds = Table(Bounds)
matrices = Table(Matrix)
media = Table(Medium)
attributes = Table(Attribute)
lights = Table(Light)
views = Table(View)
bvh_nodes = Table(BVHNode)
boxes = Table(Box)
references = Table(Box)
extent_nodes = Table(ExtentNode)
picture = Table(Pixel)
ray_counts = Table(RayCounts)
