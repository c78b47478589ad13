"""Non-maximum suppression: one detection for each object, with the scores of all its labels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, IntArray
from supermap_cli.geometry.boxes import pairwise_iou

_MAX_CANDIDATES = 1000
"""Best candidates that are considered; bounds the pairwise IoU. Chosen."""
_SAME_BOX_IOU = 0.8
"""IoU from which on boxes of different classes are one object with two labels. Chosen."""


@dataclass(frozen=True)
class KeptDetections:
    """The kept detections: `index` (n,) int64 into the candidates, best first; `class_scores` (n, classes) float32,
    each the greatest of the candidates that were merged into the detection.
    """

    index: IntArray
    class_scores: Float32Array


def suppress(boxes_xyxy: Float32Array, class_scores: Float32Array, iou: float, max_detections: int) -> KeptDetections:
    """Greedy non-maximum suppression within each class, then merging of boxes that differ only in their class."""
    best_scores = class_scores.max(axis=1, initial=0)
    order = np.argsort(-best_scores, kind="stable")[:_MAX_CANDIDATES]
    overlap = pairwise_iou(boxes_xyxy[order], boxes_xyxy[order])
    labels = class_scores[order].argmax(axis=1) if class_scores.size else np.zeros(0, np.int64)
    covered = (overlap > iou) & (labels[:, None] == labels[None, :])
    keep = _greedy(covered)
    order, overlap = order[keep], overlap[np.ix_(keep, keep)]
    group = _group_same_boxes(overlap >= _SAME_BOX_IOU)
    merged = np.zeros((len(order), class_scores.shape[1]), np.float32)
    np.maximum.at(merged, group, class_scores[order])
    group_heads = np.flatnonzero(group == np.arange(len(order)))[:max_detections]
    return KeptDetections(order[group_heads].astype(np.int64), merged[group_heads])


def _greedy(covered: BoolArray) -> IntArray:
    """Indices of the kept candidates: from best to worst, each one kept removes those it covers."""
    kept = np.ones(len(covered), dtype=bool)
    for i in range(len(covered)):
        if kept[i]:
            kept[i + 1 :] &= ~covered[i, i + 1 :]
    return np.flatnonzero(kept)


def _group_same_boxes(same: BoolArray) -> IntArray:
    """(n,) for each box the index of the best box that it is the same as, or its own."""
    group = np.arange(len(same))
    for i in range(len(same)):
        if group[i] == i:
            free = same[i, i + 1 :] & (group[i + 1 :] == np.arange(i + 1, len(same)))
            group[i + 1 :][free] = i
    return group
