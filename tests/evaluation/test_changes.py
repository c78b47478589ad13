"""Reported changes against true ones: figures worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest

from supermap_cli.evaluation.changes import score_changes
from supermap_cli.evaluation.estimate import EstimatedChange
from support import evaluated as e


def counts(score):
    return score.found, score.false, score.missed


def report(kind, object_id, before, after):
    place = lambda at: None if at is None else np.array(at, np.float64)  # noqa: E731
    return EstimatedChange(
        kind, e.instance_id(object_id), object_id.rsplit("-", 1)[0], place(before), place(after), None
    )


def test_one_traversal_has_no_changes_to_report():
    truth = e.still_life()
    scores = score_changes(e.perfect_map(truth), truth)
    assert (scores.between, scores.overall, scores.moved, scores.lenient) == (None, None, None, None)


def test_a_perfect_diff_is_perfect():
    truth = e.two_days()
    scores = score_changes(e.perfect_map(truth), truth)
    assert scores.between == ("monday", "tuesday")
    assert counts(scores.overall) == counts(scores.lenient) == (3, 0, 0)
    assert [counts(of_kind) for of_kind in (scores.appeared, scores.disappeared, scores.moved)] == [(1, 0, 0)] * 3
    assert scores.overall.f1 == 1


def test_an_empty_diff_misses_all():
    truth = e.two_days()
    scores = score_changes(e.empty_map(truth), truth)
    assert counts(scores.overall) == (0, 0, 3)
    assert (scores.overall.precision, scores.overall.recall) == (None, 0)
    assert [change.object_id for change in scores.missed] == ["plant-1", "cart-1", "bag-1"]


def test_a_doubled_report_is_right_once():
    truth = e.two_days()
    estimate = e.perfect_map(truth)
    scores = score_changes(replace(estimate, changes=estimate.changes * 2), truth)
    assert counts(scores.overall) == (3, 3, 0)
    assert scores.overall.f1 == pytest.approx(6 / 9)


@pytest.mark.parametrize(("offset_m", "right"), [(0.49, 1), (0.51, 0)])
def test_a_report_must_lie_within_half_a_metre_at_both_ends(offset_m, right):
    truth = e.two_days()
    moved = report("moved", "bag-1", (4, 0, 0.2), (4 + offset_m, 3, 0.2))
    scores = score_changes(replace(e.perfect_map(truth), changes=(moved,)), truth)
    assert counts(scores.moved) == (right, 1 - right, 1 - right)


def test_a_move_reported_as_two_changes_is_missed_but_leniently_found():
    truth = e.two_days()
    estimate = e.perfect_map(truth)
    halves = (report("disappeared", "bag-1", (4, 0, 0.2), None), report("appeared", "bag-2", None, (4, 3, 0.2)))
    scores = score_changes(replace(estimate, changes=(*estimate.changes[:2], *halves)), truth)
    assert counts(scores.overall) == (2, 2, 1)
    assert counts(scores.moved) == (0, 0, 1)
    assert counts(scores.appeared) == counts(scores.disappeared) == (1, 1, 0)
    assert scores.missed[0].reported_as_two
    assert counts(scores.lenient) == (3, 0, 0)


def test_a_static_object_reported_gone_is_false_and_counted_as_static():
    truth = e.two_days()
    estimate = e.perfect_map(truth)
    gone = report("disappeared", "chair-1", (0, 0, 0.2), None)
    ghost = report("appeared", "ghost-1", None, (9, 9, 9))
    scores = score_changes(replace(estimate, changes=(*estimate.changes, gone, ghost)), truth)
    assert counts(scores.overall) == (3, 2, 0)
    assert scores.static_reported == 1
    assert [(change.instance_id, change.unchanged_object) for change in scores.false] == [
        ("map-chair-1", "chair-1"),
        ("map-ghost-1", None),
    ]


def test_a_report_without_a_place_lies_where_its_instance_lies():
    truth = e.two_days()
    scores = score_changes(
        replace(e.perfect_map(truth), changes=(report("disappeared", "plant-1", None, None),)), truth
    )
    assert counts(scores.disappeared) == (1, 0, 0)


def test_what_the_images_do_not_show_is_neither_missed_nor_false():
    truth = e.two_days()
    hidden = lambda object_id, state, second: None if object_id == "plant-1" else e.Sight()  # noqa: E731
    tuesday = e.traversal("tuesday", 100, 109, truth.objects, hidden)
    truth = replace(truth, traversals=(truth.traversals[0], tuesday))
    for changes in (e.perfect_map(truth).changes, e.perfect_map(truth).changes[1:]):
        scores = score_changes(replace(e.perfect_map(truth), changes=changes), truth)
        assert counts(scores.overall) == (2, 0, 0)
        assert scores.unobservable == ("plant-1 disappeared",)


def test_what_came_and_went_within_a_traversal_is_not_judged():
    box = e.thing("box-1", e.stay((5, 5, 0.2), since=3, until=6))
    objects = (*e.two_days().objects, box)
    traversals = [e.traversal("monday", 0, 9, objects), e.traversal("tuesday", 100, 109, objects)]
    truth = replace(e.two_days(), objects=objects, traversals=tuple(traversals))
    estimate = e.perfect_map(truth)
    gone = report("disappeared", "box-1", (5, 5, 0.2), None)
    assert counts(score_changes(replace(estimate, changes=(*estimate.changes, gone)), truth).overall) == (3, 0, 0)
