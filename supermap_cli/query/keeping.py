"""What is to be kept, in words: "crops=30d", "observations=tuesday", "thumbnails=none"; and what was not kept.

Ages count back from the newest sensor time of the map, never from today: a map loses nothing by lying for a year.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable

from supermap_cli.errors import QueryError
from supermap_cli.memory.pruning import PrunePolicy
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredTraversal
from supermap_cli.query.clock import Clock, clock_of
from supermap_cli.query.instants import instant_of
from supermap_cli.query.views import EvidenceView

KINDS = ("crops", "observations", "thumbnails")
_UNITS_S = {"s": 1, "min": 60, "h": 3600, "d": 86_400, "w": 7 * 86_400, "y": 365 * 86_400}
_AGE = re.compile(rf"(\d+(?:\.\d+)?) ?({'|'.join(_UNITS_S)})")
_TRAVERSALS = re.compile(r"(\d+) ?traversals?")
CURE = (
    "say for example crops=30d (units s, min, h, d, w, y), observations='3 traversals', thumbnails=tuesday, "
    "crops=2026-01-05T10:21:00Z, thumbnails=none"
)


def kept_from(words: Collection[str], reader: MapReader) -> PrunePolicy:
    """The limits that words like "crops=30d" mean in a map. Raises `QueryError` for what is not understood."""
    limits: dict[str, int] = {}
    best_crops = True
    for each in words:
        kind, _, said = (part.strip() for part in each.partition("="))
        if kind not in KINDS or not said:
            raise QueryError(f"'{each}' does not say what to keep", cure=CURE)
        if kind in limits:
            raise QueryError(f"{kind} are said twice", cure="say each once")
        if said == "none" and kind == "observations":
            raise QueryError("observations cannot all be given up: states rest on them", cure=CURE)
        best_crops = best_crops and not (kind == "crops" and said == "none")
        limits[kind] = _limit_ns(said, reader)
    return PrunePolicy(limits.get("crops"), limits.get("observations"), limits.get("thumbnails"), best_crops)


def given_up_notes(traversals: Iterable[StoredTraversal], clock: Clock) -> list[str]:
    """What an answer that speaks of these traversals cannot show any more."""
    notes = []
    for each in traversals:
        limits = {
            "observations": each.observations_kept_from_ns,
            "crops": each.crops_kept_from_ns,
            "thumbnails": each.thumbnails_kept_from_ns,
        }
        for limit_ns in dict.fromkeys(limit_ns for limit_ns in limits.values() if limit_ns is not None):
            kinds = " and ".join(kind for kind, other_ns in limits.items() if other_ns == limit_ns)
            when = "" if limit_ns > each.end_ns else f" from before {clock.text(limit_ns)}"
            notes.append(f"most {kinds} of {each.name}{when} were given up")
    return notes


def evidence_notes(evidence: Iterable[EvidenceView], clock: Clock) -> list[str]:
    """What evidence lacks that there once was."""
    limits = [each.given_up_before_ns for each in evidence if each.given_up_before_ns is not None]
    return [f"of observations from before {clock.text(max(limits))} only the telling ones were kept"] if limits else []


def _limit_ns(said: str, reader: MapReader) -> int:
    if said == "none":
        return reader.now_ns + 1
    if age := _AGE.fullmatch(said):
        return reader.now_ns - round(float(age[1]) * _UNITS_S[age[2]] * 1e9)
    if number := _TRAVERSALS.fullmatch(said):
        count, complete = int(number[1]), [each for each in reader.traversals if each.status == "complete"]
        if count == 0:
            return reader.now_ns + 1
        return complete[-count].start_ns if count <= len(complete) else 0
    try:
        return instant_of(said, reader, clock_of(reader)).since_ns
    except QueryError as error:
        raise QueryError(f"'{said}' is no age, no time and no traversal", cure=CURE) from error
