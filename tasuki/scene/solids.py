"""What a scene is built from: solids, which have an inside and may be operands of set operations, and surfaces.

All numbers are in the node's local coordinates. A sphere whose radius is negative, and an open cylinder or cone, are
surfaces: they have sides to look at, but no inside. `tasuki.scene.check` says which numbers a node may have,
`tasuki.scene.constructors` of which planes and quadrics a solid is made.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from tasuki.diagnostics import Diagnostic, SceneError, Span
from tasuki.scene.kinds import kinds
from tasuki.scene.material import Material, Vector
from tasuki.scene.transforms import IDENTITY, Transform
from tasuki.scene.tree import Bounded, Extent, Node, plain

Rows = tuple[Vector, Vector, Vector]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Primitive(Bounded):
    """A solid that is no set operation of nodes."""

    @property
    def is_solid(self) -> bool:
        return True


@dataclass(frozen=True, slots=True, eq=False)
class Sphere(Primitive):
    """A sphere. With a negative radius it is a surface, of which only the inside shows."""

    noun: ClassVar[str] = "sphere"

    centre: Vector
    radius: float

    @property
    def is_solid(self) -> bool:
        return self.radius >= 0.0

    @property
    def described(self) -> str:
        return "a sphere" if self.is_solid else "a sphere of negative radius"


@dataclass(frozen=True, slots=True, eq=False)
class Ellipsoid(Primitive):
    """((x - cx) / a)^2 + ((y - cy) / b)^2 + ((z - cz) / c)^2 < 1, where `radii` are a, b, c."""

    noun: ClassVar[str] = "ellipsoid"

    centre: Vector
    radii: Vector


@dataclass(frozen=True, slots=True, eq=False)
class Box(Primitive):
    """The box between two corners, its faces along the local axes."""

    noun: ClassVar[str] = "box"

    low: Vector
    high: Vector


@dataclass(frozen=True, slots=True, eq=False)
class Cylinder(Primitive):
    """A cylinder with caps; `open`: a surface without them, of which, at a negative radius, only the inside shows."""

    noun: ClassVar[str] = "cylinder"

    base: Vector
    apex: Vector
    radius: float
    open: bool = field(default=False, kw_only=True)

    @property
    def is_solid(self) -> bool:
        return not self.open

    @property
    def described(self) -> str:
        return "an open cylinder" if self.open else "a cylinder"


@dataclass(frozen=True, slots=True, eq=False)
class Cone(Primitive):
    """A cone, or frustum of one, with caps; `open`: a surface without them.

    Of an open one whose radii are negative only the inside shows.
    """

    noun: ClassVar[str] = "cone"

    base: Vector
    base_radius: float
    apex: Vector
    apex_radius: float = 0.0
    open: bool = field(default=False, kw_only=True)

    @property
    def is_solid(self) -> bool:
        return not self.open

    @property
    def described(self) -> str:
        return "an open cone" if self.open else "a cone"


@dataclass(frozen=True, slots=True, eq=False)
class Hyperboloid(Primitive):
    """A hyperboloid about the local z axis, of one sheet or two, without bounds.

    Inside of one sheet ((x - cx) / a)^2 + ((y - cy) / b)^2 - ((z - cz) / c)^2 < 1, of two sheets < -1.
    """

    noun: ClassVar[str] = "hyperboloid"

    centre: Vector
    radii: Vector
    sheets: Literal[1, 2] = 1


@dataclass(frozen=True, slots=True, eq=False)
class Paraboloid(Primitive):
    """What lies above z - vz = ((x - vx) / a)^2 + ((y - vy) / b)^2, where `radii` are a, b; without bounds."""

    noun: ClassVar[str] = "paraboloid"

    vertex: Vector
    radii: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class HalfSpace(Primitive):
    """What lies behind the plane through `point`: (P - point) . normal < 0, the normal of any length."""

    noun: ClassVar[str] = "half-space"

    normal: Vector
    point: Vector


@dataclass(frozen=True, slots=True, eq=False)
class Slab(Primitive):
    """What lies between two parallel planes, `thickness` apart, with `point` half way."""

    noun: ClassVar[str] = "slab"

    normal: Vector
    point: Vector
    thickness: float


@dataclass(frozen=True, slots=True, eq=False)
class Wedge(Primitive):
    """The lower half of the box `low` .. `high`, cut from its edge at low x and high z to that at high x and low z."""

    noun: ClassVar[str] = "wedge"

    low: Vector
    high: Vector


@dataclass(frozen=True, slots=True, eq=False)
class Quadric(Primitive):
    """Inside (P - centre)^T matrix (P - centre) + linear . (P - centre) < constant; `matrix` is symmetric, by rows."""

    noun: ClassVar[str] = "quadric"

    matrix: Rows
    centre: Vector = (0.0, 0.0, 0.0)
    linear: Vector = (0.0, 0.0, 0.0)
    constant: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class RoundedBox(Primitive):
    """The box `low` .. `high`, its edges and corners rounded with `radius`."""

    noun: ClassVar[str] = "rounded box"

    low: Vector
    high: Vector
    radius: float


@dataclass(frozen=True, slots=True, eq=False)
class Tube(Primitive):
    """A cylinder of `radius` with caps, through which a hole of radius `hole` is drilled."""

    noun: ClassVar[str] = "tube"

    base: Vector
    apex: Vector
    radius: float
    hole: float


@dataclass(frozen=True, slots=True, eq=False, init=False)
class Solid(Primitive):
    """A solid, or a surface, of a kind that a user registered: `fields` are those of its record, without its first row.

    Solid("torus", major=2, minor=0.5, material=gold)
    """

    noun: ClassVar[str] = "solid"

    kind: str
    fields: Mapping[str, Any]

    def __init__(
        self,
        kind: str,
        *,
        material: Material | None = None,
        transform: Transform = IDENTITY,
        name: str | None = None,
        extent: Extent | Literal["auto"] | None = None,
        place: Span | None = None,
        fields: Mapping[str, Any] | None = None,
        **more_fields: Any,
    ) -> None:
        given = {name: plain(value) for name, value in {**(fields or {}), **more_fields}.items()}
        common = {"material": material, "transform": transform, "name": name, "extent": extent, "place": place}
        for attribute, value in {"kind": kind, "fields": given, **common}.items():
            object.__setattr__(self, attribute, value)

    @property
    def is_solid(self) -> bool:
        # A kind that does not exist is found wrong elsewhere.
        return all(kind.sort == "solid" for kind in kinds() if kind.name == self.kind)

    @property
    def described(self) -> str:
        return f"{'an' if self.kind[:1] in 'aeio' else 'a'} {self.kind}"


@dataclass(frozen=True, slots=True, eq=False)
class Polygon(Node):
    """A flat polygon, convex or concave, its points counterclockwise as seen from the front.

    `normals`, one for each point and of any length, make it a patch: shading interpolates them. SceneError where there
    are fewer than three points, or not as many normals as points.
    """

    noun: ClassVar[str] = "polygon"

    points: tuple[Vector, ...]
    normals: tuple[Vector, ...] | None = None

    def __post_init__(self) -> None:
        for name in ("points", "normals"):
            value = getattr(self, name)
            if type(value) is not tuple and value is not None:
                object.__setattr__(self, name, plain(value))
        found, normals = len(self.points), len(self.points if self.normals is None else self.normals)
        if found < 3:
            problem = Diagnostic("a polygon needs at least 3 points", self.place, "3 or more points", str(found))
            raise SceneError(str(problem))
        if normals != found:
            problem = Diagnostic("a patch needs a normal for every point", self.place, f"{found} normals", str(normals))
            raise SceneError(str(problem))
