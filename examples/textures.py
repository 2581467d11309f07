"""Textures of one's own, checker and marble: `tasuki render examples/textures.yaml --with examples/textures.py`."""

from tasuki.language import Table, abs, f32, floor, i32, module, record, sin, vec3
from tasuki.scene.textures import TextureKind, register

OCTAVES = 6
ASIDE = 0.001
"""Of a cell: by so much checkers lie beside whole numbers, where the faces of things like to be."""


@record
class Checker:
    """Cubes of `size` along the axes, by turns of the material's colour and of an`other`."""

    other: vec3
    size: f32


@record
class Marble:
    """Veins across the x axis, `size` from one to the next, which `turbulence` moves by so many times that."""

    veins: vec3
    size: f32
    turbulence: f32


@module
def checker(cubes: Checker, colour: vec3, point: vec3, normal: vec3) -> vec3:
    """One colour or the other, by whether the number of the cube is even."""
    place = point / cubes.size + vec3(ASIDE)
    cube = i32(floor(place.x)) + i32(floor(place.y)) + i32(floor(place.z))
    return cubes.other if cube & 1 == 1 else colour


@module
def lattice(x: i32, y: i32, z: i32) -> f32:
    """A number, 0 to 1, for each point of whole numbers, as if by chance."""
    mixed = x * 374761393 + y * 668265263 + z * 1274126177
    mixed = (mixed ^ mixed >> 13) * 1103515245
    return f32((mixed ^ mixed >> 16) & 65535) / 65535.0


@module
def smooth(x: f32) -> f32:
    """From 0 to 1, without slope at either."""
    return x * x * (3.0 - 2.0 * x)


@module
def noise(point: vec3) -> f32:
    """The numbers of the eight lattice points around a point, blended."""
    x, y, z = floor(point.x), floor(point.y), floor(point.z)
    u, v, w = smooth(point.x - x), smooth(point.y - y), smooth(point.z - z)
    total = 0.0
    for corner in range(8):
        right, back, up = corner & 1, corner >> 1 & 1, corner >> 2
        across = u if right == 1 else 1.0 - u
        along = v if back == 1 else 1.0 - v
        height = w if up == 1 else 1.0 - w
        total += across * along * height * lattice(i32(x) + right, i32(y) + back, i32(z) + up)
    return total


@module
def turbulence(point: vec3) -> f32:
    """Noise at many scales, about 0 to 1 (K. Perlin, "An Image Synthesizer", 1985)."""
    total = 0.0
    scale = 1.0
    for _octave in range(OCTAVES):
        total += abs(2.0 * noise(scale * point) - 1.0) / scale
        scale = 2.0 * scale
    return total


@module
def marble(stone: Marble, colour: vec3, point: vec3, normal: vec3) -> vec3:
    """The material's colour, and that of the veins where a disturbed wave goes through zero."""
    place = point / stone.size
    wave = sin(3.1415927 * (place.x + stone.turbulence * turbulence(place)))
    share = 1.0 - abs(wave)
    share = share * share
    return colour + share * share * (stone.veins - colour)


checkers = Table(Checker)
marbles = Table(Marble)
register(TextureKind("checker", checkers, checker, defaults={"other": (0.0, 0.0, 0.0), "size": 1.0}))
register(TextureKind("marble", marbles, marble, defaults={"veins": (0.1, 0.1, 0.1), "size": 1.0, "turbulence": 0.7}))
