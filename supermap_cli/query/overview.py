"""All that stands, now or at a time (`supermap show`)."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import ObservationRef, StoredInstance
from supermap_cli.query.clock import Clock
from supermap_cli.query.instants import Instant
from supermap_cli.query.naming import name_by
from supermap_cli.query.standing import Standing, standing_at, standing_view
from supermap_cli.query.views import (
    InstanceView,
    TraversalView,
    box_view,
    evidence_of,
    evidence_view,
    interval_view,
    support_spans,
    traversal_view,
    vector,
)


@dataclass(frozen=True)
class Overview:
    """What stands now, how much of what, and from where that is known; `absent` counts what stood once.

    As of a time, `instances` are those that stood then, `unknown` those of which nobody can say, and `absent` counts
    those that had left, or came later.
    """

    instances: tuple[InstanceView, ...]
    counts: dict[str, int]
    absent: int
    traversals: tuple[TraversalView, ...]
    as_of: str | None = field(default=None, metadata={"optional": True})
    as_of_ns: int | None = field(default=None, metadata={"optional": True})
    unknown: tuple[InstanceView, ...] | None = field(default=None, metadata={"optional": True})


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


def overview_at(reader: MapReader, instant: Instant, clock: Clock) -> Overview:
    """All that stood at a time, and all of which nobody can say whether it did."""
    known = [(each, standing) for each in reader.believed if (standing := standing_at(each, instant.at_ns)) is not None]
    told = [_summary_at(reader, *each, instant, clock) for each in known if each[1].presence != "absent"]
    there = tuple(each for each in told if each.presence == "present")
    counts = Counter(each.label for each in there)
    return Overview(
        instances=there,
        counts=dict(sorted(counts.items())),
        absent=sum(standing.presence == "absent" for _, standing in known),
        traversals=tuple(traversal_view(each) for each in reader.traversals if each.start_ns <= instant.at_ns),
        as_of=instant.text,
        as_of_ns=instant.at_ns,
        unknown=tuple(each for each in told if each.presence == "unknown"),
    )


def seen_by(reader: MapReader, instance: StoredInstance, instant: Instant) -> list[ObservationRef]:
    """What had been seen of an instance by a time."""
    return [each for each in reader.observations(instance) if each.stamp_ns <= instant.at_ns]


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


def _summary_at(
    reader: MapReader, instance: StoredInstance, standing: Standing, instant: Instant, clock: Clock
) -> InstanceView:
    seen = seen_by(reader, instance, instant)
    name = name_by(seen, instant.at_ns)
    begun = [state for state in instance.states if state.first_seen_ns <= instant.at_ns]
    by_then = {each.id for each in reader.traversals if each.start_ns <= instant.at_ns}
    return InstanceView(
        id=instance.id,
        label=standing.state.label if name is None else name.label,
        presence=standing.presence,
        position=vector(standing.state.centroid_map),
        box=box_view(standing.state.box),
        confidence=round(standing.state.confidence, 4),
        intervals=tuple(map(interval_view, begun or instance.states[:1])),
        relations=(),
        evidence=evidence_of(seen, [each for each in instance.visits if each.traversal_id in by_then]),
        standing=standing_view(standing, instant.at_ns, clock),
    )
