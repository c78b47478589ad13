"""Sensor time for people: as the recordings' own clocks have it, so that a frame can be found in its recording.

UTC where a recording carries wall time, else seconds from its start. The map's time goes forward in the order of
building; where a traversal's clock is behind that (`traversal.clock_shift_ns`), or another's shows the same, its times
are named after it: "tuesday@2026-01-05T10:21:07.3Z". So are times without a date, where there is more than one
traversal: "tuesday+12.3s". What is printed may be said in a question, and means the same there (`written_times`).
"""

from __future__ import annotations

from dataclasses import dataclass

from supermap_cli.memory.reading import MapReader
from supermap_cli.query.time_parsing import ParsedTime, is_time_of_day, parse_time
from supermap_cli.query.traversal_spans import TraversalSpan, span_at, stamp_to_datetime, traversal_spans

__all__ = ["Clock", "clock_of", "is_time_of_day"]


@dataclass(frozen=True)
class Clock:
    """`stretches` are the map's traversals in the order of building."""

    spans: tuple[TraversalSpan, ...]

    @property
    def origin_ns(self) -> int:
        """The earliest time of the map."""
        return min((span.start_ns for span in self.spans), default=0)

    def text(self, stamp_ns: int | None) -> str:
        """A time in words, "-" for none."""
        return "-" if stamp_ns is None else self._format(stamp_ns, brief=False)

    def brief(self, stamp_ns: int | None) -> str:
        """A time for a table: without the date, where the whole map is of one day."""
        return "-" if stamp_ns is None else self._format(stamp_ns, brief=True)

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

    def parse(self, text: str) -> ParsedTime:
        """What a written time means. Raises `QueryError` for what is no time, or none that the map has."""
        return parse_time(text, self.spans)

    def parse_ns(self, text: str) -> int:
        """The stamp of a written time (see `read`)."""
        return self.parse(text).stamp_ns

    def _format(self, stamp_ns: int, *, brief: bool) -> str:
        span = span_at(self.spans, stamp_ns)
        recording_ns = stamp_ns - span.shift_ns
        if not span.has_wall_time:
            seconds = (recording_ns - span.recording_start_ns) / 1e9
            return f"{seconds:.1f} s" if len(self.spans) < 2 else f"{span.name}{seconds:+.1f}s"
        written = f"{stamp_to_datetime(recording_ns):%Y-%m-%dT%H:%M:%S}.{recording_ns % 10**9 // 10**8}Z"
        if brief and self._is_one_day:
            written = written[11:]
        elif brief:
            written = f"{stamp_to_datetime(recording_ns):%Y-%m-%d %H:%M:%SZ}"
        named = span.shift_ns or any(other.contains(recording_ns) for other in self.spans if other is not span)
        return f"{span.name}@{written}" if named else written

    @property
    def _is_one_day(self) -> bool:
        """Whether all that has a date is of the same one."""
        with_wall_time = [span for span in self.spans if span.has_wall_time]
        ends_ns = [end_ns for span in with_wall_time for end_ns in (span.recording_start_ns, span.recording_end_ns)]
        return len({stamp_to_datetime(end_ns).date() for end_ns in ends_ns}) == 1


def clock_of(reader: MapReader) -> Clock:
    """The clock of a map."""
    return Clock(traversal_spans(reader.traversals))
