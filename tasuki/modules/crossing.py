"""What the modules of all primitive kinds share: no crossing, and the first crossing that shows."""

from tasuki.language import f32, i32, min, module, select
from tasuki.modules.records import INSIDE_ONLY, TWO_SIDED

NOWHERE = float("inf")
"""The ray parameter of a crossing that does not exist."""


@module
def first_crossing(flags: i32, enter: f32, leave: f32) -> f32:
    """The first visible one of two crossings with t > 0, or NOWHERE.

    From outside only the entering crossing shows, from inside only the leaving one; a two-sided surface shows both.
    Comparisons with NaN fail, so that a primitive that is missed may give NaN.
    """
    front = select(enter > 0.0, enter, NOWHERE)
    back = select(leave > 0.0, leave, NOWHERE)
    if flags & TWO_SIDED != 0:
        front = min(front, back)
    elif flags & INSIDE_ONLY != 0:
        front = back
    return front
