"""A thing that stands elsewhere is the same thing, if the evidence singles it out."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from supermap_cli.mapping.relocation import assignment_lead, nearness
from supermap_cli.types.memory import MapDelta, TemporalEdge
from support import scenes as s


def arc(run: s.Run, *things: s.Thing, looks: int = 8, target: s.Point = (1.6, 0, 0.4)) -> MapDelta:
    """Look at the room with these things from a wide arc, so that two sides of each are seen."""
    run.pause(5)
    for y in np.linspace(-1.2, 1.2, looks):
        run.see((*s.ROOM, *things), (-0.4, float(y), 1.3), target)
    return run.take()


def of_kind(delta: MapDelta, kind: str) -> list[TemporalEdge]:
    return [edge for edge in delta.temporal_edges if edge.kind == kind]


@pytest.mark.parametrize("thing", [s.CHAIR, s.CUP.at(1.4, 0), s.BOX], ids=["chair", "cup", "box"])
@pytest.mark.parametrize("distance_m", [0.5, 0.8])
def test_a_thing_that_stands_elsewhere_has_moved_and_keeps_its_number(thing: s.Thing, distance_m: float) -> None:
    things = (s.TABLE,) if thing.label == "cup" else ()
    x, y, _ = thing.center
    run = s.Run()
    arc(run, thing.at(x, y - distance_m / 2), *things)
    number = run.standing(thing.label)[0].number
    delta = arc(run, thing.at(x, y + distance_m / 2), *things)
    (moved,) = of_kind(delta, "moved")
    assert (moved.from_number, moved.from_state, moved.to_number, moved.to_state) == (number, 0, number, 1)
    assert moved.distance_m == pytest.approx(distance_m, abs=0.2)
    assert [obj.number for obj in run.standing(thing.label)] == [number]
    states = {state.index: state for state in delta.states if state.object_number == number}
    assert states[0].gone_ns is not None
    assert states[0].last_seen_ns < states[1].first_seen_ns
    assert np.linalg.norm(states[1].centroid_map - states[0].centroid_map) == pytest.approx(distance_m, abs=0.15)
    assert of_kind(delta, "appeared") == []


@pytest.mark.parametrize("thing", [s.CHAIR, s.BOX], ids=["chair", "box"])
def test_a_thing_pushed_aside_by_less_than_its_width_has_moved(thing: s.Thing) -> None:
    run = s.Run()
    arc(run, thing)
    (moved,) = arc(run, thing.at(1.6, 0.33)).temporal_edges
    assert (moved.kind, moved.from_number, moved.to_number) == ("moved", 1, 1)
    assert moved.distance_m == pytest.approx(0.33, abs=0.17)


def test_a_thing_seen_a_little_off_has_not_moved() -> None:
    """Odometry errs by centimetres."""
    run = s.Run()
    arc(run, s.CHAIR)
    assert arc(run, s.CHAIR.at(1.62, 0.04)).temporal_edges == ()


def test_a_thing_gone_from_one_place_and_found_in_another_later_is_the_same() -> None:
    run = s.Run()
    arc(run, s.CHAIR)
    (gone,) = of_kind(arc(run), "disappeared")
    run.pause(600)
    delta = arc(run, s.CHAIR.at(2.2, 0.8))
    (moved,) = of_kind(delta, "moved")
    assert (moved.from_number, moved.to_number, moved.to_state) == (gone.from_number, 1, 1)
    assert moved.not_before_ns is not None
    assert gone.not_before_ns == moved.not_before_ns < moved.not_after_ns
    assert moved.distance_m == pytest.approx(1.0, abs=0.15)
    assert {observation.object_number for observation in delta.observations} == {1}
    assert list(run.map) == [1]


def test_a_thing_found_elsewhere_before_its_old_place_is_seen_empty_is_the_same() -> None:
    run = s.Run()
    arc(run, s.CHAIR.at(1.6, -0.8), target=(1.6, -0.8, 0.4))
    arc(run, s.CHAIR.at(1.6, 2.0), target=(1.6, 2.6, 0.4))
    assert len(run.standing("chair")) == 2
    delta = arc(run, s.CHAIR.at(1.6, 2.0), target=(1.6, -0.8, 0.4))
    assert [edge.kind for edge in delta.temporal_edges if edge.kind == "moved"] == ["moved"]
    assert [obj.number for obj in run.standing("chair")] == [1]


def test_with_two_alike_it_is_not_guessed_which_one_it_is() -> None:
    run = s.Run()
    arc(run, s.CHAIR)
    arc(run)
    left, right = s.CHAIR.at(2.2, 0.4), s.CHAIR.at(2.2, -0.4)
    delta = arc(run, left, right)
    assert of_kind(delta, "moved") == []
    assert [(edge.from_number, edge.to_number) for edge in of_kind(delta, "candidate")] == [(1, 2), (1, 3)]
    assert all(0.3 < edge.probability < 0.6 for edge in of_kind(delta, "candidate"))
    assert sorted(run.map) == [1, 2, 3]
    assert not run.map[1].present


def test_what_was_not_guessed_is_not_guessed_later_because_one_of_two_alike_has_gone_too() -> None:
    run = s.Run()
    arc(run, s.CHAIR)
    arc(run)
    left, right = s.CHAIR.at(2.2, 0.4), s.CHAIR.at(2.2, -0.4)
    arc(run, left, right)
    delta = arc(run, left)
    assert [(edge.kind, edge.from_number) for edge in delta.temporal_edges] == [("disappeared", 3)]
    assert [obj.number for obj in run.standing("chair")] == [2]


def test_with_two_gone_it_is_not_guessed_which_one_was_found() -> None:
    run = s.Run()
    arc(run, s.CHAIR.at(1.6, 0.4), s.CHAIR.at(1.6, -0.4))
    arc(run)
    delta = arc(run, s.CHAIR.at(2.3, 0))
    assert of_kind(delta, "moved") == []
    assert [(edge.from_number, edge.to_number) for edge in of_kind(delta, "candidate")] == [(1, 3), (2, 3)]
    assert [obj.number for obj in run.standing("chair")] == [3]


@pytest.mark.parametrize(
    "other",
    [
        s.BOX.at(2.2, 0.8),
        s.Thing("chair", (2.2, 0.8, 0.4), s.CHAIR.size, (230, 40, 40)),
        s.Thing("chair", (2.2, 0.8, 0.15), (0.25, 0.25, 0.3), s.CHAIR.rgb),
    ],
    ids=["another label", "another colour", "another size"],
)
def test_a_thing_that_looks_otherwise_is_another(other: s.Thing) -> None:
    run = s.Run()
    arc(run, s.CHAIR)
    arc(run)
    delta = arc(run, other)
    assert of_kind(delta, "moved") == []
    assert [edge.to_number for edge in of_kind(delta, "appeared")] == [2]
    assert not run.map[1].present


def test_two_things_seen_in_one_image_are_two_though_one_goes_right_then() -> None:
    """The second comes into view in the very image that shows the first for the last time."""
    run = s.Run()
    for y in np.linspace(-0.9, 0.2, 10):
        run.see((*s.ROOM, s.CHAIR), (0, float(y), 1.2))
    other = s.CHAIR.at(1.6, 0.9)
    run.see((*s.ROOM, s.CHAIR, other), (0, 0.3, 1.2))
    for y in np.linspace(0.4, 0.8, 8):
        run.see((*s.ROOM, other), (0, float(y), 1.2))
    delta = run.take()
    assert of_kind(delta, "moved") == []
    assert not run.map[1].present
    assert [obj.number for obj in run.standing("chair")] == [2]


def test_a_person_found_elsewhere_is_not_the_one_who_left() -> None:
    run = s.Run()
    arc(run, s.PERSON)
    arc(run)
    run.pause(10)
    delta = arc(run, s.PERSON.at(2.4, 0.8))
    assert of_kind(delta, "moved") == []
    assert [obj.number for obj in run.standing("person")] == [2]


@pytest.mark.parametrize("others", [0, 2])
def test_one_more_of_a_kind_in_a_place_nobody_had_looked_at_need_not_have_moved(others: int) -> None:
    standing = [s.CHAIR.at(2.2, 0.7 * k - 0.4) for k in range(others)]
    run = s.Run()
    arc(run, s.CHAIR.at(1.2, -1.0), *standing)
    arc(run, *standing)
    far = s.CHAIR.at(1.6, 3.4)
    delta = arc(run, *standing, far, target=(1.6, 3.4, 0.4))
    assert len(of_kind(delta, "moved")) == (0 if others else 1)
    assert len(of_kind(delta, "candidate")) == (1 if others else 0)


def test_of_two_look_alikes_that_were_moved_a_little_each_is_the_one_nearby() -> None:
    run = s.Run()
    left, right = s.CHAIR.at(1.4, -1.6), s.CHAIR.at(1.4, 1.6)
    arc(run, left, right, target=(1.4, -1.2, 0.4))
    arc(run, left, right, target=(1.4, 1.2, 0.4))
    moved_left, moved_right = left.at(2.2, -1.6), right.at(2.2, 1.6)
    for _ in range(2):
        arc(run, moved_left, moved_right, target=(1.4, -1.2, 0.4))
        arc(run, moved_left, moved_right, target=(1.4, 1.2, 0.4))
    assert [obj.number for obj in run.standing("chair")] == [1, 2]
    assert s.distance_to(run.map[1], moved_left) < 0.2


def test_what_one_look_leaves_open_the_whole_traversal_decides() -> None:
    """Of a lamp that was found, a first look shows the top alone: it might be another, smaller one."""
    lamp = s.Thing("lamp", (1.6, 0, 0.8), (0.3, 0.3, 1.6), (40, 90, 160))
    elsewhere = lamp.at(2.2, 1.6)
    run = s.Run()
    arc(run, lamp)
    arc(run)
    for target_z in (2.0, 0.8):
        for y in np.linspace(1.0, 2.2, 6):
            run.see((*s.ROOM, elsewhere), (0.9, float(y), 1.0), (2.2, 1.6, target_z))
    assert [edge.kind for edge in run.take().temporal_edges] == ["candidate", "appeared"]
    run.engine.end_traversal()
    assert [edge.kind for edge in run.take().temporal_edges] == ["merged", "moved"]
    assert [obj.number for obj in run.standing("lamp")] == [1]


@given(arrays(float, st.tuples(st.integers(1, 3), st.integers(1, 3)), elements=st.floats(-5, 5)), st.data())
def test_the_lead_of_a_pair_is_that_of_the_best_assignment_with_it(scores: np.ndarray, data: st.DataObject) -> None:
    row = data.draw(st.integers(0, scores.shape[0] - 1))
    column = data.draw(st.integers(0, scores.shape[1] - 1))
    padded = np.zeros((6, 6))
    padded[: scores.shape[0], : scores.shape[1]] = np.maximum(scores, 0)
    totals: dict[bool, list[float]] = {True: [], False: []}
    for order in permutations(range(6)):
        total = float(padded[np.arange(6), order].sum())
        if order[row] == column:
            totals[True].append(total - padded[row, column] + scores[row, column])
        else:
            totals[False].append(total)
    assert assignment_lead(scores, row, column) == pytest.approx(max(totals[True]) - max(totals[False]), abs=1e-9)


@given(st.floats(0, 30), st.floats(0, 30), st.floats(10, 2000))
def test_what_is_nearer_is_likelier_the_same(first_m: float, second_m: float, area_m2: float) -> None:
    near_m, far_m = sorted((first_m, second_m))
    assert nearness(near_m, area_m2) >= nearness(far_m, area_m2)
