"""Random scenes that can be drawn, for properties that hold of all of them."""

import math

from hypothesis import strategies as st

from tasuki.scene import (
    Box,
    Camera,
    Cone,
    Cylinder,
    HalfSpace,
    Material,
    PointLight,
    Polygon,
    Scene,
    Slab,
    Sphere,
)
from tasuki.scene.transforms import IDENTITY, matrix, rotate, scale, translate

coordinates = st.floats(-1e6, 1e6, allow_subnormal=False)
vectors = st.tuples(coordinates, coordinates, coordinates)
shares = st.floats(0.0, 1.0, allow_subnormal=False)
colours = st.tuples(shares, shares, shares)
lengths = st.floats(1e-3, 1e3)


def apart(pair):
    a, b = pair
    return math.dist(a, b) > 1e-3


@st.composite
def cameras(draw):
    eye = draw(vectors)
    direction = draw(st.sampled_from([(1.0, 2.0, 0.5), (-3.0, 0.25, 1.0), (0.0, 5.0, 0.0)]))
    at = tuple(e + d for e, d in zip(eye, direction, strict=True))
    sizes = st.integers(1, 4096)
    return Camera(
        eye=eye,
        at=at,
        up=(0.0, 0.0, draw(lengths)),
        angle=draw(st.floats(0.1, 179.0)),
        resolution=(draw(sizes), draw(sizes)),
        hither=draw(st.floats(0.0, 100.0)),
        angle_between="centres",
    )


@st.composite
def nff_materials(draw, name):
    """A material that NFF can say: one coefficient for highlight and mirror, sides by rule."""
    specular = draw(shares)
    return Material(
        name=name,
        colour=draw(colours),
        diffuse=draw(shares),
        specular=specular,
        exponent=draw(st.floats(0.0, 1e6)),
        reflection=specular,
        transmission=draw(shares),
        index=draw(st.floats(0.5, 3.0)),
    )


def radii():
    return st.tuples(lengths, st.sampled_from([1.0, -1.0])).map(math.prod)


@st.composite
def cones(draw, material):
    base, apex = draw(st.tuples(vectors, vectors).filter(apart))
    sign = draw(st.sampled_from([1.0, -1.0]))
    radii_of_ends = draw(st.tuples(lengths, lengths | st.just(0.0)))
    first, second = draw(st.permutations([sign * radius for radius in radii_of_ends]))
    return Cone(base, first, apex, second, open=True, material=material)


@st.composite
def polygons(draw, material):
    """A star-shaped polygon in a plane of its own: convex or concave, flat or with normals."""
    count = draw(st.integers(3, 9))
    spokes = draw(st.lists(st.floats(0.3, 1.0), min_size=count, max_size=count))
    centre = draw(st.tuples(*[st.floats(-100.0, 100.0)] * 3))
    tilt = draw(st.floats(-3.0, 3.0))
    points = []
    for number, spoke in enumerate(spokes):
        angle = math.tau * number / count
        x, y = spoke * math.cos(angle), spoke * math.sin(angle)
        points.append((centre[0] + x, centre[1] + y * math.cos(tilt), centre[2] + y * math.sin(tilt)))
    normals = [(math.cos(n), math.sin(n), 1.0) for n in range(count)] if draw(st.booleans()) else None
    return Polygon(tuple(points), tuple(normals) if normals else None, material=material)


@st.composite
def nff_scenes(draw):
    """A scene that NFF can say, its materials in the order of their first use."""
    count = draw(st.integers(1, 3))
    drawn = [draw(nff_materials(f"material {number + 1}")) for number in range(count)]
    # NFF knows no names: equal materials would become one.
    distinct = {tuple(vars(material).values())[1:]: material for material in drawn}
    materials = [
        Material(f"material {number + 1}", *values)
        for number, values in enumerate(tuple(vars(one).values())[1:] for one in distinct.values())
    ]
    shapes = []
    for material in materials:
        for _ in range(draw(st.integers(1, 4))):
            sphere = st.builds(Sphere, vectors, radii(), material=st.just(material))
            shapes.append(draw(sphere | cones(material) | polygons(material)))
    lights = draw(st.lists(st.builds(PointLight, vectors, st.none() | colours), max_size=4))
    return Scene(draw(cameras()), shapes, lights, draw(colours))


@st.composite
def transforms(draw):
    """Moves, turns, stretches, mirrors and shears, one after the other; none of them extreme."""
    made = IDENTITY
    amounts = st.floats(-3.0, 3.0)
    factors = st.tuples(st.floats(0.3, 3.0), st.sampled_from([1.0, -1.0])).map(math.prod)
    for _ in range(draw(st.integers(0, 3))):
        kind = draw(st.sampled_from(["translate", "rotate", "scale", "matrix"]))
        if kind == "translate":
            step = translate(draw(amounts), draw(amounts), draw(amounts))
        elif kind == "rotate":
            axis = draw(st.sampled_from(["x", "y", "z", (1.0, 2.0, -3.0)]))
            step = rotate(axis, draw(st.floats(-400.0, 400.0)))
        elif kind == "scale":
            step = scale(draw(factors), draw(factors), draw(factors))
        else:
            step = matrix([[1.0, draw(amounts), 0.0], [0.0, draw(factors), 0.0], [0.0, draw(amounts), 1.0]])
        made = made.then(step)
    return made


@st.composite
def solids(draw):
    """A solid about the size of 1 near the origin, placed somehow."""
    near = st.floats(-1.0, 1.0)
    centre, size = draw(st.tuples(near, near, near)), draw(st.floats(0.5, 2.0))
    node = draw(
        st.sampled_from(
            [
                Sphere(centre, size),
                Box(centre, tuple(value + size for value in centre)),
                Cylinder(centre, (centre[0], centre[1], centre[2] + 1.0), size),
                HalfSpace((1.0, -1.0, 2.0), centre),
                Slab((0.0, 1.0, 0.0), centre, size),
            ]
        )
    )
    return node.transformed(draw(transforms()))


def numbers(*values):
    flat = [number for value in values for number in (value if isinstance(value, tuple) else (value,))]
    return " ".join(repr(number) for number in flat)


def nff_text(scene):
    """`scene` in NFF."""
    camera = scene.camera
    lines = ["v", f"from {numbers(camera.eye)}", f"at {numbers(camera.at)}", f"up {numbers(camera.up)}"]
    lines += [f"angle {camera.angle!r}", f"hither {camera.hither!r}", f"resolution {numbers(camera.resolution)}"]
    lines.append(f"b {numbers(scene.background)}")
    lines += [f"l {numbers(light.position, *(light.colour or ()))}" for light in scene.lights]
    material = None
    for shape in scene.shapes:
        if shape.material != material:
            material = shape.material
            surface = (material.diffuse, material.specular, material.exponent, material.transmission, material.index)
            lines.append(f"f {numbers(material.colour, *surface)}")
        lines += shape_lines(shape)
    return "\n".join(lines) + "\n"


def shape_lines(shape):
    if isinstance(shape, Sphere):
        return [f"s {numbers(shape.centre, shape.radius)}"]
    if isinstance(shape, Cone):
        return ["c", numbers(shape.base, shape.base_radius), numbers(shape.apex, shape.apex_radius)]
    if isinstance(shape, Cylinder):
        return ["c", numbers(shape.base, shape.radius), numbers(shape.apex, shape.radius)]
    if shape.normals is None:
        return [f"p {len(shape.points)}", *map(numbers, shape.points)]
    pairs = zip(shape.points, shape.normals, strict=True)
    return [f"pp {len(shape.points)}", *(numbers(point, normal) for point, normal in pairs)]
