"""Meshes as nodes of scenes: where their files lie, where their triangles stand, and what they are made of."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given

from tasuki import render
from tasuki.diagnostics import SceneError
from tasuki.scene import Box, Camera, Group, Instance, Material, PointLight, Scene, load_mesh, load_scene
from tasuki.scene.check import with_sides
from tasuki.scene.flatten import flatten
from tasuki.scene.importers import meshes
from tasuki.scene.source import SourceText
from tasuki.scene.yaml_format import dump_yaml, mesh_files, read
from tests.scene.strategies import transforms

CAMERA = "camera: {eye: [0.5, 0.4, 4], at: [0.5, 0.4, 0], up: [0, 1, 0], resolution: [24, 24]}\n"
VIEW = Camera((0.0, -5.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 45.0)
BRASS = Material("brass", (0.9, 0.7, 0.3))
TWO_COLOURS = (
    "mtllib colours.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\n"
    "usemtl red\nf 1//1 2//1 3//1\nusemtl blue\nf 1//1 3//1 4//1\n"
)
COLOURS = "newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n"
TRIANGLE = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
)
CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with meshes, one of them in a folder inside."""
    path = tmp_path_factory.mktemp("scenes")
    (path / "deeper").mkdir()
    for name, text in {"deeper/square.obj": TWO_COLOURS, "deeper/colours.mtl": COLOURS, "part.ply": TRIANGLE}.items():
        (path / name).write_text(text)
    return path


def loaded(folder, text, **options):
    """The scene whose file in `folder` goes on with `text` after its camera."""
    data = (CAMERA + "lights: [{position: [0, 0, 9]}]\n" + text).encode()
    return read(SourceText.from_bytes(str(folder / "scene.yaml"), data, **options))


def wrong(folder, text):
    with pytest.raises(SceneError) as caught:
        loaded(folder, text)
    return str(caught.value)


def materials(scene):
    """The materials of the two triangles of square.obj: first of that with the corner (1, 0, 0), which is red there."""
    shapes = flatten(scene).shapes
    found = {}
    for polygon in shapes:
        found[(1.0, 0.0, 0.0) in getattr(polygon, "points", ())] = polygon.material
    return [found[True], found[False]]


@given(transforms())
def test_a_transform_moves_the_points_and_keeps_the_front(folder, transform):
    polygons = flatten(Scene(VIEW, [Group([load_mesh(folder / "part.ply").transformed(transform)])])).shapes.polygons
    assume(len(polygons))  # too thin to have an area
    moved = CORNERS @ transform.matrix[:3, :3].T + transform.matrix[:3, 3]
    found = polygons.points[np.lexsort(polygons.points.T)]
    np.testing.assert_allclose(found, moved[np.lexsort(moved.T)], rtol=1e-12, atol=1e-9)
    # Normals go with the inverse transposed, and mirroring turns the order of points, not the front.
    front = np.linalg.inv(transform.matrix[:3, :3]).T @ (0.0, 0.0, 1.0)
    assert polygons.area_vectors[0] @ front > 0.0


def test_files_are_named_from_the_folder_of_the_scene(folder, monkeypatch, tmp_path):
    (folder / "scene.yaml").write_text(CAMERA + "shapes:\n  - mesh: {file: deeper/square.obj, name: square}\n")
    monkeypatch.chdir(tmp_path)
    (node,) = load_scene(folder / "scene.yaml").shapes
    assert (node.file, node.name) == (str(folder / "deeper" / "square.obj"), "square")
    assert node.place.line == 3
    monkeypatch.chdir(folder)
    assert load_scene("scene.yaml").shapes[0] == node


def test_materials_are_the_files_own_unless_the_mesh_names_one(folder):
    file = folder / "deeper" / "square.obj"
    around = Group([load_mesh(file)], material=BRASS)
    assert [one.name for one in materials(Scene(VIEW, [around]))] == ["red", "blue"]
    assert materials(Scene(VIEW, [load_mesh(file, material=BRASS)])) == [BRASS, BRASS]
    text = "materials: {brass: {}}\nshapes: [{mesh: {file: deeper/square.obj, material: brass}}]"
    assert materials(loaded(folder, text)) == [Material("brass")] * 2


def test_other_sides_leave_a_mesh_its_materials(folder):
    text = "shapes: [{mesh: {file: deeper/square.obj}}, {box: {low: [2, 0, 0], high: [3, 1, 1]}}]"
    changed = with_sides(loaded(folder, text), False)
    assert [(one.name, one.two_sided) for one in materials(changed)] == [("red", False), ("blue", False)]


def test_a_file_is_read_once_and_instances_share_it(folder, monkeypatch):
    files = []

    def reading(path):
        files.append(path)
        return meshes.read_mesh(path)

    monkeypatch.setattr(mesh_files, "read_mesh", reading)
    text = """
definitions: {part: {mesh: {file: part.ply}}}
shapes:
  - instance: {of: part}
  - instance: {of: part, transform: [{translate: [1, 0, 0]}]}
  - mesh: {file: part.ply, transform: [{translate: [2, 0, 0]}]}
"""
    scene = loaded(folder, text)
    assert files == [folder / "part.ply"]
    one, two, third = scene.shapes
    assert one.of is two.of
    assert one.of.shapes is third.shapes
    points = flatten(scene).shapes.polygons.points.reshape(3, 3, 3)
    np.testing.assert_allclose(points, CORNERS + np.array([[[x, 0.0, 0.0]] for x in range(3)]))


@pytest.mark.parametrize("name", ["../part.ply", "{outside}/part.ply", "link.ply"])
def test_what_lies_outside_has_to_be_allowed(folder, tmp_path, name):
    (tmp_path / "part.ply").write_text(TRIANGLE)
    inside = tmp_path / "inside"
    inside.mkdir()
    (inside / "link.ply").symlink_to(tmp_path / "part.ply")
    text = f"shapes:\n  - mesh: {{file: {name.format(outside=tmp_path)}}}\n"
    message = wrong(inside, text)
    place = f"{inside}/scene.yaml:4:18: error: shapes[0].mesh.file"
    assert message.startswith(f"{place}: this file lies outside the scene's folder, which has to be allowed\n")
    assert "expected: a file in that folder, or deeper" in message
    assert len(flatten(loaded(inside, text, allow_outside=True))) == 1
    (inside / "scene.yaml").write_text(CAMERA + text)
    assert len(render(inside / "scene.yaml", allow_outside=True, size=(8, 8)).pixels) == 8


def test_whole_paths_into_the_folder_are_inside(folder):
    assert len(loaded(folder, f"shapes: [{{mesh: {{file: {folder}/deeper/../part.ply}}}}]").shapes) == 1


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("ghost.ply", None, "there is no file '{path}'"),
        ("empty.obj", "", "'{path}' is empty"),
        ("cut.ply", TRIANGLE[:-10], "'{path}' cannot be read as PLY"),
        ("far.ply", TRIANGLE.replace("3 0 1 2", "3 0 1 7"), "'{path}' has a face whose vertex does not exist"),
        ("points.obj", "v 0 0 0\n", "'{path}'"),
    ],
)
def test_missing_and_broken_files_are_told_at_their_place(tmp_path, name, content, message):
    if content is not None:
        (tmp_path / name).write_text(content)
    text = f"shapes:\n  - mesh: {{file: part.ply}}\n  - group: [{{mesh: {{file: {name}}}}}]\n"
    (tmp_path / "part.ply").write_text(TRIANGLE)
    found = wrong(tmp_path, text)
    place = f"{tmp_path}/scene.yaml:5:27: error: shapes[1].group[0].mesh.file: "
    assert found.startswith(place + message.format(path=tmp_path / name))
    assert f"    5 |   - group: [{{mesh: {{file: {name}}}}}]" in found


@pytest.mark.parametrize("name", ['""', '"a\\0b"'])
def test_what_is_no_name_of_a_file(folder, name):
    assert "shapes[0].mesh.file: this is no name of a file" in wrong(folder, f"shapes: [{{mesh: {{file: {name}}}}}]")


def test_a_mesh_is_no_operand(folder):
    text = "shapes: [{union: [{box: {low: [0, 0, 0], high: [1, 1, 1]}}, {mesh: {file: part.ply}}]}]"
    assert "a mesh has no inside, so it cannot be an operand of a union" in wrong(folder, text)


def test_what_is_left_out_of_a_mesh_is_told(tmp_path):
    coloured = TRIANGLE.replace("property float z\n", "property float z\nproperty uchar red\n")
    coloured = coloured.replace(
        "property uchar red\n", "".join(f"property uchar {c}\n" for c in ("red", "green", "blue"))
    )
    for corner in ("0 0 0", "1 0 0", "0 1 0"):
        coloured = coloured.replace(f"\n{corner}\n", f"\n{corner} 9 9 9\n", 1)
    (tmp_path / "coloured.ply").write_text(coloured)
    found = loaded(tmp_path, "shapes: [{mesh: {file: coloured.ply}}, {mesh: {file: coloured.ply}}]").warnings
    assert found == [f"{tmp_path}/coloured.ply: warning: colours of vertices and faces are left out"]


def test_what_is_written_is_read_again(folder):
    square = load_mesh(folder / "deeper" / "square.obj").rotate("x", 90)
    part = load_mesh(folder / "part.ply", material=BRASS)
    scene = Scene(
        VIEW,
        [Box((0, 0, 0), (1, 1, 1)), Group([square, Instance(part), Instance(part).scale(2)], extent="auto")],
        [PointLight((0.0, 0.0, 9.0))],
    )
    text = dump_yaml(scene)
    again = read(SourceText.from_bytes(str(folder / "again.yaml"), text.encode()))
    assert again == scene
    assert dump_yaml(again) == text
    other = load_mesh(folder / "part.ply").rotate("x", 90)
    assert other != square


@pytest.mark.parametrize("accelerator", ["bvh", "extents"])
def test_both_methods_draw_it(folder, accelerator):
    text = "shapes: [{group: {children: [{mesh: {file: deeper/square.obj, extent: auto}}], extent: auto}}]"
    scene = loaded(folder, text)
    traced = render(scene, accelerator=accelerator, threads=1).pixels
    drawn = render(scene, method="scanline", threads=1).pixels
    assert traced[..., 0].any()
    assert traced[..., 2].any()
    np.testing.assert_allclose(traced, drawn, atol=1e-3)


def test_triangles_without_area_are_told_and_left_out(tmp_path):
    thin = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nf 1 2 3\nf 1 2 4\nf 1 1 2\n"
    (tmp_path / "thin.obj").write_text(thin)
    (tmp_path / "scene.yaml").write_text(
        CAMERA + "lights: [{position: [0, 0, 9]}]\nshapes: [{mesh: {file: thin.obj}}, {mesh: {file: thin.obj}}]"
    )
    scene = load_scene(tmp_path / "scene.yaml")
    assert scene.warnings == [f"{tmp_path}/thin.obj: warning: polygons without area are left out: 2"]
    assert len(flatten(scene)) == 2
