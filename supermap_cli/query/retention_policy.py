"""Retention policies in words ("crops=30d", "observations=tuesday", "thumbnails=none"), and notes on pruned data.

Ages count back from the newest sensor time of the map, never from today: an old map that is not used loses nothing.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable

from supermap_cli.errors import QueryError
from supermap_cli.memory.pruning import PrunePolicy
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredTraversal
from supermap_cli.query.clock import Clock, clock_of
from supermap_cli.query.time_points import parse_time_point
from supermap_cli.query.traversal_spans import SECOND_NS, TimeRangeError, checked_stamp
from supermap_cli.query.views import EvidenceView

DATA_KINDS = ("crops", "observations", "thumbnails")
_UNITS_S = {"s": 1, "min": 60, "h": 3600, "d": 86_400, "w": 7 * 86_400, "y": 365 * 86_400}
_AGE = re.compile(rf"(\d+(?:\.\d+)?) ?({'|'.join(_UNITS_S)})")
_COUNT_DIGITS = 18
"""Digits of a number of traversals that are read; no map has so many."""
_TRAVERSALS = re.compile(r"(\d+) ?traversals?")
CURE = (
    "say for example crops=30d (units s, min, h, d, w, y), observations='3 traversals', thumbnails=tuesday, "
    "crops=2026-01-05T10:21:00Z, thumbnails=none"
)


def parse_retention_policy(words: Collection[str], reader: MapReader) -> PrunePolicy:
    """The limits of items such as "crops=30d" in a map. Raises `QueryError` for any other text."""
    limits: dict[str, int] = {}
    best_crops = True
    for word in words:
        kind, _, limit = (part.strip() for part in word.partition("="))
        if kind not in DATA_KINDS or not limit:
            raise QueryError(f"'{word}' does not say what to keep", cure=CURE)
        if kind in limits:
            raise QueryError(f"{kind} are said twice", cure="say each once")
        if limit == "none" and kind == "observations":
            raise QueryError("observations cannot all be given up: states rest on them", cure=CURE)
        best_crops = best_crops and not (kind == "crops" and limit == "none")
        limits[kind] = _limit_ns(limit, reader)
    return PrunePolicy(limits.get("crops"), limits.get("observations"), limits.get("thumbnails"), best_crops)


def pruned_data_notes(traversals: Iterable[StoredTraversal], clock: Clock) -> list[str]:
    """What answers about these traversals can no longer show."""
    notes = []
    for traversal in traversals:
        limits = {
            "observations": traversal.observations_kept_from_ns,
            "crops": traversal.crops_kept_from_ns,
            "thumbnails": traversal.thumbnails_kept_from_ns,
        }
        for limit_ns in dict.fromkeys(limit_ns for limit_ns in limits.values() if limit_ns is not None):
            kinds = " and ".join(kind for kind, other_ns in limits.items() if other_ns == limit_ns)
            when = "" if limit_ns > traversal.end_ns else f" from before {clock.text(limit_ns)}"
            notes.append(f"most {kinds} of {traversal.name}{when} were given up")
    return notes


def pruned_evidence_notes(evidence: Iterable[EvidenceView], clock: Clock) -> list[str]:
    """A note if evidence is incomplete because observations were pruned."""
    limits = [view.given_up_before_ns for view in evidence if view.given_up_before_ns is not None]
    return [f"of observations from before {clock.text(max(limits))} only the telling ones were kept"] if limits else []


def _limit_ns(limit: str, reader: MapReader) -> int:
    if limit == "none":
        return reader.now_ns + 1
    if age := _AGE.fullmatch(limit):
        age_ns = float(age[1]) * _UNITS_S[age[2]] * SECOND_NS
        return checked_stamp(reader.now_ns - (round(age_ns) if math.isfinite(age_ns) else age_ns), limit)
    if number := _TRAVERSALS.fullmatch(limit):
        count, complete = (
            int(number[1][:_COUNT_DIGITS]),
            [traversal for traversal in reader.traversals if traversal.status == "complete"],
        )
        if count == 0:
            return reader.now_ns + 1
        return complete[-count].start_ns if count <= len(complete) else 0
    try:
        return parse_time_point(limit, reader, clock_of(reader)).since_ns
    except TimeRangeError:
        raise
    except QueryError as error:
        raise QueryError(f"'{limit}' is no age, no time and no traversal", cure=CURE) from error
