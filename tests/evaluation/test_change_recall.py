"""The paper's detection recall and change recall: figures worked out by hand."""

from dataclasses import replace

import pytest

from supermap_cli.evaluation.change_recall import score_change_recall
from support import evaluated as e


def rows(scores):
    return {
        (row.object_id, row.changes[0]): (row.there_right, row.there_samples, row.left_right, row.left_samples)
        for row in scores.places
    }


def with_state(estimate, object_id, **changes):
    """The map in which the last state of an instance reads otherwise."""
    return e.altered(
        estimate,
        object_id,
        lambda instance: replace(instance, states=(*instance.states[:-1], replace(instance.states[-1], **changes))),
    )


def test_where_nothing_changes_nothing_is_asked():
    truth = e.still_life()
    scores = score_change_recall(e.perfect_map(truth), truth)
    assert scores.places == ()
    assert (scores.per_object.detection_recall, scores.per_frame.change_recall, scores.clean_share) == (None,) * 3


def test_a_perfect_map_is_right_in_every_frame_and_a_move_counts_at_both_ends():
    truth = e.two_days()
    scores = score_change_recall(e.perfect_map(truth), truth)
    assert rows(scores) == {
        ("plant-1", "disappeared"): (10, 10, 10, 10),
        ("cart-1", "appeared"): (10, 10, 0, 0),
        ("bag-1", "moved away"): (10, 10, 10, 10),
        ("bag-1", "moved here"): (10, 10, 0, 0),
    }
    assert scores.per_object.change_recall == scores.per_frame.change_recall == scores.clean_share == 1


def test_an_empty_map_detects_nothing_and_is_right_about_every_empty_place():
    truth = e.two_days()
    scores = score_change_recall(e.empty_map(truth), truth)
    assert (scores.per_frame.detection_recall, scores.per_frame.change_recall, scores.clean_share) == (0, 20 / 60, 1)


def test_keyframes_before_a_thing_came_are_reported_and_count_in_no_recall():
    truth = e.two_days()
    too_early = with_state(e.perfect_map(truth), "cart-1", first_seen_ns=e.ns(7))
    scores = score_change_recall(too_early, truth)
    cart = next(row for row in scores.places if row.object_id == "cart-1")
    assert (cart.before_right, cart.before_samples, cart.first_wrong_ns) == (7, 10, None)
    assert cart.change_recall == cart.detection_recall == 1
    assert (scores.per_frame.change_recall, scores.clean_share) == (1, 1)
    bag = next(row for row in scores.places if row.changes == ("moved away",))
    assert bag.before_samples == 0


def test_a_disappearance_noticed_late_costs_its_frames():
    truth = e.two_days()
    scores = score_change_recall(with_state(e.perfect_map(truth), "plant-1", gone_ns=e.ns(103)), truth)
    assert rows(scores)["plant-1", "disappeared"] == (10, 10, 7, 10)
    assert scores.places[0].change_recall == 17 / 20
    assert scores.places[0].first_wrong_ns == e.ns(100)
    assert scores.per_object.change_recall == pytest.approx((17 / 20 + 3) / 4)
    assert (scores.per_frame.change_recall, scores.clean_share) == (57 / 60, 1 / 2)


def test_an_appearance_noticed_late_costs_its_frames():
    truth = e.two_days()
    scores = score_change_recall(with_state(e.perfect_map(truth), "cart-1", first_seen_ns=e.ns(102)), truth)
    assert rows(scores)["cart-1", "appeared"] == (8, 10, 0, 0)
    assert scores.per_frame.detection_recall == 38 / 40


def test_a_wrong_label_is_no_detection_and_two_poolings_differ():
    truth = e.two_days()
    monday_only = {"plant-1": range(8, 10)}

    def look(object_id, state, second):
        return e.Sight(visible=1.0 if second in monday_only.get(object_id, range(200)) else 0.29)

    traversals = [
        e.traversal("monday", 0, 9, truth.objects, look),
        e.traversal("tuesday", 100, 109, truth.objects, look),
    ]
    truth = replace(truth, traversals=tuple(traversals))
    estimate = e.altered(e.perfect_map(truth), "plant-1", lambda instance: e.relabelled(instance, "tree"))
    scores = score_change_recall(estimate, truth)
    assert rows(scores)["plant-1", "disappeared"] == (0, 2, 0, 0)
    assert scores.per_object.detection_recall == 3 / 4
    assert scores.per_frame.detection_recall == 30 / 32


def test_a_shift_smaller_than_the_gate_must_be_noticed():
    objects = (e.thing("chair-1", e.stay((0, 0, 0), until=5), e.stay((0.25, 0, 0), since=5)),)
    changes = (e.change("moved", "chair-1", 0, 1, 5, ("monday", "monday"), 0.25),)
    truth = e.world(objects, [e.traversal("monday", 0, 9, objects)], changes=changes)
    perfect = e.perfect_map(truth)
    assert score_change_recall(perfect, truth).per_frame.change_recall == 1
    first = replace(perfect.objects[0].states[0], gone_ns=None)
    scores = score_change_recall(
        e.altered(perfect, "chair-1", lambda instance: replace(instance, states=(first,))), truth
    )
    assert rows(scores) == {("chair-1", "moved away"): (5, 5, 0, 5), ("chair-1", "moved here"): (0, 5, 0, 0)}


def test_another_thing_of_the_label_in_the_place_is_no_false_positive():
    objects = (e.thing("chair-1", e.stay((0, 0, 0), until=50)), e.thing("chair-2", e.stay((0.1, 0, 0), since=50)))
    days = ("monday", "tuesday")
    changes = (
        e.change("disappeared", "chair-1", 0, None, 50, days),
        e.change("appeared", "chair-2", None, 0, 50, days),
    )
    truth = e.world(
        objects, [e.traversal("monday", 0, 9, objects), e.traversal("tuesday", 100, 109, objects)], changes=changes
    )
    assert score_change_recall(e.perfect_map(truth), truth).per_frame.change_recall == 1


def test_changes_of_traversals_that_are_not_mapped_are_left_out():
    truth = e.two_days()
    estimate = replace(e.perfect_map(truth), keyframes_ns=truth.traversals[1].stamps_ns)
    assert score_change_recall(estimate, truth).places == ()
