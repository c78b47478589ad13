"""Whether a thing that two traversals call differently is another thing, or another reading of the same one.

Another thing in the same place is compared with the same thing by Bayes' rule. The words of a detector at one thing are
draws from a confusion of its own (Dirichlet-multinomial, as in `mapping.belief`): one network makes the same error at
the same thing again, from the same place; two networks err on their own. Shape and look speak besides
(`appearance_change`). So a new name alone hardly ever is a change, and one with a new shape or look is.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.mapping import belief
from supermap_cli.mapping.belief import Viewpoint
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import ObservationRef, StoredInstance
from supermap_cli.query.appearance_change import look_log_ratio, shape_log_ratio
from supermap_cli.query.detectors import detector_of

PRIOR_ANOTHER = 0.01
"""P(a thing seen in its place was replaced by another one there since the earlier visit), before any evidence. Chosen:
things are moved or taken away more often than replaced by a thing of another kind of about the same size.
"""
ALIKE_AGAIN = 0.9
"""P(a detector errs at a thing as on the earlier visit), seen from the same place. Chosen: the light may differ."""


@dataclass(frozen=True)
class Reading:
    """What one traversal's detector called an instance: the words' weights by viewpoint cell, where views of one cell
    count by their square root, as in the map; and the observations, in the order of time.
    """

    detector: str
    words: Mapping[str, Mapping[str, float]]
    observations: tuple[ObservationRef, ...]

    @property
    def counts(self) -> dict[str, float]:
        """The words' weights, from all places."""
        return _summed(self.words.values())

    def share_seen_from(self, other: Reading) -> float:
        """The share of these words that were said in places that the other reading has words of, too."""
        whole = sum(self.counts.values())
        shared = sum(_summed(words for cell, words in self.words.items() if cell in other.words).values())
        return shared / whole if whole > 0 else 0.0


@dataclass(frozen=True)
class NameChange:
    """P(another thing stands there), and what shape and look say of it, as log likelihood ratios (0: nothing)."""

    probability: float
    shape: float
    look: float
    detectors: tuple[str, str]

    @property
    def reason(self) -> str:
        """Why it is taken for another thing, or for another reading of the same one."""
        ratios = (("shape", self.shape), ("look", self.look))
        changed = " and ".join(name for name, ratio in ratios if ratio > 0)
        alike = " and ".join(name for name, ratio in ratios if ratio < 0)
        told = [f"its {changed} changed"] if changed else []
        told += [f"its {alike} did not change"] if alike else []
        if self.probability > 0.5:
            return "; ".join([f"another thing with {self.probability:.0%}", *told])
        old, new = (detector or "an unknown one" for detector in self.detectors)
        whose = "" if old == new else f" by another detector ({old}, then {new})"
        return "; ".join([f"another reading{whose}, no change", *told])


def compare_readings(
    reader: MapReader, instance: StoredInstance, traversal_ids: tuple[int, int], until_ns: tuple[int, int]
) -> NameChange:
    """Compare what two traversals, up to a time each, called an instance that stands in one place."""
    observations = reader.observations(instance)
    old, new = (
        _reading(
            reader,
            traversal_id,
            [seen for seen in observations if seen.traversal_id == traversal_id and seen.stamp_ns <= end_ns],
        )
        for traversal_id, end_ns in zip(traversal_ids, until_ns, strict=True)
    )
    shape = shape_log_ratio(old.observations, new.observations)
    look = look_log_ratio(reader, instance, traversal_ids, until_ns)
    log_odds = math.log(PRIOR_ANOTHER / (1 - PRIOR_ANOTHER)) + words_log_ratio(old, new) + shape + look
    return NameChange(1 / (1 + math.exp(-log_odds)), shape, look, (old.detector, new.detector))


def words_log_ratio(old: Reading, new: Reading) -> float:
    """Log P(words | another thing) / P(words | the same thing).

    Of the same thing, one detector's words are draws from one confusion as far as they were said from the same places,
    and of two otherwise. All classes are equally likely beforehand.
    """
    first, second = old.counts, new.counts
    vocabulary = set(first) | set(second)
    alone = [_log_likelihoods(counts, vocabulary) for counts in (first, second)]
    another = sum(_log_mean(logs) for logs in alone)
    same = _log_mean({label: alone[0][label] + alone[1][label] for label in alone[0]})
    repeated = ALIKE_AGAIN * new.share_seen_from(old) if old.detector == new.detector else 0.0
    if repeated > 0:
        jointly = _log_mean(_log_likelihoods(_summed((first, second)), vocabulary))
        same = float(np.logaddexp(math.log(repeated) + jointly, math.log(1 - repeated) + same))
    return another - same


def _log_likelihoods(counts: Mapping[str, float], vocabulary: Iterable[str]) -> dict[str | None, float]:
    """Log P(words | class) of each class in the vocabulary, and of any other one (`None`): Dirichlet-multinomial."""
    parameters = belief.DEFAULT
    total = parameters.label_concentration
    right = total * parameters.right_word_share
    wrong = total * (1 - parameters.right_word_share) / (parameters.vocabulary - 1)

    def of_words(pseudo_counts: Mapping[str, float]) -> float:
        said = sum(
            math.lgamma(pseudo_counts.get(word, wrong) + n) - math.lgamma(pseudo_counts.get(word, wrong))
            for word, n in counts.items()
        )
        return said + math.lgamma(total) - math.lgamma(total + sum(counts.values()))

    return {label: of_words({label: right}) for label in vocabulary} | {None: of_words({})}


def _log_mean(logs: Mapping[str | None, float]) -> float:
    """The log of the mean over all classes of a vocabulary, most of which are alike (`None`)."""
    size = max(belief.DEFAULT.vocabulary, len(logs))
    weights = [size - len(logs) + 1 if label is None else 1 for label in logs]
    return float(np.logaddexp.reduce(np.array(list(logs.values())) + np.log(weights)) - math.log(size))


def _reading(reader: MapReader, traversal_id: int, observations: Sequence[ObservationRef]) -> Reading:
    detector = next(detector_of(traversal) for traversal in reader.traversals if traversal.id == traversal_id)
    cameras = reader.camera_positions({seen.keyframe_id for seen in observations})
    words: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
    views: Counter[str] = Counter()
    for seen in observations:
        cell = Viewpoint(seen.stamp_ns, cameras[seen.keyframe_id], seen.centroid_map).cell()
        views[cell] += 1
        words[cell][seen.label] += seen.score * (math.sqrt(views[cell]) - math.sqrt(views[cell] - 1))
    return Reading(detector, words, tuple(observations))


def _summed(parts: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """Weights of words, added up."""
    total: dict[str, float] = defaultdict(float)
    for part in parts:
        for word, weight in part.items():
            total[word] += weight
    return dict(total)
