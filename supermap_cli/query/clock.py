"""Sensor time for people: UTC where the recordings carry wall time, else seconds since the first one's start."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, time, timedelta

from supermap_cli.errors import QueryError
from supermap_cli.memory.reading import MapReader

_WALL_TIME_NS = 946_684_800 * 10**9  # 2000-01-01: robots' clocks that were never set start near zero


@dataclass(frozen=True)
class Clock:
    """`origin_ns` is the earliest, `newest_ns` the latest sensor time of the map."""

    origin_ns: int
    newest_ns: int

    @property
    def has_wall_time(self) -> bool:
        """Whether stamps are dates."""
        return self.origin_ns >= _WALL_TIME_NS

    def text(self, stamp_ns: int | None) -> str:
        """A time in words, "-" for none."""
        if stamp_ns is None:
            return "-"
        if not self.has_wall_time:
            return f"{(stamp_ns - self.origin_ns) / 1e9:.1f} s"
        return f"{_datetime(stamp_ns):%Y-%m-%dT%H:%M:%S}.{stamp_ns % 10**9 // 10**8}Z"

    def brief(self, stamp_ns: int | None) -> str:
        """A time for a table: without the date, where the whole map is of one day."""
        if stamp_ns is None or not self.has_wall_time:
            return self.text(stamp_ns)
        one_day = _datetime(self.origin_ns).date() == _datetime(self.newest_ns).date()
        return self.text(stamp_ns)[11:] if one_day else f"{_datetime(stamp_ns):%Y-%m-%d %H:%M:%SZ}"

    def span(self, low_ns: int | None, high_ns: int | None) -> str:
        """A span for a table."""
        if high_ns is None:
            return "-"
        return f"{'?' if low_ns is None else self.brief(low_ns)} .. {self.brief(high_ns)}"

    def between(self, low_ns: int | None, high_ns: int | None) -> str:
        """A span in words."""
        if low_ns is None:
            return f"before {self.text(high_ns)}"
        return f"between {self.text(low_ns)} and {self.text(high_ns)}"

    def parse(self, text: str) -> int:
        """The stamp of "10:21" (on the map's last day), an ISO time, or seconds since the start.

        Raises `QueryError` for anything else.
        """
        try:
            if ":" not in text:
                return self.origin_ns + round(float(text) * 1e9)
            if "T" in text:
                return _stamp_ns(datetime.fromisoformat(text.removesuffix("Z")).replace(tzinfo=UTC))
            of_day = time.fromisoformat(text.rjust(len("10:21"), "0")).replace(tzinfo=UTC)
            return _stamp_ns(datetime.combine(_datetime(self.newest_ns).date(), of_day))
        except ValueError as error:
            raise QueryError(
                f"'{text}' is no time", cure="say 'at 10:21', 'at 2026-01-05T10:21:00Z' or 'at 12 s'"
            ) from error


def is_time_of_day(text: str) -> bool:
    """Whether a time leaves its day open."""
    return ":" in text and "T" not in text


def clock_of(reader: MapReader) -> Clock:
    """The clock of a map."""
    return Clock(min((each.start_ns for each in reader.traversals), default=0), reader.now_ns)


def _datetime(stamp_ns: int) -> datetime:
    return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=stamp_ns // 1000)


def _stamp_ns(moment: datetime) -> int:
    since = moment - datetime(1970, 1, 1, tzinfo=UTC)
    return (since.days * 86_400 + since.seconds) * 10**9 + since.microseconds * 1000
