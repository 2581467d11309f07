"""Light at the surface of a dielectric: refraction direction (module 5) and the energy ratio (module 6)."""

from tasuki.language import dot, f32, max, module, sqrt, vec3


@module(number=5, method="raytrace")
def refraction_direction(direction: vec3, normal: vec3, ratio: f32) -> tuple[vec3, bool]:
    """The unit direction behind a surface, by Snell's law, and whether there is one (else: total internal reflection).

    `direction` and `normal` have unit length, `normal` faces the ray, `ratio` is the refractive index that the ray
    leaves over the one that it enters.
    """
    incidence = -dot(direction, normal)
    rest = 1.0 - ratio * ratio * (1.0 - incidence * incidence)
    bent = ratio * direction + (ratio * incidence - sqrt(max(rest, 0.0))) * normal
    return bent, rest >= 0.0


@module(number=6, method="raytrace")
def energy_ratio(direction: vec3, normal: vec3, ratio: f32) -> tuple[f32, f32]:
    """The shares of the energy that a dielectric's surface reflects and transmits; they add up to 1.

    Fresnel's equations for unpolarised light. Arguments as in module 5; total internal reflection gives 1 and 0.
    """
    incidence = -dot(direction, normal)
    rest = 1.0 - ratio * ratio * (1.0 - incidence * incidence)
    reflected = 1.0
    if rest > 0.0:
        beyond = sqrt(rest)
        across = (ratio * incidence - beyond) / (ratio * incidence + beyond)
        along = (incidence - ratio * beyond) / (incidence + ratio * beyond)
        reflected = 0.5 * (across * across + along * along)
    return reflected, 1.0 - reflected
