"""A ray against the slabs of an axis-parallel box."""

from tasuki.language import abs, copysign, f32, fma, max, min, module, reciprocal, select, vec3

LEAST_DIRECTION = 1.0e-20


@module
def slab_reciprocal(x: f32) -> f32:
    """1 / x, kept finite, so that no slab test meets 0 times infinity."""
    return reciprocal(select(abs(x) < LEAST_DIRECTION, copysign(LEAST_DIRECTION, x), x))


@module
def slab_ray(origin: vec3, direction: vec3) -> tuple[vec3, vec3]:
    """What the slab test wants of a ray: 1 / direction, kept finite, and -origin / direction."""
    inverse = vec3(slab_reciprocal(direction.x), slab_reciprocal(direction.y), slab_reciprocal(direction.z))
    return inverse, -(origin * inverse)


@module
def slab_entry(low: vec3, high: vec3, inverse: vec3, shifted: vec3, far: f32) -> tuple[f32, f32]:
    """Where a ray enters and leaves a box, clipped to 0..far; it misses where it enters after it leaves.

    (plane - origin) / direction is one fused operation: the boxes were widened by more than its error when they were
    built, and a box decides only whether its content is looked at.
    """
    x0 = fma(low.x, inverse.x, shifted.x)
    x1 = fma(high.x, inverse.x, shifted.x)
    y0 = fma(low.y, inverse.y, shifted.y)
    y1 = fma(high.y, inverse.y, shifted.y)
    z0 = fma(low.z, inverse.z, shifted.z)
    z1 = fma(high.z, inverse.z, shifted.z)
    enter = max(max(min(x0, x1), min(y0, y1)), max(min(z0, z1), 0.0))
    leave = min(min(max(x0, x1), max(y0, y1)), min(max(z0, z1), far))
    return enter, leave
