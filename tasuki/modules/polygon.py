"""Polygons as a ray sees them: corners projected along it, and on which side of an edge it passes.

Every corner is projected by itself, so that polygons that share one project it to the same point. Rounding never puts
two products into the wrong order: the side of an edge that comes out is the true side of the projected edge, or 0, and
both polygons at the edge see it alike. So no ray slips through a mesh, neither at its edges nor at its corners (after
S. Woop et al., "Watertight Ray/Triangle Intersection", 2013, who shear where we turn). And errors are roundings of the
corner's distance: small polygons far away are hit where they are.
"""

from tasuki.language import abs, cross, dot, f32, module, record, select, vec3


@record
class Seen:
    """Where a point lies in the plane across a ray that comes towards us through (0, 0), in the unit of its basis."""

    x: f32
    y: f32


@module
def basis_across(direction: vec3) -> tuple[vec3, vec3]:
    """Two vectors of one length, not far below 1, that make a right-handed basis with a unit direction, the third."""
    x, y, z = direction.x, direction.y, direction.z
    right = select(abs(y) > 0.75, vec3(y, -x, 0.0), vec3(z, 0.0, -x))
    return right, cross(direction, right)


@module
def seen_along(corner: vec3, right: vec3, up: vec3) -> Seen:
    """A corner, relative to the ray's origin, in the plane across the ray."""
    return Seen(dot(corner, right), dot(corner, up))


@module
def edge_side(p: Seen, q: Seen) -> f32:
    """In proportion to the area between the ray and an edge from p to q; exactly the opposite for the edge from q to p.

    Positive where a ray that meets the polygon's front passes inside.
    """
    return p.y * q.x - p.x * q.y
