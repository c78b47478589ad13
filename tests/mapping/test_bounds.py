"""What is near a place is found by its bounds, however things come and go."""

from __future__ import annotations

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.mapping.bounds import BoundsIndex


def cube(x: float) -> tuple[FloatArray, FloatArray]:
    return np.array([x, 0, 0]), np.array([x + 1, 1, 1])


def index(count: int) -> BoundsIndex:
    made = BoundsIndex()
    for number in range(count):
        made.add(number)
    made.refresh(lambda number: cube(2.0 * number))
    return made


def test_within_a_distance():
    assert index(200).within(np.array([10.5, 0.5, 0.5]), 1.6) == [4, 5, 6]
    assert index(0).within(np.zeros(3), 5.0) == []


def test_only_what_has_changed_is_asked_again():
    made, asked = index(3), []
    made.changed.add(1)
    made.refresh(lambda number: asked.append(number) or cube(100.0))
    assert asked == [1]
    assert made.within(np.zeros(3), 10.0) == [0, 2]


def test_what_is_removed_is_nowhere_and_the_order_stays():
    made = index(300)
    for number in range(0, 300, 2):
        made.remove(number)
    for number in range(1, 200, 2):
        made.remove(number)
    made.add(7)
    made.refresh(lambda number: cube(2.0 * number))
    assert made.within(np.array([402.5, 0, 0]), 4.0) == [201, 203]
    assert made.within(np.array([14.5, 0, 0]), 0.1) == [7]


def test_pairs_side_by_side_each_once():
    assert index(6).beside({2, 3, 99}, 1.5) == [(1, 2), (2, 3), (3, 4)]
