"""What the models of the scene format have in common: numbers, vectors, transformations, extents.

Numbers are strict: text is no number, a truth value is no number, NaN and infinity are none either. Field descriptions
end up in the schema, where editors show them. Where alternatives share one place, their tags begin with TAG, so that
error messages can leave them out of the path.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    WithJsonSchema,
    WrapValidator,
    model_validator,
)
from pydantic_core import PydanticCustomError

TAG = "\0"
"""Begins what no key of a file begins with."""

Number = Annotated[float, Field(allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Point = Annotated[list[Number], Field(min_length=3, max_length=3, description="x, y, z")]
Direction = Annotated[list[Number], Field(min_length=3, max_length=3, description="x, y, z, of any length but zero")]
Radii = Annotated[list[Positive], Field(min_length=3, max_length=3, description="along x, y, z")]
RGB = Annotated[list[NotNegative], Field(min_length=3, max_length=3, description="linear red, green, blue; 1 is full")]
MaterialName = Annotated[
    str | None, Field(description="a name among the scene's materials; without one: that of what it is part of")
]
Rows = Annotated[list[Annotated[list[Number], Field(min_length=3, max_length=4)]], Field(min_length=3, max_length=4)]

AXES = {"x": [1.0, 0.0, 0.0], "y": [0.0, 1.0, 0.0], "z": [0.0, 0.0, 1.0]}


class Model(BaseModel):
    """A mapping that has no keys but its fields."""

    model_config = ConfigDict(extra="forbid", strict=True)


def _axis(value: Any, validate: Any) -> Any:
    if isinstance(value, str):
        if value not in AXES:
            raise PydanticCustomError("expected", "no such axis", {"expected": "x, y, z, or three numbers"})
        return AXES[value]
    return validate(value)


def _factors(value: Any, validate: Any) -> Any:
    """One factor for all axes, or one for each."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return validate([value] * 3)[0]
    if not isinstance(value, list):
        raise PydanticCustomError("expected", "this is no scale", {"expected": "a number, or three"})
    return validate(value)


def _three(kind: dict[str, Any]) -> dict[str, Any]:
    return {"oneOf": [kind, {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}]}


def _file_name(value: str) -> str:
    if not value or "\0" in value:
        raise PydanticCustomError("expected", "this is no name of a file", {"expected": "the name of a file"})
    return value


FileName = Annotated[str, AfterValidator(_file_name)]


class RotateModel(Model):
    """A right-handed rotation about an axis through the origin."""

    axis: Annotated[Direction, WrapValidator(_axis), WithJsonSchema(_three({"enum": list(AXES)}))]
    angle: Annotated[Number, Field(description="degrees")]


class TranslateStep(Model):
    """Move by x, y, z."""

    translate: Point


class RotateStep(Model):
    """Turn about an axis through the origin."""

    rotate: RotateModel


class ScaleStep(Model):
    """Scale by a factor, or by one along each axis."""

    scale: Annotated[Direction, WrapValidator(_factors), WithJsonSchema(_three({"type": "number"}))]


class MatrixStep(Model):
    """Any affine map of column vectors: three rows of three or four numbers; a fourth row is 0 0 0 1."""

    matrix: Rows

    @model_validator(mode="after")
    def _is_affine(self) -> MatrixStep:
        width, height = len(self.matrix[0]), len(self.matrix)
        if any(len(row) != width for row in self.matrix) or (height, width) not in ((3, 3), (3, 4), (4, 4)):
            context = {"expected": "rows of 3 x 3, 3 x 4 or 4 x 4 numbers", "found": f"{height} rows"}
            raise PydanticCustomError("expected", "this matrix has the wrong shape", context)
        if height == 4 and self.matrix[3] != [0.0, 0.0, 0.0, 1.0]:
            context = {"expected": "0 0 0 1 as the last row", "found": " ".join(f"{x:g}" for x in self.matrix[3])}
            raise PydanticCustomError("expected", "this matrix is not affine", context)
        return self


STEPS: dict[str, type[Model]] = {
    "translate": TranslateStep,
    "rotate": RotateStep,
    "scale": ScaleStep,
    "matrix": MatrixStep,
}


def _step(value: Any) -> str | None:
    if isinstance(value, dict) and len(value) == 1 and next(iter(value)) in STEPS:
        return TAG + next(iter(value))
    return None


Step = Annotated[
    Annotated[TranslateStep, Tag(TAG + "translate")]
    | Annotated[RotateStep, Tag(TAG + "rotate")]
    | Annotated[ScaleStep, Tag(TAG + "scale")]
    | Annotated[MatrixStep, Tag(TAG + "matrix")],
    Discriminator(
        _step,
        custom_error_type="expected",
        custom_error_message="no such step of a transformation",
        custom_error_context={"expected": f"one key, one of {', '.join(STEPS)}"},
    ),
]
Transformation = Annotated[list[Step], Field(description="steps, applied in this order; without any: none")]


class ExtentModel(Model):
    """A sphere, in the node's own coordinates, that contains the node."""

    centre: Point
    radius: Positive


def _extent(value: Any) -> str | None:
    if isinstance(value, dict):
        return TAG + "sphere"
    return TAG + str(value) if value in ("auto", None) else None


Extent = Annotated[
    Annotated[ExtentModel, Tag(TAG + "sphere")]
    | Annotated[Literal["auto"], Tag(TAG + "auto")]
    | Annotated[None, Tag(TAG + "None")],
    Field(description="a sphere around it, or `auto`: computed"),
    Discriminator(
        _extent,
        custom_error_type="expected",
        custom_error_message="no such extent",
        custom_error_context={"expected": "`auto`, or a mapping with centre and radius"},
    ),
]
