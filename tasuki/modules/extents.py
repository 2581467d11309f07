"""Intersection search through the scene tree's spherical extents (modules 8, 14 and 15 as the paper has them).

`extent_nodes` is the tree in preorder: each node is a group, or a thing that a ray may hit, with the sphere around it.
Where no lane of a packet meets the sphere the walk goes on at the node's skip link, which passes over all that lies in
the group; else with the next node. So no stack is needed, however deep the tree.
"""

from tasuki.language import abs, any_lane, f32, fma, i32, module, vec3
from tasuki.modules.crossing import NOWHERE
from tasuki.modules.records import ExtentNode, extent_nodes
from tasuki.modules.search import NOTHING, hit_of, nearer_hit

ROUNDING = 1.9073486e-6
"""2**-19: by how much rounding may bring a ray, or a hit, away from where it is, relative to the way there.

That of a unit direction, the two differences, and the products of the test below add up to a third of it.
"""


@module
def fused_dot(a: vec3, b: vec3) -> f32:
    """a . b in fused operations: an extent decides only whether its content is looked at."""
    return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z))


@module(number=8, method="raytrace")
def extent_intersection(centre: vec3, radius: f32, origin: vec3, direction: vec3, far: f32) -> bool:
    """Whether a ray of unit direction meets a sphere, or is in it, at some t in 0 .. `far`.

    Conservative: it may say so of a ray that passes close by, or ends or begins close to the sphere; never the reverse.
    """
    to_centre = centre - origin
    middle = fused_dot(to_centre, direction)
    aside = vec3(
        fma(-middle, direction.x, to_centre.x),
        fma(-middle, direction.y, to_centre.y),
        fma(-middle, direction.z, to_centre.z),
    )
    reach = fma(abs(middle) + radius, ROUNDING, radius)
    return fused_dot(aside, aside) <= reach * reach and middle + reach >= 0.0 and middle - reach <= far


@module
def enters_extent(node: ExtentNode, origin: vec3, direction: vec3, far: f32) -> bool:
    """Whether a ray must look at what is in a node before `far`: one step of the walk."""
    entered = True
    if node.radius >= 0.0:
        entered = extent_intersection(node.centre, node.radius, origin, direction, far)
    return entered


@module(number=14, method="raytrace", fills="nearest_hit")
def nearest_in_extents(origin: vec3, direction: vec3, left: i32) -> tuple[f32, i32]:
    """The nearest visible hit, through the extents: see `search.nearest_hit`."""
    nearest = NOWHERE
    hit = NOTHING
    row = 0
    while row < len(extent_nodes):
        node = extent_nodes[row]
        row += 1
        if not any_lane(enters_extent(node, origin, direction, nearest)):
            row = node.skip
        elif node.code >= 0:
            nearest, hit = nearer_hit(node.code, origin, direction, left, nearest, hit)
    return nearest, hit


@module(number=15, method="raytrace", fills="is_blocked")
def shadow_in_extents(origin: vec3, direction: vec3, left: i32, distance: f32) -> bool:
    """Whether something visible lies before `distance`, through the extents: see `search.is_blocked`."""
    blocked = False
    row = 0
    while row < len(extent_nodes) and any_lane(not blocked):
        node = extent_nodes[row]
        row += 1
        if not any_lane(not blocked and enters_extent(node, origin, direction, distance)):
            row = node.skip
        elif node.code >= 0:
            blocked = blocked or hit_of(node.code, origin, direction, left, distance) < distance
    return blocked
