"""Meshes from files: what is read, how a mesh alone is looked at, and what is told about files that are wrong."""

from __future__ import annotations

import base64
import contextlib
import json
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasuki import render
from tasuki.diagnostics import SceneError
from tasuki.scene import load_scene
from tasuki.scene.importers.meshes import read_mesh

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
PLY = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 {last}\n"
)
MTL = "newmtl brass\nKd 0.8 0.6 0.2\nKs 0.4 0.4 0.4\nNs 30\nnewmtl slate\nKd 0.2 0.2 0.4\n"


def stl(triangles: np.ndarray, announced: int | None = None) -> bytes:
    """A binary STL file."""
    count = len(triangles) if announced is None else announced
    rows = b"".join(struct.pack("<12fH", 0.0, 0.0, 1.0, *corners.reshape(-1), 0) for corners in triangles)
    return b"\0" * 80 + struct.pack("<I", count) + rows


def gltf(indices: list[int], **more) -> str:
    """One triangle with normals, in metres, placed by a matrix of its node that mirrors it."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    normals = np.array([[0, 0, 1]] * 3, "<f4").tobytes()
    data = points + normals + np.array(indices, "<u4").tobytes()
    views = [{"buffer": 0, "byteOffset": at, "byteLength": size} for at, size in ((0, 36), (36, 36), (72, 12))]
    vectors = {"componentType": 5126, "type": "VEC3", "count": 3}
    content = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}],
        "bufferViews": views,
        "accessors": [
            {"bufferView": 0, **vectors, "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, **vectors},
            {"bufferView": 2, "componentType": 5125, "type": "SCALAR", "count": 3},
        ],
        "materials": [
            {
                "name": "gold",
                "doubleSided": True,
                "pbrMetallicRoughness": {
                    "baseColorFactor": [1.0, 0.6, 0.2, 1.0],
                    "metallicFactor": 1.0,
                    "roughnessFactor": 0.5,
                },
            }
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2, "material": 0}]}],
        "nodes": [{"mesh": 0, "matrix": [-2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 5, 0, 0, 1]}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    return json.dumps(content | more)


@pytest.fixture
def file(tmp_path):
    """`file(name, content)` writes a file, and gives its path."""

    def write(name: str, content: str | bytes):
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


def test_faces_of_more_corners_are_cut_and_keep_their_turn(file):
    shapes, warnings = read_mesh(file("square.obj", SQUARE + "f 1 2 3 4\n"))
    assert not warnings
    assert len(shapes) == 2
    assert not shapes.polygons.smooth.any()
    assert np.allclose(shapes.polygons.area_vectors, (0.0, 0.0, 1.0))


def test_normals_make_patches(file):
    text = SQUARE + "vn 0 0 1\nvn 1 0 1\nvn 0 1 1\nf 1//1 2//2 3//3\n"
    polygons = read_mesh(file("patch.obj", text))[0].polygons
    assert polygons.smooth.all()
    unit = polygons.normals / np.linalg.norm(polygons.normals, axis=1)[:, None]
    assert np.allclose(unit, [[0, 0, 1], [0.5**0.5, 0, 0.5**0.5], [0, 0.5**0.5, 0.5**0.5]])


def test_materials_of_an_obj(file):
    file("square.mtl", MTL)
    text = "mtllib square.mtl\n" + SQUARE + "usemtl brass\nf 1 2 3\nusemtl slate\nf 1 3 4\n"
    shapes, _ = read_mesh(file("square.obj", text))
    used = {shapes.materials[number].name: shapes.materials[number] for number in shapes.polygons.material}
    assert set(used) == {"brass", "slate"}
    assert np.allclose(used["brass"].colour, (0.8, 0.6, 0.2), atol=1 / 255)
    assert used["brass"].exponent == 30.0
    assert used["brass"].specular == pytest.approx(0.4, abs=1 / 255)


def test_a_gltf_file_is_placed_by_its_nodes(file):
    shapes, _ = read_mesh(file("gold.gltf", gltf([0, 1, 2])))
    polygons = shapes.polygons
    assert np.allclose(sorted(polygons.points.tolist()), [[3, 0, 0], [5, 0, 0], [5, 2, 0]])
    # Mirrored, and turned round again: front and normals still point along z.
    assert polygons.area_vectors[0, 2] > 0.0
    assert (polygons.normals[:, 2] > 0.0).all()
    gold = shapes.materials[polygons.material[0]]
    assert gold.name == "gold"
    assert gold.two_sided
    assert gold.exponent == pytest.approx(30.0)
    assert gold.specular == pytest.approx(0.5)


@pytest.mark.parametrize("name", ["mesh.stl", "mesh.ply", "mesh.OBJ"])
@pytest.mark.parametrize("method", ["scanline", "raytrace"])
def test_a_mesh_alone_is_a_scene(file, name, method):
    triangles = np.random.default_rng(7).normal(size=(40, 3, 3)).astype(np.float32) + np.array([100.0, 0.0, -30.0])
    rows = "\n".join(f"v {x} {y} {z}" for x, y, z in triangles.reshape(-1, 3).tolist())
    faces = "\n".join(f"f {n + 1} {n + 2} {n + 3}" for n in range(0, 120, 3))
    contents = {"mesh.stl": stl(triangles), "mesh.ply": PLY.format(last=2), "mesh.OBJ": f"{rows}\n{faces}\n"}
    scene = load_scene(file(name, contents[name]))
    pixels = render(scene, method=method, size=(64, 64)).pixels
    shown = np.flatnonzero(pixels[..., 3].any(axis=0))
    # Nothing is cut off, and it is not small.
    assert 0 < shown[0] <= shown[-1] < 63
    assert shown[-1] - shown[0] > 20


WRONG = {
    "empty.obj": (b"", "is empty"),
    "empty.glb": (b"", "is empty"),
    "text.obj": ("nothing of note\n", "holds no triangles"),
    "points.obj": (SQUARE, "holds no triangles"),
    "index.obj": (SQUARE + "f 1 2 9\n", "cannot be read as OBJ"),
    "words.obj": (SQUARE + "f one two three\n", "cannot be read as OBJ"),
    "nan.obj": ("v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", "vertex 2: 0, nan, 0"),
    "index.ply": (PLY.format(last=7), "vertex does not exist"),
    "negative.ply": (PLY.format(last=-1), "vertex does not exist"),
    "header.ply": ("ply\nformat ascii 1.0\n", "cannot be read as PLY"),
    "truncated.ply": (PLY.format(last=2)[:-20], "truncated.ply"),
    "truncated.stl": (stl(np.zeros((5, 3, 3)))[:-60], "is cut off"),
    "longer.stl": (stl(np.zeros((5, 3, 3)), announced=4), "is cut off"),
    "short.stl": (b"\0" * 10, "is cut off"),
    "nothing.stl": ("solid x\nendsolid x\n", "holds no triangles"),
    "binary.glb": (b"glTF" + b"\2\0\0\0" + b"\xff" * 12, "cannot be read as GLB"),
    "broken.gltf": (gltf([0, 1, 2])[:-30], "cannot be read as GLTF"),
    "index.gltf": (gltf([0, 1, 77]), "vertex does not exist"),
    "outside.gltf": (
        gltf([0, 1, 2], buffers=[{"byteLength": 84, "uri": "../../../etc/hostname"}]),
        "cannot be read as GLTF",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_file_gets_one_clear_message(file, name):
    content, said = WRONG[name]
    with pytest.raises(SceneError) as caught:
        load_scene(file(name, content))
    text = str(caught.value)
    assert name in text
    assert said in text
    assert text.count("error:") == 1
    assert "expected: " in text


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(SceneError, match=r"there is no file .*ghost\.obj"):
        load_scene(tmp_path / "ghost.obj")


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=200), st.sampled_from([".obj", ".ply", ".stl", ".glb", ".gltf"]), st.booleans())
def test_no_mesh_raises_anything_else(tmp_path_factory, content, suffix, with_header):
    header = {".ply": b"ply\nformat ascii 1.0\n", ".obj": SQUARE.encode(), ".stl": b"solid ", ".glb": b"glTF\2\0\0\0"}
    path = tmp_path_factory.getbasetemp() / f"random{suffix}"
    path.write_bytes((header.get(suffix, b"{") if with_header else b"") + content)
    with contextlib.suppress(SceneError):
        read_mesh(path)
