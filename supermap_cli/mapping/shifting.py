"""A thing pushed aside: part of its old place is empty, part is taken by itself. What tells is that its known shape,
laid where the detection is, agrees with the depth image, and where it stood does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.mapping.absence import ABSENT_SHARE, OBSERVABLE_SHARE
from supermap_cli.mapping.depth import DepthView
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.objects import MapObject
from supermap_cli.mapping.visibility import ObjectView, check_visibility

LEAST_SHIFT_M, MOST_SHIFT_M = 0.1, 0.6
"""Less is drift, or the error of one pose; what went farther left its place altogether."""

VACATED_SHARE = 0.15
"""Share of the seen part of its old place that must be empty before a shift is looked for."""

LEAST_GAIN = 0.12
"""A look says nothing of a shift that makes the shape agree with it by less than this (`agreement`, in [-1, 2])."""

SURE_GAIN, SETTLED_LOOKS = 0.6, 3
"""So much must looks in a row add up to; and to twice as much of a thing that was found in its place so often in this
visit: it would have been pushed aside before the robot's eyes.
"""

SHIFTED_LOOKS = 2
"""Images in a row that must show a thing beside its empty place: one may have a bad pose, and says nothing."""

COARSE_M, FINE_M = 0.1, 0.03
_SAMPLES = 250


@dataclass(frozen=True)
class Shift:
    """A level shift (3,) in metres, and how much better an object agrees with an image there."""

    by_m: FloatArray
    gain: float


def sure_gain(seen: MapObject) -> float:
    """What looks in a row must add up to before an object is taken to have been pushed aside."""
    return SURE_GAIN * (2 if settled(seen) else 1)


def settled(seen: MapObject) -> bool:
    """Whether an object was found in its place in this visit, before looks in a row showed it beside it."""
    return seen.visit.supported - seen.shifted_looks >= SETTLED_LOOKS


def shifted_since_ns(seen: MapObject, stamp_ns: int) -> tuple[int, int]:
    """When an object that was pushed aside was seen last in its old place, and first in the new one.

    Of one that was not found in its place in this visit the first looks had not been enough to tell.
    """
    first_ns, before_ns = seen.visit.first_support_ns, seen.before_visit_ns
    stood_before = before_ns is not None and seen.state.first_seen_ns <= before_ns
    if stood_before and before_ns is not None and first_ns is not None and not settled(seen):
        return before_ns, first_ns
    return seen.last_seen_ns, seen.first_shifted_ns if seen.first_shifted_ns > seen.last_seen_ns else stamp_ns


def has_left_place(obj: MapObject, view: ObjectView | None, detection: LiftedDetection, covered: float) -> bool:
    """Whether a matched object no longer stands where it stood: its old place is empty and the detection lies beside
    it.
    """
    if view is None or view.observable_share < OBSERVABLE_SHARE:
        return False
    return (
        view.contradicted_share > ABSENT_SHARE
        and covered < 0.6
        and float(np.linalg.norm(detection.centroid_map - obj.shape.centroid)) > 0.1
    )


def find_shift(depth: DepthView, seen: MapObject, view: ObjectView, detection: LiftedDetection) -> Shift | None:
    """By how much an object seems to have been pushed aside; `None` if it stands where it stood.

    `view` is what the image says of its voxels where they are believed to be.
    """
    if view.contradicted_share < VACATED_SHARE:
        return None
    shift = best_shift(depth, seen, detection, level_grid(COARSE_M, MOST_SHIFT_M))
    shift = best_shift(depth, seen, detection, shift + level_grid(FINE_M, COARSE_M))
    if np.linalg.norm(shift) < LEAST_SHIFT_M:
        return None
    there, here = agreement(depth, seen, detection, np.array([shift, np.zeros(3)]))
    gain = float(there - here)
    return Shift(shift, gain) if gain > LEAST_GAIN else None


def best_shift(depth: DepthView, seen: MapObject, detection: LiftedDetection, shifts: FloatArray) -> FloatArray:
    """The one (3,) of some shifts (k, 3) with which the object agrees best; of equals the least."""
    shifts = shifts[np.argsort(np.linalg.norm(shifts, axis=1), kind="stable")]
    return np.asarray(shifts[int(np.argmax(agreement(depth, seen, detection, shifts)))])


def level_grid(step_m: float, reach_m: float) -> FloatArray:
    """Level shifts (k, 3) on a square grid about none."""
    ticks = np.arange(-reach_m, reach_m + step_m / 2, step_m)
    x, y = np.meshgrid(ticks, ticks)
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def agreement(depth: DepthView, seen: MapObject, detection: LiftedDetection, shifts: FloatArray) -> FloatArray:
    """How well an object laid aside by each of k shifts (k, 3) agrees with an image, (k,) in [-1, 2].

    It agrees by the share of the detection's points that lie on it, and by what of it is supported rather than
    contradicted by the depth; where little of it can be told, the latter says little.
    """
    points = detection.points_map[:: len(detection.points_map) // _SAMPLES + 1]
    covered = seen.shape.near((points[None] - shifts[:, None]).reshape(-1, 3)).reshape(len(shifts), -1).mean(axis=1)
    return np.asarray(covered + lies_in(depth, seen, shifts))


def lies_in(depth: DepthView, seen: MapObject, shifts: FloatArray) -> FloatArray:
    """What of an object laid aside by k shifts (k, 3) is supported, less what is contradicted: (k,) in [-1, 1]."""
    cloud = seen.shape.points[:: len(seen.shape.points) // _SAMPLES + 1]
    laid = (cloud[None] + shifts[:, None]).reshape(-1, 3)
    told = check_visibility(depth, laid, seen.voxels.voxel_m)
    supported, contradicted = (
        each.reshape(len(shifts), -1).sum(axis=1) for each in (told.supported, told.contradicted)
    )
    return np.asarray((supported - contradicted) / np.maximum(supported + contradicted, 0.3 * len(cloud)))
