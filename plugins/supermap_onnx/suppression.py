"""From many overlapping candidates to one detection for each object, with all the labels it might bear."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, IntArray
from supermap_cli.geometry.boxes import pairwise_iou

_MOST_CANDIDATES = 1000
_SAME_BOX_IOU = 0.8
"""Two boxes of different classes that overlap like this are one thing with two names, not two things."""


@dataclass(frozen=True)
class Kept:
    """What is left: `index` (n,) int64 into the candidates, best first; `class_scores` (n, classes) float32, each the
    greatest of the candidates that were merged into the detection.
    """

    index: IntArray
    class_scores: Float32Array


def suppress(boxes_xyxy: Float32Array, class_scores: Float32Array, iou: float, most: int) -> Kept:
    """Greedy non-maximum suppression within each class, then merging of boxes that differ only in their class."""
    best_scores = class_scores.max(axis=1, initial=0)
    order = np.argsort(-best_scores, kind="stable")[:_MOST_CANDIDATES]
    overlap = pairwise_iou(boxes_xyxy[order], boxes_xyxy[order])
    labels = class_scores[order].argmax(axis=1) if class_scores.size else np.zeros(0, np.int64)
    covered = (overlap > iou) & (labels[:, None] == labels[None, :])
    keep = _greedy(covered)
    order, overlap = order[keep], overlap[np.ix_(keep, keep)]
    owner = _owners(overlap >= _SAME_BOX_IOU)
    merged = np.zeros((len(order), class_scores.shape[1]), np.float32)
    np.maximum.at(merged, owner, class_scores[order])
    owners = np.flatnonzero(owner == np.arange(len(order)))[:most]
    return Kept(order[owners].astype(np.int64), merged[owners])


def _greedy(covered: BoolArray) -> IntArray:
    """Go from the best to the worst; each one kept removes what it covers."""
    alive = np.ones(len(covered), dtype=bool)
    for i in range(len(covered)):
        if alive[i]:
            alive[i + 1 :] &= ~covered[i, i + 1 :]
    return np.flatnonzero(alive)


def _owners(same: BoolArray) -> IntArray:
    """(n,) for each box the best box that it is the same as, or itself."""
    owner = np.arange(len(same))
    for i in range(len(same)):
        if owner[i] == i:
            free = same[i, i + 1 :] & (owner[i + 1 :] == np.arange(i + 1, len(same)))
            owner[i + 1 :][free] = i
    return owner
