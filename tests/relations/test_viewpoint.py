"""Left, right, in front, behind and between: as seen from a stated viewpoint."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.relations.viewpoint import Viewpoint, behind, between, facing, in_front_of, left_of, right_of

ROBOT = Viewpoint(np.array([-3.0, 0.0, 0.0]))
"""It looks along x at what stands in the origin."""

places = st.floats(-3, 3)


def box(x: float, y: float, size: tuple[float, float] = (0.4, 0.4)) -> Box3D:
    return Box3D(np.array([x, y, 0.4]), np.array([*size, 0.8]), 0.0)


@pytest.mark.parametrize(
    ("x", "y", "relation"), [(0, 1, left_of), (0, -1, right_of), (-1, 0, in_front_of), (1, 0, behind)]
)
def test_directions_are_those_of_who_looks(x: float, y: float, relation: object) -> None:
    found = [each for each in (left_of, right_of, in_front_of, behind) if each(box(x, y), box(0, 0), ROBOT) > 0]
    assert found == [relation]


def test_who_looks_from_the_other_side_sees_left_and_right_swapped() -> None:
    other_side = Viewpoint(np.array([3.0, 0.0, 0.0]))
    assert left_of(box(0, 1), box(0, 0), ROBOT) > 0
    assert right_of(box(0, 1), box(0, 0), other_side) > 0


def test_a_robot_looks_where_it_heads_even_at_what_is_beside_it() -> None:
    robot = Viewpoint(np.array([0.0, -2.0, 0.0]), heading_rad=0.0)
    assert behind(box(1, 0), box(0, 0), robot) > 0


def test_before_a_thing_with_a_front_is_where_its_front_looks() -> None:
    cupboard = box(0, 0)
    assert in_front_of(box(0, 1), cupboard, facing(np.pi / 2, cupboard)) > 0
    assert behind(box(0, -1), cupboard, facing(np.pi / 2, cupboard)) > 0


def test_nobody_can_tell_from_the_things_own_place() -> None:
    here = Viewpoint(np.zeros(3))
    assert all(each(box(0, 1), box(0, 0), here) == 0 for each in (left_of, right_of, in_front_of, behind))
    assert left_of(box(0, 0), box(0, 0), ROBOT) == 0


@settings(max_examples=200, deadline=None)
@given(places, places, places, places)
def test_left_is_the_inverse_of_right_for_a_robot_that_heads_somewhere(x: float, y: float, u: float, v: float) -> None:
    robot = Viewpoint(np.zeros(3), heading_rad=0.3)
    one, other = box(x, y), box(u, v)
    assert left_of(one, other, robot) == pytest.approx(right_of(other, one, robot))
    assert in_front_of(one, other, robot) == pytest.approx(behind(other, one, robot))
    assert left_of(one, other, robot) == 0 or right_of(one, other, robot) == 0


def test_between_is_in_the_corridor_that_joins_two_things() -> None:
    desk, shelf = box(-2, 0, (0.6, 1.6)), box(2, 0, (0.4, 1.6))
    assert between(box(0, 0), desk, shelf) == 1.0
    assert 0 < between(box(0, 0.6), desk, shelf) < 1
    assert between(box(0, 1.5), desk, shelf) == 0
    assert between(box(-3, 0), desk, shelf) == 0
    assert between(box(0, 0), desk, desk) == 0


@settings(max_examples=200, deadline=None)
@given(places, places, places, places)
def test_the_order_of_the_two_outer_things_does_not_matter(x: float, y: float, u: float, v: float) -> None:
    assert between(box(x, y), box(-1, 0.2), box(u, v)) == pytest.approx(between(box(x, y), box(u, v), box(-1, 0.2)))


def test_a_viewpoint_is_a_place_in_space() -> None:
    with pytest.raises(ValueError, match="position"):
        Viewpoint(np.zeros(2))
