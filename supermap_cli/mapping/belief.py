"""What an object is called and whether it is real: beliefs updated by Bayes' rule.

The label belief is the paper's semantic fusion (eq. 10), with a prior on sizes (`class_sizes`). The paper updates
existence with every image; here views that share their errors, being from one place or in quick succession, count for
less than independent ones.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.mapping import class_sizes
from supermap_cli.mapping.class_sizes import ClassSizeParameters, size_log_likelihood
from supermap_cli.types.detections import Hypothesis
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class BeliefParameters:
    """How much detections and misses say, and which of them share their errors."""

    label_concentration: float = parameter(
        2.0,
        "1",
        "concentration of the words that a detector finds for one object about its confusion's mean: at 2, an object "
        "may well be called the same wrong word each time",
        "Dirichlet-multinomial (Mosimann 1962); value: errors at one object are alike every second time",
        at_least=0.01,
    )
    right_word_share: float = parameter(
        0.6, "1", "mean share of a detector's words on an object that are right", "prior", at_least=0.01, at_most=0.99
    )
    vocabulary: float = parameter(
        80.0, "1", "words among which the wrong ones are spread evenly", "COCO's classes", at_least=2.0
    )
    min_probability: float = parameter(1e-3, "1", "labels less likely than this are left out", "size of the map")
    error_duration_s: float = parameter(
        2.0, "s", "how long a detector's error mostly lasts; views farther apart are independent", TUNED
    )
    bearing_cell_deg: float = parameter(
        15.0, "deg", "azimuth and elevation within which two views are from one place", TUNED, at_least=1.0
    )
    distance_cell_ratio: float = parameter(
        1.5, "1", "ratio of distances within which two views are from one place", TUNED, at_least=1.01
    )
    min_distance_m: float = parameter(
        0.1, "m", "distances below this are one", "a camera sees nothing nearer", at_least=1e-3
    )
    min_existence: float = parameter(
        -6.0, "1", "existence (log-odds) is clamped, so that a few dozen views can always turn it", TUNED, at_most=0.0
    )
    max_existence: float = parameter(12.0, "1", "the same from above", TUNED)


DEFAULT = BeliefParameters()


@dataclass
class LabelBelief:
    """A categorical belief over labels, P(L = c | words, size) ~ P(size | c) P(words | L = c).

    The words that a detector says of one object are draws from a confusion of its own, for what misleads it once does
    so again; given L = c, that confusion is Dirichlet about a mean that favours c. So the words' probability depends on
    how often c and its rivals were said, and not on how many different wrong words there are. `counts` are the weighted
    scores of each label, `weight` is the sum of weights; `longest_side_m` is the object's size as measured.
    `by_detector` are the counts of each detector, by its identity: their confusions are independent of one another;
    `detector` is the one whose words come in now.
    """

    counts: dict[str, float] = field(default_factory=dict)
    weight: float = 0.0
    longest_side_m: float = 0.0
    parameters: BeliefParameters = field(default=DEFAULT, repr=False, compare=False)
    size_parameters: ClassSizeParameters = field(default=class_sizes.DEFAULT, repr=False, compare=False)
    by_detector: dict[str, dict[str, float]] = field(default_factory=dict)
    detector: str = ""
    _cached: tuple[tuple[float, float], dict[str, float]] | None = field(default=None, repr=False, compare=False)

    def update(self, hypotheses: tuple[Hypothesis, ...], weight: float) -> None:
        """Take in all hypotheses of one detection."""
        total = max(1.0, sum(hypothesis.score for hypothesis in hypotheses))
        for hypothesis in hypotheses:
            added = weight * hypothesis.score / total
            for counts in (self.counts, self.by_detector.setdefault(self.detector, {})):
                counts[hypothesis.label] = counts.get(hypothesis.label, 0.0) + added
        self.weight += weight

    def copy(self) -> LabelBelief:
        """The same belief, to be updated on its own."""
        by_detector = {name: dict(counts) for name, counts in self.by_detector.items()}
        return replace(self, counts=dict(self.counts), by_detector=by_detector, _cached=None)

    def absorb(self, other: LabelBelief) -> None:
        """Join two beliefs that turned out to be about one object."""
        joined = [(self.counts, other.counts)]
        joined += [(self.by_detector.setdefault(name, {}), counts) for name, counts in other.by_detector.items()]
        for own, added in joined:
            for label, count in added.items():
                own[label] = own.get(label, 0.0) + count
        self.weight += other.weight

    def probabilities(self) -> dict[str, float]:
        """The belief, summing to 1, most likely first; very unlikely labels are left out."""
        return dict(self._current())

    def expected_words(self) -> dict[str, float]:
        """How probable each word is to be the next one of the detector that looks now.

        Where other detectors have spoken too, its own words say how it calls the object, which may not be what it is:
        the mean of its confusion, after its words, about the belief.
        """
        belief, own = self._current(), self.by_detector.get(self.detector)
        if not own or len(self.by_detector) < 2:
            return dict(belief)
        worth = self.parameters.label_concentration
        total = worth + sum(own.values())
        return {word: (worth * belief.get(word, 0.0) + own.get(word, 0.0)) / total for word in {**belief, **own}}

    def _current(self) -> dict[str, float]:
        if not self.counts:
            return {}
        if self._cached is None or self._cached[0] != (self.weight, self.longest_side_m):
            self._cached = ((self.weight, self.longest_side_m), self._posterior())
        return self._cached[1]

    def _posterior(self) -> dict[str, float]:
        labels = sorted(self.counts)
        spoken = list(self.by_detector.values()) or [self.counts]
        of_each = [np.array([counts.get(label, 0.0) for label in labels]) for counts in spoken]
        said = np.sum([words_log_likelihood(counts, self.parameters) for counts in of_each], axis=0)
        fits = [size_log_likelihood(label, self.longest_side_m, self.size_parameters) for label in labels]
        logs = said + fits
        p = np.exp(logs - logs.max())
        p /= p.sum()
        least = self.parameters.min_probability
        likely = [(float(share), label) for share, label in zip(p, labels, strict=True) if share >= least]
        likely.sort(key=lambda pair: (-pair[0], pair[1]))
        total = sum(share for share, _ in likely)
        return {label: share / total for share, label in likely}

    @property
    def best(self) -> str:
        """The most likely label."""
        return next(iter(self._current()))


def words_log_likelihood(counts: FloatArray, parameters: BeliefParameters = DEFAULT) -> FloatArray:
    """(n,) log P(all words | L = c) of each label c, said so often (n,) `counts`, but for a constant.

    Of the Dirichlet-multinomial only the factor of c itself differs between labels: with pseudo-counts a r for the
    right word and a w for each wrong one, Gamma(a r + n) Gamma(a w) / (Gamma(a r) Gamma(a w + n)).
    """
    right = parameters.label_concentration * parameters.right_word_share
    wrong = parameters.label_concentration * (1 - parameters.right_word_share) / (parameters.vocabulary - 1)
    constant = math.lgamma(wrong) - math.lgamma(right)
    return np.array([math.lgamma(right + n) - math.lgamma(wrong + n) + constant for n in counts.tolist()])


def label_agreement(hypotheses: tuple[Hypothesis, ...], belief: Mapping[str, float]) -> float:
    """How probable it is, in [0, 1], that a detection and an object have the same label."""
    total = sum(hypothesis.score for hypothesis in hypotheses)
    if total <= 0:
        return 0.0
    return sum(hypothesis.score / total * belief.get(hypothesis.label, 0.0) for hypothesis in hypotheses)


@dataclass(frozen=True)
class Viewpoint:
    """When and from where (`camera_map`, (3,)) an object, its middle at `centroid_map` (3,), is looked at, and by which
    detector; two detectors err on their own, also in one place.
    """

    stamp_ns: int
    camera_map: FloatArray
    centroid_map: FloatArray
    detector: str = ""

    def cell(self, parameters: BeliefParameters = DEFAULT) -> str:
        """The cell of bearing and distance it lies in, of the detector's: views from one cell are correlated."""
        ray = self.camera_map - self.centroid_map
        distance = float(np.linalg.norm(ray))
        elevation_sine = np.clip(ray[2] / max(distance, 1e-6), -1, 1)
        azimuth = int(np.floor(np.degrees(np.arctan2(ray[1], ray[0])) / parameters.bearing_cell_deg))
        elevation = int(np.floor(np.degrees(np.arcsin(elevation_sine)) / parameters.bearing_cell_deg))
        logs = np.log(max(distance, parameters.min_distance_m)) / np.log(parameters.distance_cell_ratio)
        whose = f"@{zlib.crc32(self.detector.encode()):08x}" if self.detector else ""
        return f"{azimuth},{elevation},{int(np.floor(logs))}{whose}"


@dataclass(frozen=True)
class ViewpointCell:
    """The views from one cell: those that supported the object, all of them, the sum of their log ratios, the sum of
    these numbers' magnitudes, and the greatest magnitude.
    """

    supports: int = 0
    views: int = 0
    log_ratios: float = 0.0
    magnitudes: float = 0.0
    greatest: float = 0.0

    @classmethod
    def of(cls, log_ratio: float, *, detected: bool) -> ViewpointCell:
        """One view."""
        return cls(int(detected), 1, log_ratio, abs(log_ratio), abs(log_ratio))

    def __add__(self, other: ViewpointCell) -> ViewpointCell:
        return ViewpointCell(
            self.supports + other.supports,
            self.views + other.views,
            self.log_ratios + other.log_ratios,
            self.magnitudes + other.magnitudes,
            max(self.greatest, other.greatest),
        )

    @property
    def evidence(self) -> float:
        """N views that say equally much say what sqrt(n) independent ones would; one that says next to nothing is next
        to no view, and takes nothing from what the others say.
        """
        if self.greatest == 0:
            return 0.0
        return self.log_ratios / float(np.sqrt(self.magnitudes / self.greatest))


@dataclass(frozen=True)
class OutcomeRun:
    """The last views as far as they had one outcome: that the object was `detected` or not, since when, and of how many
    viewpoint cells in turn; `cell` is the last one.
    """

    detected: bool = False
    views: int = 0
    began_ns: int = 0
    cell: str = ""

    def extended(self, stamp_ns: int, cell: str, *, detected: bool, duration_s: float) -> OutcomeRun:
        """The run after one more view; it goes on for `duration_s` at most. Views of one cell after another count once:
        how far they repeat one another is for the cell to say (`ViewpointCell.evidence`).
        """
        if self.views > 0 and detected == self.detected and stamp_ns - self.began_ns < duration_s * 1e9:
            return OutcomeRun(detected, self.views + (cell != self.cell), self.began_ns, cell)
        return OutcomeRun(detected, 1, stamp_ns, cell)

    @property
    def weight(self) -> float:
        """What the last view counts."""
        return 1 / float(np.sqrt(self.views))


@dataclass
class ViewpointHistory:
    """From where an object has been looked at, and with what outcome: evidence from nearly one place is correlated,
    and so is that of views in quick succession.

    A detector that errs goes on to err for a while: views from the k-th cell of a run with one outcome count
    1 / sqrt(k); where errors `repeat` as long as the camera stays in one place, the k-th view of the run does. The
    views of one cell count by their square root, in whatever order they come: a long stare does not grow to certainty,
    and neither a lucky first view nor an unlucky one decides.
    """

    cells: dict[str, ViewpointCell] = field(default_factory=dict)
    run: OutcomeRun = field(default_factory=OutcomeRun)
    repeat: bool = False
    parameters: BeliefParameters = field(default=DEFAULT, repr=False, compare=False)

    def add_detection(self, viewpoint: Viewpoint, log_ratio: float) -> tuple[float, float]:
        """Take in a view with a detection: how much its word on the label weighs, in (0, 1], and how far it moves the
        log-odds of existence.
        """
        cell = self._extend_run(viewpoint, detected=True)
        gain = self._add(cell, ViewpointCell.of(log_ratio * self.run.weight, detected=True))
        n = self.cells[cell].supports
        return float(np.sqrt(n) - np.sqrt(n - 1)), gain

    def add_miss(self, viewpoint: Viewpoint, log_ratio: float) -> float:
        """Take in a view without a detection: how far it moves the log-odds of existence."""
        cell = self._extend_run(viewpoint, detected=False)
        return self._add(cell, ViewpointCell.of(log_ratio * self.run.weight, detected=False))

    def last_weight(self, viewpoint: Viewpoint) -> float:
        """How many independent looks the view that was taken in last is worth, in (0, 1]."""
        n = self.cells[viewpoint.cell(self.parameters)].views
        return self.run.weight * float(np.sqrt(n) - np.sqrt(n - 1))

    def absorb(self, other: ViewpointHistory) -> None:
        """Add another object's viewpoints."""
        for name, cell in other.cells.items():
            self.cells[name] = self.cells.get(name, ViewpointCell()) + cell

    def _extend_run(self, viewpoint: Viewpoint, *, detected: bool) -> str:
        """The cell of the view."""
        cell, duration_s = viewpoint.cell(self.parameters), self.parameters.error_duration_s
        key = str(viewpoint.stamp_ns) if self.repeat else cell
        self.run = self.run.extended(viewpoint.stamp_ns, key, detected=detected, duration_s=duration_s)
        return cell

    def _add(self, cell: str, view: ViewpointCell) -> float:
        before = self.cells.get(cell, ViewpointCell())
        self.cells[cell] = before + view
        return self.cells[cell].evidence - before.evidence


@dataclass
class Existence:
    """The belief that an object is real, as log-odds, and the views that it rests on."""

    log_odds: float
    viewpoints: ViewpointHistory = field(default_factory=ViewpointHistory)

    def add_detection(self, viewpoint: Viewpoint, log_ratio: float) -> float:
        """After a detection of this log ratio; how much its word on the label weighs, in (0, 1]."""
        weight, gain = self.viewpoints.add_detection(viewpoint, log_ratio)
        self._move(gain)
        return weight

    def add_miss(self, viewpoint: Viewpoint, log_ratio: float) -> None:
        """After a view that did not detect the object although it could have."""
        self._move(self.viewpoints.add_miss(viewpoint, log_ratio))

    def absorb(self, other: Existence) -> None:
        """Join the beliefs in two objects that turned out to be one."""
        self.viewpoints.absorb(other.viewpoints)
        self.log_odds = max(self.log_odds, other.log_odds)

    def _move(self, gain: float) -> None:
        bounds = self.viewpoints.parameters
        self.log_odds = float(np.clip(self.log_odds + gain, bounds.min_existence, bounds.max_existence))
