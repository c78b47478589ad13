"""Data association: which detection is of which object, as one gated assignment of log-likelihood ratios."""

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
from supermap_cli.types.labels import ANIMATE

PEOPLE_PER_M2, THINGS_PER_M2 = 0.05, 1.0
"""What else may be seen in a place: others that move by themselves, one in a room of 20 square metres, or any thing."""

SAME_KIND = 0.2
"""What agrees less on the label may be any thing as well as somebody the detector takes for one."""

Courses = Mapping[int, Course]
"""Object number -> where it is expected now, of those that move by themselves and were seen of late."""

NO_COURSES: Courses = MappingProxyType({})

ANIMATE_MEMORY_NS = 3_000_000_000
"""What moves by itself is believed in no longer than this without being seen."""


def expected_courses(objects: ObjectMap, stamp_ns: int) -> Courses:
    """Where those that move by themselves, and were seen of late, are expected now."""
    recent = [each for each in objects if stamp_ns - each.last_seen_ns <= ANIMATE_MEMORY_NS]
    return {
        each.number: each.motion.course.at(stamp_ns)
        for each in recent
        if each.motion.course is not None and each.label in ANIMATE
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
    detection: LiftedDetection, candidate: MapObject, view: ObjectView | None, course: Course | None = None
) -> Affinity:
    """Score one pair. A partial view must not count against the match: overlap is measured on what is seen of both.

    Of what is on its way, neither overlap nor distance from where it was says anything: it is looked for on its course.
    """
    shape = candidate.shape
    covered = shape.share_near(detection.points_map)
    explained = share_inside(detection, view) if view is not None else 0.0
    agreement = label_agreement(detection.hypotheses, candidate.labels.probabilities())
    if course is not None:
        others_per_m2 = PEOPLE_PER_M2 if agreement >= SAME_KIND else THINGS_PER_M2
        log_ratio = course_log_ratio(detection, course, others_per_m2)
    else:
        log_ratio = (
            4 * np.sqrt(covered * explained) - 1.5 + distance_log_ratio(detection.centroid_map, candidate, covered)
        )
    log_ratio += float(np.log((agreement + 0.05) / 0.2))
    if detection.track_id >= 0 and candidate.track_id >= 0:
        log_ratio += 1.0 if detection.track_id == candidate.track_id else -0.5
    return Affinity(covered, explained, float(log_ratio))


def course_log_ratio(detection: LiftedDetection, course: Course, others_per_m2: float) -> float:
    """Log ratio of the densities with which it, and anything else, would be seen at the detection's place."""
    variance = course.sigma_m**2
    off = detection.centroid_map[:2] - course.place
    return float(-np.log(2 * np.pi * variance * others_per_m2) - off @ off / (2 * variance))


def distance_log_ratio(centroid_map: FloatArray, candidate: MapObject, covered: float) -> float:
    """Centroids (3,) compared on the scale of the object; cut views shift them, so overlap excuses distance."""
    spread = 0.1 + 0.25 * candidate.shape.extent_m
    distance = float(np.linalg.norm(centroid_map - candidate.shape.centroid))
    log_ratio = max(1 - 0.5 * (distance / spread) ** 2, -2.0)
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
    within = np.flatnonzero(view.on_image & (u >= 0) & (v >= 0) & (u < w) & (v < h))
    inside = np.zeros(len(u), dtype=bool)
    inside[within] = region.ravel()[v[within] * w + u[within]]
    return inside


def associate(
    detections: Sequence[LiftedDetection],
    candidates: Sequence[MapObject],
    views: Mapping[int, ObjectView],
    courses: Courses = NO_COURSES,
    gate: float = 0.0,
) -> Association:
    """Assign detections to objects one to one so that the summed log ratio is greatest; pairs below the gate stay
    free.
    """
    if not detections or not candidates:
        return Association((), tuple(range(len(detections))))
    scores = np.full((len(detections), len(candidates)), -np.inf)
    table: dict[tuple[int, int], Affinity] = {}
    for row, detection in enumerate(detections):
        for column in np.flatnonzero(near_enough(detection, candidates, courses)):
            candidate = candidates[int(column)]
            number = candidate.number
            table[row, int(column)] = affinity(detection, candidate, views.get(number), courses.get(number))
            scores[row, column] = table[row, int(column)].log_ratio
    gain = np.where(scores > gate, scores - gate, 0.0)
    rows, columns = linear_sum_assignment(gain, maximize=True)
    pairs = tuple(
        (int(row), candidates[int(column)].number, table[int(row), int(column)])
        for row, column in zip(rows, columns, strict=True)
        if gain[row, column] > 0
    )
    taken = {row for row, _, _ in pairs}
    return Association(pairs, tuple(row for row in range(len(detections)) if row not in taken))


def near_enough(
    detection: LiftedDetection, candidates: Sequence[MapObject], courses: Courses = NO_COURSES
) -> BoolArray:
    """(m,) which candidates' bounds come within their own size and 0.3 m of the detection's centroid, or whose course
    leads there.
    """
    low, high = np.array([each.shape.low for each in candidates]), np.array([each.shape.high for each in candidates])
    near = bounds_near(detection, low, high)
    for column, each in enumerate(candidates):
        if not near[column] and each.number in courses:
            near[column] = on_course(detection, courses[each.number])
    return near


def on_course(detection: LiftedDetection, course: Course) -> bool:
    """Whether something on its way may be at the detection's place."""
    return float(np.linalg.norm(detection.centroid_map[:2] - course.place)) < 3 * course.sigma_m


def bounds_near(detection: LiftedDetection, low: FloatArray, high: FloatArray) -> BoolArray:
    """(m,) which of the bounds `low`, `high` (m, 3) come within their own size and 0.3 m of the detection's
    centroid.
    """
    gap: FloatArray = np.maximum(np.maximum(low - detection.centroid_map, detection.centroid_map - high), 0)
    reach = 0.3 + 0.5 * np.maximum((high - low).max(axis=1), detection.extent_m)
    near: BoolArray = np.linalg.norm(gap, axis=1) <= reach
    return near


def reached(
    detections: Sequence[LiftedDetection], objects: ObjectMap, courses: Courses = NO_COURSES
) -> list[MapObject]:
    """The objects that are near enough to one of the detections, in the map's order."""
    if not detections:
        return []
    bounds = objects.bounds()
    near = np.any([bounds_near(each, bounds.low, bounds.high) for each in detections], axis=0)
    numbers = [bounds.numbers[row] for row in np.flatnonzero(near)]
    coming = {n for n, course in courses.items() if any(on_course(each, course) for each in detections)}
    return [objects[number] for number in (*numbers, *sorted(coming.difference(numbers)))]
