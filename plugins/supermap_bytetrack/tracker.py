"""ByteTrack's association in two stages (Zhang et al. 2022, Algorithm 1) over the hybrid state of SuperMap's section on
tracking: tracks of map objects are predicted by the map, the others by their own motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np

from supermap_bytetrack import ByteTrackOptions
from supermap_bytetrack.kalman import BoxStates, concatenate, empty_states, initiate, predict, replace_boxes
from supermap_bytetrack.kalman import update as kalman_update
from supermap_bytetrack.similarity import LABEL_COST, assign, buffered_iou, label_agreement, label_distribution
from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.types.detections import Detections, TrackPrior, Tracks

_WEAK_EVIDENCE_IOU = 0.5
"""Least overlap for weak evidence: low scores (ByteTrack's second stage: 0.5) and objects that should be occluded."""
_MAX_PREDICTION_S = 2.0
"""Seconds: over a longer gap, tracks are predicted for this long only. Chosen."""
_LABEL_DECAY = 0.8
"""Weight of a track's label distribution against the next detection's. Chosen."""
_MIN_TRACKS_FOR_CAMERA_MOTION = 2
"""Map-led tracks from which on their median shift is taken for the camera's motion. Chosen."""


@dataclass
class _TrackTable:
    """The live tracks, n of them: `ids` and `misses` (n,), `labels` a distribution each."""

    ids: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    misses: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    states: BoxStates = field(default_factory=empty_states)
    labels: list[dict[str, float]] = field(default_factory=list)

    def add(self, ids: Sequence[int], states: BoxStates, labels: Sequence[dict[str, float]]) -> None:
        self.ids = np.concatenate([self.ids, np.asarray(ids, np.int64)])
        self.misses = np.concatenate([self.misses, np.zeros(len(ids), np.int64)])
        self.states = concatenate(self.states, states)
        self.labels.extend(labels)

    def keep(self, chosen: BoolArray) -> None:
        self.ids, self.misses = self.ids[chosen], self.misses[chosen]
        self.states = self.states.take(np.flatnonzero(chosen))
        self.labels = [label for label, kept in zip(self.labels, chosen, strict=True) if kept]


class ByteTracker:
    """A deterministic tracker; the order in which an image's detections come makes no difference."""

    def __init__(self, options: ByteTrackOptions) -> None:
        self._options = options
        self._tracks = _TrackTable()
        self._next_id = 1
        self._last_stamp_ns: int | None = None

    def update(self, detections: Detections, priors: Sequence[TrackPrior], image_size: tuple[int, int]) -> Tracks:
        """Assign the next image's detections; those below the high score that fit no track get -1."""
        order = _canonical_order(detections)
        ordered = detections.take(order)
        self._predict(detections.stamp_ns, priors, image_size[0])
        matches = self._associate(ordered, priors)
        self._update_tracks(ordered, matches, priors, image_size[0])
        track_ids = np.full(len(detections), -1, np.int64)
        for track_id, detection in matches:
            track_ids[order[detection]] = track_id
        return Tracks(track_ids)

    def state(self) -> object:
        """All that the next update depends on."""
        tracks = self._tracks
        table = (tracks.ids, tracks.misses, tracks.states.mean, tracks.states.covariance, tracks.labels)
        return (self._next_id, self._last_stamp_ns, table)

    def resume(self, state: object) -> None:
        """Go on from another tracker's state."""
        self._next_id, self._last_stamp_ns, table = cast("tuple[int, int | None, tuple[Any, ...]]", state)
        ids, misses, mean, covariance, labels = table
        self._tracks = _TrackTable(ids, misses, BoxStates(mean, covariance), labels)

    def _predict(self, stamp_ns: int, priors: Sequence[TrackPrior], image_width: int) -> None:
        """Move all tracks to the image's time; those of map objects to where the map expects them."""
        tracks = self._tracks
        if self._last_stamp_ns is not None:
            seconds = min(max((stamp_ns - self._last_stamp_ns) * 1e-9, 0.0), _MAX_PREDICTION_S)
            tracks.states = predict(tracks.states, seconds, image_width)
        self._last_stamp_ns = stamp_ns
        if not priors:
            return
        known_ids = set(tracks.ids.tolist())
        lost_priors = [prior for prior in priors if prior.track_id not in known_ids]
        boxes = np.array([prior.box_xyxy for prior in lost_priors], np.float32).reshape(-1, 4)
        tracks.add(
            [prior.track_id for prior in lost_priors],
            initiate(boxes, image_width),
            [{prior.label: 1.0} for prior in lost_priors],
        )
        self._next_id = max(self._next_id, *(prior.track_id + 1 for prior in priors))
        self._apply_priors(priors, known_ids)

    def _apply_priors(self, priors: Sequence[TrackPrior], known_ids: set[int]) -> None:
        """Set the map-led tracks to their priors, and shift the others by the median shift of these."""
        tracks = self._tracks
        index_of = {track_id: i for i, track_id in enumerate(tracks.ids.tolist())}
        map_led = np.array([index_of[prior.track_id] for prior in priors], np.int64)
        before = tracks.states.mean[map_led, :2]
        boxes = np.stack([prior.box_xyxy for prior in priors])
        states = replace_boxes(tracks.states, map_led, boxes)
        shifts = (states.mean[map_led, :2] - before)[[prior.track_id in known_ids for prior in priors]]
        if len(shifts) >= _MIN_TRACKS_FOR_CAMERA_MOTION:
            free = np.ones(len(tracks.ids), dtype=bool)
            free[map_led] = False
            states.mean[free, :2] += np.median(shifts, axis=0)
        tracks.states = states

    def _associate(self, detections: Detections, priors: Sequence[TrackPrior]) -> list[tuple[int, int]]:
        """Pairs (track id, detection): high scores with all tracks in view, low scores with those seen just before, and
        what is left of the high scores with objects that should be hidden. New tracks come last.
        """
        tracks = self._tracks
        overlap = buffered_iou(tracks.states, detections.boxes_xyxy, self._options.buffer)
        agreement = label_agreement(
            tracks.labels, [label_distribution(hypotheses) for hypotheses in detections.hypotheses]
        )
        similarity = overlap - LABEL_COST * (1 - agreement)
        hidden = np.isin(tracks.ids, [prior.track_id for prior in priors if prior.hidden])
        high = detections.scores >= self._options.high_score
        free_tracks, free_detections = np.ones(len(tracks.ids), bool), np.ones(len(detections), bool)
        matches: list[tuple[int, int]] = []
        for in_stage, scores, min_overlap in (
            (~hidden, high, self._options.least_overlap),
            (~hidden & (tracks.misses == 0), ~high, _WEAK_EVIDENCE_IOU),
            (hidden, high, _WEAK_EVIDENCE_IOU),
        ):
            rows, columns = np.flatnonzero(free_tracks & in_stage), np.flatnonzero(free_detections & scores)
            pairs = _assign_some(similarity, overlap, rows, columns, min_overlap)
            for track, detection in pairs:
                free_tracks[track] = free_detections[detection] = False
                matches.append((int(tracks.ids[track]), detection))
        new_detections = np.flatnonzero(free_detections & high).tolist()
        matches.extend((self._next_id + i, detection) for i, detection in enumerate(new_detections))
        self._next_id += len(new_detections)
        return matches

    def _update_tracks(
        self, detections: Detections, matches: Sequence[tuple[int, int]], priors: Sequence[TrackPrior], image_width: int
    ) -> None:
        """Correct the matched tracks, begin the new ones, count misses and drop what has been lost for too long."""
        tracks = self._tracks
        index_of = {track_id: i for i, track_id in enumerate(tracks.ids.tolist())}
        old = [(index_of[track_id], detection) for track_id, detection in matches if track_id in index_of]
        rows = np.array([track for track, _ in old], np.int64)
        updated = kalman_update(tracks.states.take(rows), detections.boxes_xyxy[[detection for _, detection in old]])
        tracks.states.mean[rows], tracks.states.covariance[rows] = updated.mean, updated.covariance
        for track, detection in old:
            tracks.labels[track] = _decayed_labels(
                tracks.labels[track], label_distribution(detections.hypotheses[detection])
            )
        map_led = np.isin(tracks.ids, [prior.track_id for prior in priors])
        hidden = np.isin(tracks.ids, [prior.track_id for prior in priors if prior.hidden])
        missed = ~hidden
        missed[rows] = False
        tracks.misses[rows] = 0
        tracks.misses[missed] += 1
        tracks.keep(map_led | (tracks.misses <= self._options.lost_frames))
        new = [(track_id, detection) for track_id, detection in matches if track_id not in index_of]
        tracks.add(
            [track_id for track_id, _ in new],
            initiate(detections.boxes_xyxy[[detection for _, detection in new]], image_width),
            [label_distribution(detections.hypotheses[detection]) for _, detection in new],
        )


def _canonical_order(detections: Detections) -> IntArray:
    """An order that does not depend on the one the detections came in: by score, then by box."""
    u0, v0, u1, v1 = detections.boxes_xyxy.T
    return np.lexsort((v1, u1, v0, u0, -detections.scores)).astype(np.int64)


def _assign_some(
    similarity: FloatArray, overlap: FloatArray, rows: IntArray, columns: IntArray, min_overlap: float
) -> list[tuple[int, int]]:
    """`assign` on a part of the matrices, in the indices of the whole."""
    if not len(rows) or not len(columns):
        return []
    part = np.ix_(rows, columns)
    return [(int(rows[i]), int(columns[j])) for i, j in assign(similarity[part], overlap[part], min_overlap)]


def _decayed_labels(old: dict[str, float], new: dict[str, float]) -> dict[str, float]:
    """A label distribution updated by one more detection (exponential decay)."""
    labels = {**old, **new}
    return {label: _LABEL_DECAY * old.get(label, 0.0) + (1 - _LABEL_DECAY) * new.get(label, 0.0) for label in labels}
