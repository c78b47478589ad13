"""Times given to a command: a traversal, which stands for its end, or a time on the map's clock."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from supermap_cli.errors import QueryError
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredTraversal
from supermap_cli.query.clock import Clock
from supermap_cli.query.time_parsing import names_traversal

_PREFIXES = ("at ", "in ", "during ", "of ", "as of ")
_DATE = re.compile(r"\d{4}-\d{2}-\d{2}")
CURE = (
    "say a traversal ('monday', '2', 'first', 'last'), '10:21', '2026-01-05T10:21:00Z', '12 s', 'monday@10:21', "
    "'monday+12s', 'earlier' or 'now'"
)


@dataclass(frozen=True)
class TimePoint:
    """A point in map time, and the interval [since_ns, at_ns] whose keyframes are evidence for it.

    For a traversal, `at_ns` is its end and `since_ns` its start; for a plain time both are equal. `note` tells how an
    ambiguous time was understood.
    """

    text: str
    at_ns: int
    since_ns: int
    traversal: StoredTraversal | None = None
    note: str | None = None

    @property
    def traversal_start_ns(self) -> int | None:
        """The traversal's start; `None` for a plain time."""
        return None if self.traversal is None else self.since_ns


def parse_time_point(written: str, reader: MapReader, clock: Clock) -> TimePoint:
    """The time point of a written time or traversal. Raises `QueryError` for any other text."""
    wanted = " ".join(written.casefold().split())
    for prefix in sorted(_PREFIXES, key=len, reverse=True):
        wanted = wanted.removeprefix(prefix)
    names = {traversal.name.casefold() for traversal in reader.traversals}
    if wanted in names or wanted in {"first", "last"} or wanted.isdecimal():
        return traversal_end(find_traversal(reader.traversals, wanted))
    if wanted == "now":
        return _plain_time(reader.now_ns, clock)
    if wanted in {"earlier", "before"}:
        return _plain_time(max((traversal.start_ns for traversal in reader.traversals), default=0), clock)
    if not wanted[:1].isdigit() and not names_traversal(wanted, clock.spans):
        known = traversal_list(reader.traversals)
        raise QueryError(f"'{written}' is neither a time nor a traversal; there are: {known}", cure=CURE)
    parsed = clock.parse(wanted if names_traversal(wanted, clock.spans) else _normalise_time(wanted))
    return replace(_plain_time(parsed.stamp_ns, clock), note=parsed.note)


def traversal_end(traversal: StoredTraversal) -> TimePoint:
    """The end of a traversal, or of its mapped part while it is being built."""
    end_ns = traversal.end_ns if traversal.status == "complete" else traversal.mapped_ns or traversal.start_ns
    return TimePoint(traversal.name, end_ns, traversal.start_ns, traversal)


def _plain_time(stamp_ns: int, clock: Clock) -> TimePoint:
    return TimePoint(clock.text(stamp_ns), stamp_ns, stamp_ns)


def _normalise_time(written: str) -> str:
    """A time as the clock parses it: without unit, "T" and "Z" in upper case, a "T" after the date."""
    if _DATE.match(written):
        return written.upper().replace(" ", "T", 1)
    for unit in ("seconds", "utc", "s"):
        written = written.removesuffix(unit).rstrip()
    return written.upper()


def traversal_list(traversals: Sequence[StoredTraversal]) -> str:
    """Numbers and names of traversals, for messages."""
    return ", ".join(f"{traversal.number} {traversal.name}" for traversal in traversals) or "none"


def find_traversal(traversals: Sequence[StoredTraversal], name: str) -> StoredTraversal:
    """A traversal by name, number, "first" or "last". Raises `QueryError` with the known ones."""
    for traversal in traversals:
        if name.casefold() == traversal.name.casefold():
            return traversal
    for traversal in traversals:
        if name == str(traversal.number):
            return traversal
    if traversals and name in {"first", "last"}:
        return traversals[0 if name == "first" else -1]
    known = traversal_list(traversals)
    raise QueryError(f"there is no traversal {name!r}", cure=f"there are: {known}")
