"""The scene format as pydantic models: what is validated, and the JSON Schema that is published.

Numbers are strict: text is no number, a truth value is no number, NaN and infinity are none either. Field descriptions
end up in the schema, where editors show them.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

Number = Annotated[float, Field(allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Point = Annotated[list[Number], Field(min_length=3, max_length=3, description="x, y, z")]
Direction = Annotated[list[Number], Field(min_length=3, max_length=3, description="x, y, z, of any length but zero")]
RGB = Annotated[list[NotNegative], Field(min_length=3, max_length=3, description="linear red, green, blue; 1 is full")]
Pixels = Annotated[int, Field(ge=1)]
MaterialName = Annotated[str | None, Field(description="a name among the scene's materials; without one: plain white")]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class CameraModel(_Model):
    """A perspective view. Pixels are square."""

    eye: Point
    at: Point
    up: Direction = [0.0, 0.0, 1.0]
    angle: Annotated[float, Field(gt=0, lt=180, description="field of view over the picture's height, degrees")] = 45.0
    angle_between: Annotated[
        Literal["edges", "centres"],
        Field(description="whether the angle is that between the picture's edges or the centres of its outer pixels"),
    ] = "edges"
    resolution: Annotated[list[Pixels], Field(min_length=2, max_length=2, description="width, height")] = [512, 512]
    hither: Annotated[NotNegative, Field(description="distance of the front clipping plane")] = 0.0


class LightModel(_Model):
    """A point light. Without a colour it is grey: with n lights, sqrt(n) / (2 n)."""

    position: Point
    colour: RGB | None = None


class MaterialModel(_Model):
    """What a surface is made of."""

    colour: RGB = [1.0, 1.0, 1.0]
    ambient: Annotated[
        NotNegative | None, Field(description="share of the colour shown unlit; by default diffuse sqrt(n) / (2 n)")
    ] = None
    diffuse: NotNegative = 1.0
    specular: Annotated[NotNegative, Field(description="weight of Phong's highlight")] = 0.0
    exponent: Annotated[NotNegative, Field(description="exponent of Phong's highlight")] = 1.0
    reflection: Annotated[NotNegative, Field(description="weight of the mirrored ray")] = 0.0
    transmission: Annotated[NotNegative, Field(description="share of the light that enters the surface")] = 0.0
    index: Annotated[Positive, Field(description="refractive index")] = 1.0
    transmittance: Annotated[RGB, Field(description="what a unit of the way inside lets through")] = [1.0, 1.0, 1.0]
    two_sided: Annotated[
        bool | None, Field(description="by default: true of patches and where transmission > 0, false elsewhere")
    ] = None


class SphereModel(_Model):
    """A sphere. A negative radius: only its inside is visible."""

    centre: Point
    radius: Number
    material: MaterialName = None


class CylinderModel(_Model):
    """An open cylinder, without caps. A negative radius: only its inside is visible."""

    base: Point
    apex: Point
    radius: Number
    material: MaterialName = None


class ConeModel(_Model):
    """An open cone, without caps. Negative radii: only its inside is visible."""

    base: Point
    base_radius: Number
    apex: Point
    apex_radius: Number = 0.0
    material: MaterialName = None


class PolygonModel(_Model):
    """A flat polygon, convex or concave, counterclockwise as seen from the front."""

    points: Annotated[list[Point], Field(min_length=3)]
    material: MaterialName = None


class PatchModel(_Model):
    """A polygon with a normal at each point, which shading interpolates."""

    points: Annotated[list[Point], Field(min_length=3)]
    normals: Annotated[list[Point], Field(min_length=3)]
    material: MaterialName = None

    @model_validator(mode="after")
    def _as_many_normals_as_points(self) -> PatchModel:
        points, normals = len(self.points), len(self.normals)
        if normals != points:
            context = {"expected": f"{points} normals, one for each point", "found": f"{normals} normals"}
            raise PydanticCustomError("normals_count", "points and normals differ in number", context)
        return self


class SphereShape(_Model):
    sphere: SphereModel


class CylinderShape(_Model):
    cylinder: CylinderModel


class ConeShape(_Model):
    cone: ConeModel


class PolygonShape(_Model):
    polygon: PolygonModel


class PatchShape(_Model):
    patch: PatchModel


SHAPE_MODELS: dict[str, type[_Model]] = {
    "sphere": SphereModel,
    "cylinder": CylinderModel,
    "cone": ConeModel,
    "polygon": PolygonModel,
    "patch": PatchModel,
}


def _shape_key(shape: Any) -> str | None:
    """The one key of a shape, which says what it is."""
    if isinstance(shape, dict) and len(shape) == 1:
        return next(iter(shape))
    return None


ShapeModel = Annotated[
    Annotated[SphereShape, Tag("sphere")]
    | Annotated[CylinderShape, Tag("cylinder")]
    | Annotated[ConeShape, Tag("cone")]
    | Annotated[PolygonShape, Tag("polygon")]
    | Annotated[PatchShape, Tag("patch")],
    Discriminator(_shape_key),
]


class SceneModel(_Model):
    """A scene for Tasuki. Coordinates are right-handed, colours linear, angles in degrees."""

    model_config = ConfigDict(extra="forbid", strict=True, title="Tasuki scene")

    version: Annotated[Literal[1], Field(description="version of this format")] = 1
    camera: CameraModel
    background: RGB = [0.0, 0.0, 0.0]
    lights: list[LightModel] = []
    materials: Annotated[dict[str, MaterialModel], Field(description="materials by name")] = {}
    shapes: Annotated[list[ShapeModel], Field(description="each with one key, which says what it is")] = []


def scene_schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of the scene format."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **SceneModel.model_json_schema()}
