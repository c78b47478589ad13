"""How often the detector finds what is there, and how it scores it: learnt from the run itself.

No counterpart in the paper, where a missed detection always negates; here it weighs by how likely it was.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class RecallParameters:
    """Priors of a detector, bounds of one detection's word, and which objects teach the rest."""

    area_bins: tuple[float, ...] = parameter(
        (0.0004, 0.0015, 0.006, 0.025, 0.1),
        "1",
        "borders of the visible area as a share of the image, a factor of four apart",
        "COCO's small and medium, carried on",
    )
    prior_rate: float = parameter(0.5, "1", "P(detected | there, observable) before any trial", TUNED, at_most=1.0)
    prior_trials: float = parameter(4.0, "1", "trials that the prior is worth", TUNED, at_least=1e-3)
    min_rate: float = parameter(0.02, "1", "least P(detected | there)", TUNED, at_most=1.0)
    max_rate: float = parameter(0.95, "1", "greatest P(detected | there): no miss is proof", TUNED, at_most=0.999)
    sure_log_odds: float = parameter(
        4.0, "1", "only objects believed this firmly teach how often the detector misses what is there", TUNED
    )
    own_trials: float = parameter(
        2.0,
        "1",
        "trials that the class's rate is worth for one thing: at 2, some are found in nearly every image and others "
        "hardly ever",
        "even beta prior",
        at_least=0.1,
    )
    clutter_recall: float = parameter(
        0.35,
        "1",
        "P(a detector fires once more at what fooled it, within the time its errors last) / P(it fires at a thing seen "
        "like that): its errors come back",
        TUNED,
        at_least=1e-3,
        at_most=1.0,
    )
    later_clutter_recall: float = parameter(
        0.05,
        "1",
        "the same ratio after that time: few things fool a detector for long (on the desk of TUM fr1_rpy, what was "
        "found again later was real)",
        TUNED,
        at_least=1e-3,
        at_most=1.0,
    )
    min_detection: float = parameter(
        -0.3, "1", "least log ratio of a detection: a hesitant one says less against an object than a miss does", TUNED
    )
    max_detection: float = parameter(2.5, "1", "greatest log ratio of a detection's score: none is proof", TUNED)
    prior_scores: float = parameter(100.0, "1", "detections that the prior on the scores is worth", TUNED, at_least=1)


DEFAULT = RecallParameters()


@dataclass(frozen=True)
class FoundBy:
    """In how many looks one detector found an object, and missed it where it could have found it; looks from nearly one
    place, or in quick succession, count as fewer.
    """

    found: float = 0.0
    missed: float = 0.0

    def __add__(self, other: FoundBy) -> FoundBy:
        return FoundBy(self.found + other.found, self.missed + other.missed)


@dataclass
class RecallModel:
    """Beta-Bernoulli detection rates by class, visible area and truncation.

    Every keyframe in which a confirmed object was observable is a trial. A cell starts as its class's overall rate, and
    a class as the prior (a beta distribution worth `prior_trials` trials). `detector` is whose rates these are: equal
    for detectors that err alike, empty if nobody knows.
    """

    hits: dict[str, float] = field(default_factory=dict)
    trials: dict[str, float] = field(default_factory=dict)
    detector: str = ""
    parameters: RecallParameters = field(default=DEFAULT, repr=False, compare=False)

    def cell(self, label: str, area_share: float, truncated: bool) -> str:
        """The cell of one opportunity."""
        return f"{label}|{int(np.searchsorted(self.parameters.area_bins, area_share))}|{int(truncated)}"

    def expected(self, label: str, area_share: float, truncated: bool) -> float:
        """P(detected | there, observable); never certain."""
        rate = self._posterior(label, self.parameters.prior_rate)
        rate = self._posterior(self.cell(label, area_share, truncated), rate)
        return float(np.clip(rate, self.parameters.min_rate, self.parameters.max_rate))

    def rate_of_class(self, label: str) -> float:
        """P(detected | there, observable) of a class, however its things look."""
        rate = self._posterior(label, self.parameters.prior_rate)
        return float(np.clip(rate, self.parameters.min_rate, self.parameters.max_rate))

    def own_rate(self, rate: float, found_by: Mapping[str, FoundBy]) -> float:
        """P(detected | there) of one object by the running detector, of a class that it finds at `rate`.

        Beta-Bernoulli about the class's rate: things of one class differ by pose, light and place, and what a detector
        mostly missed it misses again, whatever another one finds.
        """
        own, worth = found_by.get(self.detector, FoundBy()), self.parameters.own_trials
        own_rate = (worth * rate + own.found) / (worth + own.found + own.missed)
        return float(np.clip(own_rate, self.parameters.min_rate, self.parameters.max_rate))

    def by_class(self) -> dict[str, list[float]]:
        """How often things of each class were found, and how often they could have been."""
        return {key: [self.hits.get(key, 0.0), self.trials[key]] for key in sorted(self.trials) if "|" not in key}

    def _posterior(self, key: str, prior: float) -> float:
        trials, prior_trials = self.trials.get(key, 0.0), self.parameters.prior_trials
        return (self.hits.get(key, 0.0) + prior * prior_trials) / (trials + prior_trials)

    def record(self, label: str, area_share: float, truncated: bool, detected: bool, weight: float) -> None:
        """Count one opportunity."""
        for key in (label, self.cell(label, area_share, truncated)):
            self.trials[key] = self.trials.get(key, 0.0) + weight
            self.hits[key] = self.hits.get(key, 0.0) + weight * detected


SCORE_BINS = 10
"""Bins of the histograms of scores in [0, 1]: the prior's densities are evaluated at their centres."""

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
    parameters: RecallParameters = field(default=DEFAULT, repr=False, compare=False)

    def record_real(self, score: float) -> None:
        """Count a detection of an object believed in firmly."""
        self.real[score_bin(score)] += 1

    def record_clutter(self, scores: Iterable[float]) -> None:
        """Count the detections of an object that was none."""
        for score in scores:
            self.clutter[score_bin(score)] += 1

    def detection_log_ratio(self, score: float, returns: float = 0.0, before: int = 0) -> float:
        """Log P(a detection of this score | a thing is there) / P(... | something fooled the detector).

        `returns` is that of its firing there at all (`return_log_ratio`), `before` the number of detections there
        before: the scores of one thing are alike, so that n say what sqrt(n) independent ones would.
        """
        k, prior = score_bin(score), self.parameters.prior_scores
        real = (self.real[k] + prior * _share(_REAL_PRIOR, k)) / (sum(self.real) + prior)
        clutter = (self.clutter[k] + prior * _share(_CLUTTER_PRIOR, k)) / (sum(self.clutter) + prior)
        by_score = min(float(np.log(real / clutter)), self.parameters.max_detection)
        return max(by_score / float(np.sqrt(1 + before)) + returns, self.parameters.min_detection)


def score_bin(score: float) -> int:
    """The histogram's bin of a score in [0, 1]."""
    return min(int(score * SCORE_BINS), SCORE_BINS - 1)


def _share(density: FloatArray, k: int) -> float:
    return float(density[k] / density.sum())


def return_log_ratio(own: float, rate: float, *, soon: bool, parameters: RecallParameters = DEFAULT) -> float:
    """Log P(detected once more | there) / P(... | something fooled the detector), not below 0.

    `own` is the rate at which the thing is found, if it is one, and `rate` that of its class; `soon` after it was
    detected, what fooled the detector does so still.
    """
    clutter = parameters.clutter_recall if soon else parameters.later_clutter_recall
    return max(float(np.log(own / (clutter * rate))), 0.0)


def miss_log_ratio(
    own: float, rate: float | None = None, *, soon: bool = True, parameters: RecallParameters = DEFAULT
) -> float:
    """Log P(not detected | there) / P(not detected | something fooled it), not above 0; near 0 where the detector is
    blind. `own`, `rate` and `soon` are those of `return_log_ratio`.
    """
    rate = own if rate is None else rate
    clutter = parameters.clutter_recall if soon else parameters.later_clutter_recall
    return min(float(np.log((1 - min(own, rate)) / (1 - clutter * rate))), 0.0)
