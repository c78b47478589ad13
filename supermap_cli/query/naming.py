"""What a thing was called when: the label that one traversal's observations agree on."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from supermap_cli.memory.values import LabelledObservation, ObservationRef

Naming = ObservationRef | LabelledObservation
N = TypeVar("N", ObservationRef, LabelledObservation)

SURE_SHARE = 0.6
SURE_OBSERVATIONS = 3
"""One traversal by itself is sure of a label that has this share of so many observations, weighed by their scores."""


@dataclass(frozen=True)
class Name:
    """A label, and the share of a traversal's observations that say it."""

    label: str
    share: float
    traversal_id: int


def label_shares(seen: Iterable[Naming]) -> dict[str, float]:
    """How much of what was observed says which label, weighed by score, the likeliest first."""
    weights: dict[str, float] = defaultdict(float)
    for each in seen:
        weights[each.label] += each.score
    whole = sum(weights.values())
    ranked = sorted(weights.items(), key=lambda item: (-item[1], item[0]))
    return {label: weight / whole for label, weight in ranked} if whole > 0 else {}


def by_traversal(seen: Iterable[N]) -> dict[int, list[N]]:
    """Observations by the traversal that made them, in the order of time."""
    grouped: dict[int, list[N]] = defaultdict(list)
    for each in seen:
        grouped[each.traversal_id].append(each)
    return dict(grouped)


def sure_name(seen: Sequence[Naming]) -> Name | None:
    """What one traversal's observations agree on; `None` where they are too few, or at odds."""
    if len(seen) < SURE_OBSERVATIONS:
        return None
    label, share = next(iter(label_shares(seen).items()), ("", 0.0))
    return Name(label, share, seen[0].traversal_id) if share >= SURE_SHARE else None


def name_by(seen: Iterable[N], at_ns: int) -> Name | None:
    """What a thing was called by a time: by the last traversal that was sure by then."""
    until = [each for each in seen if each.stamp_ns <= at_ns]
    names = [name for of_one in by_traversal(until).values() if (name := sure_name(of_one)) is not None]
    return names[-1] if names else None
