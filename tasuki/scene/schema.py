"""The scene format as pydantic models: what is validated, and the JSON Schema that is published.

`schema_fields` has what the models share, `schema_nodes` the nodes of the tree.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, ConfigDict, Discriminator, Field, Tag, WithJsonSchema
from pydantic.json_schema import models_json_schema
from pydantic_core import PydanticCustomError

from tasuki.scene.schema_fields import (
    RGB,
    TAG,
    Direction,
    ExtentModel,
    Model,
    NotNegative,
    Point,
    Positive,
    RotateModel,
)
from tasuki.scene.schema_nodes import LISTS, NODE_MARK, AnyNode, BoundedModel, node_models
from tasuki.scene.textures import TextureKind, textures

Pixels = Annotated[int, Field(ge=1)]

TEXTURE_MARK = {"x-texture": True}
"""Stands in the schema for "any texture" until it is published; `tasuki.scene.textures` checks textures."""


class CameraModel(Model):
    """A perspective view. Pixels are square."""

    eye: Point
    at: Point
    up: Direction = Field([0.0, 0.0, 1.0])
    angle: Annotated[float, Field(gt=0, lt=180, description="field of view over the picture's height, degrees")] = 45.0
    angle_between: Annotated[
        Literal["edges", "centres"],
        Field(description="whether the angle is that between the picture's edges or the centres of its outer pixels"),
    ] = "edges"
    resolution: Annotated[list[Pixels], Field(min_length=2, max_length=2, description="width, height")] = Field(
        [512, 512]
    )
    hither: Annotated[NotNegative, Field(description="distance of the front clipping plane")] = 0.0


class PointLightModel(Model):
    """A point light. Without a colour it is grey: with n lights, sqrt(n) / (2 n)."""

    position: Point
    colour: RGB | None = None


class DirectionalLightModel(Model):
    """A light from far away. Without a colour it is grey: with n lights, sqrt(n) / (2 n)."""

    direction: Annotated[Direction, Field(description="in which the light travels, of any length but zero")]
    colour: RGB | None = None


LightModel = Annotated[
    Annotated[PointLightModel, Tag(TAG + "point")] | Annotated[DirectionalLightModel, Tag(TAG + "directional")],
    Discriminator(lambda light: TAG + ("directional" if isinstance(light, dict) and "direction" in light else "point")),
]


def _parameter(value: Any) -> Any:
    """What a parameter of a texture may be at all; `tasuki.scene.textures` knows what each must be."""
    parts = value if isinstance(value, list) else [value]
    if any(isinstance(part, dict | list) for part in parts):
        expected = "a number, a word, true or false, or a list of numbers"
        raise PydanticCustomError("expected", "no such parameter of a texture", {"expected": expected})
    return value


Parameters = dict[str, Annotated[Any, AfterValidator(_parameter)]]


class MaterialModel(Model):
    """What a surface is made of."""

    colour: RGB = Field([1.0, 1.0, 1.0])
    ambient: Annotated[
        NotNegative | None, Field(description="share of the colour shown unlit; by default diffuse sqrt(n) / (2 n)")
    ] = None
    diffuse: NotNegative = 1.0
    specular: Annotated[NotNegative, Field(description="weight of Phong's highlight")] = 0.0
    exponent: Annotated[NotNegative, Field(description="exponent of Phong's highlight")] = 1.0
    reflection: Annotated[NotNegative, Field(description="weight of the mirrored ray")] = 0.0
    transmission: Annotated[NotNegative, Field(description="share of the light that enters the surface")] = 0.0
    index: Annotated[Positive, Field(description="refractive index")] = 1.0
    transmittance: Annotated[RGB, Field(description="what a unit of the way inside lets through")] = Field(
        [1.0, 1.0, 1.0]
    )
    two_sided: Annotated[
        bool | None, Field(description="by default: true of patches and where transmission > 0, false elsewhere")
    ] = None
    texture: Annotated[
        dict[str, Parameters] | None, Field(min_length=1, max_length=1), WithJsonSchema(TEXTURE_MARK)
    ] = None


class SceneModel(Model):
    """A scene for Tasuki. Coordinates are right-handed, colours linear, angles in degrees."""

    model_config = ConfigDict(extra="forbid", strict=True, title="Tasuki scene")

    version: Annotated[Literal[1], Field(description="version of this format")] = 1
    camera: CameraModel
    background: RGB = Field([0.0, 0.0, 0.0])
    lights: list[LightModel] = Field([])
    materials: Annotated[dict[str, MaterialModel], Field(description="materials by name")] = Field({})
    definitions: Annotated[dict[str, AnyNode], Field(description="nodes by name, of which instances are made")] = Field(
        {}
    )
    shapes: Annotated[list[AnyNode], Field(description="nodes, each with one key, which says what it is")] = Field([])


def scene_schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of the scene format, with the kinds and the textures that users registered."""
    bodies = node_models()
    modes: Any = [(model, "validation") for model in (SceneModel, *bodies.values())]
    references, definitions = models_json_schema(modes)
    nodes = []
    for key, model in bodies.items():
        body = references[model, "validation"]
        if key in LISTS:
            body = {"oneOf": [body, {"type": "array", "items": NODE_MARK}]}
        nodes.append(_one_key(key, body))
    known: list[Any] = [_one_key(kind.name, _texture(kind)) for kind in textures()]
    defs = definitions["$defs"] | {
        "Node": {"description": "has one key, which says what it is", "oneOf": nodes},
        "Texture": {"description": "has one key, the kind of texture", "oneOf": known or [False]},
    }
    scene = defs.pop(SceneModel.__name__)
    whole = {"$schema": "https://json-schema.org/draft/2020-12/schema", **scene, "$defs": defs}
    published: dict[str, Any] = _without_marks(whole)
    return published


def known_keys(model: type[Model], path: Iterable[str | int]) -> list[str]:
    """The keys of the mapping at `path` of a `model`, a node's own first; a path as pydantic gives it, with tags."""
    steps = iter(path)
    for step in steps:
        model = _INNER.get(step, model)
        if step == "materials":
            next(steps, None)  # a name, which may be any word
    return sorted(model.model_fields, key=BoundedModel.model_fields.__contains__)


_INNER: dict[str | int, type[Model]] = {
    "camera": CameraModel,
    "materials": MaterialModel,
    TAG + "point": PointLightModel,
    TAG + "directional": DirectionalLightModel,
    TAG + "sphere": ExtentModel,
    "rotate": RotateModel,
}
"""Mappings within the models of the scene and of nodes, by the step that leads to them."""


def _one_key(key: str, body: dict[str, Any]) -> dict[str, Any]:
    """The schema of a mapping that has this one key."""
    return {"type": "object", "properties": {key: body}, "required": [key], "additionalProperties": False}


_PARAMETERS: dict[str, dict[str, Any]] = {
    "f32": {"type": "number"},
    "i32": {"type": "integer"},
    "bool": {"type": "boolean"},
    "vec3": {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3},
    "vec4": {"type": "array", "items": {"type": "number"}, "minItems": 4, "maxItems": 4},
    "file": {"type": "string", "description": "a file, from the folder of the scene"},
}


def _texture(kind: TextureKind) -> dict[str, Any]:
    """The schema of the parameters of a kind of texture."""
    properties = {name: _PARAMETERS[type_] for name, type_ in kind.takes.items()}
    required = [name for name in kind.takes if name not in kind.defaults]
    return {"type": "object", "properties": properties, "required": required, "additionalProperties": False}


def _without_marks(schema: Any) -> Any:
    """`schema` with a reference wherever a node or a texture is marked."""
    if isinstance(schema, list):
        return [_without_marks(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    for mark, name in ((NODE_MARK, "Node"), (TEXTURE_MARK, "Texture")):
        if mark.items() <= schema.items():
            return {"$ref": f"#/$defs/{name}"} | {key: part for key, part in schema.items() if key not in mark}
    return {key: _without_marks(part) for key, part in schema.items()}
