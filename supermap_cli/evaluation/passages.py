"""Who walks by: whether one passage of a person is one instance."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.evaluation.estimate import EstimatedMap, EstimatedObject
from supermap_cli.evaluation.known_truth import COUNTABLE_PIXELS, COUNTABLE_VISIBLE, images_of, keyframes_by_camera
from supermap_cli.evaluation.matching import same_label
from supermap_cli.evaluation.objects import PERSON
from supermap_cli.evaluation.shares import share
from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.types.truth import GroundTruth, TrueMotion, TrueObject, TrueTraversal

PASSAGE_GAP_NS = 3_000_000_000
"""Who is out of sight no longer than this still passes: a pillar or the image's edge hides for so long."""

REACH_M = 0.8
"""An observation is of a person whose middle was within this of it, on the floor plane: half a stride and a shoulder
(0.4 m), what is seen of the near side only, and the odometry's error.
"""

BODY_M = 0.4
"""Of two people whose middles are nearer to one another than a body is wide, nobody can tell who was observed: such
observations count for neither.
"""

LEAST_OBSERVATIONS = 3
"""A passage of which the map has fewer observations says nothing of who was followed."""

FOLLOWED_SHARE = 0.9
"""A passage is followed as one if one instance has at least this share of its observations."""


@dataclass(frozen=True)
class Passage:
    """One passage of a person: in how many `keyframes`, from `first_ns` to `last_ns`, it is well visible, in how many
    of those the map observed the person (`observed`), and by which `instances`, most observations first.
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
        """Whether the map has observed enough of it."""
        return self.observed >= LEAST_OBSERVATIONS

    @property
    def followed(self) -> bool:
        """Whether it is one instance's."""
        return self.followed_share is not None and self.followed_share >= FOLLOWED_SHARE


@dataclass(frozen=True)
class PassageScores:
    """How far who walks by is followed as one.

    A passage is a run of mapped keyframes in which a person in motion is well visible, by the measure of what else is
    countable (`known_truth`: 100 pixels, 0.2 of the front), with gaps of at most 3 s. Of every keyframe of it, the
    observation by an instance labelled "person" that lies nearest to where the person then was counts, within 0.8 m on
    the floor plane, not nearer to another person, and not while another is within 0.4 m of the person; instances that
    are doubted by now count as well, since who walked by is no part of the map. `followed` is the share, of those
    `judged` passages with at least three observations, in which one instance has at least 0.9 of them; `None` where
    there is none. `broken` lists the others, `passages` counts all.
    """

    followed: float | None
    passages: int
    judged: int
    broken: tuple[Passage, ...]


def score_passages(estimate: EstimatedMap, truth: GroundTruth) -> PassageScores:
    """Follow every person through every passage."""
    found = list(_passages(estimate, truth))
    judged = [each for each in found if each.judged]
    broken = tuple(each for each in judged if not each.followed)
    return PassageScores(share(len(judged) - len(broken), len(judged)), len(found), len(judged), broken)


def _passages(estimate: EstimatedMap, truth: GroundTruth) -> Iterator[Passage]:
    by_camera = keyframes_by_camera(estimate)
    observers = _observers(estimate, [each for each in truth.objects if each.kind == "person"])
    for traversal in truth.traversals:
        for number, person in enumerate(truth.objects):
            if person.kind == "person":
                for run in runs(_well_visible(traversal, number, by_camera)):
                    yield _passage(person.id, run, observers)


def runs(stamps_ns: IntArray) -> list[IntArray]:
    """Stamps (n,), ascending, parted wherever two of them are farther apart than `PASSAGE_GAP_NS`."""
    if not len(stamps_ns):
        return []
    return np.split(stamps_ns, np.flatnonzero(np.diff(stamps_ns) > PASSAGE_GAP_NS) + 1)


def _well_visible(traversal: TrueTraversal, number: int, by_camera: Mapping[str | None, IntArray]) -> IntArray:
    """The stamps of the keyframes of a traversal that show an object in motion well."""
    frames, stamps_ns = images_of(traversal, by_camera)
    seen = traversal.sightings
    moving = (seen.object == number) & (seen.state < 0) & seen.present
    well = moving & (seen.pixels >= COUNTABLE_PIXELS) & (seen.visible >= COUNTABLE_VISIBLE)
    return np.unique(stamps_ns[np.isin(frames, seen.frame[well])])


def _passage(object_id: str, run: IntArray, observers: dict[tuple[str, int], str]) -> Passage:
    seen = [observers[object_id, stamp] for stamp in run.tolist() if (object_id, stamp) in observers]
    counts = Counter(seen).most_common()
    return Passage(
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
                known = nearest.get((person, stamp_ns), (REACH_M, ""))
                nearest[person, stamp_ns] = min(known, (distance_m, instance.id))
    return {key: instance_id for key, (_, instance_id) in nearest.items()}


def _sightings(instance: EstimatedObject, people: Sequence[TrueObject]) -> Iterator[tuple[str, int, float]]:
    """(person, keyframe, distance) of those observations of an instance that are of some person in motion."""
    for each in instance.observations:
        here = [(person.id, place_at(person.motions, each.stamp_ns)) for person in people]
        moving = {who: at[:2] for who, at in here if at is not None}
        away = [(float(np.linalg.norm(each.centroid[:2] - at)), who) for who, at in moving.items()]
        distance_m, who = min(away, default=(np.inf, ""))
        if distance_m < REACH_M and not _entangled(who, moving):
            yield who, each.stamp_ns, distance_m


def _entangled(who: str, moving: Mapping[str, FloatArray]) -> bool:
    """Whether somebody else is where a person is."""
    return any(other != who and float(np.linalg.norm(at - moving[who])) < BODY_M for other, at in moving.items())


def place_at(motions: Sequence[TrueMotion], stamp_ns: int) -> FloatArray | None:
    """Where (3,) a thing in motion is at a time; `None` outside its motions."""
    for each in motions:
        if each.stamps_ns[0] <= stamp_ns <= each.stamps_ns[-1]:
            return np.array([np.interp(stamp_ns, each.stamps_ns, column) for column in each.centers_world.T])
    return None
