"""Semantic consistency: what an object is called, and whether it is there at all, as beliefs updated by Bayes' rule."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from supermap_cli.mapping.class_sizes import size_log_likelihood
from supermap_cli.types.detections import Hypothesis

UNSEEN_LABEL_LIKELIHOOD = 0.05
"""P(z | L = c) for a label c that the detection did not consider: a detector's confusion is never nil."""

INDEPENDENT_LOOKS = 2.0
"""One network errs on one thing in one way: however often it looks, its word on the label counts as this many."""


@dataclass
class LabelBelief:
    """A categorical belief over labels, P(L = c | z_1..k, size) ~ P(size | c) prod P(z_i | L = c).

    A detection's likelihood of class c is its score for c, and the likelihood of a class it did not consider a small
    constant. `logs` are weighted sums of log-likelihoods, `unseen_log` that of a label never considered, `looks` the
    sum of weights; `longest_side_m` is the object's size as measured.
    """

    logs: dict[str, float] = field(default_factory=dict)
    unseen_log: float = 0.0
    looks: float = 0.0
    longest_side_m: float = 0.0
    _known: tuple[tuple[float, float], dict[str, float]] | None = field(default=None, repr=False, compare=False)

    def update(self, hypotheses: tuple[Hypothesis, ...], weight: float) -> None:
        """Take in all hypotheses of one detection."""
        scores = {each.label: each.score for each in hypotheses}
        total = max(1.0, sum(scores.values()))
        for label in scores:
            self.logs.setdefault(label, self.unseen_log)
        for label in self.logs:
            likelihood = max(scores.get(label, 0.0) / total, UNSEEN_LABEL_LIKELIHOOD)
            self.logs[label] += weight * float(np.log(likelihood))
        self.unseen_log += weight * float(np.log(UNSEEN_LABEL_LIKELIHOOD))
        self.looks += weight

    def absorb(self, other: LabelBelief) -> None:
        """Join two beliefs that turned out to be about one object."""
        labels = set(self.logs) | set(other.logs)
        self.logs = {c: self.logs.get(c, self.unseen_log) + other.logs.get(c, other.unseen_log) for c in labels}
        self.unseen_log += other.unseen_log
        self.looks += other.looks

    def probabilities(self) -> dict[str, float]:
        """The belief, summing to 1, most likely first; labels below 1 in 1000 are left out."""
        return dict(self._current())

    def _current(self) -> dict[str, float]:
        if not self.logs:
            return {}
        if self._known is None or self._known[0] != (self.looks, self.longest_side_m):
            self._known = ((self.looks, self.longest_side_m), self._posterior())
        return self._known[1]

    def _posterior(self) -> dict[str, float]:
        labels = sorted(self.logs)
        tempered = min(1.0, INDEPENDENT_LOOKS / self.looks) if self.looks > 0 else 1.0
        logs = np.array([tempered * self.logs[c] + size_log_likelihood(c, self.longest_side_m) for c in labels])
        p = np.exp(logs - logs.max())
        p /= p.sum()
        kept = sorted(((float(x), c) for x, c in zip(p, labels, strict=True) if x >= 1e-3), key=lambda t: (-t[0], t[1]))
        total = sum(x for x, _ in kept)
        return {c: x / total for x, c in kept}

    @property
    def best(self) -> str:
        """The most likely label."""
        return next(iter(self._current()))


def label_agreement(hypotheses: tuple[Hypothesis, ...], belief: Mapping[str, float]) -> float:
    """How probable it is, in [0, 1], that a detection and an object have the same label."""
    total = sum(each.score for each in hypotheses)
    return sum(each.score / total * belief.get(each.label, 0.0) for each in hypotheses) if total > 0 else 0.0


@dataclass
class Viewpoints:
    """From where an object has been seen: evidence from nearly the same place is correlated.

    A view is a cell of bearing (15 degrees in azimuth and elevation) and distance (steps of a factor of 1.5). The n-th
    look from one cell weighs n^-1/2 more than n - 1 looks: a long stare grows like the square root, not to certainty.
    """

    counts: dict[str, int] = field(default_factory=dict)

    def weight(self, camera_map: np.ndarray, centroid_map: np.ndarray) -> float:
        """The weight in (0, 1] of one more look from `camera_map` (3,); counts it."""
        ray = camera_map - centroid_map
        distance = float(np.linalg.norm(ray))
        azimuth = int(np.floor(np.degrees(np.arctan2(ray[1], ray[0])) / 15))
        elevation = int(np.floor(np.degrees(np.arcsin(np.clip(ray[2] / max(distance, 1e-6), -1, 1))) / 15))
        cell = f"{azimuth},{elevation},{int(np.floor(np.log(max(distance, 0.1)) / np.log(1.5)))}"
        n = self.counts.get(cell, 0) + 1
        self.counts[cell] = n
        return float(np.sqrt(n) - np.sqrt(n - 1))

    def absorb(self, other: Viewpoints) -> None:
        """Add another object's viewpoints."""
        for cell, n in other.counts.items():
            self.counts[cell] = self.counts.get(cell, 0) + n
