"""From the memory back to the map: a build goes on as if it had never stopped."""

from __future__ import annotations

import json

import numpy as np
import pytest

from supermap_cli.mapping.changes import instance_record
from supermap_cli.mapping.engine import MappingEngine
from supermap_cli.mapping.restoring import restore_object, restore_objects
from supermap_cli.types.memory import InstanceRecord
from support import scenes as s

CHAIR_WORLD = (*s.ROOM, s.CHAIR)


def records(run: s.Run) -> list[InstanceRecord]:
    return [instance_record(obj) for obj in run.map.values()]


def go_on(run: s.Run) -> s.Run:
    """A further traversal over what the memory kept of the map."""
    objects = restore_objects(records(run), run.engine.objects.next_number)
    engine = MappingEngine(objects=objects, free_space=run.engine.free_space)
    return s.Run(engine=engine, traversal=2, at_s=run.at_s + 3600)


def assert_same(one: InstanceRecord, other: InstanceRecord) -> None:
    for name in ("number", "label", "presence", "first_seen_ns", "last_seen_ns", "observations", "merged_into"):
        assert getattr(one, name) == getattr(other, name), name
    assert one.existence_log_odds == other.existence_log_odds
    assert one.label_belief == pytest.approx(other.label_belief)
    assert one.engine_state == other.engine_state
    np.testing.assert_array_equal(one.centroid_map, other.centroid_map)
    np.testing.assert_array_equal(one.box.size, other.box.size)
    for name in ("keys", "log_odds", "inside", "outside", "rgb"):
        np.testing.assert_array_equal(getattr(one.voxels, name), getattr(other.voxels, name))


def seen(run: s.Run) -> None:
    run.walk(CHAIR_WORLD)


def gone(run: s.Run) -> None:
    run.walk(CHAIR_WORLD, 10)
    run.pause(5)
    run.walk(s.ROOM)


def back_again(run: s.Run) -> None:
    gone(run)
    run.walk(CHAIR_WORLD)


def doubted(run: s.Run) -> None:
    run.walk(CHAIR_WORLD)
    run.map[1].set_status(demoted=True)


def gone_and_doubted(run: s.Run) -> None:
    gone(run)
    run.map[1].set_status(demoted=True)


@pytest.mark.parametrize("life", [seen, gone, back_again, doubted, gone_and_doubted], ids=lambda life: life.__name__)
def test_an_object_comes_back_as_it_was_written(life: object) -> None:
    run = s.Run()
    life(run)  # type: ignore[operator]
    (record,) = records(run)
    assert_same(instance_record(restore_object(record)), record)


def test_what_was_seen_to_be_gone_and_is_doubted_too_stays_gone() -> None:
    run = s.Run()
    gone_and_doubted(run)
    further = go_on(run)
    (chair,) = further.engine.objects
    assert not chair.present
    assert further.engine.take_changes().states == ()


def test_words_and_finds_of_each_detector_come_back() -> None:
    run = s.Run()
    for detector in ("strong", "weak"):
        run.engine.use_detector(detector)
        run.walk(CHAIR_WORLD)
    (chair,) = go_on(run).engine.objects
    assert set(chair.labels.by_detector) == set(chair.found_by) == {"strong", "weak"}
    assert chair.labels.by_detector == run.map[1].labels.by_detector


def test_the_engines_state_is_plain_json() -> None:
    run = s.Run()
    back_again(run)
    (record,) = records(run)
    assert json.loads(json.dumps(record.engine_state)) == record.engine_state


def test_what_was_merged_into_another_does_not_come_back() -> None:
    run = s.Run()
    seen(run)
    merged = instance_record(run.map[1], merged_into=7)
    assert len(restore_objects([merged], 9)) == 0
    assert restore_objects([merged], 9).new_number() == 9


def test_a_thing_seen_again_in_a_later_traversal_is_the_same_and_keeps_its_state() -> None:
    run = s.Run()
    seen(run)
    later = go_on(run)
    later.walk(CHAIR_WORLD)
    delta = later.take()
    assert [(instance.number, instance.observations) for instance in delta.instances] == [(1, 12)]
    (state,) = delta.states
    assert (state.index, state.first_seen_ns) == (0, s.ns(0))
    assert state.last_seen_ns > s.ns(3600)
    (visit,) = delta.visits
    assert (visit.supported, visit.first_support_ns) == (6, state.last_seen_ns - (s.ns(5 / 3) - s.ns(0)))
    assert delta.temporal_edges == ()


def test_a_thing_gone_between_two_traversals_went_between_them() -> None:
    run = s.Run()
    seen(run)
    later = go_on(run)
    later.walk(s.ROOM)
    (edge,) = later.take().temporal_edges
    assert (edge.kind, edge.not_before_ns) == ("disappeared", s.ns(5 / 3))
    assert edge.not_after_ns > s.ns(3600)


def test_a_thing_that_was_gone_comes_back_in_a_later_traversal() -> None:
    run = s.Run()
    gone(run)
    later = go_on(run)
    later.walk(CHAIR_WORLD)
    (edge,) = later.take().temporal_edges
    assert (edge.kind, edge.from_state, edge.to_state) == ("reappeared", 0, 1)
    assert list(later.map) == [1]


def test_a_thing_moved_between_two_traversals_is_the_same() -> None:
    run = s.Run()
    seen(run)
    later = go_on(run)
    for y in np.linspace(-1, 1, 8):
        later.see((*s.ROOM, s.CHAIR.at(2.2, 0.7)), (-0.3, float(y), 1.2))
    moved = [edge for edge in later.take().temporal_edges if edge.kind == "moved"]
    assert [(edge.from_number, edge.to_number) for edge in moved] == [(1, 1)]


def test_a_candidate_is_named_once_and_not_in_every_later_traversal() -> None:
    alike = (s.CHAIR.at(2.2, 0.45), s.CHAIR.at(2.2, -0.45))
    run = s.Run()
    gone(run)
    run.walk((*s.ROOM, *alike))
    assert [edge.kind for edge in run.take().temporal_edges].count("candidate") == 2
    later = go_on(run)
    later.walk((*s.ROOM, *alike, s.BOX.at(1.4, 0)))
    assert sorted(later.map) == [1, 2, 3, 4]
    assert "candidate" not in [edge.kind for edge in later.take().temporal_edges]


def test_a_thing_pushed_aside_between_two_traversals_moved_between_them() -> None:
    """It was pushed towards the first look, which sees nothing of its old place and finds it where it is believed."""
    run = s.Run()
    for y in np.linspace(-1.2, 1.2, 8):
        run.see(CHAIR_WORLD, (-0.4, float(y), 1.3))
    last_ns = run.map[1].last_seen_ns
    later = go_on(run)
    pushed = s.CHAIR.at(1.3, 0)
    later.see((*s.ROOM, pushed), (-0.6, 0.0, 0.5), pushed.center)
    assert later.map[1].last_seen_ns > s.ns(3600)
    for y in np.linspace(-1.2, 1.2, 8):
        later.see((*s.ROOM, pushed), (0.0, float(1.5 * y), 1.3))
    delta = later.take()
    (moved,) = [edge for edge in delta.temporal_edges if edge.kind == "moved"]
    assert (moved.from_number, moved.to_number) == (1, 1)
    assert moved.not_before_ns == last_ns
    states = {state.index: state for state in delta.states if state.object_number == 1}
    assert states[0].last_seen_ns == last_ns
    assert states[1].first_seen_ns == moved.not_after_ns > s.ns(3600)


def test_what_stood_elsewhere_in_the_earlier_traversal_already_is_another() -> None:
    """One chair is taken away overnight. Another one like it stood in a place that was looked at right after it."""
    other = s.CHAIR.at(1.6, 3.4)
    run = s.Run()
    seen(run)
    for y in np.linspace(-0.6, 0.6, 6):
        run.see((*CHAIR_WORLD, other), (0.0, 2.5 + float(y), 1.2), other.center)
    assert len(run.standing("chair")) == 2
    later = go_on(run)
    later.walk((*s.ROOM, other))
    kinds = [edge.kind for edge in later.take().temporal_edges]
    assert "moved" not in kinds
    assert "disappeared" in kinds
    assert [obj.number for obj in later.standing("chair")] == [2]


def test_each_traversal_keeps_a_picture_of_its_own() -> None:
    run = s.Run()
    seen(run)
    assert any(observation.crop_jpeg is not None for observation in run.take().observations)
    later = go_on(run)
    later.walk(CHAIR_WORLD)
    assert any(observation.crop_jpeg is not None for observation in later.take().observations)


def test_new_things_get_new_numbers() -> None:
    run = s.Run()
    seen(run)
    later = go_on(run)
    later.walk((*CHAIR_WORLD, s.BOX.at(1.6, 0.8)))
    assert {obj.label: obj.number for obj in later.standing()} == {"chair": 1, "box": 2}
