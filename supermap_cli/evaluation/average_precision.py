"""Average precision of instance segmentation on points, by ScanNet's definition; works on any labelled point set.

Source: ScanNet's BenchmarkScripts/3d_evaluation/evaluate_semantic_instance.py (Dai et al., CVPR 2017), after the
Cityscapes and COCO evaluations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.evaluation.shares import mean
from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray, check_shape

IOU_THRESHOLDS = (0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9)
"""IoU thresholds that AP is the mean over: the script's np.arange(0.5, 0.95, 0.05), which ends at .90."""

LOOSE_IOU_THRESHOLD = 0.25
"""IoU threshold of AP25 (the script's `overlaps`)."""
MIN_POINTS = 100
"""True instances of fewer points are ignored, predictions of fewer left out (the script's `min_region_sizes`)."""

VOID = -1
"""Label of points that are not scored: a prediction that lies mostly there is neither right nor wrong."""

NO_INSTANCE = -1
"""Instance id of points that belong to no instance."""


@dataclass(frozen=True)
class InstancePrediction:
    """A predicted instance: the indices (m,) of its points, each once, its label, and a confidence that ranks it."""

    points: IntArray
    label: int
    confidence: float


@dataclass(frozen=True)
class ClassPrecision:
    """The average precision of one class over its `instances` true instances (of `MIN_POINTS` points at least)."""

    label: int
    instances: int
    ap: float
    ap50: float
    ap25: float


@dataclass(frozen=True)
class AveragePrecision:
    """Means over the classes that have true instances; `None` where no class has."""

    ap: float | None
    ap50: float | None
    ap25: float | None
    classes: tuple[ClassPrecision, ...]


def instance_average_precision(
    gt_labels: IntArray,
    gt_instances: IntArray,
    predictions: Sequence[InstancePrediction],
    *,
    min_points: int = MIN_POINTS,
) -> AveragePrecision:
    """AP (mean over IoU thresholds .50, .55, ..., .90), AP50 and AP25 of predicted instances on n points.

    `gt_labels` (n,) is each point's class, `VOID` where it is not scored; `gt_instances` (n,) the id of its instance,
    `NO_INSTANCE` for what belongs to none (a prediction there is wrong). Several scenes: put their points one after the
    other and number all instances apart.

    Class by class and threshold by threshold, a true instance is found by a prediction of its class with IoU *strictly*
    greater; of several, the most confident is right and the others are wrong. A prediction that overlaps no true
    instance of its class by more than the threshold is wrong, unless more than that share of its points is void or
    lies in too small true instances of its class. Precision and recall follow from all confidences as cuts; AP is the
    area under them by the trapezoid rule, from (recall 0, precision 1). Predictions of a class without true instances
    count nowhere. That is what ScanNet's script does.
    """
    check_shape("gt_labels", gt_labels, (None,))
    check_shape("gt_instances", gt_instances, (len(gt_labels),))
    scored = [prediction for prediction in predictions if len(prediction.points) >= max(min_points, 1)]
    classes = []
    for label in np.unique(gt_labels[(gt_labels != VOID) & (gt_instances != NO_INSTANCE)]).tolist():
        overlaps = _overlaps(
            gt_labels, gt_instances, [prediction for prediction in scored if prediction.label == label], label
        )
        large = overlaps.true_sizes >= min_points
        if large.any():
            ap25, *rest = (
                _average_precision(overlaps, large, threshold) for threshold in (LOOSE_IOU_THRESHOLD, *IOU_THRESHOLDS)
            )
            classes.append(ClassPrecision(label, int(large.sum()), sum(rest) / len(rest), rest[0], ap25))
    return AveragePrecision(
        mean(precision.ap for precision in classes),
        mean(precision.ap50 for precision in classes),
        mean(precision.ap25 for precision in classes),
        tuple(classes),
    )


@dataclass(frozen=True)
class _Overlaps:
    """Predictions (p) and true instances (t) of one class: `shared` (p, t) points, their sizes, how much is void."""

    shared: IntArray
    iou: FloatArray
    confidences: FloatArray
    predicted_sizes: IntArray
    true_sizes: IntArray
    void: IntArray


def _overlaps(
    gt_labels: IntArray, gt_instances: IntArray, predictions: Sequence[InstancePrediction], label: int
) -> _Overlaps:
    of_class = (gt_labels == label) & (gt_instances != NO_INSTANCE)
    ids, numbers = np.unique(gt_instances[of_class], return_inverse=True)
    number_of_point = np.full(len(gt_labels), len(ids))
    number_of_point[of_class] = numbers
    shared = np.array(
        [np.bincount(number_of_point[prediction.points], minlength=len(ids) + 1)[:-1] for prediction in predictions],
        np.int64,
    ).reshape(len(predictions), len(ids))
    predicted_sizes = np.array([len(prediction.points) for prediction in predictions], np.int64)
    true_sizes = np.bincount(numbers, minlength=len(ids))
    return _Overlaps(
        shared=shared,
        iou=shared / (predicted_sizes[:, None] + true_sizes[None, :] - shared),
        confidences=np.array([prediction.confidence for prediction in predictions], np.float64),
        predicted_sizes=predicted_sizes,
        true_sizes=true_sizes,
        void=np.array([(gt_labels[prediction.points] == VOID).sum() for prediction in predictions], np.int64),
    )


def _average_precision(overlaps: _Overlaps, large: BoolArray, threshold: float) -> float:
    """The area under the precision-recall curve of one class at one threshold."""
    right, wrong = _classify_predictions(overlaps, large, threshold)
    confidences = np.array([*right, *wrong])
    is_right = np.arange(len(confidences)) < len(right)
    cuts = np.unique(confidences)[::-1]
    kept = confidences[None, :] >= cuts[:, None]
    found = (kept & is_right).sum(axis=1)
    precision = np.concatenate([[1.0], found / kept.sum(axis=1)])
    recall = np.concatenate([[0.0], found / large.sum()])
    return float((np.diff(recall) * (precision[1:] + precision[:-1]) / 2).sum())


def _classify_predictions(overlaps: _Overlaps, large: BoolArray, threshold: float) -> tuple[list[float], list[float]]:
    """The confidences of right and of wrong predictions.

    A prediction that could find two true instances (below IoU .5 only) finds the first.
    """
    enough = overlaps.iou > threshold
    assigned = np.zeros(len(overlaps.confidences), dtype=bool)
    right, wrong = [], []
    for true in np.flatnonzero(large):
        candidates = np.flatnonzero(enough[:, true] & ~assigned)
        if len(candidates):
            assigned[candidates[0]] = True
            *others, best = sorted(overlaps.confidences[candidates].tolist())
            right.append(best)
            wrong.extend(others)
    ignored = overlaps.void + overlaps.shared[:, ~large].sum(axis=1)
    unmatched = ~enough.any(axis=1) & (ignored / overlaps.predicted_sizes <= threshold)
    return right, wrong + overlaps.confidences[unmatched].tolist()
