"""Data association in 3D: which detection is of which object, as one gated assignment of log-likelihood ratios.

The paper associates in the image, by the tracker with 3D priors (Algorithm 1, step 3). Here its tracks are evidence
beside overlap, distance and label, so that an identity outlives a track.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.optimize import linear_sum_assignment

from supermap_cli.geometry.arrays import BoolArray, FloatArray
from supermap_cli.mapping.belief import label_agreement
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.motion import Course
from supermap_cli.mapping.objects import MapObject, ObjectMap
from supermap_cli.mapping.visibility import ObjectView
from supermap_cli.types.parameters import TUNED, parameter
from supermap_cli.types.sensing import MAIN_CAMERA


@dataclass(frozen=True)
class AssociationParameters:
    """What speaks for a detection to be of an object, and how far apart the two may be."""

    strong_score: float = parameter(
        0.3,
        "1",
        "detections below this support what the map already holds, and start nothing new",
        "two stages as in Zhang et al. 2022 (ByteTrack); value: " + TUNED,
        at_most=1.0,
    )
    gate: float = parameter(0.0, "1", "log ratio above which a detection may be of an object", "even odds")
    overlap_weight: float = parameter(4.0, "1", "log ratio of full overlap, above none", TUNED)
    no_overlap: float = parameter(-1.5, "1", "log ratio without overlap", TUNED)
    label_floor: float = parameter(0.05, "1", "added to the agreement of labels: no label is sure", TUNED)
    label_by_chance: float = parameter(0.2, "1", "agreement of labels of two things", TUNED, at_least=1e-3)
    same_track: float = parameter(1.0, "1", "log ratio of one track of a camera", TUNED)
    other_track: float = parameter(-0.5, "1", "log ratio of another track of the same camera", TUNED)
    spread_m: float = parameter(0.1, "m", "deviation of the centroids of one object", TUNED, at_least=0.01)
    spread_share: float = parameter(0.25, "1", "the same as a share of the object's size, added to it", TUNED)
    near_log_ratio: float = parameter(1.0, "1", "log ratio of centroids that agree", TUNED)
    min_distance_log_ratio: float = parameter(-2.0, "1", "least log ratio of distance", TUNED)
    reach_m: float = parameter(0.3, "m", "gap between a detection and an object's bounds that is possible", TUNED)
    reach_share: float = parameter(0.5, "1", "the same as a share of the larger one's size, added to it", TUNED)
    course_sigmas: float = parameter(3.0, "1", "deviations from its course within which a moving thing is", "99.7 %")
    people_per_m2: float = parameter(
        0.05, "1/m2", "others that move by themselves and may be seen instead: one in a room of 20 m2", TUNED
    )
    things_per_m2: float = parameter(1.0, "1/m2", "things of any kind that may be seen instead", TUNED)
    same_kind: float = parameter(
        0.2, "1", "agreement of labels below which a detection may be of any thing", TUNED, at_most=1.0
    )
    dynamic_memory_s: float = parameter(
        3.0, "s", "how long what moves by itself is believed in without being seen", TUNED
    )


DEFAULT = AssociationParameters()

Courses = Mapping[int, Course]
"""Object number -> where it is expected now, of those that move by themselves and were seen of late."""

NO_COURSES: Courses = MappingProxyType({})


def is_recent(obj: MapObject, stamp_ns: int, parameters: AssociationParameters = DEFAULT) -> bool:
    """Whether what moves by itself was seen so short a time ago that it is still believed in."""
    return stamp_ns - obj.last_seen_ns <= parameters.dynamic_memory_s * 1e9


def expected_courses(objects: ObjectMap, stamp_ns: int, parameters: AssociationParameters = DEFAULT) -> Courses:
    """Where those that move by themselves, and were seen of late, are expected now."""
    recent = [obj for obj in objects if is_recent(obj, stamp_ns, parameters)]
    return {
        obj.number: obj.motion.course.at(stamp_ns) for obj in recent if obj.motion.course is not None and obj.is_dynamic
    }


@dataclass(frozen=True)
class Affinity:
    """How well one detection fits one object.

    `covered`: share of the detection's points on the object's cloud; `explained`: share of the object's voxels seen in
    this image that lie inside the detection's mask; `log_ratio`: log P(evidence | same) / P(evidence | different).
    """

    covered: float
    explained: float
    log_ratio: float


@dataclass(frozen=True)
class Association:
    """Pairs (position in the list of detections, object number) with their affinity; the rest stays free."""

    pairs: tuple[tuple[int, int, Affinity], ...]
    free: tuple[int, ...]


def affinity(
    detection: LiftedDetection,
    candidate: MapObject,
    view: ObjectView | None,
    course: Course | None = None,
    *,
    camera_id: str = MAIN_CAMERA,
    parameters: AssociationParameters = DEFAULT,
) -> Affinity:
    """Score one pair. A partial view must not count against the match: overlap is measured on what is seen of both.

    Of what is on its way, neither overlap nor distance from where it was says anything: it is looked for on its course.
    `camera_id` is the detection's: tracks of different cameras say nothing of one another.
    """
    shape = candidate.shape
    covered = shape.share_near(detection.points_map)
    explained = share_inside(detection, view) if view is not None else 0.0
    agreement = label_agreement(detection.hypotheses, candidate.labels.expected_words())
    if course is not None:
        same_kind = agreement >= parameters.same_kind
        others_per_m2 = parameters.people_per_m2 if same_kind else parameters.things_per_m2
        log_ratio = course_log_ratio(detection, course, others_per_m2)
    else:
        # Called otherwise, either must lie on the other: a keyboard lies on a desk and is none.
        shared = np.sqrt(covered * explained) if agreement >= parameters.same_kind else min(covered, explained)
        overlap = parameters.overlap_weight * shared + parameters.no_overlap
        log_ratio = overlap + distance_log_ratio(detection.centroid_map, candidate, covered, parameters)
    log_ratio += float(np.log((agreement + parameters.label_floor) / parameters.label_by_chance))
    track_id = candidate.track_ids.get(camera_id, -1)
    if detection.track_id >= 0 and track_id >= 0:
        log_ratio += parameters.same_track if detection.track_id == track_id else parameters.other_track
    return Affinity(covered, explained, float(log_ratio))


def course_log_ratio(detection: LiftedDetection, course: Course, others_per_m2: float) -> float:
    """Log ratio of the densities with which it, and anything else, would be seen at the detection's place."""
    variance = course.sigma_m**2
    off = detection.centroid_map[:2] - course.place
    return float(-np.log(2 * np.pi * variance * others_per_m2) - off @ off / (2 * variance))


def distance_log_ratio(
    centroid_map: FloatArray, candidate: MapObject, covered: float, parameters: AssociationParameters = DEFAULT
) -> float:
    """Centroids (3,) compared on the scale of the object; cut views shift them, so overlap excuses distance."""
    spread = parameters.spread_m + parameters.spread_share * candidate.shape.extent_m
    distance = float(np.linalg.norm(centroid_map - candidate.shape.centroid))
    log_ratio = max(parameters.near_log_ratio - 0.5 * (distance / spread) ** 2, parameters.min_distance_log_ratio)
    return log_ratio if log_ratio >= 0 else log_ratio * (1 - covered)


def share_inside(detection: LiftedDetection, view: ObjectView) -> float:
    """Share of the object's shown voxels whose pixels lie within the detection's mask."""
    seen = view.shown
    count = np.count_nonzero(seen)
    if count == 0:
        return 0.0
    return np.count_nonzero(pixels_inside(detection, view) & seen) / count


def pixels_inside(detection: LiftedDetection, view: ObjectView) -> BoolArray:
    """(n,) which of an object's voxels project into the detection's mask."""
    return pixels_in_region(detection.mask.pixels, detection.mask.u0, detection.mask.v0, view)


def pixels_in_region(region: BoolArray, u0: int, v0: int, view: ObjectView) -> BoolArray:
    """(n,) which of an object's voxels project into a region (h, w) whose upper left corner is pixel (u0, v0)."""
    h, w = region.shape
    u, v = view.u - u0, view.v - v0
    within = np.flatnonzero(view.on_image & (u.view(np.uint64) < w) & (v.view(np.uint64) < h))  # negative ones are huge
    inside = np.zeros(len(u), dtype=bool)
    inside[within] = region.ravel()[v[within] * w + u[within]]
    return inside


def associate(
    detections: Sequence[LiftedDetection],
    candidates: Sequence[MapObject],
    views: Mapping[int, ObjectView],
    courses: Courses = NO_COURSES,
    *,
    camera_id: str = MAIN_CAMERA,
    parameters: AssociationParameters = DEFAULT,
) -> Association:
    """Assign detections of one camera's image to objects one to one so that the summed log ratio is greatest; pairs
    below the gate stay free.
    """
    if not detections or not candidates:
        return Association((), tuple(range(len(detections))))
    scores = np.full((len(detections), len(candidates)), -np.inf)
    table: dict[tuple[int, int], Affinity] = {}
    bounds = bounds_of(candidates)
    for row, detection in enumerate(detections):
        for column in np.flatnonzero(near_enough(detection, candidates, bounds, courses, parameters)):
            candidate = candidates[int(column)]
            number = candidate.number
            table[row, int(column)] = affinity(
                detection,
                candidate,
                views.get(number),
                courses.get(number),
                camera_id=camera_id,
                parameters=parameters,
            )
            scores[row, column] = table[row, int(column)].log_ratio
    gain = np.where(scores > parameters.gate, scores - parameters.gate, 0.0)
    rows, columns = linear_sum_assignment(gain, maximize=True)
    pairs = tuple(
        (int(row), candidates[int(column)].number, table[int(row), int(column)])
        for row, column in zip(rows, columns, strict=True)
        if gain[row, column] > 0
    )
    taken = {row for row, _, _ in pairs}
    return Association(pairs, tuple(row for row in range(len(detections)) if row not in taken))


def bounds_of(candidates: Sequence[MapObject]) -> tuple[FloatArray, FloatArray]:
    """Where m candidates begin and end along each axis, (m, 3) each."""
    return np.array([obj.shape.low for obj in candidates]), np.array([obj.shape.high for obj in candidates])


def near_enough(
    detection: LiftedDetection,
    candidates: Sequence[MapObject],
    bounds: tuple[FloatArray, FloatArray],
    courses: Courses = NO_COURSES,
    parameters: AssociationParameters = DEFAULT,
) -> BoolArray:
    """(m,) which candidates' `bounds` (`bounds_of`) come within their own size and some margin of the detection's
    centroid, or whose course leads there.
    """
    near = bounds_near(detection, *bounds, parameters)
    for column, obj in enumerate(candidates):
        if not near[column] and obj.number in courses:
            near[column] = on_course(detection, courses[obj.number], parameters)
    return near


def on_course(detection: LiftedDetection, course: Course, parameters: AssociationParameters = DEFAULT) -> bool:
    """Whether something on its way may be at the detection's place."""
    off_m = float(np.linalg.norm(detection.centroid_map[:2] - course.place))
    return off_m < parameters.course_sigmas * course.sigma_m


def bounds_near(
    detection: LiftedDetection, low: FloatArray, high: FloatArray, parameters: AssociationParameters = DEFAULT
) -> BoolArray:
    """(m,) which of the bounds `low`, `high` (m, 3) come within their own size and some margin of the detection's
    centroid.
    """
    gap: FloatArray = np.maximum(np.maximum(low - detection.centroid_map, detection.centroid_map - high), 0)
    reach = parameters.reach_m + parameters.reach_share * np.maximum((high - low).max(axis=1), detection.extent_m)
    near: BoolArray = np.sqrt(np.square(gap).sum(axis=1)) <= reach
    return near


def within_reach(
    detections: Sequence[LiftedDetection],
    objects: ObjectMap,
    courses: Courses = NO_COURSES,
    parameters: AssociationParameters = DEFAULT,
) -> list[MapObject]:
    """The objects that are near enough to one of the detections, in the map's order."""
    if not detections:
        return []
    bounds = objects.bounds()
    near = np.any([bounds_near(detection, bounds.low, bounds.high, parameters) for detection in detections], axis=0)
    numbers = [bounds.numbers[row] for row in np.flatnonzero(near)]
    coming = {
        number
        for number, course in courses.items()
        if any(on_course(detection, course, parameters) for detection in detections)
    }
    return [objects[number] for number in (*numbers, *sorted(coming.difference(numbers)))]
