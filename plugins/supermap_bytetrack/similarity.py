"""Similarity of detections and tracks: IoU of buffered boxes, less a penalty for different labels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from supermap_bytetrack.kalman import BoxStates
from supermap_cli.geometry.arrays import Float32Array, FloatArray
from supermap_cli.types.detections import Hypothesis

LABEL_COST = 0.3
"""Overlap (IoU) that entirely different labels cost. Chosen: labels may not forbid a match."""


def buffered_iou(states: BoxStates, boxes_xyxy: Float32Array, buffer: float) -> FloatArray:
    """(n, m) overlap of n predicted boxes with m detected ones, both widened (C-BIoU, Yang et al. 2023).

    The margin is `buffer` times the track's size and one standard deviation of its predicted centre: at a few images a
    second from a carried camera the boxes of small objects do not touch otherwise.
    """
    predicted = states.boxes_xyxy
    margin = buffer * (predicted[:, 2:] - predicted[:, :2]) + states.centre_deviation
    detected = boxes_xyxy.astype(np.float64)
    low = np.maximum(predicted[:, None, :2], detected[None, :, :2]) - margin[:, None]
    high = np.minimum(predicted[:, None, 2:], detected[None, :, 2:]) + margin[:, None]
    shared = np.prod(np.clip(high - low, 0, None), axis=2)
    predicted_area = np.prod(predicted[:, 2:] - predicted[:, :2] + 2 * margin, axis=1)
    detected_area = np.prod(detected[None, :, 2:] - detected[None, :, :2] + 2 * margin[:, None], axis=2)
    overlap: FloatArray = shared / np.maximum(predicted_area[:, None] + detected_area - shared, 1e-9)
    return overlap


def label_distribution(hypotheses: Sequence[Hypothesis]) -> dict[str, float]:
    """The hypotheses' scores as shares that sum to 1."""
    total = sum(hypothesis.score for hypothesis in hypotheses)
    if total <= 0:
        return {hypotheses[0].label: 1.0}
    shares: dict[str, float] = {}
    for hypothesis in hypotheses:
        shares[hypothesis.label] = shares.get(hypothesis.label, 0.0) + hypothesis.score / total
    return shares


def label_agreement(tracks: Sequence[Mapping[str, float]], detections: Sequence[Mapping[str, float]]) -> FloatArray:
    """(n, m) the share, in [0, 1], that two label distributions have in common."""
    agreement = np.zeros((len(tracks), len(detections)))
    for i, track in enumerate(tracks):
        for j, detection in enumerate(detections):
            agreement[i, j] = sum(min(share, detection.get(label, 0.0)) for label, share in track.items())
    return agreement


def assign(similarity: FloatArray, overlap: FloatArray, min_overlap: float) -> list[tuple[int, int]]:
    """The pairs (track, detection) of the greatest total similarity among those that overlap enough (Kuhn 1955)."""
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - loaded when used

    allowed = (overlap >= min_overlap) & (similarity > 0)
    rows, columns = linear_sum_assignment(np.where(allowed, -similarity, 0.0))
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if allowed[i, j]]
