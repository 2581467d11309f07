"""The reference programs: what they compute, against NumPy, and what they cost."""

from functools import cache
from pathlib import Path

import numpy as np

from tasuki.machines.pu import macro, simulate

EXAMPLES = Path(__file__).parents[3] / "examples" / "pu"


@cache
def outcome(name: str) -> simulate.Outcome:
    return simulate.run(macro.assemble_file(EXAMPLES / f"{name}.macro").program)


def floats(name: str, first: int, count: int):
    return outcome(name).state.memory[first : first + count].view(np.float32).astype(np.float64)


def test_ten_thousand_vertices_are_transformed():
    vertices, found = floats("transform", 0, 10_000), floats("transform", 10_000, 10_000)
    matrix = floats("transform", 20_000, 4).T
    assert len(np.unique(vertices[:, :3], axis=0)) == 10_000
    sizes = np.abs(vertices) @ np.abs(matrix)
    assert np.all(np.abs(found - vertices @ matrix) <= 3 * np.spacing(sizes.astype(np.float32)))
    np.testing.assert_array_equal(found[:, 3], 1.0)


def test_a_vertex_takes_sixteen_steps():
    """Fetch, take, 12 of the product, store, loop."""
    assert outcome("transform").labels["transform"].steps == 16 * 10_000 + 1


def test_the_nearest_of_a_thousand_spheres_is_found():
    spheres, eye = floats("spheres", 0, 1000), floats("spheres", 1000, 2)
    origin, direction = eye[0, :3], eye[1, :3] / np.linalg.norm(eye[1, :3])
    offset = spheres[:, :3] - origin
    along = offset @ direction
    inside = along**2 - np.sum(offset**2, axis=1) + spheres[:, 3]
    distance = np.where(inside >= 0, along - np.sqrt(np.maximum(inside, 0)), np.inf)
    distance[distance < 1e-4] = np.inf
    nearest = int(np.argmin(distance))
    assert np.count_nonzero(np.isfinite(distance)) > 5
    # The answer stands behind the spheres and the ray: distance as a float, number as an integer.
    answer = outcome("spheres").state.memory[1002]
    assert answer[1] == nearest
    assert abs(float(answer[:1].view(np.float32)[0]) - distance[nearest]) < 1e-4


def test_the_picture_is_filled_line_by_line():
    picture = floats("picture", 0, 512 * 512).reshape(512, 512, 4)
    np.testing.assert_array_equal(picture[..., 0], np.arange(512)[None, :] / 512 * np.ones((512, 1)))
    np.testing.assert_array_equal(picture[..., 1], np.arange(512)[:, None] / 512 * np.ones((1, 512)))
    np.testing.assert_array_equal(picture[..., 2:], np.broadcast_to([0.5, 1.0], (512, 512, 2)))
    assert outcome("picture").counters.rows_written == 512 * 512


def test_the_normalisation_takes_the_eighteen_steps_of_figure_5():
    labels = outcome("normalize").labels
    assert labels["figure_5"].steps == 18
    # The vector unit works in steps 1, 2 (X alone) and 18, SP in the others.
    assert [labels["figure_5"].busy[unit] for unit in "xyz"] == [3, 2, 2]
