"""Gone, hidden, out of view, back again: only what was seen is said."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from supermap_cli.mapping.absence import DEFAULT
from supermap_cli.types.memory import TemporalEdge
from support import scenes as s

CHAIR_WORLD = (*s.ROOM, s.CHAIR)
LOOKS, AWAY_S = 10, 5.0
LAST_SEEN_S = (LOOKS - 1) / 3
BACK_S = LOOKS / 3 + AWAY_S
SCREEN = s.Thing("", (0.9, 0, 0.8), (0.05, 1.6, 1.8))


@pytest.fixture
def run() -> s.Run:
    """A run that has mapped a chair, written that, and looked away."""
    run = s.Run()
    run.walk(CHAIR_WORLD, LOOKS)
    run.take()
    run.pause(AWAY_S)
    return run


def edge(edges: tuple[TemporalEdge, ...]) -> TemporalEdge:
    (one,) = edges
    return one


def test_a_thing_taken_away_becomes_absent_within_the_bounds_of_what_was_seen(run: s.Run) -> None:
    last_seen_ns, empty_ns = s.ns(LAST_SEEN_S), s.ns(BACK_S)
    run.walk(s.ROOM)
    delta = run.take()
    gone = edge(delta.temporal_edges)
    assert (gone.kind, gone.from_number, gone.from_state) == ("disappeared", 1, 0)
    assert (gone.not_before_ns, gone.not_after_ns) == (last_seen_ns, empty_ns)
    (state,) = delta.states
    assert (state.last_seen_ns, state.gone_ns) == (last_seen_ns, empty_ns)
    assert [(instance.number, instance.presence) for instance in delta.instances] == [(1, "absent")]


def test_two_looks_at_an_empty_place_are_not_enough(run: s.Run) -> None:
    run.walk(s.ROOM, 2)
    run.walk(CHAIR_WORLD, 2)
    run.walk(s.ROOM, 2)
    assert run.standing("chair")
    assert run.take().temporal_edges == ()


def test_three_cameras_at_one_moment_are_one_view_for_they_share_the_error_of_the_pose(run: s.Run) -> None:
    for moment in range(3):
        assert run.standing("chair"), moment
        for camera, step_s in (("left", 0.0), ("front", 0.0), ("right", 1 / 3)):
            run.see(s.ROOM, (0.0, 0.2 * moment, 1.2), camera_id=camera, step_s=step_s)
    gone = edge(run.take().temporal_edges)
    assert (gone.kind, gone.not_after_ns) == ("disappeared", s.ns(BACK_S))


def test_a_thing_that_is_hidden_stays(run: s.Run) -> None:
    run.walk((*s.ROOM, SCREEN), 10)
    assert run.last_view is not None
    assert run.last_view.views[1].hidden
    delta = run.take()
    assert run.standing("chair")
    assert delta.temporal_edges == ()
    assert delta.states == ()


def test_a_thing_out_of_view_stays(run: s.Run) -> None:
    before = run.map[1].existence.log_odds
    run.walk(s.ROOM, 10, target=(1.6, 4, 0.4))
    assert run.standing("chair")
    assert run.map[1].existence.log_odds == before
    assert run.take().temporal_edges == ()


def test_a_thing_without_depth_behind_it_stays(run: s.Run) -> None:
    """A black or shining surface returns nothing: that is no free space."""
    run.walk((), 10)
    assert run.standing("chair")
    assert run.take().temporal_edges == ()


def slit(y: float) -> tuple[s.Thing, s.Thing]:
    """Two boards before the chair that leave a slit of 6 cm between them."""
    return s.Thing("", (0.9, y - 0.53, 0.8), (0.02, 1.0, 1.8)), s.Thing("", (0.9, y + 0.53, 0.8), (0.02, 1.0, 1.8))


SLITS = np.linspace(-0.1, 0.1, 5)


def through_slits(run: s.Run, world: tuple[s.Thing, ...], slits: Iterable[float]) -> None:
    """Looks of which none can speak of so much of the chair's place that it counts as a look at the whole."""
    for y in slits:
        run.see((*world, *slit(float(y))), (0, 0, 1.2))
        assert run.last_view is not None
        assert run.last_view.views[1].observable_share < DEFAULT.observable_share


def test_looks_at_parts_of_an_empty_place_add_up(run: s.Run) -> None:
    last_seen_ns, empty_ns = s.ns(LAST_SEEN_S), s.ns(BACK_S)
    through_slits(run, s.ROOM, SLITS)
    gone = edge(run.take().temporal_edges)
    assert (gone.kind, gone.not_before_ns, gone.not_after_ns) == ("disappeared", last_seen_ns, empty_ns)


def test_many_looks_at_one_part_are_one(run: s.Run) -> None:
    through_slits(run, s.ROOM, [0.0] * 20)
    assert run.standing("chair")
    assert run.take().temporal_edges == ()


def test_a_thing_that_stands_behind_slits_stays_though_it_is_not_detected(run: s.Run) -> None:
    run.detector = lambda scene, at_s: s.detect(scene, at_s, blind_to=["chair"])
    through_slits(run, CHAIR_WORLD, SLITS)
    assert run.standing("chair")


def test_parts_seen_empty_count_no_more_once_a_part_is_seen_in_its_place(run: s.Run) -> None:
    run.detector = lambda scene, at_s: s.detect(scene, at_s, blind_to=["chair"])
    through_slits(run, s.ROOM, SLITS[:2])
    through_slits(run, CHAIR_WORLD, SLITS[:2])
    through_slits(run, s.ROOM, SLITS[2:4])
    assert run.standing("chair")


def test_geometry_alone_sees_it_go(run: s.Run) -> None:
    run.detector = lambda scene, at_s: None
    run.walk(s.ROOM)
    assert edge(run.take().temporal_edges).kind == "disappeared"


def test_a_thing_that_was_gone_and_stands_there_again_has_the_same_number(run: s.Run) -> None:
    run.walk(s.ROOM)
    run.take()
    run.walk(CHAIR_WORLD)
    delta = run.take()
    back = edge(delta.temporal_edges)
    assert (back.kind, back.from_number, back.from_state, back.to_number, back.to_state) == ("reappeared", 1, 0, 1, 1)
    assert (back.not_before_ns, back.not_after_ns) == (s.ns(BACK_S), s.ns(BACK_S + 2))
    (state,) = delta.states
    assert (state.index, state.first_seen_ns, state.empty_before_ns, state.gone_ns) == (
        1,
        s.ns(BACK_S + 2),
        s.ns(BACK_S),
        None,
    )
    assert run.standing("chair")[0].number == 1
    assert len(run.map) == 1


def test_what_is_gone_is_not_missed_any_further(run: s.Run) -> None:
    run.walk(s.ROOM)
    existence = run.map[1].existence.log_odds
    run.walk(s.ROOM, 20)
    assert run.map[1].existence.log_odds == existence
    assert len(run.take().temporal_edges) == 1


def test_a_tentative_thing_that_goes_leaves_no_trace() -> None:
    run = s.Run()
    run.walk(CHAIR_WORLD, 2)
    run.walk(s.ROOM, 8)
    assert len(run.engine.objects) == 0
    assert run.take().temporal_edges == ()


def test_a_thing_the_detector_no_longer_finds_is_doubted_less_from_one_place_than_from_many(run: s.Run) -> None:
    run.detector = lambda scene, at_s: s.detect(scene, at_s, blind_to=["chair"])
    stare, walk = s.Run(engine=run.engine, detector=run.detector, at_s=run.at_s), s.Run(detector=run.detector)
    walk.detector = s.detect
    walk.walk(CHAIR_WORLD)
    walk.detector = run.detector
    for angle in np.linspace(-1, 1, 12):
        stare.see(CHAIR_WORLD, (0, 0, 1.2))
        walk.see(CHAIR_WORLD, (1.6 - 1.6 * np.cos(angle), 1.6 * np.sin(angle), 1.2))
    assert walk.map[1].existence.log_odds < stare.map[1].existence.log_odds < 8.0
    assert stare.map[1].present
    assert walk.map[1].present


def test_a_thing_believed_in_no_more_is_doubted_not_gone_until_it_is_found_again(run: s.Run) -> None:
    run.map[1].existence.log_odds = -1.3
    run.detector = lambda scene, at_s: s.detect(scene, at_s, blind_to=["chair"])
    for angle in np.linspace(-1, 1, 8):
        run.see(CHAIR_WORLD, (1.6 - 1.6 * np.cos(angle), 1.6 * np.sin(angle), 1.2))
    delta = run.take()
    assert [instance.presence for instance in delta.instances] == ["doubted"]
    assert delta.temporal_edges == ()
    assert run.standing() == []
    run.detector = s.detect
    for angle in np.linspace(-1.2, 1.2, 8):
        run.see(CHAIR_WORLD, (1.6 - 1.4 * np.cos(angle), 1.4 * np.sin(angle), 1.3))
    assert [instance.presence for instance in run.take().instances] == ["present"]


@pytest.mark.parametrize("step_m", [0.12, 0.3, 0.45])
def test_a_person_who_walks_through_leaves_nothing_standing(step_m: float) -> None:
    run = s.Run(target=(2, 0, 0.8))
    for y in np.arange(-1.8, 1.8, step_m):
        run.see((*s.ROOM, s.PERSON.at(2.0, float(y))), (0, 0, 1.2))
    assert len(run.map) <= 1
    assert all(obj.shape.box.size[:2].max() < 1.0 for obj in run.map.values())
    for _ in range(12):
        run.see(s.ROOM, (0, 0, 1.2))
    assert run.standing() == []
    assert "present" not in [instance.presence for instance in run.take().instances]


def test_a_person_who_was_last_seen_long_ago_has_left_though_nobody_looked() -> None:
    run = s.Run()
    run.walk((*s.ROOM, s.PERSON))
    run.walk(s.ROOM, 3, target=(1.6, 4, 0.8))
    assert run.standing("person")
    run.pause(3)
    run.walk(s.ROOM, 1, target=(1.6, 4, 0.8))
    assert run.standing("person") == []


def test_a_person_in_the_last_image_is_not_left_standing_when_the_traversal_ends() -> None:
    run = s.Run()
    run.walk((*s.ROOM, s.PERSON))
    assert run.standing("person")
    run.engine.end_traversal()
    assert run.standing("person") == []
    assert "present" not in [instance.presence for instance in run.take().instances]


def test_a_chair_in_the_last_image_is() -> None:
    run = s.Run()
    run.walk(CHAIR_WORLD)
    run.engine.end_traversal()
    assert run.standing("chair")


def test_what_was_found_in_its_place_for_long_is_not_gone_for_a_moment() -> None:
    """It would have gone before the robot's eyes; a turn of the camera puts images and poses out of step."""
    run = s.Run()
    run.walk(CHAIR_WORLD, 24)
    run.take()
    run.walk(s.ROOM, 4)
    assert run.standing("chair")
    run.walk(s.ROOM, 6)
    assert edge(run.take().temporal_edges).kind == "disappeared"
