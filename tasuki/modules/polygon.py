"""Polygons as a ray sees them: corners projected along it, and on which side of an edge it passes.

Every corner is projected by itself, so that polygons that share one project it to the same point. Rounding never puts
two products into the wrong order: the side of an edge that comes out is the true side of the projected edge, or 0, and
both polygons at the edge see it alike. So no ray slips through a mesh, neither at its edges nor at its corners (after
S. Woop et al., "Watertight Ray/Triangle Intersection", 2013, who shear where we turn). And errors are roundings of the
corner's distance: small polygons far away are hit where they are.
"""

from tasuki.language import copysign, dot, f32, module, record, vec3


@record
class Seen:
    """Where a point lies in the plane across a ray that comes towards us through (0, 0)."""

    x: f32
    y: f32


@module
def basis_across(direction: vec3) -> tuple[vec3, vec3]:
    """Two unit vectors that make a right-handed basis with a unit direction, the third.

    T. Duff et al., "Building an Orthonormal Basis, Revisited", 2017.
    """
    sign = copysign(1.0, direction.z)
    scale = -1.0 / (sign + direction.z)
    mixed = direction.x * direction.y * scale
    right = vec3(1.0 + sign * direction.x * direction.x * scale, sign * mixed, -sign * direction.x)
    up = vec3(mixed, sign + direction.y * direction.y * scale, -direction.y)
    return right, up


@module
def seen_along(corner: vec3, right: vec3, up: vec3) -> Seen:
    """A corner, relative to the ray's origin, in the plane across the ray."""
    return Seen(dot(corner, right), dot(corner, up))


@module
def edge_side(p: Seen, q: Seen) -> f32:
    """Twice the area between the ray and an edge from p to q; exactly the opposite for the edge from q to p.

    Positive where a ray that meets the polygon's front passes inside.
    """
    return p.y * q.x - p.x * q.y
