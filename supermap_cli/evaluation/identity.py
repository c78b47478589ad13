"""Identity over time: duplicates, switches, relocated objects, stale instances, person passages, IDF1, HOTA."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.evaluation.estimate import EstimatedMap, EstimatedObject
from supermap_cli.evaluation.known_truth import KnownTruth, known_truth
from supermap_cli.evaluation.matching import TrueIdentity, closeness, identify
from supermap_cli.evaluation.passages import PassageScores, score_passages
from supermap_cli.evaluation.shares import mean, share
from supermap_cli.evaluation.switches import IdentitySwitch, observers_of_static_objects, switches
from supermap_cli.evaluation.tracking import TrackingScores, score_tracking
from supermap_cli.types.truth import GroundTruth


@dataclass(frozen=True)
class ObjectInstances:
    """A true object that is not exactly one instance."""

    object_id: str
    label: str
    instances: tuple[str, ...]


@dataclass(frozen=True)
class RelocatedObject:
    """A moved object: the instances at its new place, and the one of them with a state at the old place (`kept`)."""

    object_id: str
    label: str
    distance_m: float | None
    instances: tuple[str, ...]
    kept: str | None


@dataclass(frozen=True)
class StaleInstance:
    """A present instance in a place that its object has left; `seen_empty`: a keyframe afterwards had it in view."""

    instance_id: str
    label: str
    object_id: str
    seen_empty: bool


@dataclass(frozen=True)
class IdentityScores:
    """Identity scores; instances are identified with true objects by `matching.identify`, whatever the labels.

    - `instances_per_object`: the mean number of instances, present or not, that are one countable object at some time,
      over the `found_objects` that are at least one; `several` lists those that are more, `never_found` the others.
    - `switches`: of static objects (that stood in one place all the time), how often consecutive keyframes with
      observations of an object give it to different instances (the IDSW of MOTChallenge, Leal-Taixe et al. 2015; which
      object an observation shows says `switches.observers_of_static_objects`). `static_objects` were observed.
    - relocated objects are those of the truth's moves whose both places images showed well: `relocated_found` is the
      share that some instance has a state in the new place which begins after the move (not before the last keyframe
      before it), `relocated_kept` the share that such an instance has another state in the old place. One state near
      both places is a move that went unnoticed, neither found nor kept. `None` where nothing moved.
    - `stale`: present instances at the end that are near no standing object (`Closeness.near`) but near a place that an
      object has left; `stale_share` is their share of all present instances, `None` where there are none.
      `vacated_places` counts the well-shown places that are empty at the end and were in view since.
    - `passages`: whether a person who walks by is one instance.
    - `tracking`: IDF1 and HOTA.
    """

    instances_per_object: float | None
    found_objects: int
    several: tuple[ObjectInstances, ...]
    never_found: tuple[ObjectInstances, ...]
    switches: int
    static_objects: int
    switched: tuple[IdentitySwitch, ...]
    relocated_found: float | None
    relocated_kept: float | None
    relocated: tuple[RelocatedObject, ...]
    stale_share: float | None
    vacated_places: int
    stale: tuple[StaleInstance, ...]
    passages: PassageScores
    tracking: TrackingScores


def score_identity(estimate: EstimatedMap, truth: GroundTruth) -> IdentityScores:
    """Score the identities of all instances over time."""
    known = known_truth(estimate, truth)
    identified = identify(estimate, known)
    objects = _instances_of_objects(estimate, known, identified)
    found = [obj for obj in objects if obj.instances]
    observers = observers_of_static_objects(estimate, known, identified)
    switched = switches(observers)
    relocated = _relocated_objects(estimate, truth, known, identified)
    stale = _stale_instances(estimate, known)
    return IdentityScores(
        instances_per_object=mean(len(obj.instances) for obj in found),
        found_objects=len(found),
        several=tuple(obj for obj in found if len(obj.instances) > 1),
        never_found=tuple(obj for obj in objects if not obj.instances),
        switches=len(switched),
        static_objects=len(observers),
        switched=switched,
        relocated_found=share(sum(bool(obj.instances) for obj in relocated), len(relocated)),
        relocated_kept=share(sum(obj.kept is not None for obj in relocated), len(relocated)),
        relocated=relocated,
        stale_share=share(len(stale), sum(instance.presence == "present" for instance in estimate.objects)),
        vacated_places=sum(_seen_empty(k, known) for k, place in enumerate(known.places) if place.countable),
        stale=stale,
        passages=score_passages(estimate, truth),
        tracking=score_tracking(estimate, known),
    )


def _instances_of_objects(
    estimate: EstimatedMap, known: KnownTruth, identified: Sequence[Sequence[TrueIdentity | None]]
) -> list[ObjectInstances]:
    """Every countable object with all instances identified as it at some time."""
    labels = {place.object.id: place.object.label for place in known.places if place.countable}
    instances: dict[str, list[str]] = {object_id: [] for object_id in labels}
    for instance, states in zip(estimate.objects, identified, strict=True):
        for object_id in {state.object_id for state in states if state is not None}:
            if object_id in instances:
                instances[object_id].append(instance.id)
    return [ObjectInstances(object_id, labels[object_id], tuple(ids)) for object_id, ids in instances.items()]


def _relocated_objects(
    estimate: EstimatedMap,
    truth: GroundTruth,
    known: KnownTruth,
    identified: Sequence[Sequence[TrueIdentity | None]],
) -> tuple[RelocatedObject, ...]:
    """Every true move between two countable places."""
    mapped = {traversal.name for traversal in known.traversals}
    rows = []
    for change in truth.changes:
        old = known.place_of(change.object_id, change.from_state)
        new = known.place_of(change.object_id, change.to_state)
        if change.kind != "moved" or old is None or new is None or not mapped.issuperset(change.between):
            continue
        if known.places[old].countable and known.places[new].countable:
            not_before_ns = int(known.stamps_ns[known.stamps_ns < change.stamp_ns].max(initial=0))
            there, both = [], []
            for instance, identities in zip(estimate.objects, identified, strict=True):
                arrived = _states_in(new, instance, identities, since_ns=not_before_ns)
                if arrived:
                    there.append(instance.id)
                if arrived and _states_in(old, instance, identities) - arrived:
                    both.append(instance.id)
            label = known.places[new].object.label
            rows.append(
                RelocatedObject(change.object_id, label, change.distance_m, tuple(there), both[0] if both else None)
            )
    return tuple(rows)


def _states_in(
    place: int, instance: EstimatedObject, identities: Sequence[TrueIdentity | None], *, since_ns: int = 0
) -> set[int]:
    """Which states of an instance stand in a place, of those that begin at a time or later."""
    return {
        k
        for k, (state, identified) in enumerate(zip(instance.states, identities, strict=True))
        if identified is not None and place in identified.places and state.first_seen_ns >= since_ns
    }


def _stale_instances(estimate: EstimatedMap, known: KnownTruth) -> tuple[StaleInstance, ...]:
    present = [instance for instance in estimate.objects if instance.presence == "present"]
    near = closeness(present, known.places).near
    standing = np.isin(np.arange(len(known.places)), known.standing)
    rows = []
    for instance, row in zip(present, near, strict=True):
        left = np.flatnonzero(row & ~standing)
        if len(left) and not (row & standing).any():
            newest = int(left[-1])
            place = known.places[newest]
            rows.append(StaleInstance(instance.id, instance.label, place.object.id, _seen_empty(newest, known)))
    return tuple(rows)


def _seen_empty(place: int, known: KnownTruth) -> bool:
    """Whether an object has left a place, and a keyframe since then had the place in view."""
    return bool(known.in_view_left[place].any())
