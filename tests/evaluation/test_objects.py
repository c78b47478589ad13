"""Precision, recall and F1 of the object map: figures worked out by hand."""

from dataclasses import replace

import pytest

from supermap_cli.evaluation.objects import score_objects
from support import evaluated as e


def counts(score):
    return score.found, score.false, score.missed


def test_an_empty_world_leaves_everything_undefined():
    truth = e.world((), [e.traversal("monday", 0, 9, ())])
    scores = score_objects(e.empty_map(truth), truth)
    assert (scores.labelled.precision, scores.labelled.recall, scores.labelled.f1) == (None, None, None)
    assert (scores.label_accuracy, scores.iou, scores.centroid_error_m) == (None, None, None)


def test_an_empty_map_misses_all_and_its_precision_is_undefined():
    truth = e.still_life()
    scores = score_objects(e.empty_map(truth), truth)
    assert (scores.labelled.precision, scores.labelled.recall, scores.labelled.f1) == (None, 0, 0)
    assert [obj.id for obj in scores.missed] == ["chair-1", "chair-2", "table-1", "plant-1"]


def test_a_perfect_map_is_perfect():
    truth = e.two_days()
    scores = score_objects(e.perfect_map(truth), truth)
    assert counts(scores.labelled) == counts(scores.unlabelled) == (4, 0, 0)
    assert (scores.labelled.f1, scores.label_accuracy, scores.centroid_error_m) == (1, 1, pytest.approx(0, abs=1e-6))
    assert scores.iou == pytest.approx(1)


def test_a_doubled_map_is_half_wrong():
    truth = e.still_life()
    scores = score_objects(e.doubled(e.perfect_map(truth)), truth)
    assert counts(scores.labelled) == (4, 4, 0)
    assert scores.labelled.precision == 0.5
    assert scores.labelled.f1 == pytest.approx(2 / 3)
    assert scores.false[0].reason == "chair-1 stands there, which is map-chair-1"


@pytest.mark.parametrize(("offset_m", "found", "iou"), [(0.1, 4, 0.6), (0.29, 4, 0.11 / 0.69), (0.31, 0, None)])
def test_a_shifted_map_is_right_up_to_the_gate(offset_m, found, iou):
    truth = e.still_life()
    scores = score_objects(e.shifted_map(e.perfect_map(truth), (offset_m, 0, 0)), truth)
    assert counts(scores.labelled) == (found, 4 - found, 4 - found)
    assert scores.iou == (None if iou is None else pytest.approx(iou))
    assert scores.centroid_error_m == (None if iou is None else pytest.approx(offset_m))


def test_a_mislabelled_object_is_right_only_without_labels():
    truth = e.still_life()
    scores = score_objects(
        e.altered(e.perfect_map(truth), "table-1", lambda instance: e.relabelled(instance, "desk")), truth
    )
    assert (counts(scores.labelled), counts(scores.unlabelled)) == ((3, 1, 1), (4, 0, 0))
    assert scores.label_accuracy == 0.75
    assert scores.missed[0].reason == "map-table-1 is there, labelled desk"
    assert scores.false[0].reason == "table-1 stands there, a table"


def test_labels_differ_not_by_case():
    truth = e.still_life()
    scores = score_objects(
        e.altered(e.perfect_map(truth), "table-1", lambda instance: e.relabelled(instance, "Table")), truth
    )
    assert counts(scores.labelled) == (4, 0, 0)


def test_two_instances_between_two_chairs_are_both_used():
    objects = (e.thing("chair-1", e.stay((0, 0, 0))), e.thing("chair-2", e.stay((0.25, 0, 0))))
    truth = e.world(objects, [e.traversal("monday", 0, 9, objects)])
    first, second = e.perfect_map(truth).objects
    estimate = e.with_objects(
        e.perfect_map(truth), [e.shifted_object(first, (0.1, 0, 0)), e.shifted_object(second, (-0.4, 0, 0))]
    )
    scores = score_objects(estimate, truth)
    assert counts(scores.labelled) == (2, 0, 0)
    assert {match.object_id: match.instance_id for match in scores.matched} == {
        "chair-1": "map-chair-2",
        "chair-2": "map-chair-1",
    }


def test_what_no_image_showed_well_need_not_be_found_and_is_no_error():
    objects = e.still_life().objects
    look = lambda object_id, state, second: e.Sight(pixels=99 if object_id == "plant-1" else 1000)  # noqa: E731
    truth = e.world(objects, [e.traversal("monday", 0, 9, objects, look)])
    whole = e.perfect_map(truth)
    for estimate, ignored in ((whole, 1), (e.altered(whole, "plant-1", lambda _: None), 0)):
        scores = score_objects(estimate, truth)
        assert counts(scores.labelled) == (3, 0, 0)
        assert (scores.countable_objects, scores.ignored_objects, scores.ignored_instances) == (3, 1, ignored)


def test_a_ghost_is_false_and_an_object_held_to_be_gone_is_missed():
    truth = e.two_days()
    estimate = e.altered(e.perfect_map(truth), "plant-1", lambda instance: replace(instance, presence="present"))
    estimate = e.altered(estimate, "chair-1", lambda instance: replace(instance, presence="absent"))
    scores = score_objects(estimate, truth)
    assert [(instance.id, instance.reason) for instance in scores.false] == [
        ("map-plant-1", "plant-1 stood there and does so no more")
    ]
    assert [(obj.id, obj.reason) for obj in scores.missed] == [
        ("chair-1", "the map holds map-chair-1 to be gone from there")
    ]


def test_people_in_the_map_are_named_and_wrong():
    truth = e.still_life()
    estimate = e.perfect_map(truth)
    person = e.relabelled(e.shifted_object(replace(estimate.objects[0], id="map-person-1"), (5, 5, 0)), "Person")
    scores = score_objects(e.with_objects(estimate, [*estimate.objects, person]), truth)
    assert scores.people == ("map-person-1",)
    assert counts(scores.unlabelled) == (4, 1, 0)
