"""The life of one instance (`supermap history ID`)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from supermap_cli.memory.images import Crop, crops_of
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import ObservationRef, StoredInstance, StoredVisit
from supermap_cli.query.clock import Clock
from supermap_cli.query.details import find_instance, merged_ids, relation_view
from supermap_cli.query.instants import Instant
from supermap_cli.query.moments import state_end_ns
from supermap_cli.query.naming import by_traversal, label_shares, name_by
from supermap_cli.query.standing import Known, StandingView, standing_at, standing_view
from supermap_cli.query.views import (
    EventView,
    EvidenceView,
    IntervalView,
    RelationView,
    event_view,
    evidence_of,
    interval_view,
)
from supermap_cli.types.memory import Presence, SpatialEdge, StateRecord

MOST_RELATIONS = 12
"""How many relations are told of one state; those that say most where it stood first."""

MOST_FRAMES = 3
"""How many pictures are named of one state: the best, one for each traversal as far as there are."""

_BOTH_WAYS = frozenset({"beside", "near"})
_TELLING = ("inside", "on", "attached to", "under", "above", "beside", "near")


@dataclass(frozen=True)
class SightingsView:
    """How one traversal saw an instance, in keyframes, and what it called it, by the share of its observations."""

    traversal: str
    supported: int
    in_view: int
    contradicted: int
    first_support_ns: int | None
    last_support_ns: int | None
    observation_count: int
    labels: dict[str, float]


@dataclass(frozen=True)
class FrameView:
    """A picture that is kept of it: the observation, its keyframe, and the state it was in."""

    observation: int
    keyframe: int
    stamp_ns: int
    traversal: str
    state: int | None
    score: float


@dataclass(frozen=True)
class SurroundingsView:
    """Next to what it stood in one state; `more` relations are left out."""

    state: int
    relations: tuple[RelationView, ...]
    more: int


@dataclass(frozen=True)
class History:
    """The life of one instance: its states, what happened between them, what stood around it, how each traversal saw
    it, and the pictures that are kept; as of a time, up to that.
    """

    id: str
    asked_id: str
    label: str
    presence: Presence | Known
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
    standing: StandingView | None = field(default=None, metadata={"optional": True})


def history(reader: MapReader, text_id: str, until: Instant | None = None, clock: Clock | None = None) -> History:
    """The life of one instance, or its life until an instant, told by a clock.

    Raises `QueryError` for an id that there never was.
    """
    instance = find_instance(reader, text_id)
    end_ns = None if until is None else until.at_ns
    standing = None if until is None else standing_at(instance, until.at_ns, until.begun_ns)
    seen = [each for each in reader.observations(instance) if end_ns is None or each.stamp_ns <= end_ns]
    states = [each for each in instance.states if end_ns is None or each.first_seen_ns <= end_ns]
    edges = [
        edge
        for edge in reader.temporal_edges(instance.numbers)
        if end_ns is None or (edge.not_before_ns or edge.not_after_ns) <= end_ns
    ]
    moved = {(edge.from_number, edge.from_state) for edge in edges if edge.kind == "moved"}
    edges = [each for each in edges if each.kind != "disappeared" or (each.from_number, each.from_state) not in moved]
    reader.text_ids.of({number for edge in edges for number in (edge.from_number, edge.to_number)})
    view = None if standing is None or clock is None or end_ns is None else standing_view(standing, end_ns, clock)
    visits = [each for each in instance.visits if _begun(reader, each.traversal_id, end_ns)]
    name = None if end_ns is None else name_by(seen, end_ns)
    return History(
        id=instance.id,
        asked_id=text_id,
        label=instance.label if standing is None else standing.state.label if name is None else name.label,
        presence=instance.presence if standing is None or instance.presence == "doubted" else standing.presence,
        merged_ids=merged_ids(reader, instance),
        first_seen_ns=instance.first_seen_ns,
        last_seen_ns=instance.last_seen_ns if end_ns is None else seen[-1].stamp_ns if seen else instance.first_seen_ns,
        intervals=tuple(map(interval_view, states)),
        surroundings=_surroundings(reader, instance, states, end_ns),
        events=tuple(event_view(edge, reader) for edge in edges),
        sightings=_sightings(reader, visits, seen),
        frames=_frames(reader, instance, states, end_ns),
        evidence=evidence_of(seen, visits, reader.traversals),
        as_of=None if until is None else until.text,
        as_of_ns=end_ns,
        standing=view,
    )


def _begun(reader: MapReader, traversal_id: int, end_ns: int | None) -> bool:
    return end_ns is None or any(each.id == traversal_id and each.start_ns <= end_ns for each in reader.traversals)


def _sightings(
    reader: MapReader, visits: Iterable[StoredVisit], seen: Sequence[ObservationRef]
) -> tuple[SightingsView, ...]:
    names = {each.id: each.name for each in reader.traversals}
    own = by_traversal(seen)
    return tuple(
        SightingsView(
            names[visit.traversal_id],
            visit.supported,
            visit.in_view,
            visit.contradicted,
            visit.first_support_ns,
            visit.last_support_ns,
            len(own.get(visit.traversal_id, ())),
            {label: round(share, 4) for label, share in label_shares(own.get(visit.traversal_id, ())).items()},
        )
        for visit in sorted(visits, key=lambda each: each.traversal_id)
    )


def _surroundings(
    reader: MapReader, instance: StoredInstance, states: Sequence[StateRecord], end_ns: int | None
) -> tuple[SurroundingsView, ...]:
    """The relations of each state, every one once, with all of the time that it held in that state."""
    edges = [each for each in reader.edges_of([instance.number]) if end_ns is None or each.since_ns <= end_ns]
    others = {number for edge in edges for number in (edge.subject, edge.object)}
    reader.text_ids.of(others)
    known = {each.number: each for each in reader.instances_of(others)}
    told = []
    for state in states:
        high = state_end_ns(state, instance.states)
        held = _joined(each for each in edges if _within(each, state.first_seen_ns, high))
        ranked = _most_telling(held, instance.number)
        views = tuple(
            relation_view(reader, each, known[each.subject], known[each.object], state.last_seen_ns)
            for each in ranked[:MOST_RELATIONS]
        )
        told.append(SurroundingsView(state.index, views, max(0, len(ranked) - MOST_RELATIONS)))
    return tuple(told)


def _within(edge: SpatialEdge, low_ns: int, high_ns: float) -> bool:
    return edge.since_ns < high_ns and (edge.until_ns is None or edge.until_ns > low_ns)


def _joined(edges: Iterable[SpatialEdge]) -> list[SpatialEdge]:
    """One edge for each relation, from when it held first to when it held last; stored both ways it is one."""
    joined: dict[tuple[str, frozenset[int]], SpatialEdge] = {}
    for edge in edges:
        key = edge.relation, frozenset((edge.subject, edge.object))
        before = joined.get(key)
        if before is None:
            joined[key] = edge
            continue
        open_end = before.until_ns is None or edge.until_ns is None
        until_ns = None if open_end else max(before.until_ns or 0, edge.until_ns or 0)
        joined[key] = SpatialEdge(
            before.subject,
            edge.relation,
            before.object,
            min(before.since_ns, edge.since_ns),
            until_ns,
            max(before.confidence, edge.confidence),
        )
    return list(joined.values())


def _most_telling(edges: Iterable[SpatialEdge], own: int) -> list[SpatialEdge]:
    """Of the relations to each other object the one that says most, ranked; what holds both ways from its own side."""
    chosen: dict[int, SpatialEdge] = {}
    for edge in sorted(edges, key=_rank):
        other = edge.object if edge.subject == own else edge.subject
        turned = edge.relation in _BOTH_WAYS and edge.subject != own
        chosen.setdefault(other, replace(edge, subject=own, object=other) if turned else edge)
    return list(chosen.values())


def _rank(edge: SpatialEdge) -> tuple[int, float, int]:
    telling = _TELLING.index(edge.relation) if edge.relation in _TELLING else len(_TELLING)
    return telling, -edge.confidence, edge.since_ns


def _frames(
    reader: MapReader, instance: StoredInstance, states: Sequence[StateRecord], end_ns: int | None
) -> tuple[FrameView, ...]:
    """The best pictures of each state: one of each traversal, of the latest traversals if there are many."""
    names = {each.id: each.name for each in reader.traversals}
    crops = [
        each
        for each in crops_of(reader, [instance.number]).get(instance.number, [])
        if end_ns is None or each.stamp_ns <= end_ns
    ]
    best: dict[tuple[int | None, int], Crop] = {}
    for crop in crops:  # each is kept only where it is better than those before
        state = next((each.index for each in states if each.first_seen_ns <= crop.stamp_ns <= each.last_seen_ns), None)
        best[state, crop.traversal_id] = crop
    chosen: list[FrameView] = []
    for index in dict.fromkeys(state for state, _ in best):
        own = [crop for (state, _), crop in best.items() if state == index][-MOST_FRAMES:]
        chosen += [
            FrameView(each.observation, each.keyframe_id, each.stamp_ns, names[each.traversal_id], index, each.score)
            for each in own
        ]
    return tuple(sorted(chosen, key=lambda each: (each.stamp_ns, each.observation)))
