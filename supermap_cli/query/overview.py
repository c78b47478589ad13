"""All instances present now or at a time (`supermap show`)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from itertools import islice

from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import ObservationRef, StoredInstance
from supermap_cli.query.candidates import label_in_state
from supermap_cli.query.clock import Clock
from supermap_cli.query.label_consensus import label_consensus_at
from supermap_cli.query.presence_at import PresenceAt, presence_at, presence_view
from supermap_cli.query.time_points import TimePoint
from supermap_cli.query.views import (
    DEFAULT_LIMIT,
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
    """The instances present now, counts by label, and the traversals; `absent` counts instances that were present once.

    `instances` lists the most recently seen, `more` are present besides; `counts` are of all.

    As of a time, `instances` are those present then, `unknown` those whose presence then is unknown (`more_unknown` are
    not listed), and `absent` counts those that had left or came later. Instances that are not listed are counted by the
    label of their state at that time.
    """

    instances: tuple[InstanceView, ...]
    counts: dict[str, int]
    absent: int
    traversals: tuple[TraversalView, ...]
    more: int = 0
    as_of: str | None = field(default=None, metadata={"optional": True})
    as_of_ns: int | None = field(default=None, metadata={"optional": True})
    unknown: tuple[InstanceView, ...] | None = field(default=None, metadata={"optional": True})
    more_unknown: int = 0


def overview(reader: MapReader, limit: int = DEFAULT_LIMIT) -> Overview:
    """All instances present now, at most `limit` of them listed."""
    finder = reader.finder
    listed = reader.instances_of(list(islice(finder.called(None, ["present"]), limit)))
    counts = finder.counts()
    return Overview(
        instances=tuple(_summary(reader, instance) for instance in listed),
        counts=counts,
        absent=finder.count(None, ["absent"]),
        traversals=tuple(map(traversal_view, reader.traversals)),
        more=sum(counts.values()) - len(listed),
    )


def overview_at(reader: MapReader, time_point: TimePoint, clock: Clock, limit: int = DEFAULT_LIMIT) -> Overview:
    """All instances present, or of unknown presence, at a time; at most `limit` of each listed."""
    as_of = reader.as_of(time_point.at_ns, time_point.traversal_start_ns)
    present, unknown_presences = (
        _presences(reader, as_of.first(value, limit), time_point) for value in ("present", "unknown")
    )
    totals: Counter[str] = Counter()
    counts: Counter[str] = Counter()
    for (value, label), count in as_of.counts().items():
        totals[value] += count
        counts[label] += count if value == "present" else 0
    views, unknown = (_summaries_at(reader, group, time_point, clock) for group in (present, unknown_presences))
    counts.subtract(label_in_state(instance, presence.state) for instance, presence in present)
    counts.update(view.label for view in views)
    return Overview(
        instances=views,
        counts={label: count for label, count in sorted(counts.items()) if count},
        absent=totals["absent"],
        traversals=tuple(
            traversal_view(traversal) for traversal in reader.traversals if traversal.start_ns <= time_point.at_ns
        ),
        more=totals["present"] - len(views),
        as_of=time_point.text,
        as_of_ns=time_point.at_ns,
        unknown=unknown,
        more_unknown=totals["unknown"] - len(unknown),
    )


def _presences(
    reader: MapReader, numbers: Collection[int], time_point: TimePoint
) -> list[tuple[StoredInstance, PresenceAt]]:
    """Instances in the order of their numbers, with their presence."""
    value = (
        (instance, presence_at(instance, time_point.at_ns, time_point.traversal_start_ns))
        for instance in reader.instances_of(numbers)
    )
    return [(instance, presence) for instance, presence in value if presence is not None]


def _summaries_at(
    reader: MapReader, presences: Iterable[tuple[StoredInstance, PresenceAt]], time_point: TimePoint, clock: Clock
) -> tuple[InstanceView, ...]:
    return tuple(_summary_at(reader, instance, presence, time_point, clock) for instance, presence in presences)


def observed_by(reader: MapReader, instance: StoredInstance, time_point: TimePoint) -> list[ObservationRef]:
    """The observations of an instance up to a time."""
    return [observation for observation in reader.observations(instance) if observation.stamp_ns <= time_point.at_ns]


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
    reader: MapReader, instance: StoredInstance, presence: PresenceAt, time_point: TimePoint, clock: Clock
) -> InstanceView:
    observations = observed_by(reader, instance, time_point)
    consensus = label_consensus_at(observations, time_point.at_ns)
    states_begun = [state for state in instance.states if state.first_seen_ns <= time_point.at_ns]
    traversals_by_then = {traversal.id for traversal in reader.traversals if traversal.start_ns <= time_point.at_ns}
    return InstanceView(
        id=instance.id,
        label=presence.state.label if consensus is None else consensus.label,
        presence=presence.value,
        position=vector(presence.state.centroid_map),
        box=box_view(presence.state.box),
        confidence=round(presence.state.confidence, 4),
        intervals=tuple(map(interval_view, states_begun or instance.states[:1])),
        relations=(),
        evidence=evidence_of(
            observations,
            [visit for visit in instance.visits if visit.traversal_id in traversals_by_then],
            reader.traversals,
        ),
        standing=presence_view(presence, time_point.at_ns, clock),
    )
