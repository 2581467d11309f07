"""Scenes as files of other formats: our own YAML, and meshes through trimesh (extra "meshes").

A mesh holds triangles of all that is bounded, and their colours; of cameras, lights and glass it knows nothing.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.scene.material import Material
from tasuki.scene.model import Scene
from tasuki.scene.tessellate import TOLERANCE, tessellated
from tasuki.scene.triangulate import triangulate

if TYPE_CHECKING:
    import trimesh

MESHES = (".glb", ".stl", ".obj")
FORMATS = (".yaml", *MESHES)
"""Suffixes of the formats that scenes are written in."""


def exported(scene: Scene, path: Path, tolerance: float = TOLERANCE) -> bytes:
    """The content of a file at `path`, whose suffix, one of FORMATS, tells the format, that holds `scene`.

    `tolerance` is that of curved surfaces in meshes, as a share of the scene's size. SceneError where the scene cannot
    be made of triangles, or has none.
    """
    suffix = path.suffix.lower()
    if suffix == ".yaml":
        from tasuki.scene.yaml_format import dump_yaml

        return dump_yaml(scene).encode()
    found = _mesh_scene(tessellated(scene, tolerance)).export(file_type=suffix[1:])
    return found.encode() if isinstance(found, str) else bytes(found)


def _mesh_scene(scene: Scene) -> trimesh.Scene:
    """A mesh for each material in use."""
    try:
        import trimesh
    except ImportError:
        message, hint = "meshes are written by the package trimesh, which is absent", "pip install 'tasuki[meshes]'"
        raise SceneError(str(Diagnostic(message, hint=hint))) from None
    polygons = scene.shapes.polygons
    if not len(polygons):
        raise SceneError(str(Diagnostic("the scene has no triangles", expected="something bounded", found="nothing")))
    corners, owner = triangulate(polygons)
    material = polygons.material[owner]
    made = trimesh.Scene()
    for number in np.unique(material):
        mine, name = corners[material == number].reshape(-1), scene.materials[number].name
        points, normals = polygons.points[mine], polygons.normals[mine]
        mesh: Any = trimesh.Trimesh(
            points,
            np.arange(len(mine)).reshape(-1, 3),
            vertex_normals=normals if polygons.smooth[owner[material == number]].all() else None,
            process=False,
        )
        mesh.merge_vertices(merge_norm=False)
        mesh.visual = trimesh.visual.TextureVisuals(material=_look(scene.materials[number], int(number)))
        made.add_geometry(mesh, geom_name=f"{name} {number}")
    return made


def _look(material: Material, number: int) -> Any:
    from trimesh.visual.material import PBRMaterial

    alpha = 1.0 - 0.8 * min(material.transmission, 1.0)
    colour = [*(min(part * max(material.diffuse, 0.1), 1.0) for part in material.colour), alpha]
    return PBRMaterial(
        name=f"{material.name} {number}",
        baseColorFactor=np.round(np.array(colour) * 255.0).astype(np.uint8),
        metallicFactor=min(material.reflection, 1.0),
        roughnessFactor=float(np.clip(1.0 / np.sqrt(max(material.exponent, 1.0)), 0.0, 1.0)),
        alphaMode="BLEND" if material.transmission > 0.0 else "OPAQUE",
        doubleSided=bool(material.shows_both_sides(smooth=True)),
    )
