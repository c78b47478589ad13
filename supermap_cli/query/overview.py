"""All that stands, now or at a time (`supermap show`)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from itertools import islice

from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import ObservationRef, StoredInstance
from supermap_cli.query.candidates import label_in
from supermap_cli.query.clock import Clock
from supermap_cli.query.instants import Instant
from supermap_cli.query.naming import name_by
from supermap_cli.query.standing import Standing, standing_at, standing_view
from supermap_cli.query.views import (
    LISTED,
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

    Of `instances` those seen last are listed, `more` stand besides; `counts` are of all.

    As of a time, `instances` are those that stood then, `unknown` those of which nobody can say (and `more_unknown`
    that are not listed), and `absent` counts those that had left, or came later. What is not listed is counted by what
    it is called in the state that it was in.
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


def overview(reader: MapReader, limit: int = LISTED) -> Overview:
    """All current objects, so many of them listed."""
    finder = reader.search
    listed = reader.instances_of(list(islice(finder.labelled(None, ["present"]), limit)))
    counts = finder.counts()
    return Overview(
        instances=tuple(_summary(reader, each) for each in listed),
        counts=counts,
        absent=finder.count(None, ["absent"]),
        traversals=tuple(map(traversal_view, reader.traversals)),
        more=sum(counts.values()) - len(listed),
    )


def overview_at(reader: MapReader, instant: Instant, clock: Clock, limit: int = LISTED) -> Overview:
    """All that stood at a time, and all of which nobody can say whether it did, so many of each listed."""
    as_of = reader.presence_at(instant.at_ns, instant.begun_ns)
    stood, doubtful = (_standing(reader, as_of.last_seen(known, limit), instant) for known in ("present", "unknown"))
    totals: Counter[str] = Counter()
    counts: Counter[str] = Counter()
    for (known, called), count in as_of.counts().items():
        totals[known] += count
        counts[called] += count if known == "present" else 0
    there, unknown = (_told_at(reader, each, instant, clock) for each in (stood, doubtful))
    counts.subtract(label_in(each, standing.state) for each, standing in stood)
    counts.update(each.label for each in there)
    return Overview(
        instances=there,
        counts={called: count for called, count in sorted(counts.items()) if count},
        absent=totals["absent"],
        traversals=tuple(traversal_view(each) for each in reader.traversals if each.start_ns <= instant.at_ns),
        more=totals["present"] - len(there),
        as_of=instant.text,
        as_of_ns=instant.at_ns,
        unknown=unknown,
        more_unknown=totals["unknown"] - len(unknown),
    )


def _standing(reader: MapReader, numbers: Collection[int], instant: Instant) -> list[tuple[StoredInstance, Standing]]:
    """Some instances in the order of their numbers, with what is known of them."""
    known = ((each, standing_at(each, instant.at_ns, instant.begun_ns)) for each in reader.instances_of(numbers))
    return [(each, standing) for each, standing in known if standing is not None]


def _told_at(
    reader: MapReader, standing: Iterable[tuple[StoredInstance, Standing]], instant: Instant, clock: Clock
) -> tuple[InstanceView, ...]:
    return tuple(_summary_at(reader, each, known, instant, clock) for each, known in standing)


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
        evidence=evidence_of(
            seen, [each for each in instance.visits if each.traversal_id in by_then], reader.traversals
        ),
        standing=standing_view(standing, instant.at_ns, clock),
    )
