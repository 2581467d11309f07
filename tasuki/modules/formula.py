"""Formulas of set operations along a ray: states from crossing to crossing, and the validity of one crossing.

A formula is a row of tokens in Polish order, read from left to right by all lanes together. An operator has its
operands behind it, up to its END. Complements stand at the literals alone. Operands of one operator that lie together
may form a GROUP. An operator or GROUP with bounds is passed over, through its skip link, when no lane is within them;
the rest of an operator's operands, when it is decided for all lanes.

The state of a literal at t follows from where the ray crosses its surface, never from a point near it: surfaces that
coincide are one surface, crossed at one t, and so shared, opposite and touching faces cancel exactly.
"""

from tasuki.language import all_lanes, any_lane, array, f32, i32, max, min, module, record, select, socket, vec3
from tasuki.modules.crossing import NOWHERE
from tasuki.modules.frames import local_ray
from tasuki.modules.records import UNION, Object, Token, bounds, tokens
from tasuki.modules.slabs import slab_entry

LITERAL = 0
GROUP = 1
OPERATOR = 2
END = 3
WHAT = 3
"""What a token is: the lowest two bits of `Token.operator`."""
INVERTED = 4
"""Flag: the complement of a literal's surface; of what has bounds: it is IN, not OUT, beyond them."""
OPENS_UNION = 16
"""Flag of an OPERATOR: it is a union. (`records.UNION`: that of which the token is an operand is one.)"""
SAVED = 32
"""Flag of an OPERATOR that is not the first operand, and of its END: what was before it waits on the stack."""
LOCAL = 64
"""Flag of a literal: its surface stands in local coordinates, into which the ray is brought."""
DEEPEST = 24
"""Operators that may wait for one another; the packer puts the longest operand first, so that 2**24 literals fit."""
UNOWNED = 2147483647


@socket(dispatch=True)
def solid_span(
    kind: i32, index: i32, origin: vec3, direction: vec3, leaving: bool, t: f32
) -> tuple[bool, bool, f32]:
    """Whether the ray is IN just before t and just after it, and the next crossing after t (NOWHERE: none).

    A ray that is `leaving` begins on the surface: one of its crossings is at exactly 0.
    """
    ...


@module
def literal_span(
    token: Token, origin: vec3, direction: vec3, left: i32, t: f32
) -> tuple[bool, bool, f32]:
    """`solid_span` of a literal, its complement taken."""
    kind = token.operand & 31
    index = token.operand >> 5
    leaving = left == token.operand
    inverted = token.operator & INVERTED != 0
    if token.operator & LOCAL != 0:
        from_point, along = local_ray(token.matrix, origin, direction)
        before, after, coming = solid_span(kind, index, from_point, along, leaving, t)
    else:
        before, after, coming = solid_span(kind, index, origin, direction, leaving, t)
    return before != inverted, after != inverted, coming


@record
class Lasting:
    """A state along a ray, and a bound until which it does not change."""

    state: bool
    until: f32


@record
class Change:
    """States just before and just after one place on a ray, and the rank of the literal that shows there."""

    before: bool
    after: bool
    owner: i32


@module
def bounds_span(token: Token, inverse: vec3, shifted: vec3) -> tuple[f32, f32]:
    """Where a ray enters and leaves the bounds of a token; one without is never left."""
    enter = 0.0
    leave = NOWHERE
    if token.operand >= 0:
        box = bounds[token.operand]
        enter, leave = slab_entry(box.low, box.high, inverse, shifted, NOWHERE)
    return enter, leave


@module
def joined(union: bool, whole: Lasting, operand: Lasting) -> Lasting:
    """An operator's state, and how long it lasts at least, with one operand more.

    The operand that decides (IN decides a union, OUT an intersection) decides for as long as it stays so; while there
    is none, any operand may be the next.
    """
    decides = operand.state == union
    decided = whole.state == union
    any_change = select(decided, whole.until, min(whole.until, operand.until))
    last_change = select(decided, max(whole.until, operand.until), operand.until)
    return Lasting(select(decides, union, whole.state), select(decides, last_change, any_change))


@module
def formula_span(
    formula: Object, origin: vec3, direction: vec3, inverse: vec3, shifted: vec3, left: i32, t: f32, far: f32
) -> tuple[bool, f32]:
    """Whether the ray is IN just after t, and a bound until which that does not change; nothing beyond `far` is asked.

    Bounds that lie ahead are entered only below a union, and while they are nearer than the nearest change known: what
    is OUT is left at the next way in, which is sought here; what is IN needs no more than its state at t.
    """
    waiting = array(Lasting, DEEPEST)
    depth = 0
    whole = Lasting(formula.flags & UNION == 0, far)
    row = formula.first
    while row < formula.end:
        token = tokens[row]
        union = token.operator & UNION != 0
        what = token.operator & WHAT
        row += 1
        if what == LITERAL:
            _before, after, coming = literal_span(token, origin, direction, left, t)
            whole = joined(union, whole, Lasting(after, coming))
            if all_lanes(whole.state == union):
                row = token.skip
        elif what == END:
            operand = whole
            whole = Lasting(not union, far)
            if token.operator & SAVED != 0:
                depth -= 1
                whole = waiting[depth]
            whole = joined(union, whole, operand)
            if all_lanes(whole.state == union):
                row = token.skip
        else:
            enter, leave = bounds_span(token, inverse, shifted)
            reach = whole.until if union else t
            if any_lane(whole.state != union and t <= leave and enter <= min(leave, reach)):
                if what == OPERATOR:
                    if token.operator & SAVED != 0:
                        waiting[depth] = whole
                        depth += 1
                    whole = Lasting(token.operator & OPENS_UNION == 0, far)
            else:
                ahead = select(enter <= leave and t < enter, enter, NOWHERE)
                whole = joined(union, whole, Lasting(token.operator & INVERTED != 0, ahead))
                row = token.skip
    return whole.state, whole.until


@module
def changed(union: bool, whole: Change, operand: Change) -> Change:
    """An operator's change with one operand more; its owner is the first of those of operands that change."""
    owner = select(operand.before != operand.after, operand.owner, UNOWNED)
    return Change(
        select(operand.before == union, union, whole.before),
        select(operand.after == union, union, whole.after),
        min(whole.owner, owner),
    )


@module(number=13, method="raytrace")
def intersection_validity(
    formula: Object, origin: vec3, direction: vec3, inverse: vec3, shifted: vec3, left: i32, t: f32
) -> tuple[bool, bool, i32]:
    """Whether the ray is IN just before t and just after it; and the row of the literal that shows there.

    A crossing is valid where the two differ. It shows the literal that is found from the outermost operator by always
    descending into the leftmost operand whose own state changes: among the literals that change below operands that
    change, the first (where none changes: the formula's first).
    """
    waiting = array(Change, DEEPEST)
    depth = 0
    empty = formula.flags & UNION == 0
    whole = Change(empty, empty, UNOWNED)
    row = formula.first
    while row < formula.end:
        token = tokens[row]
        union = token.operator & UNION != 0
        what = token.operator & WHAT
        row += 1
        if what == LITERAL:
            before, after, _coming = literal_span(token, origin, direction, left, t)
            whole = changed(union, whole, Change(before, after, token.rank))
        elif what == END:
            operand = whole
            whole = Change(not union, not union, UNOWNED)
            if token.operator & SAVED != 0:
                depth -= 1
                whole = waiting[depth]
            whole = changed(union, whole, operand)
        else:
            enter, leave = bounds_span(token, inverse, shifted)
            if any_lane(enter <= t and t <= leave):
                if what == OPERATOR:
                    if token.operator & SAVED != 0:
                        waiting[depth] = whole
                        depth += 1
                    empty = token.operator & OPENS_UNION == 0
                    whole = Change(empty, empty, UNOWNED)
            else:
                beyond = token.operator & INVERTED != 0
                whole = changed(union, whole, Change(beyond, beyond, UNOWNED))
                row = token.skip
    owner = select(whole.owner == UNOWNED, 0, whole.owner)
    return whole.before, whole.after, tokens[formula.first + owner].ranked
