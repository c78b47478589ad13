from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.mapping.motion import MotionState


def follow(places: list[tuple[float, float]], *, overlap: float = 0.0, size_m: float = 0.3) -> MotionState:
    motion = MotionState()
    for i, (x, y) in enumerate(places):
        motion.sighted(i, np.array([x, y, 0.5]), overlap, size_m)
    return motion


def test_two_sightings_do_not_tell_whether_a_thing_moves() -> None:
    assert not follow([(0, 0), (1, 0)]).moving


def test_what_goes_straight_on_is_moving() -> None:
    assert follow([(0, 0), (0.3, 0), (0.6, 0)]).moving


@pytest.mark.parametrize(
    ("places", "overlap", "size_m"),
    [
        ([(0, 0), (0.01, 0), (0, 0.01), (0.01, 0.01)], 0.0, 0.3),
        ([(0, 0), (0.3, 0), (0, 0), (0.3, 0)], 0.0, 0.3),
        ([(0, 0), (0.3, 0), (0.6, 0)], 0.8, 0.3),
        ([(0, 0), (0.3, 0), (0.6, 0)], 0.0, 2.0),
    ],
    ids=["noise", "to and fro", "on its known cloud", "parts of a large thing"],
)
def test_what_stands_still_is_not(places: list[tuple[float, float]], overlap: float, size_m: float) -> None:
    assert not follow(places, overlap=overlap, size_m=size_m).moving


def test_it_comes_to_rest_when_its_last_sightings_agree() -> None:
    walk = [(0.3 * i, 0.0) for i in range(5)]
    assert follow(walk).moving
    assert not follow([*walk, *[(1.2, 0.0)] * 4]).moving
