"""Instances whose presence at a question's time is unknown: they were seen later and their place had not been seen
empty before, or they left or came within a gap.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.candidates import LabelCandidates, sorted_by_number
from supermap_cli.query.views import InstanceView

MAX_NOTED = 5
"""Instances of unknown presence that an answer names in its notes."""

SEARCH_LIMIT = 400
"""Instances searched for unknown presence, unless all are counted."""


@dataclass(frozen=True)
class UncertainInstances:
    """The first few instances of unknown presence that are not listed in the answer, their `count` among the `searched`
    instances (`None`: all), and how many of them are not counted as matches either (`unmatched`).
    """

    instances: list[StoredInstance]
    count: int
    unmatched: int
    searched: int | None = None


NO_UNCERTAIN = UncertainInstances([], 0, 0)


def uncertain_instances(
    candidates: LabelCandidates, listed: Iterable[InstanceView], *, counting: bool
) -> UncertainInstances:
    """Instances that ever had the label, are not listed, and whose presence at the time is unknown."""
    if candidates.selector.kind != "at":
        return NO_UNCERTAIN
    listed_presences = {view.id: view.presence for view in listed}
    if counting and candidates.number is None:
        as_of = candidates.as_of()
        first, tally = as_of.unknown(candidates.labels, MAX_NOTED, listed_presences), as_of.counts_of(candidates.labels)
        count = tally.unknown - sum(presence == "unknown" for presence in listed_presences.values())
        return UncertainInstances(
            sorted_by_number(candidates.reader.instances_by_number(first)), count, tally.unknown_others
        )
    uncertain: dict[int, StoredInstance] = {}
    searched = None
    for at, instance in enumerate(candidates.instances()):
        if at == SEARCH_LIMIT:
            searched = SEARCH_LIMIT
            break
        presence = candidates.selector.presence(instance)
        if instance.id not in listed_presences and presence is not None and presence.value == "unknown":
            uncertain[instance.number] = instance
    return UncertainInstances(sorted_by_number(uncertain), len(uncertain), len(uncertain), searched)
