"""The history of one instance (`supermap history ID`)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from supermap_cli.memory.images import Crop, crops_of
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import ObservationRef, StoredInstance, StoredVisit
from supermap_cli.query.clock import Clock
from supermap_cli.query.details import find_instance, merged_ids, relation_view
from supermap_cli.query.detectors import detector_of
from supermap_cli.query.instance_at import label_at
from supermap_cli.query.label_consensus import group_by_traversal, label_shares
from supermap_cli.query.presence_at import PresenceValue, PresenceView, presence_at, presence_view
from supermap_cli.query.time_points import TimePoint
from supermap_cli.query.time_selector import state_end_ns
from supermap_cli.query.views import (
    EventView,
    EvidenceView,
    IntervalView,
    RelationView,
    event_view,
    evidence_of,
    interval_view,
)
from supermap_cli.relations.registry import RELATIONS
from supermap_cli.types.memory import Presence, SpatialEdge, StateRecord

MAX_RELATIONS = 12
"""Relations listed for one state, ranked by `_RELATION_PRIORITY`."""

MAX_FRAMES = 3
"""Pictures listed for one state: the best one per traversal."""

_SYMMETRIC_RELATIONS = frozenset(relation.name for relation in RELATIONS if relation.symmetric)
_RELATION_PRIORITY = ("inside", "on", "attached to", "under", "above", "beside", "near")


@dataclass(frozen=True)
class SightingsView:
    """The keyframe counts of one traversal for an instance, and the shares of the labels that its detector gave."""

    traversal: str
    supported: int
    in_view: int
    contradicted: int
    first_support_ns: int | None
    last_support_ns: int | None
    observation_count: int
    labels: dict[str, float]
    detector: str


@dataclass(frozen=True)
class FrameView:
    """A stored crop: its observation, keyframe, and the state of the instance."""

    observation: int
    keyframe: int
    stamp_ns: int
    traversal: str
    state: int | None
    score: float


@dataclass(frozen=True)
class SurroundingsView:
    """The relations of an instance in one state; `more` of them are not listed."""

    state: int
    relations: tuple[RelationView, ...]
    more: int


@dataclass(frozen=True)
class ObjectHistory:
    """The history of one instance: its states, events, relations, visits of each traversal, and stored pictures;
    optionally up to a time.
    """

    id: str
    asked_id: str
    label: str
    presence: Presence | PresenceValue
    merged_ids: tuple[str, ...]
    first_seen_ns: int
    last_seen_ns: int
    intervals: tuple[IntervalView, ...]
    surroundings: tuple[SurroundingsView, ...]
    events: tuple[EventView, ...]
    sightings: tuple[SightingsView, ...]
    frames: tuple[FrameView, ...]
    evidence: EvidenceView
    as_of: str | None = field(default=None, metadata={"optional": True})
    as_of_ns: int | None = field(default=None, metadata={"optional": True})
    standing: PresenceView | None = field(default=None, metadata={"optional": True})


def object_history(
    reader: MapReader, text_id: str, time_point: TimePoint | None = None, clock: Clock | None = None
) -> ObjectHistory:
    """The history of one instance, up to `time_point` if given (then `clock` is needed for its `standing`).

    Raises `QueryError` for an unknown id.
    """
    instance = find_instance(reader, text_id)
    end_ns = None if time_point is None else time_point.at_ns
    presence = None if time_point is None else presence_at(instance, time_point.at_ns, time_point.traversal_start_ns)
    observations = [
        observation for observation in reader.observations(instance) if end_ns is None or observation.stamp_ns <= end_ns
    ]
    states = [state for state in instance.states if end_ns is None or state.first_seen_ns <= end_ns]
    last_seen_ns = observations[-1].stamp_ns if observations else instance.first_seen_ns
    view = None if presence is None or clock is None or end_ns is None else presence_view(presence, end_ns, clock)
    visits = [visit for visit in instance.visits if _has_begun(reader, visit.traversal_id, end_ns)]
    return ObjectHistory(
        id=instance.id,
        asked_id=text_id,
        label=instance.label if presence is None or end_ns is None else label_at(presence, observations, end_ns),
        presence=instance.presence if presence is None or instance.presence == "doubted" else presence.value,
        merged_ids=merged_ids(reader, instance),
        first_seen_ns=instance.first_seen_ns,
        last_seen_ns=instance.last_seen_ns if end_ns is None else last_seen_ns,
        intervals=tuple(map(interval_view, states)),
        surroundings=_surroundings(reader, instance, states, end_ns),
        events=_events(reader, instance, end_ns),
        sightings=_sightings(reader, visits, observations),
        frames=_frames(reader, instance, states, end_ns),
        evidence=evidence_of(observations, visits, reader.traversals),
        as_of=None if time_point is None else time_point.text,
        as_of_ns=end_ns,
        standing=view,
    )


def _has_begun(reader: MapReader, traversal_id: int, end_ns: int | None) -> bool:
    return end_ns is None or any(
        traversal.id == traversal_id and traversal.start_ns <= end_ns for traversal in reader.traversals
    )


def _events(reader: MapReader, instance: StoredInstance, end_ns: int | None) -> tuple[EventView, ...]:
    """The events up to a time; a disappearance that turned out to be a move is left out."""
    edges = [
        edge
        for edge in reader.temporal_edges(instance.numbers)
        if end_ns is None or (edge.not_before_ns or edge.not_after_ns) <= end_ns
    ]
    moved = {(edge.from_number, edge.from_state) for edge in edges if edge.kind == "moved"}
    edges = [edge for edge in edges if edge.kind != "disappeared" or (edge.from_number, edge.from_state) not in moved]
    reader.text_ids.of({number for edge in edges for number in (edge.from_number, edge.to_number)})
    return tuple(event_view(edge, reader) for edge in edges)


def _sightings(
    reader: MapReader, visits: Iterable[StoredVisit], observations: Sequence[ObservationRef]
) -> tuple[SightingsView, ...]:
    traversal_names = {traversal.id: traversal.name for traversal in reader.traversals}
    detectors = {traversal.id: detector_of(traversal) for traversal in reader.traversals}
    own = group_by_traversal(observations)
    return tuple(
        SightingsView(
            traversal_names[visit.traversal_id],
            visit.supported,
            visit.in_view,
            visit.contradicted,
            visit.first_support_ns,
            visit.last_support_ns,
            len(own.get(visit.traversal_id, ())),
            {label: round(share, 4) for label, share in label_shares(own.get(visit.traversal_id, ())).items()},
            detectors[visit.traversal_id],
        )
        for visit in sorted(visits, key=lambda visit: visit.traversal_id)
    )


def _surroundings(
    reader: MapReader, instance: StoredInstance, states: Sequence[StateRecord], end_ns: int | None
) -> tuple[SurroundingsView, ...]:
    """The relations of each state, one edge per relation, over the time that it held in that state."""
    edges = [edge for edge in reader.edges_of([instance.number]) if end_ns is None or edge.since_ns <= end_ns]
    others = {number for edge in edges for number in (edge.subject, edge.object)}
    reader.text_ids.of(others)
    instances = {instance.number: instance for instance in reader.instances_of(others)}
    surroundings = []
    for state in states:
        end_of_state_ns = state_end_ns(state, instance.states)
        state_edges = _merge_edges(edge for edge in edges if _overlaps(edge, state.first_seen_ns, end_of_state_ns))
        ranked = _select_relations(state_edges, instance.number)
        views = tuple(
            relation_view(reader, edge, instances[edge.subject], instances[edge.object], state.last_seen_ns)
            for edge in ranked[:MAX_RELATIONS]
        )
        surroundings.append(SurroundingsView(state.index, views, max(0, len(ranked) - MAX_RELATIONS)))
    return tuple(surroundings)


def _overlaps(edge: SpatialEdge, low_ns: int, high_ns: float) -> bool:
    return edge.since_ns < high_ns and (edge.until_ns is None or edge.until_ns > low_ns)


def _merge_edges(edges: Iterable[SpatialEdge]) -> list[SpatialEdge]:
    """Merges the edges of a relation between two instances, in either direction, into one over their whole time."""
    merged: dict[tuple[str, frozenset[int]], SpatialEdge] = {}
    for edge in edges:
        key = edge.relation, frozenset((edge.subject, edge.object))
        before = merged.get(key)
        if before is None:
            merged[key] = edge
            continue
        open_end = before.until_ns is None or edge.until_ns is None
        until_ns = None if open_end else max(before.until_ns or 0, edge.until_ns or 0)
        merged[key] = SpatialEdge(
            before.subject,
            edge.relation,
            before.object,
            min(before.since_ns, edge.since_ns),
            until_ns,
            max(before.confidence, edge.confidence),
        )
    return list(merged.values())


def _select_relations(edges: Iterable[SpatialEdge], own: int) -> list[SpatialEdge]:
    """The highest-ranked relation to each other instance; symmetric ones with this instance as the subject."""
    chosen: dict[int, SpatialEdge] = {}
    for edge in sorted(edges, key=_rank):
        other = edge.object if edge.subject == own else edge.subject
        swapped = edge.relation in _SYMMETRIC_RELATIONS and edge.subject != own
        chosen.setdefault(other, replace(edge, subject=own, object=other) if swapped else edge)
    return list(chosen.values())


def _rank(edge: SpatialEdge) -> tuple[int, float, int]:
    priority = (
        _RELATION_PRIORITY.index(edge.relation) if edge.relation in _RELATION_PRIORITY else len(_RELATION_PRIORITY)
    )
    return priority, -edge.confidence, edge.since_ns


def _frames(
    reader: MapReader, instance: StoredInstance, states: Sequence[StateRecord], end_ns: int | None
) -> tuple[FrameView, ...]:
    """The best crops of each state: one per traversal, of the most recent traversals."""
    traversal_names = {traversal.id: traversal.name for traversal in reader.traversals}
    crops = [
        crop
        for crop in crops_of(reader, [instance.number]).get(instance.number, [])
        if end_ns is None or crop.stamp_ns <= end_ns
    ]
    best: dict[tuple[int | None, int], Crop] = {}
    for crop in crops:  # a crop is stored only if it is better than earlier ones
        state = next(
            (state.index for state in states if state.first_seen_ns <= crop.stamp_ns <= state.last_seen_ns), None
        )
        best[state, crop.traversal_id] = crop
    chosen: list[FrameView] = []
    for index in dict.fromkeys(state for state, _ in best):
        own = [crop for (state, _), crop in best.items() if state == index][-MAX_FRAMES:]
        chosen += [
            FrameView(
                crop.observation, crop.keyframe_id, crop.stamp_ns, traversal_names[crop.traversal_id], index, crop.score
            )
            for crop in own
        ]
    return tuple(sorted(chosen, key=lambda frame: (frame.stamp_ns, frame.observation)))
