"""Boxes with the scores of all phrases, as one detection for each thing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import Float32Array
from supermap_cli.geometry.suppression import suppress
from supermap_cli.types.detections import Detections, Hypothesis
from supermap_cli.types.sensing import CameraFrame

_MIN_BOX_PX = 2.0
"""Pixels: detections of a smaller width or height are left out. Chosen."""
_MIN_HYPOTHESIS_RATIO = 0.1
"""Least score of a hypothesis, relative to the best one's: what is less likely moves no belief. Chosen."""


@dataclass(frozen=True)
class PhraseCandidates:
    """Boxes a network proposes, before suppression.

    `boxes_xyxy` (n, 4) float32 pixels of the image; `scores` (n, phrases) float32, 0 for a phrase that the box's pass
    did not ask for.
    """

    boxes_xyxy: Float32Array
    scores: Float32Array

    def above(self, score_floor: float) -> PhraseCandidates:
        """Those whose best phrase reaches the floor."""
        likely = self.scores.max(axis=1, initial=0) >= score_floor
        return PhraseCandidates(self.boxes_xyxy[likely], self.scores[likely])


def joined(passes: Sequence[PhraseCandidates]) -> PhraseCandidates:
    """The candidates of all passes over an image."""
    return PhraseCandidates(
        np.concatenate([each.boxes_xyxy for each in passes]), np.concatenate([each.scores for each in passes])
    )


def to_detections(
    frame: CameraFrame, found: PhraseCandidates, phrases: Sequence[str], *, iou: float, max_detections: int
) -> Detections:
    """One detection for each thing, best first, with all its likely phrases as hypotheses."""
    height, width = frame.rgb.shape[:2]
    boxes = np.clip(found.boxes_xyxy, 0, np.array([width, height, width, height], np.float32))
    large = ((boxes[:, 2:] - boxes[:, :2]) >= _MIN_BOX_PX).all(axis=1)
    boxes, scores = boxes[large], found.scores[large]
    kept = suppress(boxes, scores, iou, max_detections)
    hypotheses = tuple(_hypotheses(row, phrases) for row in kept.class_scores)
    best = np.array([labels[0].score for labels in hypotheses], np.float32)
    return Detections(frame.stamp_ns, boxes[kept.index], best, hypotheses, (None,) * len(best), frame.camera_id)


def to_pixels(boxes: Float32Array, image_size: tuple[int, int]) -> Float32Array:
    """Boxes (n, 4) as centre and size from 0 to 1 -> xyxy in pixels of an image of (height, width)."""
    height, width = image_size
    half = boxes[:, 2:] / 2
    corners = np.concatenate([boxes[:, :2] - half, boxes[:, :2] + half], axis=1)
    return np.asarray(corners * np.array([width, height, width, height], np.float32), np.float32)


def _hypotheses(scores: Float32Array, phrases: Sequence[str]) -> tuple[Hypothesis, ...]:
    """The likely phrases, best first."""
    order = np.argsort(-scores, kind="stable")
    floor = scores[order[0]] * _MIN_HYPOTHESIS_RATIO
    return tuple(Hypothesis(phrases[i], min(float(scores[i]), 1.0)) for i in order if scores[i] >= floor)
