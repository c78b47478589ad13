"""The traversals' intervals of map time, and conversion to each recording's own clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta

from supermap_cli.errors import QueryError
from supermap_cli.memory.values import StoredTraversal
from supermap_cli.types.limits import LARGEST_STAMP_NS

SECOND_NS = 10**9
_MIN_WALL_TIME_NS = 946_684_800 * SECOND_NS  # 2000-01-01: robots' clocks that were never set start near zero
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)

FIRST_YEAR, LAST_YEAR = 1824, 2115
"""The whole years within `LARGEST_STAMP_NS` of 1970."""


class TimeRangeError(QueryError):
    """A written time or age that no stamp can hold."""


@dataclass(frozen=True)
class TraversalSpan:
    """A traversal's interval of map time, [start_ns, end_ns]; recording time is map time minus `shift_ns`."""

    number: int
    name: str
    start_ns: int
    end_ns: int
    shift_ns: int = 0

    @property
    def recording_start_ns(self) -> int:
        """The start in recording time."""
        return self.start_ns - self.shift_ns

    @property
    def recording_end_ns(self) -> int:
        """The end in recording time."""
        return self.end_ns - self.shift_ns

    @property
    def has_wall_time(self) -> bool:
        """Whether recording time is wall time."""
        return self.recording_start_ns >= _MIN_WALL_TIME_NS

    def days(self) -> tuple[date, ...]:
        """The days (UTC) that it covers, in recording time."""
        first, last = stamp_to_datetime(self.recording_start_ns).date(), stamp_to_datetime(self.recording_end_ns).date()
        return tuple(first + timedelta(days=day) for day in range((last - first).days + 1))

    def contains(self, recording_ns: int, duration_ns: int = 1) -> bool:
        """Whether it overlaps [recording_ns, recording_ns + duration_ns), in recording time."""
        return recording_ns <= self.recording_end_ns and recording_ns + duration_ns > self.recording_start_ns


def traversal_spans(traversals: Sequence[StoredTraversal]) -> tuple[TraversalSpan, ...]:
    """The spans of a map's traversals, in the order of building."""
    return tuple(
        TraversalSpan(
            traversal.number,
            traversal.name,
            traversal.start_ns,
            max(traversal.end_ns, traversal.mapped_ns or 0),
            traversal.clock_shift_ns,
        )
        for traversal in traversals
    )


def span_at(spans: Sequence[TraversalSpan], stamp_ns: int) -> TraversalSpan:
    """The span of a map time: that of the last traversal begun by then, else the first."""
    started = [span for span in spans if span.start_ns <= stamp_ns]
    return (started[-1:] or spans[:1] or [TraversalSpan(1, "map", 0, 0)])[0]


def recording_stamp_ns(spans: Sequence[TraversalSpan], stamp_ns: int) -> int:
    """A map time in the time of the recording that it belongs to."""
    return stamp_ns - span_at(spans, stamp_ns).shift_ns


def stamp_to_datetime(stamp_ns: int) -> datetime:
    """A stamp as a UTC datetime, truncated to microseconds."""
    return _EPOCH + timedelta(microseconds=stamp_ns // 1000)


def datetime_to_stamp(date_time: datetime) -> int:
    """A datetime as a stamp (ns), of any year: see `checked_stamp` for one that was written."""
    since = date_time - _EPOCH
    return (since.days * 86_400 + since.seconds) * SECOND_NS + since.microseconds * 1000


def checked_stamp(stamp_ns: float, written: str) -> int:
    """The stamp (ns) of a written time or age, infinite where it is too large to reckon with. Raises `TimeRangeError`
    outside of the years that stamps hold.
    """
    if not -LARGEST_STAMP_NS < stamp_ns < LARGEST_STAMP_NS:
        raise TimeRangeError(
            f"'{written}' lies outside of the years {FIRST_YEAR} to {LAST_YEAR}", cure="give a time within these years"
        )
    return int(stamp_ns)
