"""Doubles, switches, kept identities, ghosts, IDF1 and HOTA: figures worked out by hand."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from supermap_cli.evaluation.estimate import EstimatedObservation
from supermap_cli.evaluation.identity import score_identity
from supermap_cli.evaluation.switches import within
from supermap_cli.geometry.boxes import Box3D
from support import evaluated as e


def one_chair():
    objects = (e.thing("chair-1", e.stay((0, 0, 0.2))),)
    return e.world(objects, [e.traversal("monday", 0, 9, objects)])


def handed_over(truth):
    """The map in which one instance is lost after second 4 and another takes its place from second 5 on."""
    [chair] = e.perfect_map(truth).objects
    [state] = chair.states
    first = replace(state, last_seen_ns=e.ns(4), gone_ns=e.ns(5))
    second = replace(state, first_seen_ns=e.ns(5))
    return e.with_objects(
        e.perfect_map(truth),
        [
            replace(chair, presence="absent", states=(first,), observations=chair.observations[:5]),
            replace(chair, id="map-chair-2", states=(second,), observations=chair.observations[5:]),
        ],
    )


def parted(instance):
    """An instance with two states as two instances."""
    old, new = instance.states
    return [
        replace(
            instance, id=f"{instance.id}-old", presence="absent", centroid=old.centroid, box=old.box, states=(old,)
        ),
        replace(instance, states=(new,)),
    ]


def test_an_empty_map_of_an_empty_world():
    truth = e.world((), [e.traversal("monday", 0, 9, ())])
    scores = score_identity(e.empty_map(truth), truth)
    assert (scores.instances_per_object, scores.relocated_kept, scores.stale_share) == (None, None, None)
    assert (scores.tracking.idf1, scores.tracking.hota, scores.tracking.note) == (None, None, "nothing was in view")


def test_an_empty_map_finds_nobody():
    truth = e.two_days()
    scores = score_identity(e.empty_map(truth), truth)
    assert (scores.found_objects, scores.instances_per_object, len(scores.never_found)) == (0, None, 5)
    assert (scores.relocated_found, scores.relocated_kept) == (0, 0)
    assert (scores.tracking.idf1, scores.tracking.hota) == (0, 0)


def test_a_perfect_map_is_perfect():
    truth = e.two_days()
    scores = score_identity(e.perfect_map(truth), truth)
    assert (scores.instances_per_object, scores.found_objects, scores.several, scores.never_found) == (1, 5, (), ())
    assert (scores.switches, scores.static_objects) == (0, 4)
    assert (scores.relocated_found, scores.relocated_kept, scores.stale_share, scores.vacated_places) == (1, 1, 0, 2)
    tracking = scores.tracking
    assert tracking.idf1 == tracking.hota == tracking.det_a == tracking.ass_a == pytest.approx(1)
    assert (tracking.time_steps, tracking.true_detections, tracking.estimated_detections) == (20, 80, 80)


def test_a_doubled_map_has_two_instances_an_object_but_no_switch_while_both_go_on_observing():
    truth = one_chair()
    scores = score_identity(e.doubled(e.perfect_map(truth)), truth)
    assert (scores.instances_per_object, scores.switches) == (2, 0)
    assert scores.several[0].instances == ("map-chair-1", "map-chair-1-again")
    # 10 true detections, 20 estimated: IDTP 10, IDFP 10; DetA 10 / 20, AssA 1.
    assert scores.tracking.idf1 == pytest.approx(2 * 10 / 30)
    assert (scores.tracking.det_a, scores.tracking.ass_a) == pytest.approx((0.5, 1))
    assert scores.tracking.hota == pytest.approx(0.5**0.5)


def test_a_hand_over_is_one_switch():
    truth = one_chair()
    scores = score_identity(handed_over(truth), truth)
    assert (scores.switches, scores.instances_per_object) == (1, 2)
    [switch] = scores.switched
    assert (switch.stamp_ns, switch.before, switch.after) == (e.ns(5), "map-chair-1", "map-chair-2")
    # IDTP 5, IDFP 5, IDFN 5; all 10 detected, and each of them associated with 5 of 10.
    assert scores.tracking.idf1 == pytest.approx(0.5)
    assert (scores.tracking.det_a, scores.tracking.ass_a) == pytest.approx((1, 0.5))
    assert scores.tracking.hota == pytest.approx(0.5**0.5)


def test_the_labels_do_not_matter():
    truth = one_chair()
    estimate = e.altered(e.perfect_map(truth), "chair-1", lambda instance: e.relabelled(instance, "sofa"))
    scores = score_identity(estimate, truth)
    assert (scores.instances_per_object, scores.tracking.idf1) == (1, 1)


def test_a_shifted_map_is_tracked_up_to_its_iou():
    truth = one_chair()
    scores = score_identity(e.shifted_map(e.perfect_map(truth), (0.1, 0, 0)), truth)
    assert scores.tracking.idf1 == 1
    # IoU 0.6 reaches the thresholds .05 to .60, 12 of 19.
    assert scores.tracking.hota == pytest.approx(12 / 19)
    beyond_the_gate = score_identity(e.shifted_map(e.perfect_map(truth), (0.35, 0, 0)), truth)
    assert (beyond_the_gate.found_objects, beyond_the_gate.tracking.idf1) == (0, 0)
    assert beyond_the_gate.tracking.estimated_detections == 10


def test_a_moved_thing_that_got_another_id_is_found_but_not_kept():
    truth = e.two_days()
    estimate = e.perfect_map(truth)
    objects = [
        part
        for instance in estimate.objects
        for part in (parted(instance) if len(instance.states) == 2 else [instance])
    ]
    scores = score_identity(e.with_objects(estimate, objects), truth)
    assert (scores.relocated_found, scores.relocated_kept) == (1, 0)
    assert scores.instances_per_object == 6 / 5
    assert [obj.object_id for obj in scores.several] == ["bag-1"]


def nudged():
    """A chair that is moved by 0.25 m after second 4, less than the gate."""
    objects = (e.thing("chair-1", e.stay((0, 0, 0), until=5), e.stay((0.25, 0, 0), since=5)),)
    changes = (e.change("moved", "chair-1", 0, 1, 5, ("monday", "monday"), 0.25),)
    return e.world(objects, [e.traversal("monday", 0, 9, objects)], changes=changes)


def test_a_small_move_that_the_map_noticed_is_found_and_kept():
    truth = nudged()
    scores = score_identity(e.perfect_map(truth), truth)
    assert (scores.relocated_found, scores.relocated_kept) == (1, 1)


@pytest.mark.parametrize("x", [0, 0.125, 0.25])
def test_one_state_near_both_places_has_not_noticed_the_move(x):
    truth = nudged()
    [chair] = e.perfect_map(truth).objects
    lazy = replace(chair, states=(replace(chair.states[0], last_seen_ns=e.ns(9), gone_ns=None),))
    estimate = e.with_objects(e.perfect_map(truth), [e.shifted_object(lazy, (x, 0, 0))])
    scores = score_identity(estimate, truth)
    assert (scores.relocated_found, scores.relocated_kept, scores.instances_per_object) == (0, 0, 1)


@pytest.mark.parametrize(("begins", "found"), [(4, 1), (3, 0)])
def test_the_state_in_the_new_place_begins_not_before_the_last_keyframe_before_the_move(begins, found):
    truth = nudged()
    [chair] = e.perfect_map(truth).objects
    early = replace(chair, states=(chair.states[0], replace(chair.states[1], first_seen_ns=e.ns(begins))))
    scores = score_identity(e.with_objects(e.perfect_map(truth), [early]), truth)
    assert (scores.relocated_found, scores.relocated_kept) == (found, found)


def test_a_ghost_is_stale_and_counts_against_idf1_while_its_place_is_in_view():
    truth = e.two_days()
    never_gone = lambda instance: replace(  # noqa: E731
        instance, presence="present", states=(replace(instance.states[0], gone_ns=None),)
    )
    scores = score_identity(e.altered(e.perfect_map(truth), "plant-1", never_gone), truth)
    assert [(instance.instance_id, instance.object_id, instance.seen_empty) for instance in scores.stale] == [
        ("map-plant-1", "plant-1", True)
    ]
    assert scores.stale_share == 1 / 5
    assert scores.tracking.idf1 == pytest.approx(80 / (80 + 10 / 2))


def test_what_is_not_in_view_counts_for_nothing():
    objects = one_chair().objects
    look = lambda object_id, state, second: e.Sight(visible=1.0 if second < 3 else 0.2)  # noqa: E731
    truth = e.world(objects, [e.traversal("monday", 0, 9, objects, look)])
    tracking = score_identity(e.doubled(e.perfect_map(truth)), truth).tracking
    assert (tracking.true_detections, tracking.estimated_detections) == (3, 6)


def test_an_instance_far_from_all_that_is_true_counts_only_when_it_is_observed():
    truth = one_chair()
    [chair] = e.perfect_map(truth).objects
    far = e.shifted_object(replace(chair, id="map-ghost", observations=chair.observations[:2]), (5, 0, 0))
    tracking = score_identity(e.with_objects(e.perfect_map(truth), [chair, far]), truth).tracking
    assert tracking.estimated_detections == 12


def test_an_observation_goes_to_what_its_instance_is_where_two_things_touch():
    objects = (e.thing("table-1", e.stay((0, 0, 0.2))), e.thing("vase-1", e.stay((0, 0, 0.6))))
    truth = e.world(objects, [e.traversal("monday", 0, 9, objects)])
    high = lambda instance: replace(  # noqa: E731
        instance,
        observations=tuple(EstimatedObservation(o.stamp_ns, np.array([0, 0, 0.45])) for o in instance.observations),
    )
    scores = score_identity(e.altered(e.perfect_map(truth), "table-1", high), truth)
    assert (scores.switches, scores.static_objects) == (0, 2)


@pytest.mark.parametrize(("point", "inside"), [((0.5, 0.5, 0), True), ((0.9, 0, 0), False), ((0, 0, 0.61), False)])
def test_a_turned_box_holds_what_lies_within_reach(point, inside):
    box = Box3D(np.zeros(3), np.array([1.4, 0.2, 1.0]), np.pi / 4)
    assert within([box], np.array([point]), 0.1).tolist() == [[inside]]


def test_without_trackeval_the_rest_is_there_and_a_note_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "trackeval.metrics", None)
    truth = one_chair()
    scores = score_identity(e.perfect_map(truth), truth)
    assert (scores.instances_per_object, scores.tracking.idf1, scores.tracking.hota) == (1, None, None)
    assert 'pip install "supermap-cli[eval]"' in scores.tracking.note
