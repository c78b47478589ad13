"""All that is known of one instance, now or at a time (`supermap show ID`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from supermap_cli.errors import QueryError
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import ObservationRef, StoredInstance
from supermap_cli.query.clock import Clock
from supermap_cli.query.detectors import detector_of
from supermap_cli.query.instance_at import evidence_until, intervals_until, label_at, observations_until
from supermap_cli.query.label_consensus import group_by_traversal, label_shares
from supermap_cli.query.presence_at import PresenceValue, PresenceView, presence_at, presence_view, state_held_at
from supermap_cli.query.relations import box_distance_m
from supermap_cli.query.time_points import TimePoint
from supermap_cli.query.views import (
    BoxView,
    EvidenceView,
    IntervalView,
    RelationView,
    Vector,
    box_view,
    evidence_view,
    interval_view,
    support_spans,
    vector,
)
from supermap_cli.types.existence import log_odds_of
from supermap_cli.types.memory import Presence, SpatialEdge


@dataclass(frozen=True)
class CalledView:
    """What one traversal's detector called an instance most of all, with its share of the scores."""

    traversal: str
    detector: str
    label: str
    share: float


@dataclass(frozen=True)
class ObjectDetails:
    """One instance as believed now, or as of a time; then `standing` gives the basis of its presence."""

    id: str
    asked_id: str
    label: str
    label_belief: dict[str, float]
    presence: Presence | PresenceValue
    existence_log_odds: float
    position: Vector
    box: BoxView
    first_seen_ns: int
    last_seen_ns: int
    merged_ids: tuple[str, ...]
    intervals: tuple[IntervalView, ...]
    relations: tuple[RelationView, ...]
    evidence: EvidenceView
    called: tuple[CalledView, ...]
    as_of: str | None = field(default=None, metadata={"optional": True})
    as_of_ns: int | None = field(default=None, metadata={"optional": True})
    standing: PresenceView | None = field(default=None, metadata={"optional": True})


def details(reader: MapReader, text_id: str) -> ObjectDetails:
    """One instance as believed now. Raises `QueryError` for an unknown id."""
    instance = find_instance(reader, text_id)
    return ObjectDetails(
        id=instance.id,
        asked_id=text_id,
        label=instance.label,
        label_belief={label: round(share, 4) for label, share in instance.label_belief.items()},
        presence=instance.presence,
        existence_log_odds=round(instance.existence_log_odds, 4),
        position=vector(instance.centroid_map),
        box=box_view(instance.box),
        first_seen_ns=instance.first_seen_ns,
        last_seen_ns=instance.last_seen_ns,
        merged_ids=merged_ids(reader, instance),
        intervals=tuple(map(interval_view, instance.states)),
        relations=relations_of(reader, instance, None),
        evidence=evidence_view(reader, instance, support_spans(instance.states)),
        called=_called(reader, reader.observations(instance)),
    )


def details_at(reader: MapReader, text_id: str, time_point: TimePoint, clock: Clock) -> ObjectDetails:
    """One instance as of a time. Raises `QueryError` for an unknown id, or if the instance has no state."""
    instance, at_ns = find_instance(reader, text_id), time_point.at_ns
    presence = presence_at(instance, at_ns, time_point.traversal_start_ns)
    if presence is None:
        raise QueryError(f"{text_id!r} has stood nowhere", where=reader.where, cure="leave out --at")
    state, observations = presence.state, observations_until(reader, instance, at_ns)
    return ObjectDetails(
        id=instance.id,
        asked_id=text_id,
        label=label_at(presence, observations, at_ns),
        label_belief={label: round(share, 4) for label, share in label_shares(observations).items()},
        presence="doubted" if instance.presence == "doubted" else presence.value,
        existence_log_odds=round(log_odds_of(state.confidence), 4),
        position=vector(state.centroid_map),
        box=box_view(state.box),
        first_seen_ns=instance.first_seen_ns,
        last_seen_ns=max((observation.stamp_ns for observation in observations), default=instance.first_seen_ns),
        merged_ids=merged_ids(reader, instance),
        intervals=intervals_until(instance, at_ns),
        relations=relations_of(reader, instance, at_ns),
        evidence=evidence_until(reader, instance, observations, at_ns),
        called=_called(reader, observations),
        as_of=time_point.text,
        as_of_ns=at_ns,
        standing=presence_view(presence, at_ns, clock),
    )


def _called(reader: MapReader, observations: Sequence[ObservationRef]) -> tuple[CalledView, ...]:
    """What each traversal called an instance."""
    by_traversal = group_by_traversal(observations)
    return tuple(
        CalledView(traversal.name, detector_of(traversal), label, round(share, 4))
        for traversal in reader.traversals
        for label, share in list(label_shares(by_traversal.get(traversal.id, ())).items())[:1]
    )


def find_instance(reader: MapReader, text_id: str) -> StoredInstance:
    """The instance with an id, or the one it was merged into. Raises `QueryError` for an unknown id."""
    instance = reader.instance(text_id)
    if instance is None:
        raise QueryError(
            f"there is no object {text_id!r}", where=reader.where, cure="`supermap show` lists those there are"
        )
    return instance


def merged_ids(reader: MapReader, instance: StoredInstance) -> tuple[str, ...]:
    """The ids of the instances merged into this one."""
    return tuple(reader.text_ids[number] for number in instance.numbers if number != instance.number)


def relations_of(reader: MapReader, instance: StoredInstance, at_ns: int | None) -> tuple[RelationView, ...]:
    """The stored relations of an instance that hold now (`at_ns` is `None`) or at a time. A relation stored in both
    directions is listed once, with this instance as the subject.
    """
    edges = reader.edges_of([instance.number], open_only=at_ns is None)
    holding = [edge for edge in edges if _holds(edge, at_ns)]
    stored_forms = {(edge.subject, edge.relation, edge.object) for edge in holding}
    ends = {number for edge in holding for number in (edge.subject, edge.object)}
    others = {instance.number: instance for instance in reader.instances_of(ends)}
    return tuple(
        relation_view(reader, edge, others[edge.subject], others[edge.object], at_ns)
        for edge in holding
        if edge.subject == instance.number
        or (edge.object == instance.number and (edge.object, edge.relation, edge.subject) not in stored_forms)
    )


def relation_view(
    reader: MapReader, edge: SpatialEdge, subject: StoredInstance, obj: StoredInstance, at_ns: int | None
) -> RelationView:
    """A stored relation as a view, with the distance between the two boxes now or at a time."""
    boxes = []
    for end in (subject, obj):
        state = None if at_ns is None else state_held_at(end.states, at_ns)
        boxes.append(end.box if state is None else state.box)
    return RelationView(
        name=edge.relation,
        subject=reader.text_ids[edge.subject],
        object=reader.text_ids[edge.object],
        basis="stored",
        stored_as=f"{edge.relation}({reader.text_ids[edge.subject]}, {reader.text_ids[edge.object]})",
        since_ns=edge.since_ns,
        until_ns=edge.until_ns,
        distance_m=round(box_distance_m(*boxes), 4),
        confidence=round(edge.confidence, 4),
    )


def _holds(edge: SpatialEdge, at_ns: int | None) -> bool:
    if at_ns is None:
        return edge.until_ns is None
    return edge.since_ns <= at_ns and (edge.until_ns is None or at_ns < edge.until_ns)
