"""Free space: what blocks, and ways around it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.simulation.building_plan import BuildingPlan, Room
from supermap_cli.simulation.motion.free_space import FreeSpace
from support.small_office import box, furniture, two_rooms

EMPTY = FreeSpace(two_rooms(), [], clearance_m=0.3)
FURNISHED = FreeSpace(two_rooms(), furniture(), clearance_m=0.3)


@pytest.mark.parametrize(
    ("xy", "free"),
    [((2, 4), True), ((2, 1.7), True), ((4.1, 4), False), ((0.2, 4), False), ((3, 1.7), False), ((-1, 0.5), False)],
    ids=["room", "doorway", "wall between rooms", "near a wall", "wall beside the doorway", "outside"],
)
def test_rooms_and_doorways_are_free_but_for_the_clearance(xy: tuple[float, float], free: bool) -> None:
    assert EMPTY.is_free(np.array(xy)) is free


@pytest.mark.parametrize(
    ("obstacle", "blocks"),
    [
        (box(2, 4, 0.6, 0.6, 0.7), True),
        (box(2, 4, 0.6, 0.6, 0.4, z=1.0), True),
        (box(2, 4, 0.6, 0.6, 0.4, z=1.5), False),
        (box(2, 4, 1.6, 1.6, 0.02), False),
    ],
    ids=["stands", "hangs low", "hangs high", "lies flat"],
)
def test_what_stands_blocks_and_what_hangs_high_or_lies_flat_does_not(obstacle: Box3D, blocks: bool) -> None:
    free = FreeSpace(two_rooms(), [obstacle], clearance_m=0.3)
    assert free.is_free(np.array([2.0, 4.0])) is not blocks


def test_a_thing_on_another_blocks_no_more_than_that_one() -> None:
    table, wide_tray = box(2, 4, 0.8, 0.8, 0.7), box(2, 4, 1.6, 0.3, 0.05, z=0.7)
    free = FreeSpace(two_rooms(), [table, wide_tray], clearance_m=0.1)
    assert free.is_free(np.array([2.65, 4.0]))


def test_a_way_leads_from_room_to_room_and_keeps_its_clearance() -> None:
    way = FURNISHED.path(np.array([0.8, 3.0]), np.array([7.4, 5.3]))
    assert np.allclose(way[[0, -1]], [[0.8, 3.0], [7.4, 5.3]])
    steps = [a + (b - a) * np.linspace(0, 1, 50)[:, None] for a, b in pairwise(way)]
    assert (FURNISHED.room_to_move_m(np.vstack(steps)) >= 0.3 - 1e-9).all()
    assert (way[:, 1] < 1.6).any()


def test_a_straight_way_is_two_points() -> None:
    assert len(EMPTY.path(np.array([1.0, 4.0]), np.array([3.0, 4.0]))) == 2


def test_standing_still_is_a_way_too() -> None:
    way = EMPTY.path(np.array([1.0, 4.0]), np.array([1.0, 4.0]))
    assert np.allclose(way, [[1.0, 4.0], [1.0, 4.0]])


def test_there_is_no_way_into_a_room_without_a_doorway() -> None:
    rooms = (Room("a", np.zeros(2), np.array([5.0, 4.0])), Room("b", np.array([6.0, 0.0]), np.array([9.0, 3.0])))
    free = FreeSpace(BuildingPlan(rooms, (), 2.5), [], clearance_m=0.3)
    with pytest.raises(ValueError, match="no free place"):
        free.path(np.array([2.0, 2.0]), np.array([7.6, 1.5]))


def test_a_place_on_a_table_is_moved_beside_it() -> None:
    beside = FURNISHED.nearest_free(np.array([2.0, 3.9]))
    assert FURNISHED.is_free(beside)
    assert np.linalg.norm(beside - [2.0, 3.9]) < 1.0


def test_walls_and_tall_things_hide_and_tables_do_not() -> None:
    seen = FURNISHED.sees(np.array([1.0, 2.6]), np.array([[3.0, 5.2], [6.2, 3.9], [2.0, 3.9]]))
    assert seen.tolist() == [True, False, True]
    beside_a_shelf = FreeSpace(two_rooms(), [box(2, 4, 1.0, 0.3, 1.8)], clearance_m=0.3)
    assert not beside_a_shelf.sees(np.array([2.0, 2.6]), np.array([[2.0, 5.4]]))[0]


@settings(max_examples=25, deadline=None)
@given(st.tuples(*[st.floats(0.4, 1.0)] * 4))
def test_ways_are_no_shorter_than_the_beeline_and_as_long_back(shares: tuple[float, ...]) -> None:
    low, high = np.array([0.0, 1.8]), np.array([4.0, 5.8])
    start, goal = low + (high - low) * shares[:2], low + (high - low) * shares[2:]
    start, goal = FURNISHED.nearest_free(start), FURNISHED.nearest_free(goal)
    there, back = (_length_m(FURNISHED.path(*ends)) for ends in ((start, goal), (goal, start)))
    assert there >= np.linalg.norm(goal - start) - 1e-9
    assert there == pytest.approx(back, abs=0.4)


def _length_m(way: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
