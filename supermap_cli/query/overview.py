"""All instances present now or at a time (`supermap show`)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from itertools import islice
from typing import TypedDict

from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.candidates import label_in_state
from supermap_cli.query.clock import Clock
from supermap_cli.query.instance_at import evidence_until, intervals_until, label_at, observations_until
from supermap_cli.query.presence_at import PresenceAt, presence_at, presence_view
from supermap_cli.query.time_points import TimePoint
from supermap_cli.query.views import (
    DEFAULT_LIMIT,
    InstanceView,
    TraversalView,
    box_view,
    evidence_view,
    interval_view,
    support_spans,
    traversal_view,
    vector,
)


@dataclass(frozen=True)
class Overview:
    """The instances present now, counts by label, and the traversals; `absent` counts instances that were present once.

    `instances` lists the most recently seen, `more` are present besides; `counts` are of all. `doubted` are those that
    are believed in no more today, `more_doubted` are not listed. So every instance is listed or counted.

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
    doubted: tuple[InstanceView, ...] = ()
    more_doubted: int = 0


class _DoubtedInstances(TypedDict):
    """These fields of an `Overview`."""

    doubted: tuple[InstanceView, ...]
    more_doubted: int


def overview(reader: MapReader, limit: int = DEFAULT_LIMIT) -> Overview:
    """All instances present now, at most `limit` of them listed."""
    finder = reader.search
    listed = reader.instances_of(list(islice(finder.labelled(None, ["present"]), limit)))
    counts = finder.counts()
    return Overview(
        instances=tuple(_summary(reader, instance) for instance in listed),
        counts=counts,
        absent=finder.count(None, ["absent"]),
        traversals=tuple(map(traversal_view, reader.traversals)),
        more=sum(counts.values()) - len(listed),
        **_doubted(reader, limit),
    )


def overview_at(reader: MapReader, time_point: TimePoint, clock: Clock, limit: int = DEFAULT_LIMIT) -> Overview:
    """All instances present, or of unknown presence, at a time; at most `limit` of each listed."""
    as_of = reader.presence_at(time_point.at_ns, time_point.traversal_start_ns)
    present, unknown_presences = (
        _presences(reader, as_of.last_seen(value, limit), time_point) for value in ("present", "unknown")
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
        **_doubted(reader, limit),
    )


def _doubted(reader: MapReader, limit: int) -> _DoubtedInstances:
    """Those believed in no more today, at most `limit` of them listed."""
    listed = reader.instances_of(list(islice(reader.search.labelled(None, ["doubted"]), limit)))
    return {
        "doubted": tuple(_summary(reader, instance) for instance in listed),
        "more_doubted": reader.search.count(None, ["doubted"]) - len(listed),
    }


def _presences(
    reader: MapReader, numbers: Collection[int], time_point: TimePoint
) -> list[tuple[StoredInstance, PresenceAt]]:
    """Instances in the order of their numbers, with their presence."""
    presences = (
        (instance, presence_at(instance, time_point.at_ns, time_point.traversal_start_ns))
        for instance in reader.instances_of(numbers)
    )
    return [(instance, presence) for instance, presence in presences if presence is not None]


def _summaries_at(
    reader: MapReader, presences: Iterable[tuple[StoredInstance, PresenceAt]], time_point: TimePoint, clock: Clock
) -> tuple[InstanceView, ...]:
    return tuple(_summary_at(reader, instance, presence, time_point, clock) for instance, presence in presences)


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
    at_ns = time_point.at_ns
    observations = observations_until(reader, instance, at_ns)
    return InstanceView(
        id=instance.id,
        label=label_at(presence, observations, at_ns),
        presence=presence.value,
        position=vector(presence.state.centroid_map),
        box=box_view(presence.state.box),
        confidence=round(presence.state.confidence, 4),
        intervals=intervals_until(instance, at_ns),
        relations=(),
        evidence=evidence_until(reader, instance, observations, at_ns),
        standing=presence_view(presence, at_ns, clock),
    )
