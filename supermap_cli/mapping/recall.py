"""How often the detector finds what is there: learnt from the run itself, so that a miss weighs what it should."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from supermap_cli.geometry.arrays import FloatArray

AREA_BINS_PX = (0.0004, 0.0015, 0.006, 0.025, 0.1)
"""Borders of the visible area as a share of the image, a factor of four apart."""

CLUTTER_RECALL = 0.35
"""P(a detector fires once more at what fooled it) / P(it fires at a thing seen like that): its errors come back."""

LEAST_DETECTION, MOST_DETECTION = -0.3, 2.5
"""Bounds of one detection's word: a hesitant one says less against a thing than silence does; and none is proof."""


@dataclass
class RecallModel:
    """Beta-Bernoulli detection rates by class, visible area and truncation.

    Every keyframe in which a confirmed object was observable is a trial. A cell starts as its class's overall rate, and
    a class as the prior (a beta distribution worth `PRIOR_TRIALS` trials).
    """

    hits: dict[str, float] = field(default_factory=dict)
    trials: dict[str, float] = field(default_factory=dict)

    PRIOR_RATE = 0.5
    PRIOR_TRIALS = 4.0

    @staticmethod
    def cell(label: str, area_share: float, truncated: bool) -> str:
        """The cell of one opportunity."""
        return f"{label}|{int(np.searchsorted(AREA_BINS_PX, area_share))}|{int(truncated)}"

    def expected(self, label: str, area_share: float, truncated: bool) -> float:
        """P(detected | there, observable), in (0.02, 0.95)."""
        rate = self._posterior(label, self.PRIOR_RATE)
        rate = self._posterior(self.cell(label, area_share, truncated), rate)
        return float(np.clip(rate, 0.02, 0.95))

    def _posterior(self, key: str, prior: float) -> float:
        trials = self.trials.get(key, 0.0)
        return (self.hits.get(key, 0.0) + prior * self.PRIOR_TRIALS) / (trials + self.PRIOR_TRIALS)

    def record(self, label: str, area_share: float, truncated: bool, detected: bool, weight: float) -> None:
        """Count one opportunity."""
        for key in (label, self.cell(label, area_share, truncated)):
            self.trials[key] = self.trials.get(key, 0.0) + weight
            self.hits[key] = self.hits.get(key, 0.0) + weight * detected


SCORE_BINS = 10
PRIOR_SCORES = 100.0
"""Detections that the prior on the scores is worth."""

_CENTERS = (np.arange(SCORE_BINS) + 0.5) / SCORE_BINS
_REAL_PRIOR = _CENTERS**2 * (1 - _CENTERS)
_CLUTTER_PRIOR = _CENTERS**0.5 * (1 - _CENTERS) ** 4


@dataclass
class ScoreModel:
    """How a detector scores what is there, and what is not: learnt from the run, for a small network's 0.4 may be
    another's 0.8.

    Histograms of the scores of detections of objects believed in firmly, and of those of tentative objects that were
    forgotten. The priors are beta densities, Beta(3, 2) and Beta(1.5, 5).
    """

    real: list[float] = field(default_factory=lambda: [0.0] * SCORE_BINS)
    clutter: list[float] = field(default_factory=lambda: [0.0] * SCORE_BINS)

    def record_real(self, score: float) -> None:
        """Count a detection of an object believed in firmly."""
        self.real[score_bin(score)] += 1

    def record_clutter(self, scores: Iterable[float]) -> None:
        """Count the detections of an object that was none."""
        for score in scores:
            self.clutter[score_bin(score)] += 1

    def detection_log_ratio(self, score: float, *, again: bool) -> float:
        """Log P(a detection of this score | a thing is there) / P(... | something fooled the detector); `again`: it is
        not the first there.
        """
        k = score_bin(score)
        real = (self.real[k] + PRIOR_SCORES * _share(_REAL_PRIOR, k)) / (sum(self.real) + PRIOR_SCORES)
        clutter = (self.clutter[k] + PRIOR_SCORES * _share(_CLUTTER_PRIOR, k)) / (sum(self.clutter) + PRIOR_SCORES)
        fires = -np.log(CLUTTER_RECALL) if again else 0.0
        return float(np.clip(np.log(real / clutter) + fires, LEAST_DETECTION, MOST_DETECTION))


def score_bin(score: float) -> int:
    """The histogram's bin of a score in [0, 1]."""
    return min(int(score * SCORE_BINS), SCORE_BINS - 1)


def _share(density: FloatArray, k: int) -> float:
    return float(density[k] / density.sum())


def miss_log_ratio(expected_recall: float) -> float:
    """Log P(not detected | there) / P(not detected | something fooled it); near 0 where the detector is blind."""
    return float(np.log((1 - expected_recall) / (1 - CLUTTER_RECALL * expected_recall)))
