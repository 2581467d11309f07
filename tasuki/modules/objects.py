"""Objects: what a ray meets of a formula of set operations, through the same sockets as single primitives."""

from tasuki.language import dot, f32, i32, module, select, socket, vec3
from tasuki.modules.crossing import NOWHERE
from tasuki.modules.formula import LOCAL, formula_span, intersection_validity, literal_span
from tasuki.modules.frames import local_point, normal_from_local
from tasuki.modules.records import INSIDE_ONLY, SHEET, TWO_SIDED, Object, objects, tokens
from tasuki.modules.search import OBJECT, primitive_hit
from tasuki.modules.slabs import slab_ray
from tasuki.modules.surface import Facet, facet_of_primitive


@socket(dispatch=True)
def solid_normal(kind: i32, index: i32, point: vec3) -> vec3:
    """The outward unit normal at a point of a solid's surface."""
    ...


@module
def shows(formula: Object, entering: bool) -> bool:
    """Whether a crossing shows: the way in, or as the flags say."""
    if formula.flags & TWO_SIDED != 0:
        return True
    return entering != (formula.flags & INSIDE_ONLY != 0)


@module
def object_hit(index: i32, origin: vec3, direction: vec3, left: i32, far: f32) -> f32:
    """The first visible crossing of an object with 0 < t <= `far`, or NOWHERE.

    From bound to bound the state is known not to change, so that whole parts of the formula are passed in one step.
    """
    formula = objects[index]
    inverse, shifted = slab_ray(origin, direction)
    found = NOWHERE
    # A little farther, so that what lies at `far` itself is told from what is not asked.
    horizon = far * 1.0001
    inside, until = formula_span(formula, origin, direction, inverse, shifted, left, 0.0, horizon)
    while until <= far and until < horizon:
        t = until
        was = inside
        inside, until = formula_span(formula, origin, direction, inverse, shifted, left, t, horizon)
        if inside != was and shows(formula, inside):
            found = t
            break
    return found


@module
def sheet_hit(index: i32, origin: vec3, direction: vec3, left: i32, far: f32) -> f32:
    """As `object_hit`, of an object with the flag SHEET: where its first literal, a plane, is crossed within its edges.

    A plane that is a face of other objects too is crossed at their t.
    """
    formula = objects[index]
    plane = tokens[tokens[formula.first].ranked]
    _before, _after, t = literal_span(plane, origin, direction, left, 0.0)
    found = NOWHERE
    if t <= far and t < NOWHERE:
        inverse, shifted = slab_ray(origin, direction)
        was, will, _row = intersection_validity(formula, origin, direction, inverse, shifted, left, t)
        if was != will and shows(formula, will):
            found = t
    return found


@module(fills="hit_of")
def hit_of_anything(code: i32, origin: vec3, direction: vec3, left: i32, far: f32) -> f32:
    """For scenes with objects."""
    if code & 31 == OBJECT:
        if objects[code >> 5].flags & SHEET != 0:
            t = sheet_hit(code >> 5, origin, direction, left, far)
        else:
            t = object_hit(code >> 5, origin, direction, left, far)
    else:
        t = primitive_hit(code & 31, code >> 5, origin, direction, left == code)
    return t


@module
def literal_normal(row: i32, point: vec3) -> vec3:
    """The outward unit normal of the surface of the literal in token `row`."""
    token = tokens[row]
    place = point
    if token.operator & LOCAL != 0:
        place = local_point(token.matrix, point)
    normal = solid_normal(token.operand & 31, token.operand >> 5, place)
    if token.operator & LOCAL != 0:
        normal = normal_from_local(token.matrix, normal)
    return normal


@module
def object_facet(index: i32, origin: vec3, direction: vec3, t: f32, left: i32) -> Facet:
    """The literal that shows where a ray has hit an object at t. Its normal faces the side which is OUT."""
    inverse, shifted = slab_ray(origin, direction)
    formula = objects[index]
    _before, after, row = intersection_validity(formula, origin, direction, inverse, shifted, left, t)
    normal = literal_normal(row, origin + t * direction)
    falls = dot(normal, direction) <= 0.0
    outward = select(falls == after, normal, -normal)
    token = tokens[row]
    return Facet(outward, outward, token.attribute, token.matrix, token.operand)


@module(fills="facet_of")
def facet_of_anything(code: i32, origin: vec3, direction: vec3, t: f32, left: i32) -> Facet:
    """For scenes with objects."""
    if code & 31 == OBJECT:
        facet = object_facet(code >> 5, origin, direction, t, left)
    else:
        facet = facet_of_primitive(code, origin, direction, t, left)
    return facet


@module
def object_bounds(formula: Object) -> tuple[vec3, vec3]:
    """The box around an object, which was found when it was packed."""
    return formula.low, formula.high
