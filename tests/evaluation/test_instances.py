"""ScanNet's figures of whole maps: worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest

from supermap_cli.evaluation.instances import score_instances
from support import evaluated as e


def figures(scores):
    return scores.ap, scores.ap50, scores.ap25


def regardless(scores):
    return scores.regardless_ap, scores.regardless_ap50, scores.regardless_ap25


def test_an_empty_world_leaves_everything_undefined():
    truth = e.world((), [e.traversal("monday", 0, 9, ())])
    scores = score_instances(e.empty_map(truth), truth)
    assert figures(scores) == regardless(scores) == (None, None, None)


def test_an_empty_map_scores_nothing_and_a_perfect_one_everything():
    truth = e.still_life()
    assert figures(score_instances(e.empty_map(truth), truth)) == (0, 0, 0)
    perfect = score_instances(e.perfect_map(truth), truth)
    assert figures(perfect) == regardless(perfect) == (1, 1, 1)
    assert [(figures.label, figures.instances) for figures in perfect.labels] == [
        ("chair", 2),
        ("plant", 1),
        ("table", 1),
    ]


def test_only_what_is_present_counts_as_things_stand_at_the_end():
    truth = e.two_days()
    scores = score_instances(e.perfect_map(truth), truth)
    assert figures(scores) == (1, 1, 1)
    assert [obj.object_id for obj in scores.objects] == ["chair-1", "table-1", "cart-1", "bag-1"]


def test_a_map_that_is_beside_itself_scores_nothing():
    truth = e.still_life()
    assert figures(score_instances(e.shifted_map(e.perfect_map(truth), (1, 0, 0)), truth)) == (0, 0, 0)


def test_a_wrong_label_costs_its_class_but_no_shape():
    truth = e.still_life()
    estimate = e.altered(e.perfect_map(truth), "table-1", lambda instance: e.relabelled(instance, "desk"))
    scores = score_instances(estimate, truth)
    assert figures(scores) == pytest.approx((2 / 3,) * 3)
    assert regardless(scores) == (1, 1, 1)
    assert [obj.label_right for obj in scores.objects] == [True, True, False, True]


def test_a_thing_held_twice_is_shared_out():
    truth = e.still_life()
    scores = score_instances(e.doubled(e.perfect_map(truth)), truth)
    assert figures(scores) == (0, 0, 1)
    assert [obj.iou for obj in scores.objects] == [0.5] * 4


def test_two_things_held_to_be_one_are_half_found():
    truth = e.still_life()
    estimate = e.perfect_map(truth)
    first, second, *others = estimate.objects
    both = replace(first, points=np.concatenate([first.points, second.points]))
    scores = score_instances(e.with_objects(estimate, [both, *others]), truth)
    # Chairs: IoU .5 with each, so one of two is found above .25 and none above .50.
    assert figures(scores) == pytest.approx((2 / 3, 2 / 3, (0.5 + 1 + 1) / 3))


def test_a_wall_close_by_costs_nothing_and_an_instance_on_the_wall_is_wrong():
    truth = replace(e.still_life(), surfaces=(e.wall(0.23), e.wall(5.0)))
    estimate = e.perfect_map(truth)
    assert figures(score_instances(estimate, truth)) == (1, 1, 1)
    on_wall = replace(
        estimate.objects[0], id="map-ghost", confidence=0.95, points=e.wall(5.0).points_world.astype(float)
    )
    scores = score_instances(e.with_objects(estimate, [*estimate.objects, on_wall]), truth)
    # Chairs: the surest is wrong: (recall, precision) = (0, 0), (1, 2/3).
    assert scores.ap50 == pytest.approx(((0 + 2 / 3) / 2 + 2) / 3)


def test_bleeding_into_the_wall_lowers_the_iou():
    truth = replace(e.still_life(), surfaces=(e.wall(5.0),))
    wall = e.wall(5.0).points_world.astype(float)
    bleed = lambda instance: replace(instance, points=np.concatenate([instance.points, wall]))  # noqa: E731
    scores = score_instances(e.altered(e.perfect_map(truth), "table-1", bleed), truth)
    assert scores.objects[2].iou == pytest.approx(384 / (384 + 6400))


def test_things_that_no_image_showed_well_are_void():
    objects = e.still_life().objects
    look = lambda object_id, state, second: e.Sight(pixels=99 if object_id == "plant-1" else 1000)  # noqa: E731
    truth = e.world(objects, [e.traversal("monday", 0, 9, objects, look)])
    mistaken = e.altered(e.perfect_map(truth), "plant-1", lambda instance: e.relabelled(instance, "chair"))
    scores = score_instances(mistaken, truth)
    assert figures(scores) == regardless(scores) == (1, 1, 1)


def test_a_map_of_a_part_of_the_truth_is_not_judged():
    truth = e.still_life()
    half = replace(e.perfect_map(truth), keyframes_ns=e.keyframes(truth)[:5])
    scores = score_instances(half, truth)
    assert figures(scores) == regardless(scores) == (None, None, None)
    assert (scores.objects, scores.note) == ((), "not judged: the map lacks a part of monday")


def test_objects_of_few_points_are_named():
    truth = e.still_life()
    chair, *others = truth.objects
    seen = np.arange(384) < 99
    truth = replace(truth, objects=(replace(chair, surface_seen=seen), *others))
    scores = score_instances(e.perfect_map(truth), truth)
    assert scores.too_small == ("chair-1",)
    assert scores.labels[0].instances == 1
