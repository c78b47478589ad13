"""ScanNet's average precision: figures worked out by hand, and an implementation of its own to compare with."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.evaluation.average_precision import (
    NO_INSTANCE,
    VOID,
    InstancePrediction,
    instance_average_precision,
)

CHAIR, TABLE, FLOOR = 1, 2, 0


def scene(*parts):
    """Points of several parts, each (label, instance, count)."""
    labels = np.concatenate([np.full(count, label) for label, _, count in parts])
    instances = np.concatenate([np.full(count, instance) for _, instance, count in parts])
    return labels, instances


def predicted(first, last, confidence=0.9, label=CHAIR):
    return InstancePrediction(np.arange(first, last), label, confidence)


def figures(result):
    return result.ap, result.ap50, result.ap25


def test_without_true_instances_nothing_is_defined():
    labels, instances = scene((FLOOR, NO_INSTANCE, 200))
    result = instance_average_precision(labels, instances, [predicted(0, 200)])
    assert (figures(result), result.classes) == ((None, None, None), ())


def test_without_predictions_all_is_zero():
    labels, instances = scene((CHAIR, 7, 200))
    assert figures(instance_average_precision(labels, instances, [])) == (0, 0, 0)


def test_exact_predictions_are_perfect():
    labels, instances = scene((CHAIR, 7, 200), (TABLE, 8, 300), (FLOOR, NO_INSTANCE, 500))
    predictions = [predicted(0, 200), predicted(200, 500, label=TABLE)]
    assert figures(instance_average_precision(labels, instances, predictions)) == (1, 1, 1)


def test_a_curve_worked_out_by_hand():
    # Two chairs; one found exactly (.9), junk on the floor (.8), the other covered to 60 % (.7). IoU > .50 and > .55:
    # (recall, precision) = (.5, 1), (.5, .5), (1, 2/3); from .60 on, which 120 / 200 does not exceed: AP = .5.
    labels, instances = scene((CHAIR, 1, 200), (CHAIR, 2, 200), (FLOOR, NO_INSTANCE, 200))
    predictions = [predicted(0, 200, 0.9), predicted(400, 550, 0.8), predicted(200, 320, 0.7)]
    found_both = 0.5 * 1 + 0.5 * (1 / 2 + 2 / 3) / 2
    result = instance_average_precision(labels, instances, predictions)
    assert figures(result) == pytest.approx(((2 * found_both + 7 * 0.5) / 9, found_both, found_both))


def test_iou_must_be_strictly_greater():
    labels, instances = scene((CHAIR, 1, 200))
    assert instance_average_precision(labels, instances, [predicted(0, 100)]).ap50 == 0
    assert instance_average_precision(labels, instances, [predicted(0, 101)]).ap50 == 1


def test_a_double_is_wrong_but_only_hurts_if_it_is_as_sure():
    labels, instances = scene((CHAIR, 1, 200))
    less_sure = instance_average_precision(labels, instances, [predicted(0, 200, 0.5), predicted(0, 200, 0.9)])
    as_sure = instance_average_precision(labels, instances, [predicted(0, 200), predicted(0, 200)])
    assert (less_sure.ap50, as_sure.ap50) == (1, pytest.approx((1 + 1 / 2) / 2))


def test_a_wrong_label_finds_nothing_and_classes_without_truth_do_not_count():
    labels, instances = scene((CHAIR, 1, 200), (TABLE, 2, 200))
    predictions = [predicted(0, 200), predicted(200, 400, label=3)]
    result = instance_average_precision(labels, instances, predictions)
    assert [(precision.label, precision.ap50) for precision in result.classes] == [(CHAIR, 1), (TABLE, 0)]
    assert result.ap50 == 0.5


@pytest.mark.parametrize(("label", "ap50"), [(VOID, 1), (FLOOR, 0.75)])
def test_void_points_forgive_a_prediction_and_others_do_not(label, ap50):
    labels, instances = scene((CHAIR, 1, 200), (label, NO_INSTANCE, 200))
    predictions = [predicted(0, 200), predicted(250, 400)]
    assert instance_average_precision(labels, instances, predictions).ap50 == ap50


def test_small_true_instances_are_ignored_and_small_predictions_left_out():
    labels, instances = scene((CHAIR, 1, 200), (CHAIR, 2, 99), (FLOOR, NO_INSTANCE, 200))
    predictions = [predicted(0, 200), predicted(200, 300), predicted(300, 399)]
    result = instance_average_precision(labels, instances, predictions)
    assert (result.ap50, result.classes[0].instances) == (1, 1)


def test_shapes_are_checked():
    with pytest.raises(ValueError, match="gt_instances"):
        instance_average_precision(np.zeros(3, np.int64), np.zeros(4, np.int64), [])


MIN_POINTS = 3


@st.composite
def scenes(draw):
    """A few dozen points of up to six instances of two classes, void and floor, and predictions anywhere."""
    label_of = draw(st.lists(st.sampled_from([CHAIR, TABLE]), min_size=1, max_size=6))
    parts = [(label, k, draw(st.integers(1, 8))) for k, label in enumerate(label_of)]
    parts += [(label, NO_INSTANCE, draw(st.integers(0, 6))) for label in (VOID, FLOOR)]
    labels, instances = scene(*parts)
    order = draw(st.permutations(range(len(labels))))
    window = st.tuples(st.integers(0, len(labels)), st.integers(0, 12))
    predictions = [
        InstancePrediction(
            np.array(sorted(set(range(a, min(a + n, len(labels)))) ^ extra), np.int64), label, confidence
        )
        for (a, n), extra, label, confidence in draw(
            st.lists(
                st.tuples(
                    window,
                    st.sets(st.integers(0, len(labels) - 1), max_size=2),
                    st.sampled_from([CHAIR, TABLE, 3]),
                    st.sampled_from([0.1, 0.5, 0.9]),
                ),
                max_size=8,
            )
        )
    ]
    return labels[list(order)], instances[list(order)], [moved(prediction, order) for prediction in predictions]


def moved(prediction, order):
    where = {point: position for position, point in enumerate(order)}
    points = np.array(sorted(where[point] for point in prediction.points.tolist()), np.int64)
    return InstancePrediction(points, prediction.label, prediction.confidence)


def plain_average_precision(labels, instances, predictions, label, threshold):
    """One class at one threshold with sets and lists, and the curve summed by steps around its points, as ScanNet's
    script sums it.
    """
    true = {}
    for point, (own, instance) in enumerate(zip(labels.tolist(), instances.tolist(), strict=True)):
        if own == label and instance != NO_INSTANCE:
            true.setdefault(instance, set()).add(point)
    void = {point for point, own in enumerate(labels.tolist()) if own == VOID}
    masks = [
        (set(prediction.points.tolist()), prediction.confidence)
        for prediction in predictions
        if prediction.label == label and len(prediction.points) >= MIN_POINTS
    ]
    large = [true[k] for k in sorted(true) if len(true[k]) >= MIN_POINTS]
    if not large:
        return None

    def fits(mask, points):
        return len(mask & points) / len(mask | points) > threshold

    marks, used = [], set()
    for points in large:
        claims = [k for k, (mask, _) in enumerate(masks) if k not in used and fits(mask, points)]
        used.update(claims[:1])
        ranked = sorted((masks[k][1] for k in claims), reverse=True)
        marks += [(confidence, rank == 0) for rank, confidence in enumerate(ranked)]
    tiny = set().union(*(points for points in true.values() if len(points) < MIN_POINTS))
    for mask, confidence in masks:
        forgiven = (len(mask & void) + len(mask & tiny)) / len(mask) > threshold
        if not any(fits(mask, points) for points in true.values()) and not forgiven:
            marks.append((confidence, False))
    if not marks:
        return 0.0
    curve = []
    for cut in sorted({confidence for confidence, _ in marks}):
        kept = [right for confidence, right in marks if confidence >= cut]
        curve.append((sum(kept) / len(large), sum(kept) / len(kept)))
    curve.append((0.0, 1.0))
    recalls = [curve[0][0], *(recall for recall, _ in curve), 0.0]
    return sum(p * (recalls[k] - recalls[k + 2]) / 2 for k, (_, p) in enumerate(curve))


def mean_of_defined(values):
    defined = [value for value in values if value is not None]
    return sum(defined) / len(defined) if defined else None


@given(scenes())
def test_it_agrees_with_a_plain_implementation(case):
    labels, instances, predictions = case
    result = instance_average_precision(labels, instances, predictions, min_points=MIN_POINTS)

    def plain(threshold):
        return [plain_average_precision(labels, instances, predictions, label, threshold) for label in (CHAIR, TABLE)]

    strict = [value for k in range(9) for value in plain(0.5 + 0.05 * k)]
    expected = (mean_of_defined(strict), mean_of_defined(plain(0.5)), mean_of_defined(plain(0.25)))
    for have, want in zip(figures(result), expected, strict=True):
        assert have == (want if want is None else pytest.approx(want))
