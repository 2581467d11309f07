"""Rays in waves: where few lanes of a packet have a mirror ray left, their rays wait, and go on in company of others.

Mirrors scatter: after a few of them the rays of a packet go anywhere, and each of its lanes waits for all others. Rays
that wait are sorted, by where they begin and roughly where they go before the search, by where they have hit before the
shading, and make new packets with their neighbours (after T. Boulos et al., "Adaptive Ray Packet Reordering", 2008).
What a ray computes does not depend on its company: the picture is the same, bit for bit.

Each module here is a step for all rays of a wave; what sorts between the steps is `tasuki.renderers.waves`. A step
returns for every ray the key by which it is sorted for the next, or ENDED.
"""

from tasuki.language import Table, f32, i32, max, min, module, record, vec3
from tasuki.modules.light_paths import Path, Ray, along_mirrors, path_after, path_of
from tasuki.modules.raytrace import Traced, eye_direction
from tasuki.modules.records import Pixel, RayCounts, picture, ray_counts, views
from tasuki.modules.search import nearest_hit

ENDED = 65535
"""The key of a path that has come to its end."""
CELLS = 32
"""Cells along each side of the box by which points are sorted; with directions half as many."""


@record
class WaitingPath:
    """A path whose ray waits: one cache line."""

    origin: vec3
    left: i32
    direction: vec3
    pixel: i32
    weight: vec3
    generation: i32
    luminance: vec3
    shadow: i32


@record
class WaitingHit:
    """What a waiting ray meets, and where."""

    t: f32
    hit: i32


@record
class Wave:
    """The box of the scene: its low corner, and cells for each unit of length. Lanes below which a packet gives up."""

    low: vec3
    fewest: i32
    scale: vec3


waiting_paths = Table(WaitingPath)
waiting_hits = Table(WaitingHit)
waves = Table(Wave)


@module
def spread_bits(x: i32) -> i32:
    """The lowest five bits, each with two zeros above it."""
    x = (x | x << 8) & 0x100F
    x = (x | x << 4) & 0x10C3
    return (x | x << 2) & 0x1249


@module
def cell_of(point: vec3) -> i32:
    """The number of a point's cell along Morton's curve; 15 bits."""
    cells = (point - waves[0].low) * waves[0].scale
    x = min(max(i32(cells.x), 0), CELLS - 1)
    y = min(max(i32(cells.y), 0), CELLS - 1)
    z = min(max(i32(cells.z), 0), CELLS - 1)
    return spread_bits(x) | spread_bits(y) << 1 | spread_bits(z) << 2


@module
def ray_key(ray: Ray) -> i32:
    """Where a ray begins, in cells of twice the size, and the octant into which it goes."""
    octant = i32(ray.direction.x < 0.0) | i32(ray.direction.y < 0.0) << 1 | i32(ray.direction.z < 0.0) << 2
    return cell_of(ray.origin) & 0x7FF8 | octant


@module
def end_path(path: Path, pixel: i32, is_first: bool):
    """Add what a path has brought to its pixel, which has nothing yet if it is the first."""
    traced = path.traced
    known = Pixel(vec3(0.0), 0.0)
    counts = RayCounts(0, 0, 0, 0)
    if not is_first:
        known = picture[pixel]
        counts = ray_counts[pixel]
    picture[pixel] = Pixel(known.colour + traced.luminance, known.coverage + f32(traced.eye_hits))
    ray_counts[pixel] = RayCounts(
        counts.eye_hits + traced.eye_hits,
        counts.reflection + traced.reflection,
        counts.refraction,
        counts.shadow + traced.shadow,
    )


@module
def end_or_wait(path: Path, pixel: i32, place: i32, is_first: bool) -> i32:
    """Let a path wait at a place of `waiting_paths`, if it has not ended."""
    key = ENDED
    if path.ray.rests:
        end_path(path, pixel, is_first)
    else:
        if is_first:
            picture[pixel] = Pixel(vec3(0.0), 0.0)
            ray_counts[pixel] = RayCounts(0, 0, 0, 0)
        ray = path.ray
        waiting_paths[place] = WaitingPath(
            ray.origin,
            ray.left,
            ray.direction,
            pixel,
            ray.weight,
            path.generation,
            path.traced.luminance,
            path.traced.shadow,
        )
        key = ray_key(ray)
    return key


@module
def begin_wave(place: i32, number: i32, first: i32, sample: i32) -> i32:
    """Follow one eye ray through the pixel at a place of the region, as `raytrace.trace_pixel` does; the path waits at
    `first + number`.
    """
    view = views[0]
    pixel = (place >> 16 & 65535) * view.region_width + (place & 65535)
    path = along_mirrors(path_of(view, eye_direction(view, place, sample)), view, waves[0].fewest)
    return end_or_wait(path, pixel, first + number, sample == 0)


@module
def search_wave(place: i32) -> i32:
    """Find what a waiting ray meets; the key says where."""
    waiting = waiting_paths[place]
    t, hit = nearest_hit(waiting.origin, waiting.direction, waiting.left)
    waiting_hits[place] = WaitingHit(t, hit)
    return cell_of(waiting.origin + t * waiting.direction)


@module
def shade_wave(place: i32, number: i32, first: i32) -> i32:
    """Take a path on from what its ray has met; it waits again at `first + number`."""
    waiting = waiting_paths[place]
    found = waiting_hits[place]
    ray = Ray(waiting.origin, waiting.direction, waiting.weight, waiting.left, False)
    traced = Traced(waiting.luminance, 1, waiting.generation, 0, waiting.shadow)
    path = path_after(Path(ray, traced, waiting.generation), views[0], found.t, found.hit)
    return end_or_wait(path, waiting.pixel, first + number, False)
