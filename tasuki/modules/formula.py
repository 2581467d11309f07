"""Formulas of set operations along a ray: states from crossing to crossing, and the validity of one crossing.

A formula is a row of tokens in Polish order, read from left to right by all lanes together. An operator has its
operands behind it, up to its END. Complements stand at the literals alone. Operands of one operator that lie together
may form a GROUP. An operator or GROUP with bounds is passed over, through its skip link, when no lane is within them;
the rest of an operator's operands, when it is decided for all lanes.

The state of a literal at t follows from where the ray crosses its surface, never from a point near it: surfaces that
coincide are one surface, crossed at one t, and so shared, opposite and touching faces cancel exactly.
"""

from tasuki.language import all_lanes, any_lane, array, f32, i32, max, min, module, select, socket, vec3
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


@module
def joined(union: bool, state: bool, until: f32, operand: bool, operand_until: f32) -> tuple[bool, f32]:
    """An operator's state, and how long it lasts at least, with one operand more.

    The operand that decides (IN decides a union, OUT an intersection) decides for as long as it stays so; while there
    is none, any operand may be the next.
    """
    decides = operand == union
    decided = state == union
    any_change = select(decided, until, min(until, operand_until))
    last_change = select(decided, max(until, operand_until), operand_until)
    return select(decides, union, state), select(decides, last_change, any_change)


@module
def formula_span(
    formula: Object, origin: vec3, direction: vec3, inverse: vec3, shifted: vec3, left: i32, t: f32, far: f32
) -> tuple[bool, f32]:
    """Whether the ray is IN just after t, and a bound until which that does not change; nothing beyond `far` is asked.

    Bounds that lie ahead are entered only below a union, and while they are nearer than the nearest change known: what
    is OUT is left at the next way in, which is sought here; what is IN needs no more than its state at t.
    """
    states = array(bool, DEEPEST)
    untils = array(f32, DEEPEST)
    depth = 0
    state = formula.flags & UNION == 0
    until = far
    row = formula.first
    while row < formula.end:
        token = tokens[row]
        union = token.operator & UNION != 0
        what = token.operator & WHAT
        row += 1
        if what == LITERAL:
            _before, after, coming = literal_span(token, origin, direction, left, t)
            state, until = joined(union, state, until, after, coming)
            if all_lanes(state == union):
                row = token.skip
        elif what == END:
            operand = state
            coming = until
            state = not union
            until = far
            if token.operator & SAVED != 0:
                depth -= 1
                state = states[depth]
                until = untils[depth]
            state, until = joined(union, state, until, operand, coming)
            if all_lanes(state == union):
                row = token.skip
        else:
            entered = True
            if token.operand >= 0:
                box = bounds[token.operand]
                enter, leave = slab_entry(box.low, box.high, inverse, shifted, NOWHERE)
                reach = t
                if union:
                    reach = until
                entered = any_lane(state != union and t <= leave and enter <= min(leave, reach))
                if not entered:
                    ahead = select(enter <= leave and t < enter, enter, NOWHERE)
                    state, until = joined(union, state, until, token.operator & INVERTED != 0, ahead)
                    row = token.skip
            if entered and what == OPERATOR:
                if token.operator & SAVED != 0:
                    states[depth] = state
                    untils[depth] = until
                    depth += 1
                state = token.operator & OPENS_UNION == 0
                until = far
    return state, until


@module(number=13, method="raytrace")
def intersection_validity(
    formula: Object, origin: vec3, direction: vec3, inverse: vec3, shifted: vec3, left: i32, t: f32
) -> tuple[bool, bool, i32]:
    """Whether the ray is IN just before t and just after it; and the row of the literal that shows there.

    A crossing is valid where the two differ. It shows the literal that is found from the outermost operator by always
    descending into the leftmost operand whose own state changes: among the literals that change below operands that
    change, the first (where none changes: the formula's first).
    """
    befores = array(bool, DEEPEST)
    afters = array(bool, DEEPEST)
    owners = array(i32, DEEPEST)
    depth = 0
    before = formula.flags & UNION == 0
    after = before
    owner = UNOWNED
    row = formula.first
    while row < formula.end:
        token = tokens[row]
        union = token.operator & UNION != 0
        what = token.operator & WHAT
        row += 1
        if what == LITERAL:
            was, will, _coming = literal_span(token, origin, direction, left, t)
            owner = min(owner, select(was != will, token.rank, UNOWNED))
            before = select(was == union, union, before)
            after = select(will == union, union, after)
        elif what == END:
            was = before
            will = after
            changing = select(before != after, owner, UNOWNED)
            before = not union
            after = not union
            owner = UNOWNED
            if token.operator & SAVED != 0:
                depth -= 1
                before = befores[depth]
                after = afters[depth]
                owner = owners[depth]
            owner = min(owner, changing)
            before = select(was == union, union, before)
            after = select(will == union, union, after)
        else:
            entered = True
            if token.operand >= 0:
                box = bounds[token.operand]
                enter, leave = slab_entry(box.low, box.high, inverse, shifted, NOWHERE)
                entered = any_lane(enter <= t and t <= leave)
                if not entered:
                    beyond = token.operator & INVERTED != 0
                    before = select(beyond == union, union, before)
                    after = select(beyond == union, union, after)
                    row = token.skip
            if entered and what == OPERATOR:
                if token.operator & SAVED != 0:
                    befores[depth] = before
                    afters[depth] = after
                    owners[depth] = owner
                    depth += 1
                before = token.operator & OPENS_UNION == 0
                after = before
                owner = UNOWNED
    return before, after, tokens[formula.first + select(owner == UNOWNED, 0, owner)].ranked
