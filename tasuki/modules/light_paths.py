"""Following an eye ray: through mirrors alone, or through a tree of reflected and refracted rays.

Both fill the socket `traced_light`; a scene in which nothing is transparent is linked with the first, which is faster.
"""

from tasuki.language import any_lane, array, count_lanes, f32, i32, max, min, module, reciprocal, record, vec3
from tasuki.modules.directions import reflection_direction
from tasuki.modules.elementary import power
from tasuki.modules.glass import energy_ratio, refraction_direction
from tasuki.modules.media import index_of, media_at
from tasuki.modules.raytrace import Traced, direct_light
from tasuki.modules.records import Attribute, View, attributes, views
from tasuki.modules.search import NOTHING, nearest_hit
from tasuki.modules.shading import accumulate_luminance
from tasuki.modules.surface import lift, material_of, surface_at

DEEPEST = 32
"""Generations of rays that `trace_tree` can follow."""


@module
def attenuation(attribute: Attribute, distance: f32) -> vec3:
    """What is left of light after `distance` in a medium that lets `attribute.transmittance` through for each unit."""
    clear = attribute.transmittance
    return vec3(power(clear.x, distance), power(clear.y, distance), power(clear.z, distance))


@record
class Ray:
    """A ray that waits to be followed. A lane that has no such ray `rests`."""

    origin: vec3
    direction: vec3
    weight: vec3
    left: i32
    rests: bool


@record
class Fork:
    """What one ray met: the light that came from there, and the rays that go on from it."""

    luminance: vec3
    met: i32
    shadow: i32
    mirrored: Ray
    refracted: Ray


@module
def matters(weight: vec3) -> bool:
    """Whether a ray of this weight is followed (R. A. Hall, D. P. Greenberg, "A Testbed for Realistic Image Synthesis",
    1983).
    """
    return max(max(weight.x, weight.y), weight.z) > views[0].cutoff


@module
def shares(attribute: Attribute, direction: vec3, normal: vec3, ratio: f32) -> tuple[f32, f32]:
    """The shares of the light that a surface mirrors and refracts.

    `attribute.reflection` of it is mirrored whatever the angle; `attribute.transmission` of it enters the surface,
    which splits that by Fresnel's energy ratio. `ratio` as in module 5.
    """
    mirrored = attribute.reflection
    refracted = 0.0
    if attribute.transmission > 0.0:
        reflected, transmitted = energy_ratio(direction, normal, ratio)
        mirrored = mirrored + attribute.transmission * reflected
        refracted = attribute.transmission * transmitted
    return mirrored, refracted


@module
def fork_at_mirror(ray: Ray, t: f32, hit: i32) -> Fork:
    """The light from the surface that a ray has hit, and the ray that its mirror sends on."""
    surface = surface_at(ray.origin, ray.direction, t, hit, ray.left)
    attribute = material_of(surface)
    start = surface.point + lift(surface, t)
    luminance, shadow_rays = direct_light(attribute, surface, start, ray.direction)
    mirror = reflection_direction(ray.direction, surface.normal)
    weight = attribute.reflection * ray.weight
    resting = Ray(start, mirror, vec3(0.0), surface.code, True)
    mirrored = Ray(start, mirror, weight, surface.code, not matters(weight))
    return Fork(ray.weight * luminance, 1, shadow_rays, mirrored, resting)


@module
def fork_at_glass(ray: Ray, t: f32, hit: i32) -> Fork:
    """The light from the surface that a ray has hit, and the rays that its mirror and its glass send on."""
    surface = surface_at(ray.origin, ray.direction, t, hit, ray.left)
    attribute = material_of(surface)
    offset = lift(surface, t)
    before, after = media_at(ray.origin, ray.direction, ray.left, t, surface)
    weight = ray.weight
    if before != NOTHING:
        weight = weight * attenuation(attributes[before], t)
    start = surface.point + offset
    beyond = surface.point - offset
    mirror = reflection_direction(ray.direction, surface.normal)
    resting = Ray(beyond, mirror, vec3(0.0), surface.code, True)
    fork = Fork(vec3(0.0), 1, 0, resting, resting)
    if before == after and attribute.transmission > 0.0:
        # Inside one medium a surface of another, which gives way to it, is not there.
        fork.refracted = Ray(beyond, ray.direction, weight, surface.code, not matters(weight))
    else:
        luminance, fork.shadow = direct_light(attribute, surface, start, ray.direction)
        fork.luminance = weight * luminance
        ratio = index_of(before) * reciprocal(index_of(after))
        mirrored, refracted = shares(attribute, ray.direction, surface.normal, ratio)
        bent, possible = refraction_direction(ray.direction, surface.normal, ratio)
        sent = possible and attribute.transmission > 0.0
        along, through = mirrored * weight, refracted * weight
        fork.mirrored = Ray(start, mirror, along, surface.code, not matters(along))
        fork.refracted = Ray(beyond, bent, through, surface.code, not (sent and matters(through)))
    return fork


@module
def fork_of(ray: Ray, background: vec3) -> Fork:
    """What a ray meets; nothing goes on from a ray that rests, or that meets only the background."""
    ended = Ray(ray.origin, ray.direction, ray.weight, NOTHING, True)
    fork = Fork(vec3(0.0), 0, 0, ended, ended)
    if not ray.rests:
        t, hit = nearest_hit(ray.origin, ray.direction, ray.left)
        if hit == NOTHING:
            fork.luminance = ray.weight * background
        else:
            fork = fork_at_glass(ray, t, hit)
    return fork


@record
class Path:
    """An eye ray and the mirror rays that follow it, so far: the ray that goes on (it rests: none does), what all came
    to, and how many generations there were.
    """

    ray: Ray
    traced: Traced
    generation: i32


@module
def path_of(view: View, eye_direction: vec3) -> Path:
    """A path that begins at the eye."""
    ray = Ray(view.eye, eye_direction, vec3(1.0), NOTHING, False)
    return Path(ray, Traced(vec3(0.0), 0, 0, 0, 0), 0)


@module
def path_after(path: Path, view: View, t: f32, hit: i32) -> Path:
    """The path when its ray has met thing `hit` at t, or the background."""
    after = path
    if hit == NOTHING:
        after.traced.luminance = accumulate_luminance(path.traced.luminance, path.ray.weight, view.background)
        after.ray.rests = True
    else:
        fork = fork_at_mirror(path.ray, t, hit)
        after.ray = fork.mirrored
        after.generation += 1
        after.traced.luminance = path.traced.luminance + fork.luminance
        after.traced.shadow += fork.shadow
        after.traced.eye_hits = 1
        if after.generation == view.depth:
            after.ray.rests = True
        after.traced.reflection += i32(not after.ray.rests)
    return after


@module
def parts(path: Path, fewest: i32) -> bool:
    """Whether the rays of a packet that go on had better part: fewer than `fewest` do, or on average every second is
    astray: it goes, along some axis, the other way than most. With `fewest` 0 they never part.
    """
    goes_on = not path.ray.rests
    rays = count_lanes(goes_on)
    left = count_lanes(goes_on and path.ray.direction.x < 0.0)
    front = count_lanes(goes_on and path.ray.direction.y < 0.0)
    down = count_lanes(goes_on and path.ray.direction.z < 0.0)
    astray = min(left, rays - left) + min(front, rays - front) + min(down, rays - down)
    return rays < fewest or (fewest > 0 and 2 * astray > rays)


@module
def along_mirrors(path: Path, view: View, fewest: i32) -> Path:
    """Follow a path to its end, or until its packet `parts`."""
    goes_on = not path.ray.rests
    while goes_on:
        t, hit = nearest_hit(path.ray.origin, path.ray.direction, path.ray.left)
        path = path_after(path, view, t, hit)
        goes_on = not path.ray.rests
        if parts(path, fewest):
            break
    return path


@module(fills="traced_light")
def trace_mirrors(view: View, eye_direction: vec3) -> Traced:
    """Follow an eye ray and its mirror rays."""
    return along_mirrors(path_of(view, eye_direction), view, 0).traced


@module(fills="traced_light")
def trace_tree(view: View, eye_direction: vec3) -> Traced:
    """Follow an eye ray and the tree of rays that mirrors and dielectrics make of it, mirrors first.

    The rays that are still to be followed wait on one stack for the packet: all lanes walk through the same tree, and
    in a branch that a lane does not have it rests. So every lane adds up its own luminance in the tree's order.
    """
    waiting = array(Ray, DEEPEST)
    generations = array(i32, DEEPEST)
    count = 1
    waiting[0] = Ray(view.eye, eye_direction, vec3(1.0), NOTHING, False)
    generations[0] = 1
    out = Traced(vec3(0.0), 0, 0, 0, 0)
    while count > 0:
        count -= 1
        generation = generations[count]
        fork = fork_of(waiting[count], view.background)
        out.luminance = out.luminance + fork.luminance
        out.shadow += fork.shadow
        if generation == 1:
            out.eye_hits = fork.met
        if generation < view.depth:
            out.reflection += i32(not fork.mirrored.rests)
            out.refraction += i32(not fork.refracted.rests)
            if any_lane(not fork.refracted.rests):
                waiting[count] = fork.refracted
                generations[count] = generation + 1
                count += 1
            if any_lane(not fork.mirrored.rests):
                waiting[count] = fork.mirrored
                generations[count] = generation + 1
                count += 1
    return out
