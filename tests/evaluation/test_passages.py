"""Whether who walks by is one track a passage: figures worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest

from supermap_cli.evaluation.estimate import EstimatedObservation
from supermap_cli.evaluation.passages import score_passages
from support import evaluated as e


def walked(*, look=lambda object_id, state, second: e.Sight()):
    """Someone walks along x at 1 m/s from second 0 to 9."""
    objects = (e.person("person-1", ((0, 9), ((0, 0), (9, 0)))),)
    return e.world(objects, [e.traversal("monday", 0, 9, objects, look)])


def track(truth, name, seconds, *, y=0.0, label="person"):
    """A map's instance that observed who walks at y = 0, `y` beside."""
    box = e.cube_box((9, y, 0.9))
    seen = tuple(EstimatedObservation(e.ns(at), np.array([at, y, 1.2])) for at in seconds)
    template = e.perfect_map(e.still_life()).objects[0]
    return replace(template, id=name, label=label, box=box, centroid=box.center, states=(), observations=seen)


def scored(truth, objects=(), doubted=()):
    return score_passages(replace(e.empty_map(truth), objects=tuple(objects), doubted=tuple(doubted)), truth)


def test_who_is_one_instance_all_the_way_is_followed_also_when_the_map_believes_in_it_no_more():
    truth = walked()
    scores = scored(truth, doubted=[track(truth, "person-1", range(10))])
    assert (scores.followed, scores.passages, scores.judged, scores.broken) == (1, 1, 1, ())


@pytest.mark.parametrize(("handed_over", "followed"), [(9, 1), (8, 0)])
def test_one_instance_must_have_nine_of_ten_observations(handed_over, followed):
    truth = walked()
    scores = scored(truth, [track(truth, "a", range(handed_over)), track(truth, "b", range(handed_over, 10))])
    assert scores.followed == followed
    assert [passage.instances for passage in scores.broken] == ([] if followed else [("a", "b")])


def test_too_few_observations_tell_nothing():
    truth = walked()
    scores = scored(truth, [track(truth, "a", (3, 5))])
    assert (scores.followed, scores.passages, scores.judged) == (None, 1, 0)
    assert scored(truth).followed is None


def test_what_lies_out_of_reach_or_is_no_person_is_of_nobody():
    truth = walked()
    others = [track(truth, "far", range(10), y=1.0), track(truth, "cart", range(10), label="cart")]
    assert scored(truth, others).judged == 0


def test_of_a_keyframe_the_nearest_observation_counts():
    truth = walked()
    scores = scored(truth, [track(truth, "ghost", range(10), y=0.4), track(truth, "a", range(10), y=0.1)])
    assert scores.followed == 1


def test_a_passage_ends_when_nobody_is_seen_for_more_than_three_seconds():
    truth = walked(look=lambda object_id, state, second: None if 3 <= second < 6 else e.Sight())
    seen = [track(truth, "a", range(3)), track(truth, "b", range(6, 10))]
    assert (scored(truth, seen).followed, scored(truth, seen).judged) == (1, 2)
    blink = walked(look=lambda object_id, state, second: None if 3 <= second < 5 else e.Sight())
    assert (scored(blink, seen).followed, scored(blink, seen).judged) == (0, 1)


def test_keyframes_that_hardly_show_the_person_are_no_passage():
    truth = walked(look=lambda object_id, state, second: e.Sight(visible=0.1))
    assert scored(truth, [track(truth, "a", range(10))]).passages == 0


def test_of_two_people_each_observation_is_of_the_nearer_one():
    objects = (e.person("p-1", ((0, 9), ((0, 0), (9, 0)))), e.person("p-2", ((0, 9), ((0, 0.5), (9, 0.5)))))
    truth = e.world(objects, [e.traversal("monday", 0, 9, objects)])
    scores = scored(truth, [track(truth, "a", range(10)), track(truth, "b", range(10), y=0.5)])
    assert (scores.followed, scores.judged) == (1, 2)


def test_of_two_people_in_one_place_nobody_can_tell_who_was_observed():
    objects = (e.person("p-1", ((0, 9), ((0, 0), (9, 0)))), e.person("p-2", ((0, 9), ((0, 0.1), (9, 3.1)))))
    truth = e.world(objects, [e.traversal("monday", 0, 9, objects)])
    swapped = [track(truth, "a", (2, 3, 4, 5)), track(truth, "b", (0,))]
    scores = scored(truth, swapped)
    assert (scores.followed, scores.judged) == (1, 1)
