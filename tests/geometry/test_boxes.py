"""Boxes in the image and in the map, compared with counting points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from supermap_cli.geometry.boxes import (
    Box3D,
    box_iou,
    clip_convex,
    displacement_m,
    footprint_gap_m,
    footprint_overlap_m2,
    pairwise_iou,
    polygon_area_m2,
)

GRID = np.stack(np.meshgrid(*[(np.arange(240) - 119.5) / 60] * 2), axis=-1).reshape(-1, 2)
CELL_M2 = (1 / 60) ** 2
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)

lengths = st.floats(0.1, 1.5)
places = st.floats(-1.0, 1.0)
angles = st.floats(-np.pi, np.pi)


def box(x: float, y: float, z: float, size: tuple[float, float, float], yaw: float = 0.0) -> Box3D:
    return Box3D(np.array([x, y, z]), np.array(size), yaw)


boxes = st.builds(box, places, places, places, st.tuples(lengths, lengths, lengths), angles)


def holds(one: Box3D, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(n,) which points (n, 2) lie in a footprint, by turning them into the box's own axes."""
    c, s = np.cos(one.yaw), np.sin(one.yaw)
    x, y = (points - one.center[:2]).T
    inside: NDArray[np.bool_] = (np.abs(c * x + s * y) <= one.size[0] / 2) & (np.abs(c * y - s * x) <= one.size[1] / 2)
    return inside


def turned(one: Box3D, angle: float) -> Box3D:
    """The box after the whole world was turned about its z axis."""
    c, s = np.cos(angle), np.sin(angle)
    return Box3D(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ one.center, one.size, one.yaw + angle)


@pytest.mark.parametrize(
    ("center", "size", "yaw", "said"),
    [
        (np.zeros(2), np.ones(3), 0.0, "shapes"),
        (np.array([0, np.nan, 0]), np.ones(3), 0.0, "finite"),
        (np.zeros(3), np.ones(3), np.inf, "finite"),
        (np.zeros(3), np.array([1, -1, 1]), 0.0, "negative"),
    ],
)
def test_a_box_that_makes_no_sense_is_refused(
    center: NDArray[np.float64], size: NDArray[np.float64], yaw: float, said: str
) -> None:
    with pytest.raises(ValueError, match=said):
        Box3D(center, size, yaw)


def test_the_footprint_runs_counter_clockwise_from_the_boxs_own_lower_corner() -> None:
    np.testing.assert_allclose(box(1, 2, 0, (2, 1, 1)).footprint(), [[0, 1.5], [2, 1.5], [2, 2.5], [0, 2.5]])
    np.testing.assert_allclose(
        box(0, 0, 0, (2, 1, 1), np.pi / 2).footprint(), [[0.5, -1], [0.5, 1], [-0.5, 1], [-0.5, -1]], atol=1e-12
    )


def test_the_lower_corners_come_first() -> None:
    corners = box(0, 0, 1, (2, 2, 1)).corners()
    assert corners.shape == (8, 3)
    assert corners[:, 2].tolist() == [0.5] * 4 + [1.5] * 4


@settings(max_examples=40)
@given(boxes, boxes)
def test_the_overlap_is_the_area_of_the_points_in_both(first: Box3D, second: Box3D) -> None:
    counted = (holds(first, GRID) & holds(second, GRID)).sum() * CELL_M2
    outline_m = 2 * (first.size[:2].sum() + second.size[:2].sum())
    assert footprint_overlap_m2(first, second) == pytest.approx(counted, abs=outline_m / 60)


@given(boxes)
def test_a_box_overlaps_itself_wholly(one: Box3D) -> None:
    assert box_iou(one, one) == pytest.approx(1.0)
    assert footprint_gap_m(one, one) == 0.0


@given(boxes, boxes)
def test_neither_order_nor_heading_matters(first: Box3D, second: Box3D) -> None:
    assert footprint_overlap_m2(first, second) == pytest.approx(footprint_overlap_m2(second, first), abs=1e-9)
    assert footprint_gap_m(first, second) == pytest.approx(footprint_gap_m(second, first), abs=1e-9)
    assert box_iou(first, second) == pytest.approx(box_iou(second, first), abs=1e-9)


@given(boxes, boxes, angles)
def test_turning_the_world_changes_nothing(first: Box3D, second: Box3D, angle: float) -> None:
    overlap = footprint_overlap_m2(first, second)
    assume(overlap == 0 or overlap > 1e-6)
    one, other = turned(first, angle), turned(second, angle)
    assert footprint_overlap_m2(one, other) == pytest.approx(overlap, abs=1e-6)
    assert footprint_gap_m(one, other) == pytest.approx(footprint_gap_m(first, second), abs=1e-6)
    assert box_iou(one, other) == pytest.approx(box_iou(first, second), abs=1e-6)


@given(boxes, boxes)
def test_boxes_overlap_or_stand_apart(first: Box3D, second: Box3D) -> None:
    assert footprint_overlap_m2(first, second) < 1e-9 or footprint_gap_m(first, second) == 0.0


@pytest.mark.parametrize(
    ("x", "y", "yaw", "gap"),
    [
        (2.0, 0.0, 0.0, 1.0),
        (2.0, 2.0, 0.0, np.sqrt(2)),
        (2.0, 0.3, 0.0, 1.0),
        (2.0, 0.0, np.pi / 4, 1.5 - np.sqrt(0.5)),
        (1.0, 0.0, 0.0, 0.0),
        (0.2, 0.0, 0.0, 0.0),
    ],
)
def test_the_gap_is_the_shortest_way_between_outlines(x: float, y: float, yaw: float, gap: float) -> None:
    assert footprint_gap_m(box(0, 0, 0, (1, 1, 1)), box(x, y, 5, (1, 1, 1), yaw)) == pytest.approx(gap)


def test_the_gap_between_crossing_outlines_is_zero_though_no_corner_is_inside() -> None:
    assert footprint_gap_m(box(0, 0, 0, (3, 0.2, 1)), box(0, 0, 0, (3, 0.2, 1), np.pi / 2)) == 0.0


def test_iou_counts_the_height() -> None:
    assert box_iou(box(0, 0, 0, (1, 1, 1)), box(0, 0, 0.5, (1, 1, 1))) == pytest.approx(1 / 3)
    assert box_iou(box(0, 0, 0, (1, 1, 1)), box(0, 0, 1.5, (1, 1, 1))) == 0.0


def test_flat_boxes_have_no_iou() -> None:
    flat = box(0, 0, 0, (1, 1, 0))
    assert box_iou(flat, flat) == 0.0


@pytest.mark.parametrize("polygon", [np.zeros((0, 2)), SQUARE[:1], SQUARE[:2]])
def test_fewer_than_three_corners_have_no_area(polygon: NDArray[np.float64]) -> None:
    assert polygon_area_m2(polygon) == 0.0


@pytest.mark.parametrize(
    ("shift", "area"), [((0, 0), 1.0), ((0.5, 0), 0.5), ((0.5, 0.5), 0.25), ((1.5, 0), 0.0), ((-0.9, 0), 0.1)]
)
def test_clipping_keeps_what_is_in_the_window(shift: tuple[float, float], area: float) -> None:
    assert polygon_area_m2(clip_convex(SQUARE + np.array(shift), SQUARE)) == pytest.approx(area)


def test_no_image_boxes_have_no_overlaps() -> None:
    none = np.zeros((0, 4))
    assert pairwise_iou(none, none).shape == (0, 0)
    assert pairwise_iou(none, np.ones((3, 4))).shape == (0, 3)


def test_image_boxes_overlap_by_their_share() -> None:
    a = np.array([[0, 0, 10, 10], [0, 0, 0, 0]], np.float32)
    b = np.array([[0, 0, 10, 10], [5, 0, 15, 10], [20, 20, 30, 30], [0, 0, 10, 5]], np.float32)
    np.testing.assert_allclose(pairwise_iou(a, b), [[1, 1 / 3, 0, 0.5], [0, 0, 0, 0]])


def test_a_thing_has_moved_as_far_as_its_box_whatever_was_hidden_of_its_height() -> None:
    whole = Box3D(np.array([0, 0, 0.5]), np.array([0.6, 0.6, 1.0]), 0.0)
    top_only = Box3D(np.array([0.3, 0.4, 0.8]), np.array([0.6, 0.6, 0.4]), 0.0)
    lifted = Box3D(np.array([0, 0, 1.25]), np.array([0.6, 0.6, 1.0]), 0.0)
    assert displacement_m(whole, top_only) == displacement_m(top_only, whole) == pytest.approx(0.5)
    assert displacement_m(whole, lifted) == pytest.approx(0.75)
    assert displacement_m(whole, whole) == 0.0
