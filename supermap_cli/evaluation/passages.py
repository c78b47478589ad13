"""Tracking of people who walk by: whether one passage of a person is one instance."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.evaluation.estimate import EstimatedMap, EstimatedObject
from supermap_cli.evaluation.known_truth import (
    MIN_COUNTABLE_PIXELS,
    MIN_COUNTABLE_SHARE,
    images_of,
    keyframes_by_camera,
)
from supermap_cli.evaluation.matching import same_label
from supermap_cli.evaluation.objects import PERSON
from supermap_cli.evaluation.shares import share
from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.types.truth import GroundTruth, TrueMotion, TrueObject, TrueTraversal

MAX_PASSAGE_GAP_NS = 3_000_000_000
"""Nanoseconds (3 s) without view that do not end a passage: occlusion by a pillar, or the image's edge. Chosen."""

MAX_OBSERVATION_OFFSET_M = 0.8
"""Metres on the floor plane between an observation and the person's centre: half a stride and a shoulder (0.4 m), the
near side only being seen, and the odometry's error. Chosen.
"""

AMBIGUITY_RADIUS_M = 0.4
"""Metres between two people below which an observation cannot be assigned to one of them and counts for neither: the
width of a body.
"""

MIN_OBSERVATIONS = 3
"""Passages with fewer observations are not scored. Chosen."""

MIN_FOLLOWED_SHARE = 0.9
"""Share of a passage's observations that one instance must have for the passage to count as followed. Chosen."""


@dataclass(frozen=True)
class ObservedPassage:
    """One passage of a person, well visible in `keyframes` keyframes from `first_ns` to `last_ns`.

    In `observed` of them the map observed the person, by `instances` (most observations first).
    """

    object_id: str
    first_ns: int
    last_ns: int
    keyframes: int
    observed: int
    instances: tuple[str, ...]
    followed_share: float | None

    @property
    def judged(self) -> bool:
        """Whether it has enough observations to be scored."""
        return self.observed >= MIN_OBSERVATIONS

    @property
    def followed(self) -> bool:
        """Whether one instance has nearly all of its observations."""
        return self.followed_share is not None and self.followed_share >= MIN_FOLLOWED_SHARE


@dataclass(frozen=True)
class PassageScores:
    """Scores of person passages.

    A passage is a run of mapped keyframes in which a person in motion is well visible, by the measure of what else is
    countable (`known_truth`: 100 pixels, 0.2 of the front), with gaps of at most 3 s. Of every keyframe of it, the
    observation by an instance labelled "person" nearest to the person's true position counts, within 0.8 m on
    the floor plane, not nearer to another person, and not while another is within 0.4 m of the person; instances that
    are demoted by now count as well, since people who walked by are no part of the map. `followed` is the share, of
    those `judged` passages with at least three observations, in which one instance has at least 0.9 of them; `None`
    where there is none. `broken` lists the others, `passages` counts all.
    """

    followed: float | None
    passages: int
    judged: int
    broken: tuple[ObservedPassage, ...]


def score_passages(estimate: EstimatedMap, truth: GroundTruth) -> PassageScores:
    """Score every passage of every person."""
    found = list(_passages(estimate, truth))
    judged = [passage for passage in found if passage.judged]
    broken = tuple(passage for passage in judged if not passage.followed)
    return PassageScores(share(len(judged) - len(broken), len(judged)), len(found), len(judged), broken)


def _passages(estimate: EstimatedMap, truth: GroundTruth) -> Iterator[ObservedPassage]:
    by_camera = keyframes_by_camera(estimate)
    observers = _observers(estimate, [obj for obj in truth.objects if obj.kind == "person"])
    for traversal in truth.traversals:
        for number, person in enumerate(truth.objects):
            if person.kind == "person":
                for run in split_at_gaps(_well_visible(traversal, number, by_camera)):
                    yield _passage(person.id, run, observers)


def split_at_gaps(stamps_ns: IntArray) -> list[IntArray]:
    """Split ascending stamps (n,) at gaps longer than `MAX_PASSAGE_GAP_NS`."""
    if not len(stamps_ns):
        return []
    return np.split(stamps_ns, np.flatnonzero(np.diff(stamps_ns) > MAX_PASSAGE_GAP_NS) + 1)


def _well_visible(traversal: TrueTraversal, number: int, by_camera: Mapping[str | None, IntArray]) -> IntArray:
    """The stamps of the keyframes of a traversal that show an object in motion well."""
    frames, stamps_ns = images_of(traversal, by_camera)
    seen = traversal.sightings
    moving = (seen.object == number) & (seen.state < 0) & seen.present
    well = moving & (seen.pixels >= MIN_COUNTABLE_PIXELS) & (seen.visible >= MIN_COUNTABLE_SHARE)
    return np.unique(stamps_ns[np.isin(frames, seen.frame[well])])


def _passage(object_id: str, run: IntArray, observers: dict[tuple[str, int], str]) -> ObservedPassage:
    seen = [observers[object_id, stamp] for stamp in run.tolist() if (object_id, stamp) in observers]
    counts = Counter(seen).most_common()
    return ObservedPassage(
        object_id=object_id,
        first_ns=int(run[0]),
        last_ns=int(run[-1]),
        keyframes=len(run),
        observed=len(seen),
        instances=tuple(instance_id for instance_id, _ in counts),
        followed_share=share(counts[0][1], len(seen)) if counts else None,
    )


def _observers(estimate: EstimatedMap, people: Sequence[TrueObject]) -> dict[tuple[str, int], str]:
    """(person, keyframe) -> the instance whose observation lies nearest to the person then."""
    nearest: dict[tuple[str, int], tuple[float, str]] = {}
    for instance in (*estimate.objects, *estimate.doubted):
        if same_label(instance.label, PERSON):
            for person, stamp_ns, distance_m in _sightings(instance, people):
                known = nearest.get((person, stamp_ns), (MAX_OBSERVATION_OFFSET_M, ""))
                nearest[person, stamp_ns] = min(known, (distance_m, instance.id))
    return {key: instance_id for key, (_, instance_id) in nearest.items()}


def _sightings(instance: EstimatedObject, people: Sequence[TrueObject]) -> Iterator[tuple[str, int, float]]:
    """(person, keyframe, distance) of those observations of an instance that are of some person in motion."""
    for observation in instance.observations:
        positions = [(person.id, position_in_motion(person.motions, observation.stamp_ns)) for person in people]
        moving = {person_id: at[:2] for person_id, at in positions if at is not None}
        offsets = [
            (float(np.linalg.norm(observation.centroid[:2] - at)), person_id) for person_id, at in moving.items()
        ]
        distance_m, person_id = min(offsets, default=(np.inf, ""))
        if distance_m < MAX_OBSERVATION_OFFSET_M and not _is_ambiguous(person_id, moving):
            yield person_id, observation.stamp_ns, distance_m


def _is_ambiguous(person_id: str, moving: Mapping[str, FloatArray]) -> bool:
    """Whether another person is too close to tell the two apart."""
    return any(
        other != person_id and float(np.linalg.norm(at - moving[person_id])) < AMBIGUITY_RADIUS_M
        for other, at in moving.items()
    )


def position_in_motion(motions: Sequence[TrueMotion], stamp_ns: int) -> FloatArray | None:
    """Position (3,) of a moving object at a time; `None` outside its motions."""
    for motion in motions:
        if motion.stamps_ns[0] <= stamp_ns <= motion.stamps_ns[-1]:
            return np.array([np.interp(stamp_ns, motion.stamps_ns, column) for column in motion.centers_world.T])
    return None
