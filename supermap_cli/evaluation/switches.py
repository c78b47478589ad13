"""Identity switches of static objects: changes of the instance that observations of an object belong to."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.evaluation.estimate import EstimatedMap, EstimatedObject
from supermap_cli.evaluation.known_truth import KnownTruth, Place
from supermap_cli.evaluation.matching import TrueIdentity, centroids
from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.geometry.boxes import Box3D

BOX_MARGIN_M = 0.15
"""Metres by which an object's box is enlarged on every side to contain the centroids of its observations. Chosen."""

ObserversByKeyframe = dict[str, dict[int, list[str]]]
"""True object id -> stamp of a keyframe -> instances that observed it then, nearest observation first."""


@dataclass(frozen=True)
class IdentitySwitch:
    """At a keyframe, a static object's observations come from another instance than before."""

    object_id: str
    stamp_ns: int
    before: str
    after: str


def switches(observers: ObserversByKeyframe) -> tuple[IdentitySwitch, ...]:
    """All switches along the keyframes of every object; as long as the current instance observes it, there is none."""
    found = []
    for object_id, at in observers.items():
        current: str | None = None
        for stamp_ns, instances in at.items():
            if current in instances:
                continue
            if current is not None:
                found.append(IdentitySwitch(object_id, stamp_ns, current, instances[0]))
            current = instances[0]
    return tuple(found)


def observers_of_static_objects(
    estimate: EstimatedMap, known: KnownTruth, identified: Sequence[Sequence[TrueIdentity | None]]
) -> ObserversByKeyframe:
    """Which instances observed the static objects (those that stood in one place all the time), and when.

    An observation is of the object that its instance's state then is (`identified`), if it lies within reach of that
    object's box, else of the object standing then with the nearest centroid among those within reach.
    """
    static = _static_objects(known)
    seen: dict[str, dict[int, list[tuple[float, str]]]] = defaultdict(lambda: defaultdict(list))
    for instance, states in zip(estimate.objects, identified, strict=True):
        points, stamps_ns = _observations(instance)
        own = _own_object(instance, states, stamps_ns)
        for k, row in _observed_places(points, stamps_ns, own, known):
            place = known.places[row]
            if place.object.id in static:
                distance_m = float(np.linalg.norm(place.centroid - points[k]))
                seen[place.object.id][int(stamps_ns[k])].append((distance_m, instance.id))
    return {
        object_id: {stamp_ns: [instance_id for _, instance_id in sorted(at[stamp_ns])] for stamp_ns in sorted(at)}
        for object_id, at in sorted(seen.items())
    }


def _static_objects(known: KnownTruth) -> set[str]:
    stays: dict[str, list[Place]] = defaultdict(list)
    for place in known.places:
        stays[place.object.id].append(place)
    return {object_id for object_id, places in stays.items() if len(places) == 1 and not places[0].object.motions}


def _observations(instance: EstimatedObject) -> tuple[FloatArray, IntArray]:
    """Where (n, 3) and when (n,) an instance was observed."""
    points = np.array([observation.centroid for observation in instance.observations], np.float64).reshape(-1, 3)
    return points, np.array([observation.stamp_ns for observation in instance.observations], np.int64)


def _own_object(
    instance: EstimatedObject, states: Sequence[TrueIdentity | None], stamps_ns: IntArray
) -> list[str | None]:
    """(n,): id of the true object that an instance is at each stamp; `None` where it is none."""
    own: list[str | None] = [None] * len(stamps_ns)
    for state, identity in zip(instance.states, states, strict=True):
        for k in np.flatnonzero((state.first_seen_ns <= stamps_ns) & (stamps_ns <= state.last_seen_ns)):
            own[k] = identity.object_id if identity is not None else None
    return own


def _observed_places(
    points: FloatArray, stamps_ns: IntArray, own: Sequence[str | None], known: KnownTruth
) -> list[tuple[int, int]]:
    """(observation, place) of those of n observations that are of an object."""
    if not len(points) or not known.places:
        return []
    fits = within([place.box for place in known.places], points, BOX_MARGIN_M) & known.present_at(stamps_ns).T
    ids = [place.object.id for place in known.places]
    is_own = fits & np.array([[place_id == one for place_id in ids] for one in own], dtype=bool)
    candidates = np.where(is_own.any(axis=1, keepdims=True), is_own, fits)
    distances_m = np.linalg.norm(points[:, None] - centroids(known.places)[None], axis=2)
    nearest = np.argmin(np.where(candidates, distances_m, np.inf), axis=1)
    return [(int(k), int(nearest[k])) for k in np.flatnonzero(candidates.any(axis=1))]


def within(boxes: Sequence[Box3D], points: FloatArray, reach_m: float) -> BoolArray:
    """Whether points (n, 3) lie within boxes (p) enlarged by `reach_m` on every side: (n, p)."""
    yaw = np.array([box.yaw for box in boxes])
    offsets = points[:, None, :] - np.array([box.center for box in boxes])[None]
    c, s = np.cos(yaw), np.sin(yaw)
    along = np.stack(
        [c * offsets[..., 0] + s * offsets[..., 1], c * offsets[..., 1] - s * offsets[..., 0], offsets[..., 2]], axis=2
    )
    inside: BoolArray = (np.abs(along) <= np.array([box.size for box in boxes]) / 2 + reach_m).all(axis=2)
    return inside
