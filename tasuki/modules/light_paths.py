"""Following an eye ray: through mirrors alone, or through a tree of reflected and refracted rays.

Both fill the socket `traced_light`; a scene in which nothing is transparent is linked with the first, which is faster.
"""

from tasuki.language import any_lane, array, f32, i32, module, reciprocal, select, vec3
from tasuki.modules.bvh import NOTHING, nearest_intersection
from tasuki.modules.directions import reflection_direction
from tasuki.modules.elementary import power
from tasuki.modules.glass import energy_ratio, refraction_direction
from tasuki.modules.raytrace import Traced, direct_light, lift, surface_at
from tasuki.modules.records import Attribute, View, attributes
from tasuki.modules.shading import accumulate_luminance

DEEPEST = 32
"""Generations of rays that `trace_tree` can follow."""


@module(fills="traced_light")
def trace_mirrors(view: View, eye_direction: vec3) -> Traced:
    """Follow an eye ray and its mirror rays."""
    origin = view.eye
    direction = eye_direction
    left = NOTHING
    weight = vec3(1.0)
    out = Traced(vec3(0.0), 0, 0, 0, 0)
    for generation in range(view.depth):
        t, hit = nearest_intersection(origin, direction, left)
        if hit == NOTHING:
            out.luminance = accumulate_luminance(out.luminance, weight, view.background)
            break
        if generation == 0:
            out.eye_hits = 1
        surface = surface_at(origin, direction, t, hit)
        attribute = attributes[surface.attribute]
        start = surface.point + lift(surface, t)
        luminance, shadow_rays = direct_light(attribute, surface, start, direction, hit)
        out.shadow += shadow_rays
        out.luminance = accumulate_luminance(out.luminance, weight, luminance)
        if attribute.reflection <= 0.0 or generation + 1 == view.depth:
            break
        weight = weight * attribute.reflection
        direction = reflection_direction(direction, surface.normal)
        origin = start
        left = hit
        out.reflection += 1
    return out


@module
def attenuation(attribute: Attribute, distance: f32) -> vec3:
    """What is left of light after `distance` in a medium that lets `attribute.transmittance` through for each unit."""
    clear = attribute.transmittance
    return vec3(power(clear.x, distance), power(clear.y, distance), power(clear.z, distance))


@module(fills="traced_light")
def trace_tree(view: View, eye_direction: vec3) -> Traced:
    """Follow an eye ray and the tree of rays that mirrors and dielectrics make of it, depth first.

    The rays that lanes still have to follow wait on one stack for the packet: all lanes walk through the same tree, and
    in a branch that some lanes do not have these rest. So every lane adds up its own luminance in the tree's order.

    A dielectric's surface sends on `attribute.reflection` of the light as a mirror of its own, and splits
    `attribute.transmission` of it by Fresnel's energy ratio between the reflected ray and the refracted one.
    """
    origins = array(vec3, DEEPEST)
    directions = array(vec3, DEEPEST)
    weights = array(vec3, DEEPEST)
    lefts = array(i32, DEEPEST)
    rested = array(i32, DEEPEST)
    generations = array(i32, DEEPEST)
    origin = view.eye
    direction = eye_direction
    weight = vec3(1.0)
    left = NOTHING
    resting = 0
    generation = 1
    waiting = 0
    out = Traced(vec3(0.0), 0, 0, 0, 0)
    walking = True
    while walking:
        mirrored = False
        refracted = False
        mirror_direction = direction
        mirror_weight = weight
        refraction_weight = weight
        bent = direction
        outside = origin
        inside = origin
        struck = NOTHING
        if resting == 0:
            t, hit = nearest_intersection(origin, direction, left)
            if hit == NOTHING:
                out.luminance = accumulate_luminance(out.luminance, weight, view.background)
            else:
                if generation == 1:
                    out.eye_hits = 1
                surface = surface_at(origin, direction, t, hit)
                entering = surface.entering
                attribute = attributes[surface.attribute]
                offset = lift(surface, t)
                outside = surface.point + offset
                inside = surface.point - offset
                struck = hit
                if not entering:
                    weight = weight * attenuation(attribute, t)
                luminance, shadow_rays = direct_light(attribute, surface, outside, direction, hit)
                out.shadow += shadow_rays
                out.luminance = accumulate_luminance(out.luminance, weight, luminance)
                mirror_share = attribute.reflection
                refraction_share = 0.0
                if attribute.transmission > 0.0:
                    ratio = select(entering, reciprocal(attribute.index), attribute.index)
                    bent, refracted = refraction_direction(direction, surface.normal, ratio)
                    reflected, transmitted = energy_ratio(direction, surface.normal, ratio)
                    mirror_share = mirror_share + attribute.transmission * reflected
                    refraction_share = attribute.transmission * transmitted
                mirrored = mirror_share > 0.0
                mirror_direction = reflection_direction(direction, surface.normal)
                mirror_weight = mirror_share * weight
                refraction_weight = refraction_share * weight
                if mirrored and generation < view.depth:
                    out.reflection += 1
                if refracted and generation < view.depth:
                    out.refraction += 1
        if generation < view.depth and any_lane(refracted):
            origins[waiting] = inside
            directions[waiting] = bent
            weights[waiting] = refraction_weight
            lefts[waiting] = struck
            rested[waiting] = select(refracted, 0, 1)
            generations[waiting] = generation + 1
            waiting += 1
        if generation < view.depth and any_lane(mirrored):
            origin = outside
            direction = mirror_direction
            weight = mirror_weight
            left = struck
            resting = select(mirrored, 0, 1)
            generation += 1
        else:
            walking = waiting > 0
            if walking:
                waiting -= 1
                origin = origins[waiting]
                direction = directions[waiting]
                weight = weights[waiting]
                left = lefts[waiting]
                resting = rested[waiting]
                generation = generations[waiting]
    return out
