"""Which things of one memory are things of another: by where they stand, over all pairs at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from supermap_cli.mapping.association import distance_log_ratio
from supermap_cli.mapping.duplicates import same_object
from supermap_cli.mapping.objects import MapObject, OpenState
from supermap_cli.types.memory import InstanceRecord, StateRecord

REACH_M = 0.6
"""Things whose bounds lie farther apart do not stand in one place."""


@dataclass(frozen=True)
class Met:
    """An object of the other memory, in the map's frame and time.

    `first` is the object where it stood first, `last` at the end (the same where it stood in one place only); both have
    the number `-record.number` until it is known which object of the map it is.
    """

    record: InstanceRecord
    states: tuple[StateRecord, ...]
    first: MapObject
    last: MapObject

    @property
    def number(self) -> int:
        """Its number in the other memory."""
        return self.record.number

    @property
    def is_thing(self) -> bool:
        """Whether it may be a thing of the map: what moves by itself is somebody else each time."""
        return self.record.merged_into is None and not self.last.is_dynamic and not self.last.demoted


def met(record: InstanceRecord, states: Sequence[StateRecord], last: MapObject) -> Met:
    """An object with its states, all in the map's frame and time."""
    if not states:  # what was merged away may have none
        return Met(record, (), last, last)
    earliest = states[0]
    first = replace(
        last,
        state=OpenState(earliest.index, earliest.first_seen_ns, earliest.empty_before_ns),
        voxels=last.voxels.moved(earliest.centroid_map - last.shape.centroid) if len(states) > 1 else last.voxels,
        _shape=None,
        _changed=set(),
    )
    return Met(record, tuple(states), first, last)


def in_place(known: Sequence[MapObject], others: Sequence[MapObject]) -> list[tuple[MapObject, MapObject]]:
    """Pairs (of the map, of the other memory) that are one thing in one place: the assignment with the greatest sum of
    log ratios, first to what stands in the map, then to what has gone from it and may be back.
    """
    pairs = []
    free = list(others)
    for candidates in ([each for each in known if each.present], [each for each in known if not each.present]):
        found = _assigned(candidates, free)
        taken = {id(other) for _, other in found}
        free = [each for each in free if id(each) not in taken]
        pairs += found
    return pairs


def parts_of(known: Sequence[MapObject], others: Sequence[MapObject]) -> list[tuple[MapObject, MapObject]]:
    """Pairs (of the map, of the other memory) of which the second is a part of the first: where one memory saw a thing
    whole, another may have seen its two ends.
    """
    pairs = []
    for other in others:
        wholes = [each for each in known if each.present and _apart_m(each, other) <= REACH_M]
        within = [each for each in wholes if same_object(each, other, seen_apart=False)]
        if within:
            pairs.append((max(within, key=lambda each: each.shape.share_near(other.shape.points)), other))
    return pairs


def _apart_m(first: MapObject, second: MapObject) -> float:
    """Gap between the bounds of two clouds."""
    gap = np.maximum(np.maximum(first.shape.low - second.shape.high, second.shape.low - first.shape.high), 0)
    return float(np.linalg.norm(gap))


def _assigned(known: Sequence[MapObject], others: Sequence[MapObject]) -> list[tuple[MapObject, MapObject]]:
    if not known or not others:
        return []
    low, high = (np.array([getattr(each.shape, side) for each in known]) for side in ("low", "high"))
    scores = np.zeros((len(known), len(others)))
    for column, other in enumerate(others):
        gap = np.maximum(np.maximum(low - other.shape.high, other.shape.low - high), 0)
        for row in np.flatnonzero(np.linalg.norm(gap, axis=1) <= REACH_M).tolist():
            scores[row, column] = max(standing_log_ratio(known[row], other), 0.0)
    rows, columns = linear_sum_assignment(scores, maximize=True)
    return [(known[row], others[column]) for row, column in zip(rows, columns, strict=True) if scores[row, column] > 0]


def standing_log_ratio(first: MapObject, second: MapObject) -> float:
    """Log ratio for two clouds, made at different times, to be one thing that stands in one place: how much of each
    lies on the other, how far their middles are apart, and whether they are called the same (as for a detection in
    `association.affinity`).
    """
    covered, back = first.shape.share_near(second.shape.points), second.shape.share_near(first.shape.points)
    log_ratio = 4 * np.sqrt(covered * back) - 1.5 + distance_log_ratio(second.shape.centroid, first, max(covered, back))
    p, q = first.labels.probabilities(), second.labels.probabilities()
    agreement = sum(p[label] * q.get(label, 0.0) for label in p)
    log_ratio += float(np.log((agreement + 0.05) / 0.2))
    if log_ratio <= 0 and same_object(first, second, seen_apart=False):
        return 0.1
    return float(log_ratio)
