"""Matches the objects of two maps by where they stand, in one assignment over all pairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from supermap_cli.mapping.association import distance_log_ratio
from supermap_cli.mapping.duplicates import same_object
from supermap_cli.mapping.objects import MapObject, OpenState
from supermap_cli.types.memory import InstanceRecord, StateRecord

MAX_GAP_M = 0.6
"""Objects whose bounds are farther apart than this do not stand in one place; tuned on simulated merges."""


@dataclass(frozen=True)
class ImportedObject:
    """An object of the other map, in this map's frame and time.

    `first` is the object in its first place, `last` in its last one (the same object if it never moved). Both have the
    number `-record.number` until the object is matched.
    """

    record: InstanceRecord
    states: tuple[StateRecord, ...]
    first: MapObject
    last: MapObject

    @property
    def number(self) -> int:
        """Its number in the other map."""
        return self.record.number

    @property
    def is_matchable(self) -> bool:
        """Whether it may be an object of this map: not merged, not demoted, and not of a dynamic class."""
        return self.record.merged_into is None and not self.last.is_dynamic and not self.last.demoted


def imported_object(record: InstanceRecord, states: Sequence[StateRecord], last: MapObject) -> ImportedObject:
    """An object with its states, all in this map's frame and time."""
    if not states:  # a merged instance may have none
        return ImportedObject(record, (), last, last)
    earliest = states[0]
    first = replace(
        last,
        state=OpenState(earliest.index, earliest.first_seen_ns, earliest.empty_before_ns),
        voxels=last.voxels.moved(earliest.box.center - last.shape.box.center) if len(states) > 1 else last.voxels,
        _shape=None,
        _changed=set(),
    )
    return ImportedObject(record, tuple(states), first, last)


def match_in_place(known: Sequence[MapObject], others: Sequence[MapObject]) -> list[tuple[MapObject, MapObject]]:
    """Pairs (of this map, of the other map) that are one object in one place.

    The assignment maximises the sum of log ratios: first over the present objects of this map, then over the absent
    ones, which may be back.
    """
    pairs = []
    unmatched = list(others)
    for candidates in ([obj for obj in known if obj.present], [obj for obj in known if not obj.present]):
        found = _assigned(candidates, unmatched)
        taken = {id(other) for _, other in found}
        unmatched = [other for other in unmatched if id(other) not in taken]
        pairs += found
    return pairs


def match_parts(known: Sequence[MapObject], others: Sequence[MapObject]) -> list[tuple[MapObject, MapObject]]:
    """Pairs (of this map, of the other map) in which the second is a part of the first: one map may have segmented the
    whole object, the other only its ends.
    """
    pairs = []
    for other in others:
        near = [obj for obj in known if obj.present and _gap_m(obj, other) <= MAX_GAP_M]
        wholes = [obj for obj in near if same_object(obj, other, seen_apart=False)]
        if wholes:
            pairs.append((max(wholes, key=lambda whole: whole.shape.share_near(other.shape.points)), other))
    return pairs


def _gap_m(first: MapObject, second: MapObject) -> float:
    """Gap between the bounds of two clouds."""
    gap = np.maximum(np.maximum(first.shape.low - second.shape.high, second.shape.low - first.shape.high), 0)
    return float(np.linalg.norm(gap))


def _assigned(known: Sequence[MapObject], others: Sequence[MapObject]) -> list[tuple[MapObject, MapObject]]:
    if not known or not others:
        return []
    low, high = (np.array([getattr(obj.shape, side) for obj in known]) for side in ("low", "high"))
    scores = np.zeros((len(known), len(others)))
    for column, other in enumerate(others):
        gap = np.maximum(np.maximum(low - other.shape.high, other.shape.low - high), 0)
        for row in np.flatnonzero(np.linalg.norm(gap, axis=1) <= MAX_GAP_M).tolist():
            scores[row, column] = max(same_place_log_ratio(known[row], other), 0.0)
    rows, columns = linear_sum_assignment(scores, maximize=True)
    return [(known[row], others[column]) for row, column in zip(rows, columns, strict=True) if scores[row, column] > 0]


def same_place_log_ratio(first: MapObject, second: MapObject) -> float:
    """Log ratio for two clouds from different times to be one object in one place.

    Sums overlap both ways, distance of the centroids and agreement of the labels, as `association.affinity` does for a
    detection.
    """
    covered, back = first.shape.share_near(second.shape.points), second.shape.share_near(first.shape.points)
    log_ratio = 4 * np.sqrt(covered * back) - 1.5 + distance_log_ratio(second.shape.centroid, first, max(covered, back))
    p, q = first.labels.probabilities(), second.labels.probabilities()
    agreement = sum(p[label] * q.get(label, 0.0) for label in p)
    log_ratio += float(np.log((agreement + 0.05) / 0.2))
    if log_ratio <= 0 and same_object(first, second, seen_apart=False):
        return 0.1
    return float(log_ratio)
