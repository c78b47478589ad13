"""Displacement: an object pushed aside, so that part of its old place is empty and part is taken by itself.

The evidence: its known shape, moved to where the detection is, agrees with the depth image, and where it stood it does
not. No counterpart in the paper, where such an object is negated and built anew beside itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.mapping import absence, visibility
from supermap_cli.mapping.absence import AbsenceParameters
from supermap_cli.mapping.depth import DepthView
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.objects import MapObject
from supermap_cli.mapping.visibility import ObjectView, VisibilityParameters, check_visibility
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class DisplacementParameters:
    """How far, how clearly and how often an object must be seen beside its place."""

    min_shift_m: float = parameter(0.1, "m", "least shift: less is drift, or the error of one pose", TUNED)
    max_shift_m: float = parameter(0.6, "m", "greatest shift: what went farther left its place altogether", TUNED)
    coarse_step_m: float = parameter(0.1, "m", "step of the grid of shifts tried first", TUNED, at_least=0.01)
    fine_step_m: float = parameter(0.03, "m", "step of the grid tried about the best of these", TUNED, at_least=0.005)
    samples: int = parameter(250, "1", "points of a cloud that are compared", "bounds the time", at_least=1)
    vacated_share: float = parameter(
        0.15, "1", "share of the seen part of its old place that must be empty before a shift is looked for", TUNED
    )
    min_gain: float = parameter(
        0.12, "1", "agreement that a shift must add: below this a view says nothing of it (`agreement`)", TUNED
    )
    sure_gain: float = parameter(0.6, "1", "what views in a row must add up to", TUNED)
    settled_factor: float = parameter(
        2.0, "1", "how much more they must add up to for an object that was found in its place in this visit", TUNED
    )
    settled_views: int = parameter(3, "1", "keyframes that must have found it in its place for that", TUNED)
    settled_span_s: float = parameter(
        2.0,
        "s",
        "time that views of such an object beside its place must span: an error of the pose, of the mask or between "
        "the clocks of colour and depth lasts for a turn of the camera",
        "as belief.error_duration_s",
    )
    min_views: int = parameter(
        2, "1", "moments in a row that must show it beside its place: one may have a bad pose", TUNED
    )
    same_shift_m: float = parameter(0.1, "m", "two views whose shifts differ by less agree", TUNED)
    dynamic_overlap: float = parameter(
        0.3, "1", "of what moves by itself, less of a detection than this on its cloud says that it has moved", TUNED
    )
    max_overlap: float = parameter(
        0.6, "1", "of anything else, more of a detection than this on its cloud says that it has not", TUNED
    )
    min_distance_m: float = parameter(0.1, "m", "least distance of the detection from an empty place", TUNED)
    min_checked_share: float = parameter(
        0.3, "1", "share of a cloud that a view must check for its agreement to count in full", TUNED, at_least=0.01
    )


DEFAULT = DisplacementParameters()


@dataclass(frozen=True)
class Displacement:
    """Where an image shows an object that is not in its place: its middle (3,), the shift (3,) in metres if it is
    known, and how much better the object agrees with the image there (`agreement`).
    """

    centroid_map: FloatArray
    shift_m: FloatArray | None
    gain: float


def observe_displacement(
    obj: MapObject,
    view: ObjectView | None,
    depth: DepthView,
    detection: LiftedDetection,
    covered: float,
    *,
    stamp_ns: int,
    parameters: DisplacementParameters = DEFAULT,
    absence_parameters: AbsenceParameters = absence.DEFAULT,
) -> Displacement | None:
    """Where this image shows the object, if away from its place; counts the moments in a row that do so."""
    to: Displacement | None = None
    walked = obj.is_dynamic and covered < parameters.dynamic_overlap
    if (
        walked
        or obj.is_moving
        or _has_left_place(obj, view, detection, covered, parameters=parameters, absence_parameters=absence_parameters)
    ):
        to = Displacement(detection.centroid_map, None, parameters.sure_gain)
    elif view is not None and view.observable_share >= absence_parameters.observable_share:
        to = find_displacement(depth, obj, view, detection, parameters)
    _count(obj, to, stamp_ns, parameters)
    return to


def is_displaced(obj: MapObject, parameters: DisplacementParameters = DEFAULT) -> bool:
    """Whether the views in a row that showed it beside its place are enough."""
    evidence = obj.displacement
    if _is_settled(obj, parameters) and evidence.last_ns - evidence.first_ns < parameters.settled_span_s * 1e9:
        return False
    return evidence.views >= parameters.min_views and evidence.gain >= sure_gain(obj, parameters)


def sure_gain(obj: MapObject, parameters: DisplacementParameters = DEFAULT) -> float:
    """What views in a row must add up to before an object is taken to have been pushed aside.

    More for one that was found in its place: it would have been pushed aside before the robot's eyes.
    """
    return parameters.sure_gain * (parameters.settled_factor if _is_settled(obj, parameters) else 1)


def displaced_since_ns(obj: MapObject, stamp_ns: int, parameters: DisplacementParameters = DEFAULT) -> tuple[int, int]:
    """When an object that was pushed aside was seen last in its old place, and first in the new one.

    Of one that was not found in its place in this visit the first views had not been enough evidence.
    """
    first_ns, earlier_ns = obj.visit.first_support_ns, obj.visit.earlier_ns
    stood_before = earlier_ns is not None and obj.state.first_seen_ns <= earlier_ns
    if stood_before and earlier_ns is not None and first_ns is not None and not _is_settled(obj, parameters):
        return earlier_ns, first_ns
    displaced_ns = obj.displacement.first_ns
    return obj.last_seen_ns, displaced_ns if displaced_ns > obj.last_seen_ns else stamp_ns


def find_displacement(
    depth: DepthView,
    obj: MapObject,
    view: ObjectView,
    detection: LiftedDetection,
    parameters: DisplacementParameters = DEFAULT,
) -> Displacement | None:
    """Where an object seems to have been pushed to; `None` if it stands where it stood.

    `view` is what the image says of its voxels where they are believed to be.
    """
    if view.contradicted_share < parameters.vacated_share:
        return None
    coarse_m, fine_m = parameters.coarse_step_m, parameters.fine_step_m
    agreements = partial(agreement, depth, obj, detection, parameters=parameters, visibility_parameters=view.parameters)
    shift = _best_shift(agreements, level_grid(coarse_m, parameters.max_shift_m))
    shift = _best_shift(agreements, shift + level_grid(fine_m, coarse_m))
    if np.linalg.norm(shift) < parameters.min_shift_m:
        return None
    there, here = agreements(np.array([shift, np.zeros(3)]))
    gain = float(there - here)
    return Displacement(obj.shape.centroid + shift, shift, gain) if gain > parameters.min_gain else None


def level_grid(step_m: float, reach_m: float) -> FloatArray:
    """Level shifts (k, 3) on a square grid about none."""
    ticks = np.arange(-reach_m, reach_m + step_m / 2, step_m)
    x, y = np.meshgrid(ticks, ticks)
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def agreement(
    depth: DepthView,
    obj: MapObject,
    detection: LiftedDetection,
    shifts: FloatArray,
    *,
    parameters: DisplacementParameters = DEFAULT,
    visibility_parameters: VisibilityParameters = visibility.DEFAULT,
) -> FloatArray:
    """How well an object moved by each of k shifts (k, 3) agrees with an image, (k,) in [-1, 2].

    It agrees by the share of the detection's points that lie on it, and by what of it is supported rather than
    contradicted by the depth; where little of it can be checked, the latter counts for little.
    """
    points = detection.points_map[:: len(detection.points_map) // parameters.samples + 1]
    covered = obj.shape.near((points[None] - shifts[:, None]).reshape(-1, 3)).reshape(len(shifts), -1).mean(axis=1)
    in_depth = depth_agreement(depth, obj, shifts, parameters=parameters, visibility_parameters=visibility_parameters)
    return np.asarray(covered + in_depth)


def depth_agreement(
    depth: DepthView,
    obj: MapObject,
    shifts: FloatArray,
    *,
    parameters: DisplacementParameters = DEFAULT,
    visibility_parameters: VisibilityParameters = visibility.DEFAULT,
) -> FloatArray:
    """What of an object moved by k shifts (k, 3) is supported, less what is contradicted: (k,) in [-1, 1]."""
    cloud = obj.shape.points[:: len(obj.shape.points) // parameters.samples + 1]
    shifted = (cloud[None] + shifts[:, None]).reshape(-1, 3)
    checked = check_visibility(depth, shifted, obj.voxels.voxel_m, visibility_parameters)
    supported, contradicted = (
        voxels.reshape(len(shifts), -1).sum(axis=1) for voxels in (checked.supported, checked.contradicted)
    )
    least = parameters.min_checked_share * len(cloud)
    return np.asarray((supported - contradicted) / np.maximum(supported + contradicted, least))


def _best_shift(agreements: Callable[[FloatArray], FloatArray], shifts: FloatArray) -> FloatArray:
    """The one (3,) of some shifts (k, 3) with which the object agrees best; of equals the least."""
    shifts = shifts[np.argsort(np.linalg.norm(shifts, axis=1), kind="stable")]
    return np.asarray(shifts[int(np.argmax(agreements(shifts)))])


def _has_left_place(
    obj: MapObject,
    view: ObjectView | None,
    detection: LiftedDetection,
    covered: float,
    *,
    parameters: DisplacementParameters,
    absence_parameters: AbsenceParameters,
) -> bool:
    """Whether an object's old place is empty and the detection lies beside it."""
    if view is None or view.observable_share < absence_parameters.observable_share:
        return False
    return (
        view.contradicted_share > absence_parameters.absent_share
        and covered < parameters.max_overlap
        and float(np.linalg.norm(detection.centroid_map - obj.shape.centroid)) > parameters.min_distance_m
    )


def _count(obj: MapObject, to: Displacement | None, stamp_ns: int, parameters: DisplacementParameters) -> None:
    """Count a detection; those of several cameras at one moment are one view, for they share the pose's error."""
    evidence = obj.displacement
    if to is None:
        evidence.interrupt()
        evidence.shift_m, evidence.gain = None, 0.0
        return
    if _agrees(to.shift_m, evidence.shift_m, parameters):
        new_moment = evidence.views == 0 or stamp_ns != evidence.last_ns
        evidence.views += int(new_moment)
        evidence.keyframes += 1
        evidence.gain = to.gain + evidence.gain
    else:
        evidence.views = evidence.keyframes = 1
        evidence.gain = to.gain
    evidence.shift_m, evidence.last_ns = to.shift_m, stamp_ns
    if evidence.views == 1:
        evidence.first_ns = stamp_ns


def _agrees(shift_m: FloatArray | None, before_m: FloatArray | None, parameters: DisplacementParameters) -> bool:
    """Whether two images mean the same place, as far as they know the shifts (3,)."""
    if shift_m is None or before_m is None:
        return True
    return float(np.linalg.norm(shift_m - before_m)) < parameters.same_shift_m


def _is_settled(obj: MapObject, parameters: DisplacementParameters) -> bool:
    """Whether an object was found in its place in this visit, before views in a row showed it beside it."""
    return obj.visit.supported - obj.displacement.keyframes >= parameters.settled_views
