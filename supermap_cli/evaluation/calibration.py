"""Whether the map's confidences are probabilities: of the instances that it is 0.8 sure of, eight in ten are right."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from supermap_cli.evaluation.shares import mean, share
from supermap_cli.geometry.arrays import FloatArray

BINS = 10
"""Bins of equal width over [0, 1], as many as Guo et al. mostly take for a reliability diagram."""

Rated = tuple[float, bool]
"""The confidence of an instance, and whether it is right."""


@dataclass(frozen=True)
class ReliabilityBin:
    """The instances whose confidence lies in [low, high), in the last bin [low, high]; `None` where there are none."""

    low: float
    high: float
    count: int
    mean_confidence: float | None
    share_right: float | None


@dataclass(frozen=True)
class Reliability:
    """A reliability diagram as numbers, and the expected calibration error of Guo et al. 2017 ("On calibration of
    modern neural networks"): the mean over all instances of |share right - mean confidence| of their bin; `None`
    where there are no instances.
    """

    count: int
    mean_confidence: float | None
    share_right: float | None
    expected_calibration_error: float | None
    bins: tuple[ReliabilityBin, ...]


def reliability(rated: Iterable[Rated]) -> Reliability:
    """The reliability of confidences in [0, 1]. Raises `ValueError` for any that lies outside."""
    pairs = list(rated)
    confidence = np.array([pair[0] for pair in pairs], np.float64)
    right = np.array([pair[1] for pair in pairs], np.float64)
    if not bool(np.all((confidence >= 0) & (confidence <= 1))):
        raise ValueError("a confidence lies in [0, 1]")
    borders = np.arange(BINS + 1) / BINS
    numbers = np.minimum(np.searchsorted(borders, confidence, side="right") - 1, BINS - 1)
    bins = tuple(
        _bin(float(borders[k]), float(borders[k + 1]), confidence[numbers == k], right[numbers == k])
        for k in range(BINS)
    )
    gaps = [abs(float((right - confidence)[numbers == k].sum())) for k in range(BINS)]
    return Reliability(
        count=len(pairs),
        mean_confidence=mean(confidence.tolist()),
        share_right=mean(right.tolist()),
        expected_calibration_error=share(sum(gaps), len(pairs)),
        bins=bins,
    )


def _bin(low: float, high: float, confidence: FloatArray, right: FloatArray) -> ReliabilityBin:
    return ReliabilityBin(low, high, len(confidence), mean(confidence.tolist()), mean(right.tolist()))
