"""The scanline method's modules one by one: exact edges, clipping, transforms, normals, shading."""

from __future__ import annotations

from fractions import Fraction
from math import floor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasuki.modules import records as rec
from tasuki.modules.scanline import records as scan
from tasuki.modules.scanline.active import update_active_edge
from tasuki.modules.scanline.clipping import SIDES, crossing, distance_inside, outcode
from tasuki.modules.scanline.edges import SHORT, edge_between, end_row, first_row, slope_multiple
from tasuki.modules.scanline.fixed import SUBPIXEL, first_from, fixed, multiple, quotient
from tasuki.modules.scanline.geometry import (
    face_normal,
    face_state,
    homogeneous,
    perspective,
    plane_of,
    vertex_normal,
    vertex_to_reference,
)
from tasuki.modules.scanline.luminance import smooth_normal
from tasuki.modules.scanline.reference import light_to_reference, normal_matrix, reference_matrix, sample_direction
from tasuki.scene import Camera
from tests.modules.running import dot, everywhere, exactly, random_directions, records

LARGEST = 65535 * SUBPIXEL
MANY = 400


def view_and_frame(width: int = 640, height: int = 480) -> tuple[np.ndarray, np.ndarray]:
    """A camera's view and frame, one record each, the frame's matrices those of module 1."""
    camera = Camera((1.0, 2.0, 3.0), (0.5, -1.0, 0.25), (0.1, 1.0, 0.2), 40.0)
    shown = camera.frame(width, height)
    view = records(rec.View, 1, eye=shown.eye, corner=shown.corner, right=shown.right, down=shown.down)
    view["width"], view["height"] = width, height
    frame = records(scan.Frame, 1, pixel=np.linalg.norm(shown.right), near=0.01, sample_x=2048, sample_y=2048)
    return view[0], frame[0]


# --- fixed point ------------------------------------------------------------------------------------------------------

pairs = st.lists(st.tuples(st.integers(1, 2**29 - 1), st.integers(-(2**28), 2**28)), min_size=1, max_size=50)


@settings(max_examples=30, deadline=None)
@given(pairs, st.integers(0, 4095))
def test_multiples_of_fractions_are_exact(fractions, n):
    divisors = np.array([divisor for divisor, _ in fractions], np.int32)
    numerators = np.array([min(abs(a), divisor) * (1 if a > 0 else -1) for divisor, a in fractions], np.int64)
    whole, rest = np.divmod(numerators, divisors)
    found = everywhere(multiple, n, 12, whole, rest, divisors)
    expected = np.divmod(n * numerators, divisors)
    assert np.array_equal(found[0], expected[0])
    assert np.array_equal(found[1], expected[1])


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.integers(-(2**30) + 1, 2**30 - 1), st.integers(1, 2**30 - 1)), min_size=1, max_size=50))
def test_quotients_are_exact(divisions):
    n, divisor = np.array(divisions, np.int64).T
    divisor = np.maximum(divisor, np.abs(n) // 2**20 + 1)
    found = everywhere(quotient, n, divisor)
    expected = np.divmod(n, divisor)
    assert np.array_equal(found[0], expected[0])
    assert np.array_equal(found[1], expected[1])


def test_short_and_long_edges_are_divided_alike():
    draw = np.random.default_rng(2)
    height = draw.integers(1, 2 * SHORT, MANY)
    across = draw.integers(-2 * SHORT, 2 * SHORT, MANY)
    n = draw.integers(0, 4096, MANY) % (height + 1)
    way, rest = everywhere(slope_multiple, n, 12, across, height)
    expected = np.divmod(n * across, height)
    assert np.array_equal(way, expected[0])
    assert np.array_equal(rest, expected[1])


def test_the_nearest_subpixel():
    x = np.random.default_rng(3).uniform(0.0, 16.0, MANY).astype(np.float32)
    assert np.array_equal(everywhere(fixed, x), np.floor(x.astype(np.float64) * SUBPIXEL + 0.5))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, LARGEST), st.integers(0, 4095))
def test_the_first_pixel_whose_sample_is_not_before(x, sample):
    [first] = everywhere(first_from, np.array([x]), sample)
    assert first * SUBPIXEL + sample >= x > (first - 1) * SUBPIXEL + sample


# --- edges ------------------------------------------------------------------------------------------------------------

places = st.one_of(
    st.integers(0, LARGEST),
    st.integers(0, 40 * SUBPIXEL),
    st.integers(0, 12).map(lambda n: n * SUBPIXEL // 2),  # through samples
    st.integers(-60, 0),  # what clipping left a little outside
)


@settings(max_examples=150, deadline=None)
@given(st.tuples(places, places), st.tuples(places, places), st.sampled_from([0, 1, 2048, 4095]))
def test_an_edge_crosses_each_row_where_it_does(a, b, sample):
    """Against fractions, row by row; from either end the same."""
    ends = [records(scan.ScreenVertex, 1, x=x, y=y) for x, y in (a, b)]
    edge = everywhere(edge_between, *ends, 7, -1, sample)
    if a[1] != b[1]:
        assert edge == everywhere(edge_between, *reversed(ends), 7, -1, sample)
    top, bottom = sorted((a, b), key=lambda end: end[1])
    rows = [row for row in range(65535) if top[1] <= row * SUBPIXEL + sample < bottom[1]][:20]
    first, end = int(everywhere(first_row, edge)[0]), int(everywhere(end_row, edge)[0])
    if not rows:
        assert first >= end
        return
    assert rows[0] == first
    assert (edge["first"], edge["second"]) == (7, -1)
    for row in rows:
        slope = Fraction(bottom[0] - top[0], bottom[1] - top[1])
        exact = top[0] + (row * SUBPIXEL + sample - top[1]) * slope
        assert edge["x"][0] == floor(exact)
        assert Fraction(int(edge["rest"][0]), int(edge["height"][0])) == exact - floor(exact)
        edge = everywhere(update_active_edge, edge)


# --- clipping ---------------------------------------------------------------------------------------------------------


def test_outcodes_name_the_sides_that_are_passed():
    view, frame = view_and_frame()
    draw = np.random.default_rng(5)
    points = draw.normal(size=(MANY, 3)) * (900.0, 700.0, 1.0)
    distances = np.stack([everywhere(distance_inside, points, side, view, frame) for side in range(SIDES)])
    bits = (1 << np.arange(SIDES)) @ ~(distances >= 0.0)
    assert np.array_equal(everywhere(outcode, points, view, frame), bits)
    x, y, w = points.astype(np.float32).T
    inside = (w >= 0.01) & (x >= 0.0) & (x <= 640.0 * w) & (y >= 0.0) & (y <= 480.0 * w)
    assert np.array_equal(bits == 0, inside)


def test_an_edge_is_cut_on_the_side_and_alike_from_both_faces():
    draw = np.random.default_rng(6)
    a, b = draw.normal(size=(2, MANY, 3)).astype(np.float32)
    a_distance, b_distance = draw.uniform(0.0, 1.0, MANY), -draw.uniform(1e-3, 1.0, MANY)
    cut = everywhere(crossing, a, a_distance, b, b_distance)
    assert np.array_equal(cut, everywhere(crossing, b, b_distance, a, a_distance))
    share = (a_distance / (a_distance - b_distance))[:, None]
    assert np.allclose(cut, a + share * (b - a), atol=1e-5)


# --- coordinate systems and normals -----------------------------------------------------------------------------------


def test_the_reference_system_has_the_eye_at_its_origin_and_keeps_lengths():
    view, _ = view_and_frame()
    matrix = exactly(reference_matrix, view)[0]
    axes = matrix[:3, :3]
    assert np.allclose(axes.T @ axes, np.eye(3), atol=1e-6)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    points = np.random.default_rng(8).normal(size=(MANY, 3))
    placed = everywhere(vertex_to_reference, points, everywhere(reference_matrix, view)[0])
    assert np.allclose(np.linalg.norm(placed, axis=1), np.linalg.norm(points - view["eye"], axis=1), atol=1e-5)


def test_what_is_projected_lies_in_the_direction_of_its_pixel():
    view, frame = view_and_frame()
    draw = np.random.default_rng(9)
    column, row = draw.integers(0, 640, MANY), draw.integers(0, 480, MANY)
    direction = everywhere(sample_direction, view, frame, column, row)
    along = view["corner"] + (column + 0.5)[:, None] * view["right"] + (row + 0.5)[:, None] * view["down"]
    seen = exactly(vertex_to_reference, along + view["eye"], everywhere(reference_matrix, view)[0])
    assert np.allclose(seen, direction, atol=2e-6)
    screen = everywhere(perspective, everywhere(homogeneous, 7.0 * direction, view, frame))
    assert np.abs(screen["x"] - (column * SUBPIXEL + 2048)).max() <= 1
    assert np.abs(screen["y"] - (row * SUBPIXEL + 2048)).max() <= 1


def test_normals_stay_across_what_is_transformed():
    draw = np.random.default_rng(10)
    matrix = np.eye(4)
    matrix[:3, :3] = draw.normal(size=(3, 3))
    a, b, c = draw.normal(size=(3, MANY, 3))
    normal = everywhere(vertex_normal, everywhere(face_normal, a, b, c), exactly(normal_matrix, matrix)[0])
    moved = [point @ matrix[:3, :3] for point in (a, b, c)]
    size = np.linalg.norm(normal, axis=1) * np.linalg.norm(moved[1] - moved[0], axis=1)
    assert (np.abs(dot(normal, moved[1] - moved[0])) <= 1e-4 * size).all()


def test_lamps_move_and_directions_turn():
    view, _ = view_and_frame()
    matrix = everywhere(reference_matrix, view)[0]
    lights = records(rec.Light, 2, position=[view["eye"] + (0.0, 0.0, 1.0), (0.0, 0.0, 1.0)])
    lights["kind"] = 0, rec.DIRECTIONAL
    moved = everywhere(light_to_reference, lights, matrix)
    assert np.allclose(moved["position"][0], moved["position"][1], atol=1e-6)


def test_a_plane_gives_depth_and_normals_back():
    """At the corners, one of which may lie behind the eye."""
    draw = np.random.default_rng(11)
    corners = draw.normal(size=(3, MANY, 3)) + np.array([0.0, 0.0, 2.0])
    normals = random_directions(draw, 3 * MANY).reshape(3, MANY, 3)
    plane = exactly(plane_of, *corners, *normals)
    facing = dot(np.cross(corners[1] - corners[0], corners[2] - corners[0]), corners[0]) < 0.0
    for corner, normal in zip(corners, normals, strict=True):
        before = corner[:, 2] > 0.1
        direction = corner / corner[:, 2:]
        assert np.allclose((dot(plane["slope"], direction) * corner[:, 2])[before], 1.0, atol=1e-3)
        found = exactly(smooth_normal, plane, direction)
        expected = np.where(facing[:, None], normal, -normal)
        assert (dot(found, expected)[before] > 0.999).mean() > 0.98


def test_only_what_turns_its_front_shows_unless_both_sides_do():
    flags = np.array([0, 0, rec.TWO_SIDED, rec.TWO_SIDED, rec.INSIDE_ONLY, rec.INSIDE_ONLY])
    away = np.array([False, True] * 3)
    states = everywhere(face_state, 0, 0, flags, away)
    assert states.tolist() == [scan.WHOLE, scan.HIDDEN, scan.WHOLE, scan.WHOLE, scan.HIDDEN, scan.WHOLE]
    assert (everywhere(face_state, 0, 4, flags, away)[states != scan.HIDDEN] == scan.PARTIAL).all()
    assert (everywhere(face_state, 4, 4, flags, away) == scan.HIDDEN).all()
