"""Semantic consistency: what an object is called, and whether it is there at all, as beliefs updated by Bayes' rule."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.mapping.class_sizes import size_log_likelihood
from supermap_cli.types.detections import Hypothesis

UNSEEN_LABEL_LIKELIHOOD = 0.05
"""P(z | L = c) for a label c that the detection did not consider: a detector's confusion is never nil."""

SPELL_NS = 2_000_000_000
"""So long a detector's error mostly lasts: what looks farther apart say is on its own."""

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

    def copy(self) -> LabelBelief:
        """The same belief, to go its own way."""
        return LabelBelief(dict(self.logs), self.unseen_log, self.looks, self.longest_side_m)

    def absorb(self, other: LabelBelief) -> None:
        """Join two beliefs that turned out to be about one object."""
        labels = self.logs | other.logs  # in their order: a set of words has another one in each run
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


@dataclass(frozen=True)
class Cell:
    """The looks from one view: those that supported the object, all of them, and the sum of their log ratios."""

    supports: int = 0
    looks: int = 0
    log_ratios: float = 0.0

    def __add__(self, other: Cell) -> Cell:
        return Cell(self.supports + other.supports, self.looks + other.looks, self.log_ratios + other.log_ratios)

    @property
    def evidence(self) -> float:
        """The looks say what sqrt(n) independent ones that agree with them on average would."""
        return self.log_ratios / float(np.sqrt(self.looks)) if self.looks else 0.0


@dataclass(frozen=True)
class Vantage:
    """When and from where (`camera_map`, (3,)) an object, its middle at `centroid_map` (3,), is looked at."""

    stamp_ns: int
    camera_map: FloatArray
    centroid_map: FloatArray

    @cached_property
    def cell(self) -> str:
        """The view this is one of: bearing and distance."""
        ray = self.camera_map - self.centroid_map
        distance = float(np.linalg.norm(ray))
        azimuth = int(np.floor(np.degrees(np.arctan2(ray[1], ray[0])) / 15))
        elevation = int(np.floor(np.degrees(np.arcsin(np.clip(ray[2] / max(distance, 1e-6), -1, 1))) / 15))
        return f"{azimuth},{elevation},{int(np.floor(np.log(max(distance, 0.1)) / np.log(1.5)))}"


@dataclass(frozen=True)
class Spell:
    """The last looks as far as they said the same: that they were `hit`s or not, how many, and since when."""

    hit: bool = False
    looks: int = 0
    began_ns: int = 0

    def then(self, stamp_ns: int, *, hit: bool) -> Spell:
        """The spell after one more look."""
        if self.looks > 0 and hit == self.hit and stamp_ns - self.began_ns < SPELL_NS:
            return Spell(hit, self.looks + 1, self.began_ns)
        return Spell(hit, 1, stamp_ns)

    @property
    def weight(self) -> float:
        """What the last look counts."""
        return 1 / float(np.sqrt(self.looks))


@dataclass
class Viewpoints:
    """From where an object has been looked at, and what the looks said: evidence from nearly one place is correlated,
    and so is that of looks in quick succession.

    A detector that errs goes on to err for a while: the k-th look within `SPELL_NS` that says the same as those before
    it counts 1 / sqrt(k), from wherever it was. A view is a cell of bearing (15 degrees in azimuth and elevation) and
    distance (steps of a factor of 1.5). Its looks count by their square root, in whatever order they come: a long stare
    does not grow to certainty, and neither a lucky first look nor an unlucky one decides.
    """

    cells: dict[str, Cell] = field(default_factory=dict)
    spell: Spell = field(default_factory=Spell)

    def support(self, view: Vantage, log_ratio: float) -> tuple[float, float]:
        """Take in a look that supported the object: how much its word on the label weighs, in (0, 1], and how far it
        moves the log-odds of existence.
        """
        self.spell = self.spell.then(view.stamp_ns, hit=True)
        gain = self._take_in(view.cell, Cell(1, 1, log_ratio * self.spell.weight))
        n = self.cells[view.cell].supports
        return float(np.sqrt(n) - np.sqrt(n - 1)), gain

    def miss(self, view: Vantage, log_ratio: float) -> float:
        """Take in a look without a detection: how far it moves the log-odds of existence."""
        self.spell = self.spell.then(view.stamp_ns, hit=False)
        return self._take_in(view.cell, Cell(0, 1, log_ratio * self.spell.weight))

    def _take_in(self, cell: str, look: Cell) -> float:
        before = self.cells.get(cell, Cell())
        self.cells[cell] = before + look
        return self.cells[cell].evidence - before.evidence

    def absorb(self, other: Viewpoints) -> None:
        """Add another object's viewpoints."""
        for name, cell in other.cells.items():
            self.cells[name] = self.cells.get(name, Cell()) + cell
