"""mIoU, f-mIoU and accuracies: figures worked out by hand, and an implementation of its own to compare with."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.evaluation.semantics import VOID, on_voxels, score_semantics, semantic_figures
from support import evaluated as e


def values(figures):
    return figures.miou, figures.fmiou, figures.accuracy, figures.mean_accuracy


def labels(*numbers):
    return np.array(numbers, np.int64)


def test_without_points_nothing_is_defined():
    assert values(semantic_figures(labels(), labels())[0]) == (None, None, None, None)
    assert values(semantic_figures(labels(VOID, 2), labels(1, 1), without={2})[0]) == (None, None, None, None)


def test_figures_worked_out_by_hand():
    # Class 1: 2 of 3 right, 3 predicted, IoU 2/4. Class 2: 1 of 1 right, 2 predicted, IoU 1/2. Class 9 is no class.
    figures, classes = semantic_figures(labels(1, 1, 1, 2, VOID), labels(1, 1, 2, 2, 9))
    assert [
        (class_figures.label, class_figures.points, class_figures.iou, class_figures.accuracy)
        for class_figures in classes
    ] == [
        (1, 3, pytest.approx(2 / 3), pytest.approx(2 / 3)),
        (2, 1, 1 / 2, 1),
    ]
    assert values(figures) == pytest.approx(((2 / 3 + 1 / 2) / 2, (3 * 2 / 3 + 1 / 2) / 4, 3 / 4, (2 / 3 + 1) / 2))


def test_points_of_a_class_left_out_are_no_errors_of_others():
    figures, _ = semantic_figures(labels(0, 0, 1), labels(1, 1, 1), without={0})
    assert values(figures) == (1, 1, 1, 1)


@given(st.lists(st.tuples(st.integers(-1, 4), st.integers(0, 5)), max_size=60), st.sets(st.integers(0, 4), max_size=2))
def test_it_agrees_with_a_plain_implementation(points, without):
    figures, _ = semantic_figures(labels(*(t for t, _ in points)), labels(*(p for _, p in points)), without=without)
    judged = [(t, p) for t, p in points if t != VOID and t not in without]
    if not judged:
        assert values(figures) == (None,) * 4
        return
    confusion = np.zeros((6, 6))
    for t, p in judged:
        confusion[t, p] += 1
    true, hit = confusion.sum(axis=1), np.diag(confusion)
    exists = true > 0
    iou = (hit / np.maximum(true + confusion.sum(axis=0) - hit, 1))[exists]
    frequency = true[exists] / true.sum()
    expected = (iou.mean(), (iou * frequency).sum(), hit.sum() / true.sum(), (hit[exists] / true[exists]).mean())
    assert values(figures) == pytest.approx(expected)


def test_a_voxel_has_the_labels_of_most_of_its_points():
    points = np.array([[0.01, 0, 0], [0.02, 0, 0], [0.03, 0, 0], [0.06, 0, 0], [0.07, 0, 0]])
    true, predicted = on_voxels(points, labels(2, 2, 1, 3, 1), labels(VOID, 4, 4, VOID, VOID))
    assert (true.tolist(), predicted.tolist()) == ([2, 1], [4, VOID])


def test_an_empty_world_and_an_empty_map():
    nothing = e.world((), [e.traversal("monday", 0, 9, ())])
    scores = score_semantics(e.empty_map(nothing), nothing)
    assert (scores.with_background.miou, scores.voxels, scores.labels) == (None, 0, ())
    truth = replace(e.still_life(), surfaces=(e.wall(5.01),))
    scores = score_semantics(e.empty_map(truth), truth)
    background, objects = 40 * 40, 4 * 384
    assert scores.voxels == background + objects
    assert values(scores.without_background) == (0, 0, 0, 0)
    share = background / (background + objects)
    assert values(scores.with_background) == pytest.approx((share / 4, share * share, share, 1 / 4))


def test_a_perfect_map_is_perfect_even_close_to_a_wall():
    truth = replace(e.still_life(), surfaces=(e.wall(0.23), e.wall(5.01, label="window")))
    scores = score_semantics(e.perfect_map(truth), truth)
    assert values(scores.with_background) == values(scores.without_background) == (1, 1, 1, 1)
    assert (scores.background_labels, scores.confusions) == (("wall", "window"), ())


def test_a_map_of_a_part_of_the_truth_is_not_judged():
    truth = e.still_life()
    half = replace(e.perfect_map(truth), keyframes_ns=e.keyframes(truth)[:5])
    scores = score_semantics(half, truth)
    assert values(scores.with_background) == values(scores.without_background) == (None,) * 4
    assert (scores.voxels, scores.note) == (0, "not judged: the map lacks a part of monday")


def test_a_doubled_map_is_as_good_as_a_single_one():
    truth = e.still_life()
    assert values(score_semantics(e.doubled(e.perfect_map(truth)), truth).with_background) == (1, 1, 1, 1)


def test_a_mislabelled_table_costs_the_table_and_the_plant():
    truth = e.still_life()
    estimate = e.altered(e.perfect_map(truth), "table-1", lambda instance: e.relabelled(instance, "plant"))
    scores = score_semantics(estimate, truth)
    # Voxels: 768 of chairs, 384 of the plant, 384 of the table. IoU 1, 1/2, 0.
    assert values(scores.without_background) == pytest.approx((1 / 2, (768 + 192) / 1536, 1152 / 1536, 2 / 3))
    [confusion] = scores.confusions
    assert (confusion.true, confusion.predicted, confusion.voxels) == ("table", "plant", 384)


def test_a_label_that_the_truth_does_not_have_is_just_wrong():
    truth = e.still_life()
    estimate = e.altered(e.perfect_map(truth), "table-1", lambda instance: e.relabelled(instance, "desk"))
    scores = score_semantics(estimate, truth)
    assert values(scores.with_background) == pytest.approx((2 / 3, 1152 / 1536, 1152 / 1536, 2 / 3))
    assert scores.confusions[0].predicted == "another label"


def test_a_shifted_map_leaves_all_objects_to_the_background():
    truth = e.still_life()
    scores = score_semantics(e.shifted_map(e.perfect_map(truth), (0, 0, 3)), truth)
    assert values(scores.with_background) == (0, 0, 0, 0)
    assert {confusion.predicted for confusion in scores.confusions} == {"background"}
