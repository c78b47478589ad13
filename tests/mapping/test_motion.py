from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
import pytest

from supermap_cli.mapping.motion import Course, MotionState, first_course
from support import scenes as s


def follow(places: list[tuple[float, float]], *, overlap: float = 0.0, size_m: float = 0.3) -> MotionState:
    motion = MotionState()
    for i, (x, y) in enumerate(places):
        motion.add_detection(i, np.array([x, y, 0.5]), overlap, size_m)
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


def test_two_cameras_that_see_two_sides_of_a_still_thing_do_not_make_it_move() -> None:
    motion = MotionState(moving=True)
    for moment in range(5):
        for side in (-0.15, 0.15):
            motion.add_detection(moment, np.array([0.0, side, 0.5]), 0.0, 0.3)
    assert motion.stamps_ns == [1, 2, 3, 4]
    assert not motion.moving


def test_it_comes_to_rest_when_its_last_sightings_agree() -> None:
    walk = [(0.3 * i, 0.0) for i in range(5)]
    assert follow(walk).moving
    assert not follow([*walk, *[(1.2, 0.0)] * 4]).moving


def course_of(places: list[tuple[float, float]], step_s: float = 0.4) -> Course:
    course = first_course(0, np.array(places[0]))
    for k, place in enumerate(places[1:], start=1):
        course = course.updated(round(k * step_s * 1e9), np.array(place))
    return course


def test_who_walks_is_expected_farther_on() -> None:
    course = course_of([(0.5 * k, 0.0) for k in range(6)])
    assert course.walking
    assert course.at(course.stamp_ns + 800_000_000).place == pytest.approx([3.5, 0], abs=0.1)


def test_who_stands_is_expected_where_they_are() -> None:
    course = course_of([(0.05 * (-1) ** k, 0.0) for k in range(8)])
    assert not course.walking
    assert course.at(course.stamp_ns + 800_000_000).place == pytest.approx([0, 0], abs=0.1)


def test_one_sighting_does_not_tell_where_somebody_goes() -> None:
    course = first_course(0, np.zeros(2))
    assert not course.walking
    assert course.at(400_000_000).sigma_m > 0.3


def test_the_longer_unseen_the_less_is_known_of_where_somebody_is() -> None:
    course = course_of([(0.5 * k, 0.0) for k in range(6)])
    spread = [course.at(course.stamp_ns + k * 500_000_000).sigma_m for k in range(6)]
    assert spread == sorted(spread)


def walk_past(run: s.Run, missed: tuple[int, ...] = (), others: Sequence[s.Thing] = ()) -> set[int]:
    """Somebody walks by at 1.2 m/s, in some images unnoticed; the numbers of all people that the map has had."""
    numbers = set()
    for k in range(9):
        run.detector = partial(s.detect, blind_to=("person",)) if k in missed else s.detect
        run.see((*s.ROOM, s.PERSON.at(2.2, 1.6 - 0.4 * k), *others), (0, 0, 1.2), (2.2, 0, 0.8))
        numbers |= {obj.number for obj in run.map.values() if obj.label == "person"}
    return numbers


def test_who_walks_by_is_one_object() -> None:
    run = s.Run()
    assert walk_past(run) == {1}
    assert run.map[1].is_moving


def test_who_was_missed_on_the_way_is_found_again_farther_on() -> None:
    assert walk_past(s.Run(), missed=(4, 5)) == {1}


def test_two_who_pass_one_another_keep_their_identities() -> None:
    run = s.Run()
    for k in range(9):
        y = 1.6 - 0.4 * k
        run.see((*s.ROOM, s.PERSON.at(1.8, y), s.PERSON.at(2.6, -y)), (0, 0, 1.2), (2.2, 0, 0.8))
    last = {obj.number: obj.motion.course for obj in run.standing("person")}
    assert set(last) == {1, 2}
    first_x = {seen.object_number: seen.centroid_map[0] for seen in reversed(run.take().observations)}
    for number, course in last.items():
        assert course is not None
        assert abs(course.place[0] - first_x[number]) < 0.3


def test_a_person_does_not_become_the_chair_they_walk_past() -> None:
    run = s.Run()
    assert walk_past(run, missed=(4,), others=(s.CHAIR.at(2.2, 0.0),)) == {1}
    assert len(run.standing("chair")) == 1
