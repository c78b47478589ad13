"""Precision, recall and F1 of the objects in the map at its end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.evaluation.calibration import Rated, Reliability, reliability
from supermap_cli.evaluation.estimate import EstimatedMap, EstimatedObject
from supermap_cli.evaluation.known_truth import KnownTruth, Place, known_truth
from supermap_cli.evaluation.matching import (
    MAX_MATCH_DISTANCE_M,
    Closeness,
    closeness,
    label_agreement,
    match_one_to_one,
    same_label,
)
from supermap_cli.evaluation.shares import PrecisionRecall, mean, precision_recall, share
from supermap_cli.geometry.arrays import BoolArray
from supermap_cli.types.truth import GroundTruth

PERSON = "person"
"""Label of people, who are no part of the map."""

Pairs = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class MatchedObject:
    """An instance matched with a true object, by the labelled matching."""

    object_id: str
    instance_id: str
    label: str
    centroid_error_m: float
    iou: float


@dataclass(frozen=True)
class UnmatchedObject:
    """A true object that the map misses, or an instance without a true object, and why."""

    id: str
    label: str
    reason: str


@dataclass(frozen=True)
class ObjectScores:
    """Precision, recall and F1 of present instances against countable objects that stand at the end.

    Matching is one-to-one (`match_one_to_one`: as many pairs as possible, then the greatest IoU); a pair needs a 3D IoU
    of the boxes > 0.1 and their centres nearer than 0.3 m, and for `labelled` the same label too. An instance that is
    near nothing but an ignored object (`known_truth`) is neither right nor wrong and counted in `ignored_instances`.

    `centroid_error_m` and `iou` are means over the labelled matches, `label_accuracy` is the share of label-free
    matches whose label is right: each `None` where there are no such matches. `people` are present instances labelled
    "person": left in the map, and wrong in both scores. `missed` and `false` belong to the labelled matching, and so
    does `rated`: the confidence of every judged instance, and whether it is right; `calibration` sums it up.
    """

    labelled: PrecisionRecall
    unlabelled: PrecisionRecall
    label_accuracy: float | None
    centroid_error_m: float | None
    iou: float | None
    countable_objects: int
    ignored_objects: int
    present_instances: int
    ignored_instances: int
    people: tuple[str, ...]
    matched: tuple[MatchedObject, ...]
    missed: tuple[UnmatchedObject, ...]
    false: tuple[UnmatchedObject, ...]
    rated: tuple[Rated, ...]
    calibration: Reliability


def score_objects(estimate: EstimatedMap, truth: GroundTruth) -> ObjectScores:
    """Score the present instances of the map at its end."""
    known = known_truth(estimate, truth)
    comparison = FinalMapComparison(estimate, known)
    labelled, unlabelled = comparison.match(with_label=True), comparison.match(with_label=False)
    matched = tuple(comparison.matched(pair) for pair in labelled)
    rated = comparison.rated(labelled)
    labels_right = sum(bool(comparison.agrees[pair]) for pair in unlabelled)
    return ObjectScores(
        labelled=comparison.count(labelled),
        unlabelled=comparison.count(unlabelled),
        label_accuracy=share(labels_right, len(unlabelled)),
        centroid_error_m=mean(pair.centroid_error_m for pair in matched),
        iou=mean(pair.iou for pair in matched),
        countable_objects=len(comparison.countable),
        ignored_objects=len(known.standing) - len(comparison.countable),
        present_instances=len(comparison.present),
        ignored_instances=int(comparison.ignored.sum()),
        people=tuple(instance.id for instance in comparison.present if same_label(instance.label, PERSON)),
        matched=matched,
        missed=comparison.missed(labelled),
        false=comparison.false(labelled),
        rated=rated,
        calibration=reliability(rated),
    )


class FinalMapComparison:
    """Present instances (n) beside the countable objects (m) that stand at the end, all pairs compared."""

    def __init__(self, estimate: EstimatedMap, known: KnownTruth) -> None:
        standing = [known.places[k] for k in known.standing]
        self.known = known
        self.present = [instance for instance in estimate.objects if instance.presence == "present"]
        self.absent = [instance for instance in estimate.objects if instance.presence != "present"]
        self.countable = [place for place in standing if place.countable]
        self.close: Closeness = closeness(self.present, self.countable)
        self.agrees: BoolArray = label_agreement(
            [instance.label for instance in self.present], [place.object.label for place in self.countable]
        )
        uncountable = [place for place in standing if not place.countable]
        near_uncountable = closeness(self.present, uncountable).near.sum(axis=1) > 0
        self.ignored: BoolArray = near_uncountable & (self.close.near.sum(axis=1) == 0)

    def match(self, *, with_label: bool) -> Pairs:
        """Pairs (instance, countable object)."""
        allowed = self.close.near & self.agrees if with_label else self.close.near
        return match_one_to_one(allowed, self.close.iou)

    def count(self, pairs: Pairs) -> PrecisionRecall:
        """Precision and recall of a matching."""
        judged = len(self.present) - int(self.ignored.sum())
        return precision_recall(len(pairs), judged - len(pairs), len(self.countable) - len(pairs))

    def matched(self, pair: tuple[int, int]) -> MatchedObject:
        """A matched pair with its errors."""
        instance, place = self.present[pair[0]], self.countable[pair[1]]
        error_m, iou = float(self.close.distance_m[pair]), float(self.close.iou[pair])
        return MatchedObject(place.object.id, instance.id, place.object.label, error_m, iou)

    def missed(self, pairs: Pairs) -> tuple[UnmatchedObject, ...]:
        """Countable objects without an instance, and what the map has in their place."""
        found = {column for _, column in pairs}
        return tuple(
            UnmatchedObject(place.object.id, place.object.label, self._why_missed(column))
            for column, place in enumerate(self.countable)
            if column not in found
        )

    def false(self, pairs: Pairs) -> tuple[UnmatchedObject, ...]:
        """Instances without an object, and what stands in their place."""
        right = {row for row, _ in pairs}
        objects = {row: self.countable[column].object.id for row, column in pairs}
        instance_ids = {object_id: self.present[row].id for row, object_id in objects.items()}
        return tuple(
            UnmatchedObject(instance.id, instance.label, self._why_false(row, instance_ids))
            for row, instance in enumerate(self.present)
            if row not in right and not self.ignored[row]
        )

    def rated(self, pairs: Pairs) -> tuple[Rated, ...]:
        """The confidence of every instance that is not ignored, and whether a matching has it."""
        right = {row for row, _ in pairs}
        return tuple(
            (instance.confidence, row in right)
            for row, instance in enumerate(self.present)
            if row in right or not self.ignored[row]
        )

    def _why_missed(self, column: int) -> str:
        if not self.present:
            return "the map is empty"
        place = self.countable[column]
        rows = np.flatnonzero(self.close.near[:, column])
        if len(rows):
            row = rows[np.argmax(self.close.iou[rows, column])]
            wrong = not self.agrees[row, column]
            return f"{self.present[row].id} is there" + (f", labelled {self.present[row].label}" if wrong else "")
        if gone := _nearest_within(place, self.absent):
            return f"the map holds {gone.id} to be gone from there"
        nearest = int(np.argmin(self.close.distance_m[:, column]))
        return (
            f"nearest is {self.present[nearest].id} ({self.present[nearest].label}), "
            f"{self.close.distance_m[nearest, column]:.2f} m away, IoU {self.close.iou[nearest, column]:.2f}"
        )

    def _why_false(self, row: int, instance_ids: dict[str, str]) -> str:
        instance = self.present[row]
        if same_label(instance.label, PERSON):
            return "a person is no part of the map"
        columns = np.flatnonzero(self.close.near[row])
        if len(columns):
            place = self.countable[columns[np.argmax(self.close.iou[row, columns])]]
            if not same_label(instance.label, place.object.label):
                return f"{place.object.id} stands there, a {place.object.label}"
            return f"{place.object.id} stands there, which is {instance_ids.get(place.object.id, 'another instance')}"
        former = [place for k, place in enumerate(self.known.places) if k not in self.known.standing]
        if gone := [place for place, near in zip(former, closeness([instance], former).near[0], strict=True) if near]:
            return f"{gone[0].object.id} stood there and does so no more"
        if not self.countable:
            return "nothing stands there"
        nearest = int(np.argmin(self.close.distance_m[row]))
        return (
            f"nearest is {self.countable[nearest].object.id}, {self.close.distance_m[row, nearest]:.2f} m away, "
            f"IoU {self.close.iou[row, nearest]:.2f}"
        )


def _nearest_within(place: Place, instances: Sequence[EstimatedObject]) -> EstimatedObject | None:
    """The instance of the place's label whose centroid is nearest, if within the gate's distance."""
    offsets = [(float(np.linalg.norm(instance.centroid - place.centroid)), k) for k, instance in enumerate(instances)]
    same_class = [offset for offset in offsets if same_label(instances[offset[1]].label, place.object.label)]
    distance_m, k = min(same_class, default=(np.inf, -1))
    return instances[k] if distance_m < MAX_MATCH_DISTANCE_M else None
