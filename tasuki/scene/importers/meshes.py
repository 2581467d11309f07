"""Triangle meshes from .obj, .ply, .stl, .gltf and .glb, read by trimesh (package extra "meshes").

Coordinates and units stay those of the file (glTF says metres; the other formats say nothing). A file alone makes a
scene: a camera that frames it, the file's upward axis up (z for STL, y for the others), and one light.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tasuki.diagnostics import Diagnostic, SceneError
from tasuki.scene.material import Colour, Material
from tasuki.scene.mesh import Mesh
from tasuki.scene.model import Camera, PointLight, Scene
from tasuki.scene.shapes import POLYGON, Polygons, Shapes

ANGLE = 30.0
"""Degrees that the picture of a mesh alone is high."""
MARGIN = 1.05
"""How much larger than the sphere around the mesh the picture is."""
BACKGROUND = (0.1, 0.1, 0.12)
AMBIENT = 0.15
"""Share of a material's colour that shows without light. No file's own is taken: few mean what we do by it."""
PLAIN = Material("mesh", (0.8, 0.8, 0.8), AMBIENT, two_sided=True)
"""For files without materials."""
UPWARD = {".stl": 2}
"""The axis that points up, where that is not y."""
LEAST_EXPONENT, MOST_EXPONENT = 1.0, 1000.0
STL_HEADER, STL_TRIANGLE = 84, 50
"""Bytes of a binary STL file."""


class MeshError(SceneError):
    """What is wrong with the file of a mesh, in the parts of its message, for a scene that names the file."""

    def __init__(
        self, message: str, expected: str | None = None, found: str | None = None, hint: str | None = None
    ) -> None:
        self.message, self.expected, self.found, self.hint = message, expected, found, hint
        super().__init__(str(Diagnostic(message, None, expected, found, hint)))


def read(path: Path) -> Scene:
    """The mesh in the file at `path` as a scene. MeshError with what is wrong with the file."""
    shapes, warnings = read_mesh(path)
    points = shapes.polygons.points
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high) / 2.0
    radius = float(np.linalg.norm(points - middle, axis=1).max())
    up = np.roll((0.0, 1.0, 0.0), UPWARD.get(path.suffix.lower(), 1) - 1)
    towards = np.cross(up, (0.0, 0.0, 1.0) if up[1] else (1.0, 0.0, 0.0))
    front = np.cross(towards, up)
    distance = MARGIN * radius / np.sin(np.radians(ANGLE / 2.0))
    eye = middle + distance * _unit(front + 0.5 * towards + 0.4 * up)
    lamp = middle + distance * _unit(front - 0.6 * towards + 1.2 * up)
    camera = Camera(_tuple(eye), _tuple(middle), _tuple(up), ANGLE)
    return Scene(camera, shapes, [PointLight(_tuple(lamp), (1.0, 1.0, 1.0))], BACKGROUND, warnings)


def load_mesh(path: str | Path, *, material: Material | None = None) -> Mesh:
    """The mesh in the file at `path` as a node, all of one `material` or, without one, of those of the file.

    What was left out goes untold: `read_mesh` tells it. MeshError with what is wrong with the file.
    """
    return Mesh(str(path), read_mesh(path)[0], material=material)


def read_mesh(path: str | Path) -> tuple[Shapes, list[str]]:
    """The triangles in a file, in its coordinates, with its materials; and warnings of what was left out.

    Faces with normals at their corners are patches, others flat. Surfaces show from both sides, unless glTF says
    otherwise. MeshError, naming the file, where it cannot be read, or holds no triangles, coordinates that are not
    finite, or indices of vertices that do not exist.
    """
    path = Path(path)
    warnings: list[str] = []
    materials: list[Material] = []
    parts = []
    for mesh, matrix in _meshes(path, _loaded(path), warnings):
        parts.append(_polygons(path, mesh, matrix, len(materials)))
        materials.append(_material(mesh.visual, path, warnings))
    if not sum(len(part) for part in parts):
        raise _error(path, "holds no triangles", "a mesh", "none")
    polygons = _joined(parts)
    nothing = Shapes.of([])
    sorts = np.full(len(polygons), POLYGON, np.uint8)
    shapes = Shapes(materials, sorts, nothing.spheres, nothing.cones, polygons, str(path))
    return shapes, warnings


def _loaded(path: Path) -> Any:
    """The file as trimesh has it."""
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            start = file.read(STL_HEADER)
    except FileNotFoundError:
        raise MeshError(f"there is no file {str(path)!r}") from None
    except OSError as error:
        raise MeshError(f"cannot read {str(path)!r}: {error.strerror}") from None
    if not size:
        raise _error(path, "is empty", "a mesh", "0 bytes")
    if path.suffix.lower() == ".stl":
        _check_length(path, start, size)
    try:
        import trimesh
    except ImportError:
        hint = "pip install 'tasuki[meshes]'"
        raise MeshError("meshes are read by the package trimesh, which is absent", hint=hint) from None
    try:
        return trimesh.load_scene(path, process=False)
    except Exception as error:
        # trimesh promises nothing of what it raises for a file that is wrong.
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise _error(path, f"cannot be read as {path.suffix[1:].upper()}", "a whole file", reason) from None


def _check_length(path: Path, start: bytes, size: int) -> None:
    """MeshError where a binary STL file is longer or shorter than it says."""
    if start.lstrip().startswith(b"solid"):
        return
    announced = int.from_bytes(start[-4:], "little") if len(start) == STL_HEADER else 0
    if size != STL_HEADER + STL_TRIANGLE * announced:
        expected = f"{STL_HEADER + STL_TRIANGLE * announced:,} bytes, of {announced:,} triangles"
        raise _error(path, "is cut off, or no STL", expected, f"{size:,} bytes")


def _meshes(path: Path, scene: Any, warnings: list[str]) -> Iterator[tuple[Any, np.ndarray]]:
    """Every mesh of a loaded file, as often as it stands in it, and the matrix that places it."""
    import trimesh

    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        geometry = scene.geometry[name]
        if isinstance(geometry, trimesh.Trimesh):
            yield geometry, matrix
        else:
            warnings.append(f"{path}: warning: {name!r} is no mesh but a {type(geometry).__name__}: left out")


def _polygons(path: Path, mesh: Any, matrix: np.ndarray, material: int) -> Polygons:
    """The triangles of one mesh, placed."""
    vertices = np.asarray(mesh.vertices, np.float64).reshape(-1, 3)
    faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
    wrong = faces[(faces < 0) | (faces >= len(vertices))]
    if len(wrong):
        expected = f"indices of its {len(vertices):,} vertices, counted from 0"
        raise _error(path, "has a face whose vertex does not exist", expected, str(wrong[0]))
    points = vertices @ matrix[:3, :3].T + matrix[:3, 3]
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        found = f"vertex {bad[0]}: {', '.join(f'{x:g}' for x in vertices[bad[0]])}"
        raise _error(path, "has coordinates that are not finite", "finite numbers", found)
    if np.linalg.det(matrix[:3, :3]) < 0.0:
        faces = faces[:, ::-1]
    count = len(faces)
    corners = faces.reshape(-1)
    normals = _normals(mesh, matrix)
    around = np.zeros((3 * count, 3)) if normals is None else normals[corners]
    smooth = np.full(count, normals is not None)
    numbers = np.full(count, material, np.int32)
    lines = np.zeros(count, np.int64)
    return Polygons(numbers, lines, points[corners], around, 3 * np.arange(count + 1), smooth)


def _normals(mesh: Any, matrix: np.ndarray) -> np.ndarray | None:
    """The normals at the vertices, placed, (v, 3); None where the file gives none, or one that is not finite."""
    # What trimesh has not read from the file it would compute.
    if "vertex_normals" not in mesh._cache.cache:
        return None
    normals = np.asarray(mesh.vertex_normals, np.float64) @ np.linalg.inv(matrix[:3, :3])
    return normals if np.isfinite(normals).all() else None


def _material(visual: Any, path: Path, warnings: list[str]) -> Material:
    """A material of a file as one of ours. Pictures and colours of vertices are left out, with a warning."""
    found = getattr(visual, "material", None)
    if visual.kind in ("vertex", "face"):
        warnings.append(f"{path}: warning: colours of vertices and faces are left out")
    if found is None:
        return PLAIN
    if any(getattr(found, name, None) is not None for name in ("image", "baseColorTexture")):
        warnings.append(f"{path}: warning: the picture of material {found.name!r} is left out")
    if hasattr(found, "baseColorFactor"):
        return _physical(found)
    return _classical(found)


def _physical(found: Any) -> Material:
    """glTF's metallic-roughness material: Phong's highlight as wide as its roughness, in Karis's approximation.

    B. Karis, "Specular BRDF Reference", 2013: exponent 2 / roughness**4 - 2.
    """
    metallic = 1.0 if found.metallicFactor is None else float(found.metallicFactor)
    roughness = 1.0 if found.roughnessFactor is None else float(found.roughnessFactor)
    exponent = 2.0 / max(roughness, 0.1) ** 4 - 2.0
    return Material(
        found.name or "mesh",
        (1.0, 1.0, 1.0) if found.baseColorFactor is None else _colour(found.baseColorFactor),
        AMBIENT,
        # Half of a metal's light is left to the diffuse part: there is no room around to be mirrored.
        diffuse=1.0 - 0.5 * metallic,
        specular=0.04 + 0.46 * metallic,
        exponent=float(np.clip(exponent, LEAST_EXPONENT, MOST_EXPONENT)),
        two_sided=bool(found.doubleSided),
    )


def _classical(found: Any) -> Material:
    """Wavefront's Kd, Ks and Ns; Ks, which has a colour there, by its mean."""
    shiny = float(found.glossiness)
    return Material(
        found.name or "mesh",
        _colour(found.diffuse),
        AMBIENT,
        specular=float(np.mean(_colour(found.specular))) if shiny > LEAST_EXPONENT else 0.0,
        exponent=float(np.clip(shiny, LEAST_EXPONENT, MOST_EXPONENT)),
        two_sided=True,
    )


def _colour(bytes_: Any) -> Colour:
    """Linear red, green, blue from trimesh's bytes."""
    return _tuple(np.asarray(bytes_, np.float64)[:3] / 255.0)


def _joined(parts: list[Polygons]) -> Polygons:
    """All triangles of the parts, in order."""
    count = sum(len(part) for part in parts)
    return Polygons(
        np.concatenate([part.material for part in parts]),
        np.zeros(count, np.int64),
        np.concatenate([part.points for part in parts]),
        np.concatenate([part.normals for part in parts]),
        3 * np.arange(count + 1),
        np.concatenate([part.smooth for part in parts]),
    )


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


def _tuple(vector: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in vector)
    return x, y, z


def _error(path: Path, message: str, expected: str, found: str) -> MeshError:
    return MeshError(f"{str(path)!r} {message}", expected, found)
