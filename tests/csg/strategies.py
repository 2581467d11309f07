"""Random solids whose faces coincide often: everything stands on a coarse grid, turned by a few angles."""

from __future__ import annotations

from hypothesis import strategies as st

from tasuki.scene.solids import (
    Box,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hyperboloid,
    Paraboloid,
    Quadric,
    RoundedBox,
    Slab,
    Sphere,
    Tube,
    Wedge,
)
from tasuki.scene.tree import Complement, Difference, Intersection, Node, Union
from tests.csg.operands import directly

DEEPEST = 6
"""Operations within operations."""

places = st.tuples(*[st.integers(-2, 2)] * 3)
lengths = st.integers(1, 2)
radii = st.tuples(lengths, lengths, lengths)
axes = st.sampled_from([(1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1)])
normals = st.sampled_from([*((s * x, s * y, s * z) for s in (1, -1) for x, y, z in ((1, 0, 0), (0, 0, 1), (1, 2, 0)))])


def _plus(a, b, times=1):
    return tuple(x + times * y for x, y in zip(a, b, strict=True))


@st.composite
def _boxes(draw, kind):
    low = draw(places)
    return kind(low, _plus(low, draw(radii)))


@st.composite
def _turned(draw, kind):
    """Cylinders, cones and tubes along an axis."""
    base, axis = draw(places), draw(axes)
    apex = _plus(base, axis, draw(lengths))
    if kind is Cylinder:
        return Cylinder(base, apex, draw(lengths))
    if kind is Tube:
        return Tube(base, apex, 2, 1)
    return Cone(base, draw(lengths), apex, draw(st.integers(0, 2)))


SADDLE = Quadric(((1, 0, 0), (0, -1, 0), (0, 0, 0)), linear=(0, 0, -1), constant=0)

solids = st.one_of(
    _boxes(Box),
    _boxes(Wedge),
    st.builds(Sphere, places, lengths),
    _turned(Cylinder),
    _turned(Cone),
    _turned(Tube),
    st.builds(HalfSpace, normals, places),
    st.builds(Slab, normals, places, lengths),
    st.builds(Ellipsoid, places, radii),
    st.builds(Paraboloid, places, st.tuples(lengths, lengths)),
    st.builds(Hyperboloid, places, radii, st.sampled_from([1, 2])),
    st.builds(lambda place: RoundedBox(place, _plus(place, (2, 2, 2)), 0.5), places),
    st.builds(lambda place: SADDLE.translate(*place), places),
)

turns = st.sampled_from(
    [
        lambda node: node,
        lambda node: node.rotate("x", 90.0),
        lambda node: node.rotate("z", -270.0).translate(1, 0, 0),
        lambda node: node.scale(-1, 1, 1),
        directly,
    ]
)


@st.composite
def _operations(draw, operands):
    operation = draw(st.sampled_from([Union, Intersection, Difference, Complement]))
    count = 1 if operation is Complement else draw(st.integers(2, 3))
    children = [draw(turns)(draw(operands)) for _ in range(count)]
    return Complement(children[0]) if operation is Complement else operation(tuple(children))


def formulas(depth: int = DEEPEST) -> st.SearchStrategy[Node]:
    """Solids and set operations on them, nested at most `depth` deep."""
    operands = solids
    for _ in range(depth - 1):
        operation = _operations(operands)
        operands = st.one_of(operation, operation, solids)
    return _operations(operands)
