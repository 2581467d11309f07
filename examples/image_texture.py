"""A texture from a picture: `tasuki render examples/image_texture.yaml --with examples/image_texture.py`."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from PIL import Image

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.language import Table, f32, floor, i32, module, record, vec3
from tasuki.scene.textures import FILE, TextureKind, register


@record
class Picture:
    """A picture, `width` x `height` in local units, whose rows begin at `texels`; again and again along x and y."""

    width: f32
    height: f32
    columns: i32
    rows: i32
    texels: i32


@record
class Texel:
    """One pixel of a picture, in linear light."""

    colour: vec3


pictures = Table(Picture)
texels = Table(Texel)


@module
def texel(picture: Picture, column: i32, row: i32) -> vec3:
    """The pixel at any column and row of the repeated picture."""
    return texels[picture.texels + row % picture.rows * picture.columns + column % picture.columns].colour


@module
def painted(picture: Picture, colour: vec3, point: vec3, normal: vec3) -> vec3:
    """The material's colour times that of the picture, which is seen from above: along the local z axis.

    Blended from the four nearest pixels.
    """
    x = point.x / picture.width * f32(picture.columns) - 0.5
    y = (1.0 - point.y / picture.height) * f32(picture.rows) - 0.5
    column, row = i32(floor(x)), i32(floor(y))
    u, v = x - floor(x), y - floor(y)
    upper = (1.0 - u) * texel(picture, column, row) + u * texel(picture, column + 1, row)
    lower = (1.0 - u) * texel(picture, column, row + 1) + u * texel(picture, column + 1, row + 1)
    return colour * ((1.0 - v) * upper + v * lower)


def load(values: Mapping[str, Any]) -> tuple[Mapping[str, Any], Mapping[str, np.ndarray]]:
    """The record of a picture in a file, and its pixels. SceneError where Pillow cannot read it."""
    try:
        with Image.open(values["file"]) as image:
            pixels = np.asarray(image.convert("RGB"), np.float64) / 255.0
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        message = f"the texture's file {values['file']!r} is no picture"
        raise SceneError(str(Diagnostic(message, None, "a picture that Pillow reads", str(error)))) from None
    linear = np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4)  # IEC 61966-2-1
    rows, columns = pixels.shape[:2]
    records = np.zeros(rows * columns, Texel.numpy_dtype())
    records["colour"] = linear.reshape(-1, 3)
    size = {"width": values["width"], "height": values["width"] * rows / columns}
    return {**size, "columns": columns, "rows": rows}, {"texels": records}


register(TextureKind("image", pictures, painted, {"file": FILE, "width": "f32"}, {"width": 1.0}, load))
