"""What is in a scene, counted: the content of `tasuki info`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from tasuki.renderers.prepared import PreparedScene
from tasuki.scene.flatten import Flat
from tasuki.scene.model import Scene, default_intensity
from tasuki.scene.shapes import CONE, POLYGON, SPHERE


def info(scene: Scene) -> dict[str, Any]:
    """Counts, bounds, lights, materials and warnings of `scene`, as plain data that JSON can hold.

    "shapes" counts what stands in the scene without its tree (a polygon is one, and so is an object: a formula of set
    operations, or a polygon in a face of one), "primitives" what machines intersect (its triangles), by kind.
    "formulas" says of how many literals the objects are made, on how many different surfaces, and how many surfaces
    were merged since they coincide. "bounds" are the corners of the box around all that has bounds, None where there is
    nothing. Each material has the number of its "shapes", each light the colour that it shines with. SceneError where
    the scene cannot be packed.
    """
    prepared = PreparedScene(scene)
    packed = prepared.packed
    bounds = prepared.bounds()
    return {
        "camera": asdict(scene.camera),
        "background": list(scene.background),
        "shapes": _shape_counts(packed.flat),
        "primitives": {**packed.counts, **({"object": packed.objects.count} if packed.objects.count else {})},
        "formulas": {
            "literals": packed.objects.literals,
            "surfaces": packed.objects.literals - packed.objects.merged,
            "merged": packed.objects.merged,
        },
        "bounds": {"low": bounds[0].tolist(), "high": bounds[1].tolist()} if bounds else None,
        "lights": _lights(scene),
        "materials": _materials(packed.flat),
        "warnings": list(packed.scene.warnings),
    }


def _shape_counts(flat: Flat) -> dict[str, int]:
    shapes = flat.shapes
    cylinders = int((shapes.cones.base_radius == shapes.cones.apex_radius).sum())
    patches = int(shapes.polygons.smooth.sum())
    counts = {
        "sphere": len(shapes.spheres),
        "cylinder": cylinders,
        "cone": len(shapes.cones) - cylinders,
        "polygon": len(shapes.polygons) - patches,
        "patch": patches,
        "object": len(flat.objects),
    }
    return {"total": len(flat), **{name: count for name, count in counts.items() if count}}


def _lights(scene: Scene) -> list[dict[str, Any]]:
    grey = (default_intensity(len(scene.lights)),) * 3
    return [{**asdict(light), "colour": list(light.colour or grey)} for light in scene.lights]


def _materials(flat: Flat) -> list[dict[str, Any]]:
    used = np.zeros(len(flat.materials), np.int64)
    for sort in (SPHERE, CONE, POLYGON):
        used += np.bincount(flat.shapes.batch(sort).material, minlength=len(used))
    used += np.bincount(flat.objects.material, minlength=len(used))
    together = zip(flat.materials, used.tolist(), strict=True)
    return [{**asdict(material), "shapes": count} for material, count in together]
