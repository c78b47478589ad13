"""The life of one instance (`supermap history ID`)."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from supermap_cli.memory.reading import MapReader
from supermap_cli.query.details import find_instance
from supermap_cli.query.views import (
    EventView,
    EvidenceView,
    IntervalView,
    event_view,
    evidence_view,
    interval_view,
    support_spans,
)
from supermap_cli.types.memory import Presence


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


def history(reader: MapReader, text_id: str) -> History:
    """The life of one instance. Raises `QueryError` for an id that there never was."""
    instance = find_instance(reader, text_id)
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
