"""IDF1 and HOTA of the map as a tracker over its keyframes, computed by the package `trackeval`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from supermap_cli.evaluation.estimate import EstimatedMap, EstimatedState
from supermap_cli.evaluation.known_truth import KnownTruth
from supermap_cli.evaluation.matching import Closeness, closeness
from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray

MAX_NEIGHBOUR_DISTANCE_M = 1.0
"""Metres to the nearest true place whose view decides for an instance that is near no true place. Chosen."""

MISSING_TRACKEVAL = 'IDF1 and HOTA need the package trackeval: pip install "supermap-cli[eval]"'


@dataclass(frozen=True)
class TrackingScores:
    """The map as a tracker. A time step is a mapped keyframe; similarity is the 3D IoU of boxes.

    The true objects of a time step are those that stand in a place that is in view (>= 0.3 of the front unhidden) and
    that this or an earlier image showed well (`known_truth`). The tracker's are the instances that the map, asked
    afterwards, believes to be in view then, so that doubles and ghosts count against it and what the camera does not
    see counts for nothing:
    - an instance near a true place (`Closeness.near`; a place whose object is there goes first, then the greatest IoU)
      is in view if that place is. If its object is there but does not count at that keyframe, nor does the instance;
    - an instance near no true place is in view if it was observed at that keyframe, or if the nearest true place within
      1 m is in view.

    `idf1` (Ristani et al. 2016) at IoU 0.5; `hota`, `det_a`, `ass_a` (Luiten et al. 2021), means over the IoU
    thresholds .05 to .95. `None` with a `note` where `trackeval` is not installed, and where there is neither a true
    object nor an instance in any time step.
    """

    idf1: float | None
    hota: float | None
    det_a: float | None
    ass_a: float | None
    time_steps: int
    true_detections: int
    estimated_detections: int
    note: str | None


@dataclass(frozen=True)
class Track:
    """One state of one instance, the keyframes (k,) at which the map has it there, and those that observed it."""

    instance: int
    state: EstimatedState
    believed: BoolArray
    observed: BoolArray


def score_tracking(estimate: EstimatedMap, known: KnownTruth) -> TrackingScores:
    """Compare true objects in view with the map's instances in view, keyframe by keyframe."""
    tracks = _tracks(estimate, known)
    close = closeness([track.state for track in tracks], known.places)
    data = _sequence(known, tracks, close.iou, _in_view(known, tracks, close))
    counts = (len(known.stamps_ns), data["num_gt_dets"], data["num_tracker_dets"])
    if data["num_gt_dets"] + data["num_tracker_dets"] == 0:
        return TrackingScores(None, None, None, None, *counts, note="nothing was in view")
    try:
        from trackeval.metrics import HOTA, Identity  # noqa: PLC0415 - optional, heavy
    except ImportError:
        return TrackingScores(None, None, None, None, *counts, note=MISSING_TRACKEVAL)
    identity = Identity({"PRINT_CONFIG": False}).eval_sequence(data)
    hota = HOTA().eval_sequence(data)
    hota_mean, det_a, ass_a = (float(np.mean(hota[name])) for name in ("HOTA", "DetA", "AssA"))
    return TrackingScores(float(identity["IDF1"]), hota_mean, det_a, ass_a, *counts, note=None)


def _tracks(estimate: EstimatedMap, known: KnownTruth) -> list[Track]:
    """All states that hold at some keyframe; where two of an instance do, the newest one."""
    stamps_ns = known.stamps_ns.tolist()
    tracks = []
    for number, instance in enumerate(estimate.objects):
        believed = [instance.state_at(stamp_ns) for stamp_ns in stamps_ns]
        observed = np.isin(known.stamps_ns, [observation.stamp_ns for observation in instance.observations])
        for state in instance.states:
            at = np.array([current is state for current in believed], dtype=bool)
            if at.any():
                tracks.append(Track(number, state, at, at & observed))
    return tracks


def _in_view(known: KnownTruth, tracks: list[Track], close: Closeness) -> BoolArray:
    """(t, k): which tracks count at which keyframe."""
    counts = np.zeros((len(tracks), len(known.stamps_ns)), dtype=bool)
    for row, track in enumerate(tracks):
        near = np.flatnonzero(close.near[row])
        if len(near):
            place = _place_of_track(near, close.iou[row], known)
            view = np.take_along_axis(known.in_view_with_object | known.in_view_empty, place[None, :], axis=0)[0]
            counts[row] = track.believed & view
            continue
        counts[row] = track.observed
        nearest = int(np.argmin(close.distance_m[row])) if len(known.places) else None
        if nearest is not None and close.distance_m[row, nearest] < MAX_NEIGHBOUR_DISTANCE_M:
            counts[row] |= track.believed & known.in_view[nearest]
    return counts


def _place_of_track(near: IntArray, iou: FloatArray, known: KnownTruth) -> IntArray:
    """(k,): at every keyframe the place, among the near ones, that an instance is matched with."""
    preference = known.present[near] + iou[near][:, None] / 2
    place: IntArray = near[np.argmax(preference, axis=0)]
    return place


def _sequence(known: KnownTruth, tracks: list[Track], iou: FloatArray, in_view: BoolArray) -> dict[str, Any]:
    """A sequence in the form of trackeval: contiguous ids from 0, and the similarities of each time step."""
    names = [place.object.id for place in known.places]
    steps = [
        (np.flatnonzero(places), np.flatnonzero(shown))
        for places, shown in zip(known.in_view_with_object.T, in_view.T, strict=True)
    ]
    n_true, true_ids = _contiguous_ids([[names.index(names[k]) for k in places] for places, _ in steps])
    n_tracked, tracked_ids = _contiguous_ids([[tracks[row].instance for row in shown] for _, shown in steps])
    return {
        "num_timesteps": len(steps),
        "num_gt_ids": n_true,
        "num_tracker_ids": n_tracked,
        "num_gt_dets": sum(len(places) for places, _ in steps),
        "num_tracker_dets": sum(len(shown) for _, shown in steps),
        "gt_ids": true_ids,
        "tracker_ids": tracked_ids,
        "similarity_scores": [iou[np.ix_(shown, places)].T for places, shown in steps],
    }


def _contiguous_ids(steps: list[list[int]]) -> tuple[int, list[IntArray]]:
    """The number of different ids, and each step's ids renumbered 0, 1, ... in ascending order."""
    ids = sorted({identifier for step in steps for identifier in step})
    number = {identifier: k for k, identifier in enumerate(ids)}
    return len(ids), [np.array([number[identifier] for identifier in step], np.int64) for step in steps]
