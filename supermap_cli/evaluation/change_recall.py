"""Detection recall and change recall of changed objects, frame by frame (the change detection metrics of the paper
SuperMap).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.evaluation.estimate import EstimatedMap
from supermap_cli.evaluation.known_truth import KnownTruth, known_truth
from supermap_cli.evaluation.matching import MAX_MATCH_DISTANCE_M, centroids, same_label
from supermap_cli.evaluation.shares import mean, share
from supermap_cli.geometry.arrays import BoolArray, FloatArray
from supermap_cli.types.truth import GroundTruth


@dataclass(frozen=True)
class ChangedPlace:
    """One place of one changed object, over all keyframes that had it in view.

    `changes` says what happened there, in the order of time: "appeared", "disappeared", "moved here", "moved away". Of
    `there_samples` keyframes in which the object stood there, `there_right` have an instance; of `left_samples`
    keyframes after it had left, `left_right` have none. `first_wrong_ns` is the first of these keyframes that is wrong.
    Of `before_samples` keyframes before it came, `before_right` have none; they count in no recall.

    detection_recall = there_right / there_samples; change_recall = (there_right + left_right) / (there_samples +
    left_samples); each `None` without samples. Of what only appeared, the two are the same.
    """

    object_id: str
    label: str
    changes: tuple[str, ...]
    there_samples: int
    there_right: int
    left_samples: int
    left_right: int
    before_samples: int
    before_right: int
    detection_recall: float | None
    change_recall: float | None
    first_wrong_ns: int | None


@dataclass(frozen=True)
class PooledRecall:
    """Both recalls under one pooling; `None` where no sample exists."""

    detection_recall: float | None
    change_recall: float | None


@dataclass(frozen=True)
class ChangeRecallScores:
    """The paper's "detection recall (appearance interval) and change recall (also zero false positives in the
    disappearance interval)", per changed object.

    Changed objects are those that appeared, disappeared or moved during or between mapped traversals, before the end of
    the map; what moved counts twice, as the old place that must become empty and the new one that must be filled. The
    finished map is compared at the time t of every mapped keyframe that had the place in view (>= 0.3 of its front
    unhidden). While the object stood there, from the first image that showed it well (`known_truth`), t is a sample of
    the *appearance interval*: right if an instance of the label is believed to be there at t. After it has left, t is a
    sample of the *disappearance interval*: right if none is. Keyframes before it first came are in neither interval.

    An instance is there if its state at t (`EstimatedObject.state_at`) has its centroid within 0.3 m of the place's,
    and no nearer to another place of the same object or to another object of the label that stands at t.

    Two poolings, as the paper does not say which it means: `per_object` is the mean over changed places of their own
    shares, `per_frame` the share of all samples together. Two readings of change recall: `change_recall` asks every
    sample of both intervals; `clean_share` is strict, the share of those places with samples in the disappearance
    interval where not one of them is wrong. `None` where there are no samples.
    """

    per_object: PooledRecall
    per_frame: PooledRecall
    clean_share: float | None
    places: tuple[ChangedPlace, ...]


def score_change_recall(estimate: EstimatedMap, truth: GroundTruth) -> ChangeRecallScores:
    """Compare the map with the truth at every keyframe for every changed place."""
    known = known_truth(estimate, truth)
    believed_positions = BelievedPositions(estimate, known)
    rows = tuple(
        _changed_place(place, changes, believed_positions) for place, changes in changed_places(known, truth).items()
    )
    there_right = sum(row.there_right for row in rows)
    there_samples = sum(row.there_samples for row in rows)
    both_right = there_right + sum(row.left_right for row in rows)
    emptied = [row for row in rows if row.left_samples]
    return ChangeRecallScores(
        per_object=PooledRecall(
            mean(row.detection_recall for row in rows),
            mean(row.change_recall for row in rows),
        ),
        per_frame=PooledRecall(
            share(there_right, there_samples),
            share(both_right, there_samples + sum(row.left_samples for row in rows)),
        ),
        clean_share=share(sum(row.left_right == row.left_samples for row in emptied), len(emptied)),
        places=rows,
    )


def changed_places(known: KnownTruth, truth: GroundTruth) -> dict[int, tuple[str, ...]]:
    """Every place (position in `known.places`) that a change of the mapped traversals filled or emptied, and how."""
    mapped = {traversal.name for traversal in known.traversals}
    changes_of_place: dict[int, tuple[str, ...]] = {}
    for change in truth.changes:
        if not mapped.issuperset(change.between) or known.end_ns is None or change.stamp_ns > known.end_ns:
            continue
        moved = change.kind == "moved"
        for index, word in (
            (change.from_state, "moved away" if moved else change.kind),
            (change.to_state, "moved here" if moved else change.kind),
        ):
            place = known.place_of(change.object_id, index)
            if place is not None:
                changes_of_place[place] = (*changes_of_place.get(place, ()), word)
    return changes_of_place


class BelievedPositions:
    """Centroids (n, k, 3) of the map's instances at every keyframe that the truth knows; NaN where one is absent."""

    def __init__(self, estimate: EstimatedMap, known: KnownTruth) -> None:
        self.known = known
        self.labels = [instance.label for instance in estimate.objects]
        self.centroids = np.full((len(estimate.objects), len(known.stamps_ns), 3), np.nan)
        for row, instance in enumerate(estimate.objects):
            for k, stamp_ns in enumerate(known.stamps_ns.tolist()):
                if (state := instance.state_at(stamp_ns)) is not None:
                    self.centroids[row, k] = state.centroid

    def there(self, place: int) -> BoolArray:
        """(k,): the map has an instance of the place's label in the place, and not in another one."""
        target = self.known.places[place]
        same_class = [row for row, label in enumerate(self.labels) if same_label(label, target.object.label)]
        believed = self.centroids[same_class]
        distance_m = self._distances_m(believed, [place])[0]
        competing = self._competing_places(place)
        competing_m = self._distances_m(believed, competing)
        competing_m[~self._competing_at(place, competing)[:, None, :].repeat(len(same_class), axis=1)] = np.inf
        nearest_competing_m = competing_m.min(axis=0, initial=np.inf)
        there: BoolArray = ((distance_m < MAX_MATCH_DISTANCE_M) & (distance_m <= nearest_competing_m)).any(axis=0)
        return there

    def _competing_places(self, place: int) -> list[int]:
        """Other places of the object, and places of other objects of its label."""
        label = self.known.places[place].object.label
        return [k for k, other in enumerate(self.known.places) if k != place and same_label(other.object.label, label)]

    def _competing_at(self, place: int, competing: Sequence[int]) -> BoolArray:
        """(r, k): which competing places count: those of the object always, those of others while they stand there."""
        own = [self.known.places[k].object.id == self.known.places[place].object.id for k in competing]
        competes: BoolArray = self.known.present[list(competing)] | np.array(own, dtype=bool)[:, None]
        return competes

    def _distances_m(self, believed: FloatArray, places: Sequence[int]) -> FloatArray:
        """(p, n, k): from places to believed centroids (n, k, 3); infinite where there are none."""
        targets = centroids([self.known.places[k] for k in places])
        offsets = np.linalg.norm(believed[None] - targets[:, None, None, :], axis=3)
        distances_m: FloatArray = np.where(np.isnan(offsets), np.inf, offsets)
        return distances_m


def _changed_place(place: int, changes: tuple[str, ...], believed_positions: BelievedPositions) -> ChangedPlace:
    known = believed_positions.known
    there = believed_positions.there(place)
    samples_there, samples_left = known.in_view_with_object[place], known.in_view_left[place]
    samples_before = known.in_view_empty[place] & ~samples_left
    wrong = np.flatnonzero((samples_there & ~there) | (samples_left & there))
    there_samples, there_right = int(samples_there.sum()), int((samples_there & there).sum())
    left_samples, left_right = int(samples_left.sum()), int((samples_left & ~there).sum())
    return ChangedPlace(
        object_id=known.places[place].object.id,
        label=known.places[place].object.label,
        changes=changes,
        there_samples=there_samples,
        there_right=there_right,
        left_samples=left_samples,
        left_right=left_right,
        before_samples=int(samples_before.sum()),
        before_right=int((samples_before & ~there).sum()),
        detection_recall=share(there_right, there_samples),
        change_recall=share(there_right + left_right, there_samples + left_samples),
        first_wrong_ns=int(known.stamps_ns[wrong[0]]) if len(wrong) else None,
    )
