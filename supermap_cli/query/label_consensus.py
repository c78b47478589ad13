"""The label of an instance over time: the label that one traversal's observations agree on."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from supermap_cli.memory.values import LabelledObservation, ObservationRef

LabelSource = ObservationRef | LabelledObservation
LabelledT = TypeVar("LabelledT", ObservationRef, LabelledObservation)

MIN_LABEL_SHARE = 0.6
MIN_OBSERVATIONS = 3
"""A traversal has a consensus if at least MIN_OBSERVATIONS observations give one label at least this score-weighted
share.
"""


@dataclass(frozen=True)
class LabelConsensus:
    """A label, and its score-weighted share of one traversal's observations."""

    label: str
    share: float
    traversal_id: int


def label_shares(observations: Iterable[LabelSource]) -> dict[str, float]:
    """The score-weighted share of each label in the observations, the largest first; empty without observations."""
    weights: dict[str, float] = defaultdict(float)
    for observation in observations:
        weights[observation.label] += observation.score
    total = sum(weights.values())
    ranked = sorted(weights.items(), key=lambda item: (-item[1], item[0]))
    return {label: weight / total for label, weight in ranked} if total > 0 else {}


def group_by_traversal(observations: Iterable[LabelledT]) -> dict[int, list[LabelledT]]:
    """Observations by the id of the traversal that made them; order is kept."""
    grouped: dict[int, list[LabelledT]] = defaultdict(list)
    for observation in observations:
        grouped[observation.traversal_id].append(observation)
    return dict(grouped)


def label_consensus(observations: Sequence[LabelSource]) -> LabelConsensus | None:
    """The label that one traversal's observations agree on; `None` if there are too few, or they disagree."""
    if len(observations) < MIN_OBSERVATIONS:
        return None
    label, share = next(iter(label_shares(observations).items()), ("", 0.0))
    return LabelConsensus(label, share, observations[0].traversal_id) if share >= MIN_LABEL_SHARE else None


def label_consensus_at(observations: Iterable[LabelledT], at_ns: int) -> LabelConsensus | None:
    """The label of an instance at a time: that of the last traversal with a consensus by then."""
    by_then = [observation for observation in observations if observation.stamp_ns <= at_ns]
    labels = [
        consensus
        for observations in group_by_traversal(by_then).values()
        if (consensus := label_consensus(observations)) is not None
    ]
    return labels[-1] if labels else None
