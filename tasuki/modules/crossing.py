"""What the modules of all primitive kinds share: no crossing, and the first crossing that shows."""

from tasuki.language import copysign, f32, i32, min, module, select, sqrt
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


@module
def quadratic_crossings(a: f32, b: f32, c: f32) -> tuple[f32, f32]:
    """Where a t^2 + 2 b t + c falls through zero, and where it rises through it; NaN where it has no roots.

    No cancellation: the root of larger size comes from -(b + sign(b) sqrt(b^2 - a c)), the other from their product
    (W. H. Press et al., *Numerical Recipes*, section 5.6). With c = 0 one root is exactly 0.
    """
    q = -(b + copysign(sqrt(b * b - a * c), b))
    # Where b < 0, and where b is a zero with its sign set.
    rising = q > 0.0
    return select(rising, c / q, q / a), select(rising, q / a, c / q)
