"""When two are one, and when they are two."""

from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.mapping.duplicates import merge_evidence
from supermap_cli.mapping.objects import OpenState
from supermap_cli.types.detections import Detections
from support import scenes as s


def in_halves(scene: s.Scene, at_s: float) -> Detections:
    """A detector that takes the left and the right half of the image's one thing for two."""
    left, right = scene.mask(2), scene.mask(2)
    left[:, 80:] = False
    right[:, :80] = False
    return s.detections_of([left, right], [[("dining table", 0.8)]] * 2, at_s)


def test_a_half_seen_table_is_not_a_second_table() -> None:
    world = (*s.ROOM, s.TABLE)
    run = s.Run()
    for y in (1.0, -1.0):
        run.walk(world, 4, target=(1.6, y, 0.4))
        assert [obj.number for obj in run.standing()] == [1]
    run.walk(world, 4)
    (table,) = run.standing("dining table")
    assert table.number == 1
    assert table.shape.box.size.max() == pytest.approx(1.2, abs=0.25)


def test_two_chairs_side_by_side_stay_two() -> None:
    left, right = s.CHAIR.at(1.6, 0.23), s.CHAIR.at(1.6, -0.23)
    run = s.Run()
    for _ in range(2):
        run.walk((*s.ROOM, left, right), 8)
    assert len(run.standing("chair")) == 2
    for one in (left, right):
        assert min(s.distance_to(obj, one) for obj in run.standing("chair")) < 0.25


def test_a_thing_on_a_table_stays_by_itself() -> None:
    run = s.Run()
    run.walk((*s.ROOM, s.TABLE, s.CUP), 8)
    assert sorted(obj.label for obj in run.standing()) == ["cup", "dining table"]


def test_two_halves_that_turn_out_to_be_one_are_merged_and_it_is_said_so() -> None:
    world = (*s.ROOM, s.TABLE)
    run = s.Run(detector=in_halves)
    for _ in range(4):
        run.see(world, (0, 0, 1.2))
    assert len(run.map) == 2
    run.take()
    run.detector = s.detect
    run.walk(world, 8)
    delta = run.take()
    (merged,) = delta.temporal_edges
    assert (merged.kind, merged.from_number, merged.from_state, merged.to_number, merged.to_state) == (
        "merged",
        2,
        0,
        1,
        0,
    )
    assert [(instance.number, instance.merged_into) for instance in delta.instances] == [(1, None), (2, 1)]
    assert list(run.map) == [1]
    assert run.map[1].shape.box.size.max() == pytest.approx(1.2, abs=0.25)


def test_what_belonged_to_a_tentative_duplicate_is_written_under_the_number_that_stays() -> None:
    """Two detections of one thing in the first images; the second never enters the map by itself."""

    def twice(scene: s.Scene, at_s: float) -> Detections:
        mask = scene.mask(2)
        return s.detections_of([mask, mask], [[("chair", 0.8)], [("chair", 0.6)]], at_s)

    run = s.Run(detector=twice)
    run.walk((*s.ROOM, s.CHAIR), 6)
    delta = run.take()
    assert [instance.number for instance in delta.instances] == [1]
    assert {observation.object_number for observation in delta.observations} == {1}
    assert delta.temporal_edges == ()


def test_two_labels_for_one_thing_become_one_thing_with_both_in_its_belief() -> None:
    def undecided(scene: s.Scene, at_s: float) -> Detections:
        label = "couch" if round(3 * at_s) % 2 else "chair"
        other = "chair" if label == "couch" else "couch"
        return s.detections_of([scene.mask(2)], [[(label, 0.6), (other, 0.3)]], at_s)

    run = s.Run(detector=undecided)
    run.walk((*s.ROOM, s.CHAIR), 10)
    (one,) = run.map.values()
    belief = one.labels.probabilities()
    assert set(belief) == {"chair", "couch"}
    assert min(belief.values()) > 0.3


def test_a_chair_under_a_table_is_not_merged_into_it() -> None:
    chair = s.Thing("chair", (1.0, 0, 0.3), (0.3, 0.3, 0.6), s.CHAIR.rgb)
    top = s.Thing("dining table", (1.6, 0, 0.7), (0.8, 1.2, 0.06), s.TABLE.rgb)
    run = s.Run()
    for y in np.linspace(-1.0, 1.0, 8):
        run.see((*s.ROOM, chair, top), (-0.6, float(y), 1.3))
    assert sorted(obj.label for obj in run.standing()) == ["chair", "dining table"]


def test_a_place_was_not_empty_when_the_other_half_already_stood_there() -> None:
    run = s.Run(detector=in_halves)
    for _ in range(4):
        run.see((*s.ROOM, s.TABLE), (0, 0, 1.2))
    kept, joined = run.map[1], run.map[2]
    kept.first_seen_ns, kept.state = s.ns(5), OpenState(0, s.ns(5), s.ns(4))
    joined.first_seen_ns, joined.state = s.ns(2), OpenState(0, s.ns(2), s.ns(1))
    merge_evidence(kept, joined)
    assert (kept.state.first_seen_ns, kept.state.empty_before_ns) == (s.ns(2), s.ns(1))


def test_what_the_other_half_was_last_seen_at_was_not_yet_empty() -> None:
    """Looks that found one half's place empty are void when the other half was seen there afterwards."""
    run = s.Run()
    run.walk((*s.ROOM, s.CHAIR.at(1.6, 0.5), s.CHAIR.at(1.6, -0.5)), 6)
    kept, joined = run.standing("chair")
    kept.absence.add_empty(s.ns(1.9))
    joined.last_seen_ns = s.ns(2.0)
    merge_evidence(kept, joined)
    assert (kept.last_seen_ns, kept.absence.views) == (s.ns(2.0), 0)
    run.engine.transitions.mark_absent(kept, s.ns(1.9))
    assert kept.gone_ns is not None
    assert kept.gone_ns > kept.last_seen_ns
