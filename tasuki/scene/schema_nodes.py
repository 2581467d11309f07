"""The nodes of a scene as pydantic models, by their keys: what may stand under `sphere`, `union`, `group`, ...

A model validates one node and no node within it (these are plain data to it), so that the tree may be deep. Kinds that
users registered are among them, under their names and with the fields of their records.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import Field, WithJsonSchema, create_model, model_validator
from pydantic_core import PydanticCustomError

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.scene.formula_text import PART_NAME
from tasuki.scene.kinds import PrimitiveKind, kinds
from tasuki.scene.schema_fields import (
    Direction,
    Extent,
    FileName,
    MaterialName,
    Model,
    Number,
    Point,
    Positive,
    Radii,
    Transformation,
)

NODE_MARK = {"x-node": True}
"""Stands in the schema for "any node" until it is published: pydantic cannot refer to what it does not know."""

AnyNode = Annotated[Any, WithJsonSchema(NODE_MARK)]
PartName = Annotated[str, Field(pattern=f"^{PART_NAME}$")]


class NodeModel(Model):
    """What every node may have."""

    material: MaterialName = None
    transform: Transformation = Field(default_factory=list)
    name: Annotated[str | None, Field(description="shown in messages and by `tasuki info`")] = None


class BoundedModel(NodeModel):
    """What solids, set operations and groups may have besides."""

    extent: Extent = None


class SphereModel(BoundedModel):
    """A sphere. A negative radius: a surface of which only the inside is visible."""

    centre: Point
    radius: Number


class EllipsoidModel(BoundedModel):
    """An ellipsoid along the axes."""

    centre: Point
    radii: Radii


class BoxModel(BoundedModel):
    """A box along the axes, between two corners."""

    low: Point
    high: Point


class CylinderModel(BoundedModel):
    """A cylinder. `open`: a surface without caps; there a negative radius makes only the inside visible."""

    base: Point
    apex: Point
    radius: Number
    open: bool = False


class ConeModel(BoundedModel):
    """A cone or a frustum. `open`: a surface without caps; there negative radii make only the inside visible."""

    base: Point
    base_radius: Number
    apex: Point
    apex_radius: Number = 0.0
    open: bool = False


class HyperboloidModel(BoundedModel):
    """(x/a)^2 + (y/b)^2 - (z/c)^2 < 1, of one sheet, or < -1, of two, about `centre`. Unbounded."""

    centre: Point
    radii: Annotated[Radii, Field(description="a, b, c")]
    sheets: Literal[1, 2] = 1


class ParaboloidModel(BoundedModel):
    """What lies above z = (x/a)^2 + (y/b)^2, counted from `vertex`. Unbounded."""

    vertex: Point
    radii: Annotated[list[Positive], Field(min_length=2, max_length=2, description="a, b")]


class HalfSpaceModel(BoundedModel):
    """What lies behind the plane through `point`, away from `normal`. Unbounded."""

    normal: Direction
    point: Point


class SlabModel(BoundedModel):
    """What lies between two parallel planes, `point` in the middle. Unbounded."""

    normal: Direction
    point: Point
    thickness: Positive


class WedgeModel(BoundedModel):
    """The lower half of the box `low` .. `high`, cut from its upper edge at low x to its lower edge at high x."""

    low: Point
    high: Point


class QuadricModel(BoundedModel):
    """(P - c)^T Q (P - c) + l . (P - c) < constant, Q symmetric. In general unbounded."""

    matrix: Annotated[list[Point], Field(min_length=3, max_length=3, description="the rows of Q")]
    centre: Annotated[Point, Field(description="c")] = Field([0.0, 0.0, 0.0])
    linear: Annotated[Point, Field(description="l")] = Field([0.0, 0.0, 0.0])
    constant: Number = 1.0


class RoundedBoxModel(BoundedModel):
    """A box whose edges and corners are rounded with `radius`."""

    low: Point
    high: Point
    radius: Positive


class TubeModel(BoundedModel):
    """A cylinder of `radius` with a bore of radius `hole` along its axis."""

    base: Point
    apex: Point
    radius: Positive
    hole: Positive


class OperandsModel(BoundedModel):
    """Operands of a set operation."""

    children: Annotated[list[AnyNode], Field(min_length=1, description="solids and set operations")]


class UnionModel(OperandsModel):
    """What is in any of its children."""


class IntersectionModel(OperandsModel):
    """What is in all of its children."""


class DifferenceModel(OperandsModel):
    """What is in the first of its children and in no other."""


class ComplementModel(BoundedModel):
    """All that is not in its child."""

    child: AnyNode


class ObjectModel(BoundedModel):
    """Named parts, which a formula in infix or in Polish form combines."""

    parts: Annotated[dict[PartName, AnyNode], Field(min_length=1, description="solids and set operations by name")]
    formula: Annotated[str | None, Field(description='infix: "plate - (hole1 + hole2)"')] = None
    polish: Annotated[str | None, Field(description='Polish form: "- plate + hole1 hole2"')] = None

    @model_validator(mode="after")
    def _has_one_formula(self) -> ObjectModel:
        if (self.formula is None) == (self.polish is None):
            context = {"expected": "`formula` (infix) or `polish`, one of them"}
            context["found"] = "neither" if self.formula is None else "both"
            raise PydanticCustomError("expected", "an object has one formula", context)
        return self


class PolygonModel(NodeModel):
    """A flat polygon, convex or concave, counterclockwise as seen from the front. A surface."""

    points: Annotated[list[Point], Field(min_length=3)]


class PatchModel(NodeModel):
    """A polygon with a normal at each point, which shading interpolates. A surface."""

    points: Annotated[list[Point], Field(min_length=3)]
    normals: Annotated[list[Point], Field(min_length=3)]

    @model_validator(mode="after")
    def _as_many_normals_as_points(self) -> PatchModel:
        points, normals = len(self.points), len(self.normals)
        if normals != points:
            context = {"expected": f"{points} normals, one for each point", "found": f"{normals} normals"}
            raise PydanticCustomError("expected", "points and normals differ in number", context)
        return self


class MeshModel(BoundedModel):
    """The triangles of a file: .obj, .ply, .stl, .gltf or .glb. With a material all are made of it."""

    file: Annotated[FileName, Field(description="a file, from the folder of the scene")]


class GroupModel(BoundedModel):
    """Nodes of any kind, placed together."""

    children: list[AnyNode]


class InstanceModel(NodeModel):
    """A definition, placed once more."""

    of: Annotated[str, Field(description="a name among the scene's definitions")]


BUILT_IN: Mapping[str, type[NodeModel]] = MappingProxyType(
    {
        "sphere": SphereModel,
        "ellipsoid": EllipsoidModel,
        "box": BoxModel,
        "cylinder": CylinderModel,
        "cone": ConeModel,
        "hyperboloid": HyperboloidModel,
        "paraboloid": ParaboloidModel,
        "half_space": HalfSpaceModel,
        "slab": SlabModel,
        "wedge": WedgeModel,
        "quadric": QuadricModel,
        "rounded_box": RoundedBoxModel,
        "tube": TubeModel,
        "union": UnionModel,
        "intersection": IntersectionModel,
        "difference": DifferenceModel,
        "complement": ComplementModel,
        "object": ObjectModel,
        "polygon": PolygonModel,
        "patch": PatchModel,
        "mesh": MeshModel,
        "group": GroupModel,
        "instance": InstanceModel,
    }
)
"""The model under each key that Tasuki itself brings."""

LISTS = ("union", "intersection", "difference", "group")
"""Keys under which the list of children alone may stand, where there is nothing else to say."""

FIELD_TYPES: dict[str, Any] = {"vec3": Point, "f32": Number, "i32": int, "bool": bool}
"""What the types of a record's fields are in a scene file."""

COMMON_FIELDS = ("kind", "attribute", "matrix", "flags")
"""Fields that every primitive's record begins with, which the scene fills in itself."""


def node_models() -> Mapping[str, type[NodeModel]]:
    """The model under every key that a node may have: Tasuki's own, then those of users' solids and surfaces.

    SceneError where the name of a user's kind is taken, or its record has a field that a scene file cannot hold.
    """
    return _node_models(tuple(kind for kind in kinds() if not kind.is_built_in))


@cache
def _node_models(users: tuple[PrimitiveKind, ...]) -> Mapping[str, type[NodeModel]]:
    return MappingProxyType(dict(BUILT_IN) | {kind.name: _users_model(kind) for kind in users})


def _users_model(kind: PrimitiveKind) -> type[NodeModel]:
    if kind.name in BUILT_IN:
        message = f"the primitive kind {kind.name!r} needs another name"
        raise SceneError(str(Diagnostic(message, None, "a name that no node of a scene has", repr(kind.name))))
    fields: dict[str, Any] = {}
    for name, type_ in kind.record.ir.fields:
        if name in COMMON_FIELDS:
            continue
        if str(type_) not in FIELD_TYPES or name in BoundedModel.model_fields:
            taken = ", ".join(BoundedModel.model_fields)
            expected = f"fields of type {', '.join(FIELD_TYPES)}, with other names than {taken}"
            message = f"the primitive kind {kind.name!r} cannot stand in a scene"
            raise SceneError(str(Diagnostic(message, None, expected, f"{name}: {type_}")))
        fields[name] = (FIELD_TYPES[str(type_)], ...)
    # Only what has an inside may have an extent.
    base = BoundedModel if kind.sort == "solid" else NodeModel
    return create_model(kind.name, __base__=base, __doc__=f"A {kind.sort} that a user brought.", **fields)
