"""What a thing was called when: the label that one traversal's observations agree on."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from supermap_cli.memory.values import ObservationRef, Said

LabelledObservation = ObservationRef | Said
LabelledT = TypeVar("LabelledT", ObservationRef, Said)

MIN_LABEL_SHARE = 0.6
MIN_OBSERVATIONS = 3
"""One traversal by itself is sure of a label that has this share of so many observations, weighed by their scores."""


@dataclass(frozen=True)
class LabelConsensus:
    """A label, and the share of a traversal's observations that say it."""

    label: str
    share: float
    traversal_id: int


def label_shares(seen: Iterable[LabelledObservation]) -> dict[str, float]:
    """How much of what was observed says which label, weighed by score, the likeliest first."""
    weights: dict[str, float] = defaultdict(float)
    for observation in seen:
        weights[observation.label] += observation.score
    whole = sum(weights.values())
    ranked = sorted(weights.items(), key=lambda item: (-item[1], item[0]))
    return {label: weight / whole for label, weight in ranked} if whole > 0 else {}


def group_by_traversal(seen: Iterable[LabelledT]) -> dict[int, list[LabelledT]]:
    """Observations by the traversal that made them, in the order of time."""
    grouped: dict[int, list[LabelledT]] = defaultdict(list)
    for observation in seen:
        grouped[observation.traversal_id].append(observation)
    return dict(grouped)


def label_consensus(seen: Sequence[LabelledObservation]) -> LabelConsensus | None:
    """What one traversal's observations agree on; `None` where they are too few, or at odds."""
    if len(seen) < MIN_OBSERVATIONS:
        return None
    label, share = next(iter(label_shares(seen).items()), ("", 0.0))
    return LabelConsensus(label, share, seen[0].traversal_id) if share >= MIN_LABEL_SHARE else None


def label_consensus_at(seen: Iterable[LabelledT], at_ns: int) -> LabelConsensus | None:
    """What a thing was called by a time: by the last traversal that was sure by then."""
    seen_by_then = [observation for observation in seen if observation.stamp_ns <= at_ns]
    labels = [
        consensus
        for observations in group_by_traversal(seen_by_then).values()
        if (consensus := label_consensus(observations)) is not None
    ]
    return labels[-1] if labels else None
