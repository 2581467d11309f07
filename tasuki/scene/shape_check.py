"""What must hold of a scene's shapes: of its batches, and of the nodes of its tree.

Every distinct node is looked at once, all nodes of one class together. `tasuki.scene.walk` finds what only shows in the
place where a node stands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from tasuki.diagnostics import SceneError
from tasuki.scene.constructors import CONSTRUCTORS
from tasuki.scene.kinds import lookup
from tasuki.scene.problem import Path, Problem, number, point
from tasuki.scene.shapes import CONE, NODE, POLYGON, SPHERE, Shapes
from tasuki.scene.solids import (
    Box,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hyperboloid,
    Paraboloid,
    Polygon,
    Quadric,
    RoundedBox,
    Slab,
    Solid,
    Sphere,
    Tube,
    Wedge,
)
from tasuki.scene.source import quote, suggestion
from tasuki.scene.traverse import measure
from tasuki.scene.tree import MOST_LEVELS, Bounded, Complement, Extent, Formula, Many, SetOperation

MOST_NODES = 2**24
"""How many nodes a tree may have, every instance counted apart: no file of a few lines can exhaust the computer."""


class Fault(NamedTuple):
    """What is wrong with `field` of the solids where the mask `bad` is true."""

    field: str
    bad: np.ndarray
    message: str
    expected: str


def shape_problems(shapes: Shapes) -> list[Problem]:
    """What is wrong with the batches of `shapes`, with its other nodes, and with all that is inside them."""
    too_large = list(_sizes(shapes))
    if too_large:
        return too_large
    census = Census(shapes)
    found: list[Problem] = []
    for place in census.by_class.pop(Shapes):
        found += _batches(census.nodes[place], census.path(place))
    for node_class, members in census.by_class.items():
        if issubclass(node_class, SetOperation | Complement | Formula):
            found += _operands(census, members)
        if issubclass(node_class, Bounded):
            found += _extents(census, members)
        if node_class in CONSTRUCTORS:
            found += _numbers(census, node_class, members)
        elif node_class is Polygon:
            found += _polygons(census, members)
        elif node_class is Solid:
            found += _registered(census, members)
    return found


class Census:
    """Every distinct node once, with the way to where it stands first."""

    def __init__(self, shapes: Shapes) -> None:
        self.nodes: list[Any] = [shapes]
        self.by_class: dict[type, list[int]] = {}
        self._parents = [-1]
        self._steps = [0]
        seen = {id(shapes)}
        for place, node in enumerate(self.nodes):
            self.by_class.setdefault(type(node), []).append(place)
            for step, inner in enumerate(node.nodes if isinstance(node, Many) else node.inner):
                if id(inner) not in seen:
                    seen.add(id(inner))
                    self.nodes.append(inner)
                    self._parents.append(place)
                    self._steps.append(step)

    def path(self, place: int) -> Path:
        """The path to the node with the number `place`."""
        steps: list[Path] = []
        while self._parents[place] >= 0:
            parent, step = self.nodes[self._parents[place]], self._steps[place]
            steps.append(_step(parent, step))
            place = self._parents[place]
        return ("shapes", *(one for step in reversed(steps) for one in step))


def _step(parent: Any, number: int) -> Path:
    if isinstance(parent, Shapes):
        return (int(np.flatnonzero(parent.sorts == NODE)[number]),)
    return parent.step(number)


def _sizes(shapes: Shapes) -> Iterator[Problem]:
    """Trees that are too deep or too large to walk through."""
    positions = np.flatnonzero(shapes.sorts == NODE).tolist()
    sizes = measure(shapes.nodes)
    for position, (levels, _) in zip(positions, sizes, strict=True):
        if levels > MOST_LEVELS:
            message = "nodes are nested too deeply here"
            yield Problem(("shapes", position), message, f"at most {MOST_LEVELS} levels", f"{levels} levels")
    total = sum(count for _, count in sizes)
    if total > MOST_NODES:
        largest = max(range(len(sizes)), key=lambda place: sizes[place][1])
        message = "the scene has too many nodes, most of them here: instances count one by one"
        yield Problem(("shapes", positions[largest]), message, f"at most {MOST_NODES:,}", f"{total:,}")


def _batches(shapes: Shapes, path: Path) -> Iterator[Problem]:
    orders = [np.flatnonzero(shapes.sorts == sort) for sort in (SPHERE, CONE, POLYGON)]

    def where(sort: int, bad: np.ndarray) -> Iterator[tuple[int, Path]]:
        return ((int(position), (*path, int(orders[sort][position]))) for position in np.flatnonzero(bad))

    spheres, cones, polygons = shapes.spheres, shapes.cones, shapes.polygons
    finite_polygon = np.ones(len(polygons), bool)
    owner = np.repeat(np.arange(len(polygons)), polygons.sizes)
    finite_polygon[owner[_not_finite(polygons.points, polygons.normals)]] = False
    sorted_by_batch = [
        (SPHERE, _not_finite(spheres.centre, spheres.radius)),
        (CONE, _not_finite(cones.base, cones.base_radius, cones.apex, cones.apex_radius)),
        (POLYGON, ~finite_polygon),
    ]
    for sort, bad in sorted_by_batch:
        for _, here in where(sort, bad):
            yield Problem(here, "not all of its numbers are finite", "finite numbers", "NaN or infinity")
    for _, here in where(SPHERE, spheres.radius == 0.0):
        yield Problem((*here, "radius"), "this sphere has no size", "a radius other than 0", "0")
    first, second = cones.base_radius, cones.apex_radius
    for position, here in where(CONE, (first == 0.0) & (second == 0.0) | (first * second < 0.0)):
        found = f"{number(first[position])} and {number(second[position])}"
        expected = "two radii of one sign, not both 0"
        yield Problem((*here, "base_radius"), "this cone has no such surface", expected, found)
    for position, here in where(CONE, (cones.base == cones.apex).all(axis=1)):
        found = point(cones.apex[position])
        expected = "a point other than the base"
        yield Problem((*here, "apex"), "the base and the apex of this cone coincide", expected, found)


def _not_finite(*arrays: np.ndarray) -> np.ndarray:
    """Which rows hold a number that is not finite."""
    bad = [~np.isfinite(array) for array in arrays]
    return np.logical_or.reduce([rows.any(axis=1) if rows.ndim > 1 else rows for rows in bad])


def _operands(census: Census, members: Sequence[int]) -> Iterator[Problem]:
    for place in members:
        operation = census.nodes[place]
        for step, operand in enumerate(operation.inner):
            if not operand.is_solid:
                what = f"{operand.described} has no inside"
                message = f"{what}, so it cannot be an operand of {operation.described}"
                yield Problem((*census.path(place), *operation.step(step)), message, "a solid", operand.described)


def _extents(census: Census, members: Sequence[int]) -> Iterator[Problem]:
    for place in members:
        node = census.nodes[place]
        extent = node.extent
        if extent is None:
            continue
        path = (*census.path(place), "extent")
        if not (node.is_solid or node.holds):
            yield Problem(path, f"{node.described} can have no extent", "an extent of a group or a solid", "one here")
        elif isinstance(extent, Extent):
            yield from _extent(path, extent)
        elif extent != "auto":
            yield Problem(path, "this is no extent", "a centre and a radius, or 'auto'", quote(str(extent)))


def _extent(path: Path, extent: Extent) -> Iterator[Problem]:
    if np.shape(extent.centre) != (3,) or not np.isfinite(extent.centre).all():
        yield Problem((*path, "centre"), "this is no point", "three finite numbers", str(extent.centre))
    if not 0.0 < extent.radius < np.inf:
        yield Problem((*path, "radius"), "no such radius", "a number greater than 0", number(extent.radius))


def _polygons(census: Census, members: Sequence[int]) -> Iterator[Problem]:
    for place in members:
        polygon = census.nodes[place]
        for name in ("points", "normals"):
            values = getattr(polygon, name)
            if values is not None and not _is_finite(values, (len(values), 3)):
                message = "not all of these are three finite numbers"
                yield Problem((*census.path(place), name), message, "finite numbers", _shown(values))


def _registered(census: Census, members: Sequence[int]) -> Iterator[Problem]:
    for place in members:
        solid = census.nodes[place]
        path = census.path(place)
        try:
            kind = lookup(solid.kind)
        except SceneError:
            yield Problem((*path, "kind"), "there is no such kind", "a registered kind", quote(solid.kind))
            continue
        if kind.is_built_in:
            message = "what comes with Tasuki has nodes of its own"
            yield Problem((*path, "kind"), message, "a kind that a user registered", quote(solid.kind))
            continue
        yield from _fields(path, solid.fields, _given_fields(kind.record))


def _given_fields(record: Any) -> dict[str, np.dtype]:
    """The fields that a user gives of a kind's record, with their types."""
    dtype = record.numpy_dtype()
    return {name: dtype[name] for name in dtype.names if name not in ("kind", "attribute", "matrix", "flags")}


def _fields(path: Path, fields: Mapping[str, Any], types: Mapping[str, np.dtype]) -> Iterator[Problem]:
    for name, dtype in types.items():
        is_whole = dtype.base.kind == "i"
        expected = "a whole number" if is_whole else _expected(dtype.shape)
        if name not in fields:
            yield Problem((*path, name), "this is missing", expected, "nothing")
        elif not _is_finite(fields[name], dtype.shape) or (is_whole and fields[name] != int(fields[name])):
            yield Problem((*path, name), "this is no such value", expected, _shown(fields[name]))
    for name in fields:
        if name not in types:
            hint = suggestion(name, list(types))
            message = "there is no such field" + (f", {hint}" if hint else "")
            yield Problem((*path, name), message, f"one of {', '.join(types)}", quote(name))


# The numbers of solids with constructors


def _numbers(census: Census, solid_class: type, members: Sequence[int]) -> Iterator[Problem]:
    """Fields that are not finite numbers of the right form; where all are, those that no such solid can have."""
    constructor = CONSTRUCTORS[solid_class]
    solids = [census.nodes[place] for place in members]
    try:
        columns = constructor.columns(solids)
        well_formed = all(
            np.isfinite(values).all() and values.shape[1:] == _form(solid_class, name)
            for name, values in columns.items()
        )
    except (ValueError, TypeError):
        well_formed = False
    if not well_formed:
        yield from _malformed(census, solid_class, members)
        return
    if solid_class in (Cylinder, Cone):
        columns["open"] = np.array([solid.open for solid in solids], bool)
    for fault in _RULES[solid_class](**columns):
        for which in np.flatnonzero(fault.bad).tolist():
            path = (*census.path(members[which]), fault.field)
            yield Problem(path, fault.message, fault.expected, _shown(getattr(solids[which], fault.field)))


def _malformed(census: Census, solid_class: type, members: Sequence[int]) -> Iterator[Problem]:
    for place in members:
        for name in CONSTRUCTORS[solid_class].fields:
            value, form = getattr(census.nodes[place], name), _form(solid_class, name)
            if not _is_finite(value, form):
                yield Problem((*census.path(place), name), "this is no such value", _expected(form), _shown(value))


_SCALARS = ("radius", "base_radius", "apex_radius", "hole", "thickness", "constant", "sheets")


def _form(solid_class: type, name: str) -> tuple[int, ...]:
    """The shape of a field's value."""
    if name in _SCALARS:
        return ()
    if name == "matrix":
        return (3, 3)
    return (2,) if (solid_class, name) == (Paraboloid, "radii") else (3,)


def _expected(shape: tuple[int, ...]) -> str:
    """What a value of this shape is."""
    return f"{' x '.join(map(str, shape))} finite numbers" if shape else "a finite number"


def _is_finite(value: Any, shape: tuple[int, ...]) -> bool:
    try:
        numbers = np.array(value, np.float64)
    except (ValueError, TypeError):
        return False
    return numbers.shape == shape and bool(np.isfinite(numbers).all())


def _shown(value: Any) -> str:
    """A value as messages show it, not too long."""
    try:
        text = point(np.array(value, np.float64).reshape(-1))
    except (ValueError, TypeError):
        return quote(str(value))
    return text if len(text) <= 80 else f"{text[:77]}..."


def _positive(field: str, values: np.ndarray) -> Fault:
    if values.ndim == 1:
        return Fault(field, ~(values > 0.0), f"no such {field}", "a number greater than 0")
    return Fault(field, ~np.all(values > 0.0, axis=1), f"no such {field}", "numbers greater than 0")


def _direction(normal: np.ndarray) -> Fault:
    return Fault("normal", ~np.any(normal, axis=1), "this normal has no direction", "a vector other than zero")


def _axis(base: np.ndarray, apex: np.ndarray) -> Fault:
    bad = np.all(base == apex, axis=1)
    return Fault("apex", bad, "the base and the apex coincide", "a point other than the base")


def _volume(low: np.ndarray, high: np.ndarray) -> Fault:
    bad = ~np.all(low < high, axis=1)
    return Fault("high", bad, "there is no volume between the corners", "more than `low` along every axis")


def _sphere(centre: np.ndarray, radius: np.ndarray) -> Iterator[Fault]:
    yield Fault("radius", radius == 0.0, "this sphere has no size", "a radius other than 0")


def _ellipsoid(centre: np.ndarray, radii: np.ndarray) -> Iterator[Fault]:
    yield _positive("radii", radii)


def _box(low: np.ndarray, high: np.ndarray) -> Iterator[Fault]:
    yield _volume(low, high)


def _cylinder(base: np.ndarray, apex: np.ndarray, radius: np.ndarray, open: np.ndarray) -> Iterator[Fault]:
    yield _axis(base, apex)
    yield Fault("radius", open & (radius == 0.0), "this cylinder has no size", "a radius other than 0")
    yield Fault("radius", ~open & (radius <= 0.0), "no such radius", "a number greater than 0")


def _cone(
    base: np.ndarray, base_radius: np.ndarray, apex: np.ndarray, apex_radius: np.ndarray, open: np.ndarray
) -> Iterator[Fault]:
    yield _axis(base, apex)
    nothing = (base_radius == 0.0) & (apex_radius == 0.0)
    mixed = open & (base_radius * apex_radius < 0.0)
    yield Fault("base_radius", nothing | mixed, "this cone has no such surface", "two radii of one sign, not both 0")
    for name, radius in (("base_radius", base_radius), ("apex_radius", apex_radius)):
        yield Fault(name, ~open & (radius < 0.0), "a closed cone has no negative radius", "0 or more")


def _hyperboloid(centre: np.ndarray, radii: np.ndarray, sheets: np.ndarray) -> Iterator[Fault]:
    yield _positive("radii", radii)
    yield Fault("sheets", ~np.isin(sheets, (1, 2)), "no such number of sheets", "1 or 2")


def _paraboloid(vertex: np.ndarray, radii: np.ndarray) -> Iterator[Fault]:
    yield _positive("radii", radii)


def _half_space(normal: np.ndarray, point: np.ndarray) -> Iterator[Fault]:
    yield _direction(normal)


def _slab(normal: np.ndarray, point: np.ndarray, thickness: np.ndarray) -> Iterator[Fault]:
    yield _direction(normal)
    yield _positive("thickness", thickness)


def _quadric(matrix: np.ndarray, centre: np.ndarray, linear: np.ndarray, constant: np.ndarray) -> Iterator[Fault]:
    uneven = np.any(matrix != np.swapaxes(matrix, 1, 2), axis=(1, 2))
    yield Fault("matrix", uneven, "this matrix is not symmetric", "the same numbers across the diagonal")
    nothing = ~(np.any(matrix, axis=(1, 2)) | np.any(linear, axis=1))
    yield Fault("matrix", nothing, "this quadric has no surface", "a matrix or linear term other than zero")


def _rounded_box(low: np.ndarray, high: np.ndarray, radius: np.ndarray) -> Iterator[Fault]:
    yield _volume(low, high)
    bad = ~((radius > 0.0) & (2.0 * radius < (high - low).min(axis=1)))
    yield Fault("radius", bad, "no such radius", "more than 0, less than half the shortest edge")


def _tube(base: np.ndarray, apex: np.ndarray, radius: np.ndarray, hole: np.ndarray) -> Iterator[Fault]:
    yield _axis(base, apex)
    yield _positive("radius", radius)
    yield Fault("hole", ~((hole > 0.0) & (hole < radius)), "no such hole", "more than 0, less than the radius")


_RULES: dict[type, Callable[..., Iterator[Fault]]] = {
    Sphere: _sphere,
    Ellipsoid: _ellipsoid,
    Box: _box,
    Cylinder: _cylinder,
    Cone: _cone,
    Hyperboloid: _hyperboloid,
    Paraboloid: _paraboloid,
    HalfSpace: _half_space,
    Slab: _slab,
    Wedge: _box,
    Quadric: _quadric,
    RoundedBox: _rounded_box,
    Tube: _tube,
}
