"""The life of one instance (`supermap history ID`), and what stands now (`supermap show [ID]`)."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from supermap_cli.errors import QueryError
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.relations import box_distance_m
from supermap_cli.query.views import (
    BoxView,
    EventView,
    EvidenceView,
    InstanceView,
    IntervalView,
    RelationView,
    TraversalView,
    Vector,
    box_view,
    event_view,
    evidence_view,
    interval_view,
    support_spans,
    traversal_view,
    vector,
)
from supermap_cli.types.memory import Presence


@dataclass(frozen=True)
class Overview:
    """What stands now, how much of what, and from where that is known; `absent` counts what stood once."""

    instances: tuple[InstanceView, ...]
    counts: dict[str, int]
    absent: int
    traversals: tuple[TraversalView, ...]


@dataclass(frozen=True)
class ObjectDetails:
    """Everything about one instance as it is believed to be now."""

    id: str
    asked_id: str
    label: str
    label_belief: dict[str, float]
    presence: Presence
    existence_log_odds: float
    position: Vector
    box: BoxView
    first_seen_ns: int
    last_seen_ns: int
    merged_ids: tuple[str, ...]
    intervals: tuple[IntervalView, ...]
    relations: tuple[RelationView, ...]
    evidence: EvidenceView


@dataclass(frozen=True)
class SightingsView:
    """How one traversal saw an instance, in keyframes."""

    traversal: str
    supported: int
    in_view: int
    contradicted: int
    first_support_ns: int | None
    last_support_ns: int | None
    observation_count: int


@dataclass(frozen=True)
class History:
    """The life of one instance: its states, what happened between them, and how each traversal saw it."""

    id: str
    asked_id: str
    label: str
    presence: Presence
    intervals: tuple[IntervalView, ...]
    events: tuple[EventView, ...]
    sightings: tuple[SightingsView, ...]
    evidence: EvidenceView


def overview(reader: MapReader) -> Overview:
    """All current objects."""
    present = [each for each in reader.instances if each.presence == "present"]
    counts = Counter(each.label for each in present)
    return Overview(
        instances=tuple(_summary(reader, each) for each in present),
        counts=dict(sorted(counts.items())),
        absent=sum(each.presence == "absent" for each in reader.instances),
        traversals=tuple(map(traversal_view, reader.traversals)),
    )


def details(reader: MapReader, text_id: str) -> ObjectDetails:
    """One instance. Raises `QueryError` for an id that there never was."""
    instance = _find(reader, text_id)
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
        merged_ids=tuple(reader.text_ids[each] for each in instance.numbers if each != instance.number),
        intervals=tuple(map(interval_view, instance.states)),
        relations=_relations(reader, instance),
        evidence=evidence_view(reader, instance, support_spans(instance.states)),
    )


def history(reader: MapReader, text_id: str) -> History:
    """The life of one instance. Raises `QueryError` for an id that there never was."""
    instance = _find(reader, text_id)
    names = {each.id: each.name for each in reader.traversals}
    seen = Counter(each.traversal_id for each in reader.sightings(instance))
    return History(
        id=instance.id,
        asked_id=text_id,
        label=instance.label,
        presence=instance.presence,
        intervals=tuple(map(interval_view, instance.states)),
        events=tuple(event_view(edge, reader) for edge in reader.temporal_edges(instance.numbers)),
        sightings=tuple(
            SightingsView(
                names[visit.traversal_id],
                visit.supported,
                visit.in_view,
                visit.contradicted,
                visit.first_support_ns,
                visit.last_support_ns,
                seen[visit.traversal_id],
            )
            for visit in sorted(instance.visits, key=lambda each: each.traversal_id)
        ),
        evidence=evidence_view(reader, instance, support_spans(instance.states)),
    )


def _find(reader: MapReader, text_id: str) -> StoredInstance:
    instance = reader.instance(text_id)
    if instance is None:
        raise QueryError(
            f"there is no object {text_id!r}", where=str(reader.path), cure="`supermap show` lists those there are"
        )
    return instance


def _summary(reader: MapReader, instance: StoredInstance) -> InstanceView:
    return InstanceView(
        id=instance.id,
        label=instance.label,
        presence=instance.presence,
        position=vector(instance.centroid_map),
        box=box_view(instance.box),
        confidence=round(instance.states[-1].confidence, 4),
        intervals=tuple(interval_view(state) for state in instance.states),
        relations=(),
        evidence=evidence_view(reader, instance, support_spans(instance.states)),
    )


def _relations(reader: MapReader, instance: StoredInstance) -> tuple[RelationView, ...]:
    """The stored relations that still hold; one that is stored both ways is told from this instance's side."""
    edges = reader.edges_of([instance.number], open_only=True)
    held = {(edge.subject, edge.relation, edge.object) for edge in edges}
    ends = {number for edge in edges for number in (edge.subject, edge.object)}
    boxes = {each.number: each.box for each in reader.instances_of(ends)}
    return tuple(
        RelationView(
            name=edge.relation,
            subject=reader.text_ids[edge.subject],
            object=reader.text_ids[edge.object],
            basis="stored",
            stored_as=f"{edge.relation}({reader.text_ids[edge.subject]}, {reader.text_ids[edge.object]})",
            since_ns=edge.since_ns,
            until_ns=edge.until_ns,
            distance_m=round(box_distance_m(boxes[edge.subject], boxes[edge.object]), 4),
            confidence=round(edge.confidence, 4),
        )
        for edge in edges
        if edge.subject == instance.number
        or (edge.object == instance.number and (edge.object, edge.relation, edge.subject) not in held)
    )
