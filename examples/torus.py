"""A solid of one's own, the ring torus: `tasuki render examples/torus.yaml --with examples/torus.py`."""

from tasuki.language import Table, dot, f32, i32, max, min, module, norm, normalize, record, select, sqrt, vec3, vec4
from tasuki.modules.crossing import NOWHERE
from tasuki.scene.kinds import PrimitiveKind, register


@record
class Torus:
    """What is less than `minor` from a circle of radius `major` about the local z axis; `minor` < `major`."""

    kind: i32
    attribute: i32
    matrix: i32
    flags: i32
    major: f32
    minor: f32


@module
def value_and_slope(lead: f32, c: vec4, x: f32) -> tuple[f32, f32]:
    """Of the polynomial lead x^4 + c.w x^3 + c.z x^2 + c.y x + c.x, by Horner's rule."""
    return (((lead * x + c.w) * x + c.z) * x + c.y) * x + c.x, ((4.0 * lead * x + 3.0 * c.w) * x + 2.0 * c.z) * x + c.y


@module
def zero_between(lead: f32, c: vec4, low: f32, high: f32, rises: bool) -> f32:
    """The zero of a polynomial that rises, or falls, from low to high, by Newton's method; if none, the nearer end."""
    passed = (value_and_slope(lead, c, low)[0] > 0.0) == rises
    if passed or (value_and_slope(lead, c, high)[0] > 0.0) != rises:
        return low if passed else high
    x, step = 0.5 * (low + high), 1.0
    while step > 1e-7 or step < -1e-7:
        value, slope = value_and_slope(lead, c, x)
        passed = (value > 0.0) == rises
        low, high = select(passed, low, x), select(passed, x, high)
        following = x - value / slope
        following = select(low < following and following < high, following, 0.5 * (low + high))
        x, step = following, following - x
    return x


@module
def torus_crossings(torus: Torus, origin: vec3, direction: vec3, leaving: bool) -> vec4:
    """Where a ray crosses the torus, up to four times, NOWHERE for the others. `leaving`: once at exactly 0.

    The zeros of a quartic, found between those of its derivative (C. Yuksel, "High-Performance Polynomial Root Finding
    for Graphics", 2022), in units of the torus, from the ray's middle; of a ray that begins on it, those of a cubic.
    """
    size = torus.major + torus.minor
    ring, tube, along = torus.major / size, torus.minor / size, normalize(direction)
    shift = 0.0 if leaving else -dot(origin, along)
    near = (origin + shift * along) / size
    ahead, aside, half = dot(near, along), 2.0 * ring * norm(vec3(near.x, near.y, 0.0)), dot(near, near) + ring - tube
    c1 = 4.0 * half * ahead - 8.0 * ring * ring * (near.x * along.x + near.y * along.y)
    c2 = 2.0 * half + 4.0 * ahead * ahead - 4.0 * ring * ring * (1.0 - along.z * along.z)
    c = vec4((half - aside) * (half + aside), c1, c2, 4.0 * ahead)
    cubic = vec4(c.y, c.z, c.w, 1.0) if leaving else 0.25 * vec4(c.y, 2.0 * c.z, 3.0 * c.w, 4.0)
    bend, bends = -cubic.z / 3.0, sqrt(max(cubic.z * cubic.z - 3.0 * cubic.y, 0.0)) / 3.0
    x, z = zero_between(0.0, cubic, -3.0, bend - bends, True), zero_between(0.0, cubic, bend + bends, 3.0, True)
    y, w = zero_between(0.0, cubic, bend - bends, bend + bends, False), 0.0
    if not leaving:
        first, second = zero_between(1.0, c, -3.0, x, False), zero_between(1.0, c, x, y, True)
        x, y, z, w = first, second, zero_between(1.0, c, y, z, False), zero_between(1.0, c, z, 3.0, True)
    xy, yz, zw = x == y, y == z, z == w
    t = vec4(select(xy, NOWHERE, x), select(xy or yz, NOWHERE, y), select(yz or zw, NOWHERE, z), select(zw, NOWHERE, w))
    return (t * size + vec4(shift)) / norm(direction)


@module
def torus_span(torus: Torus, origin: vec3, direction: vec3, leaving: bool, t: f32) -> tuple[bool, bool, f32]:
    """Whether the ray is IN just before and just after t, by the number of crossings, and where it next changes."""
    at = torus_crossings(torus, origin, direction, leaving)
    before = ((at.x < t) != (at.y < t)) != ((at.z < t) != (at.w < t))
    after = ((at.x <= t) != (at.y <= t)) != ((at.z <= t) != (at.w <= t))
    soon = min(select(at.x > t, at.x, NOWHERE), select(at.y > t, at.y, NOWHERE))
    return before, after, min(soon, select(at.z > t, at.z, NOWHERE), select(at.w > t, at.w, NOWHERE))


@module
def torus_normal(torus: Torus, point: vec3) -> vec3:
    """The outward unit normal: away from the nearest point of the circle."""
    return normalize(point - torus.major * normalize(vec3(point.x, point.y, 0.0)))


@module
def torus_inside(torus: Torus, point: vec3) -> bool:
    """Whether the point is IN."""
    return norm(point - torus.major * normalize(vec3(point.x, point.y, 0.0))) < torus.minor


@module
def torus_bounds(torus: Torus) -> tuple[vec3, vec3]:
    """The corners of the box around the torus."""
    return torus.major * vec3(-1, -1, 0) - vec3(torus.minor), torus.major * vec3(1, 1, 0) + vec3(torus.minor)


tori = Table(Torus)
register(PrimitiveKind("torus", "solid", tori, torus_bounds, span=torus_span, normal=torus_normal, inside=torus_inside))
