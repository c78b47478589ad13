"""Spatial relations of two boxes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.query.relations import RelationName, box_distance_m, covered_share, holds
from support.memories import Point, upright_box

TABLE = upright_box((0, 0, 0.375), (1.9, 0.9, 0.75))


@pytest.mark.parametrize(
    ("center", "size", "expected"),
    [
        ((0.5, 0.2, 0.8), (0.08, 0.08, 0.1), {"on", "above", "near"}),
        ((0.0, 0.8, 0.45), (0.5, 0.5, 0.9), {"near", "beside"}),
        ((0.0, 0.0, 0.2), (0.3, 0.3, 0.3), {"near", "inside"}),
        ((0.0, 0.0, 1.9), (0.3, 0.3, 0.4), {"near", "above"}),
        ((4.0, 0.0, 0.45), (0.5, 0.5, 0.9), set()),
    ],
)
def test_relations_to_a_table(center: Point, size: Point, expected: set[str]) -> None:
    names: tuple[RelationName, ...] = ("near", "beside", "on", "under", "inside", "above")
    assert {name for name in names if holds(name, upright_box(center, size), TABLE)} == expected


def test_a_table_is_under_the_cup_and_a_rug_under_the_table() -> None:
    assert holds("under", TABLE, upright_box((0.5, 0.2, 0.8), (0.08, 0.08, 0.1)))
    assert holds("under", upright_box((0, 0, 0.005), (3, 2, 0.01)), TABLE)


def test_nearness_is_scaled_by_size() -> None:
    cups = [upright_box((x, 0, 0.8), (0.08, 0.08, 0.1)) for x in (0.0, 0.9)]
    couches = [upright_box((x, 0, 0.4), (2.0, 0.9, 0.8)) for x in (0.0, 2.9)]
    assert not holds("near", *cups)
    assert holds("near", *couches)


coordinates = st.floats(-3, 3)
boxes = st.builds(
    Box3D,
    st.tuples(coordinates, coordinates, coordinates).map(np.array),
    st.tuples(*[st.floats(0.05, 2)] * 3).map(np.array),
    st.floats(-np.pi, np.pi),
)


def inner_points(box: Box3D) -> FloatArray:
    """Points (n, 3) within a box, on a grid."""
    corners = box.corners()
    steps = np.linspace(0, 1, 5)
    u, v, w = (steps.ravel()[:, None] for steps in np.meshgrid(steps, steps, steps))
    return corners[0] + u * (corners[1] - corners[0]) + v * (corners[3] - corners[0]) + w * (corners[4] - corners[0])


@settings(deadline=None)
@given(boxes, boxes)
def test_the_distance_is_that_of_the_closest_points(a: Box3D, b: Box3D) -> None:
    closest = float(np.linalg.norm(inner_points(a)[:, None] - inner_points(b)[None], axis=2).min())
    assert closest - 0.9 <= box_distance_m(a, b) <= closest + 1e-9  # the points lie up to half a metre apart
    assert box_distance_m(a, b) == pytest.approx(box_distance_m(b, a))


@given(boxes, boxes)
def test_the_common_part_of_outlines_is_as_large_as_seen_from_either(a: Box3D, b: Box3D) -> None:
    shares = covered_share(a, b) * np.prod(a.size[:2]), covered_share(b, a) * np.prod(b.size[:2])
    assert shares[0] == pytest.approx(shares[1], abs=1e-9)
    assert 0 <= covered_share(a, b) <= 1 + 1e-9


@given(boxes)
def test_a_box_covers_itself(box: Box3D) -> None:
    assert covered_share(box, box) == pytest.approx(1.0)
    assert box_distance_m(box, box) == 0.0
