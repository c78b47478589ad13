"""Of which things nobody can say whether they stood there at the time that a question speaks of.

They were seen later, and their place had not been seen empty before; or they were on their way.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.candidates import Called
from supermap_cli.query.views import InstanceView

NOTED = 5
"""Of how many things an answer says that nobody can tell."""

LOOKED_AT = 400
"""Among how many it looks for those of which nobody can tell, where it need not count."""


@dataclass(frozen=True)
class Perhaps:
    """Those of which nobody can say whether they stood there, and that are not listed: the first few, and how many
    there are of `looked_at` (`None`: of all); `besides` are those that are not counted among what fits.
    """

    told: list[StoredInstance]
    count: int
    besides: int
    looked_at: int | None = None


NOBODY = Perhaps([], 0, 0)


def perhaps(called: Called, listed: Iterable[InstanceView], *, counting: bool) -> Perhaps:
    """Of all that were ever called so, those of which nobody can say, but for those that are listed."""
    if called.moment.kind != "at":
        return NOBODY
    told = {each.id: each.presence for each in listed}
    if counting and called.number is None:
        as_of = called.as_of()
        first, tally = as_of.unknown(called.labels, NOTED, told), as_of.counts_of(called.labels)
        count = tally.unknown - sum(presence == "unknown" for presence in told.values())
        return Perhaps(_by_number(called.reader.instances_by_number(first)), count, tally.unknown_others)
    unsure: dict[int, StoredInstance] = {}
    looked_at = None
    for at, each in enumerate(called.lives()):
        if at == LOOKED_AT:
            looked_at = LOOKED_AT
            break
        standing = called.moment.standing(each)
        if each.id not in told and standing is not None and standing.presence == "unknown":
            unsure[each.number] = each
    return Perhaps(_by_number(unsure), len(unsure), len(unsure), looked_at)


def _by_number(instances: dict[int, StoredInstance]) -> list[StoredInstance]:
    return [instance for _, instance in sorted(instances.items())]
