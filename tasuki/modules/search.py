"""What every accelerator asks of the things in a scene, and what every renderer asks of an accelerator.

A *code* names one thing that a ray may hit: index * 32 + kind for a primitive of that kind, index * 32 + OBJECT for an
object (a formula of set operations). A ray also carries the code of the surface that it has left: a primitive's own, or
that of one of an object's surfaces; so it is known by identity, not by distance.
"""

from tasuki.language import f32, i32, module, select, socket, vec3

NOTHING = -1
"""The code of no thing: what a ray has hit that hit nothing, or has left that left nothing."""
OBJECT = 31
"""The kind of objects."""


@socket(dispatch=True)
def primitive_hit(kind: i32, index: i32, origin: vec3, direction: vec3, leaving: bool) -> f32:
    """The first visible crossing of a primitive with t > 0, or NOWHERE (or NaN)."""
    ...


@socket
def hit_of(code: i32, origin: vec3, direction: vec3, left: i32, far: f32) -> f32:
    """The first visible crossing of a thing with t > 0, or NOWHERE (or NaN); beyond `far` it may be either."""
    ...


@socket
def nearest_hit(origin: vec3, direction: vec3, left: i32) -> tuple[f32, i32]:
    """The nearest visible hit of a ray of unit direction: its t, and the code of the thing (NOTHING: none).

    `left` is the code of the surface on which the ray begins. Hits at one t go to the lower code, so that no
    accelerator shows in a picture.
    """
    ...


@socket
def is_blocked(origin: vec3, direction: vec3, left: i32, distance: f32) -> bool:
    """Whether something visible lies on a ray of unit direction before `distance`; `left` as in `nearest_hit`."""
    ...


@module(fills="hit_of")
def hit_of_primitive(code: i32, origin: vec3, direction: vec3, left: i32, far: f32) -> f32:
    """For scenes without objects."""
    return primitive_hit(code & 31, code >> 5, origin, direction, left == code)


@module
def nearer_hit(
    code: i32, origin: vec3, direction: vec3, left: i32, nearest: f32, hit: i32
) -> tuple[f32, i32]:
    """The nearer of the nearest hit so far and that of one more thing. Selected, not branched: lanes seldom agree."""
    t = hit_of(code, origin, direction, left, nearest)
    closer = t < nearest or (t == nearest and code < hit)
    return select(closer, t, nearest), select(closer, code, hit)
