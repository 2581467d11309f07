"""What is in a scene, counted: the content of `tasuki info`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from tasuki.renderers.prepared import PreparedScene
from tasuki.scene.model import Scene, default_intensity
from tasuki.scene.shapes import CONE, POLYGON, SPHERE


def info(scene: Scene) -> dict[str, Any]:
    """Counts, bounds, lights, materials and warnings of `scene`, as plain data that JSON can hold.

    "shapes" counts what the scene file holds (a polygon is one), "primitives" what machines intersect (its triangles),
    by kind. "bounds" are the corners of the box around all shapes that have bounds, None where there are none. Each
    material has the number of its "shapes", each light the colour that it shines with. SceneError where the scene
    cannot be packed.
    """
    prepared = PreparedScene(scene)
    scene = prepared.packed.scene
    bounds = prepared.bounds()
    return {
        "camera": asdict(scene.camera),
        "background": list(scene.background),
        "shapes": _shape_counts(scene),
        "primitives": dict(prepared.packed.counts),
        "bounds": {"low": bounds[0].tolist(), "high": bounds[1].tolist()} if bounds else None,
        "lights": _lights(scene),
        "materials": _materials(scene),
        "warnings": list(scene.warnings),
    }


def _shape_counts(scene: Scene) -> dict[str, int]:
    shapes = scene.shapes
    cylinders = int((shapes.cones.base_radius == shapes.cones.apex_radius).sum())
    patches = int(shapes.polygons.smooth.sum())
    counts = {
        "sphere": len(shapes.spheres),
        "cylinder": cylinders,
        "cone": len(shapes.cones) - cylinders,
        "polygon": len(shapes.polygons) - patches,
        "patch": patches,
    }
    return {"total": len(shapes), **{name: count for name, count in counts.items() if count}}


def _lights(scene: Scene) -> list[dict[str, Any]]:
    grey = (default_intensity(len(scene.lights)),) * 3
    return [{"position": list(light.position), "colour": list(light.colour or grey)} for light in scene.lights]


def _materials(scene: Scene) -> list[dict[str, Any]]:
    used = np.zeros(len(scene.materials), np.int64)
    for sort in (SPHERE, CONE, POLYGON):
        used += np.bincount(scene.shapes.batch(sort).material, minlength=len(used))
    return [
        {**asdict(material), "shapes": count} for material, count in zip(scene.materials, used.tolist(), strict=True)
    ]
