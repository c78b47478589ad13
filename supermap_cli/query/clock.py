"""Sensor time as text, by the recordings' own clocks, so that a frame can be found in its recording.

UTC where a recording has wall time, otherwise seconds from its start. Map time increases in the order of building. A
time is prefixed with its traversal ("tuesday@2026-01-05T10:21:07.3Z") where that traversal's clock is shifted against
map time (`traversal.clock_shift_ns`), or where another recording shows the same time. Times without a date are prefixed
where the map has more than one traversal: "tuesday+12.3s". Every printed time can be used in a question and means the
same there (`time_parsing`).
"""

from __future__ import annotations

from dataclasses import dataclass

from supermap_cli.memory.reading import MapReader
from supermap_cli.query.time_parsing import ParsedTime, is_time_of_day, parse_time
from supermap_cli.query.traversal_spans import TraversalSpan, span_at, stamp_to_datetime, traversal_spans

__all__ = ["Clock", "clock_of", "is_time_of_day"]


@dataclass(frozen=True)
class Clock:
    """Converts between map time and text. `spans` are the map's traversals in the order of building."""

    spans: tuple[TraversalSpan, ...]

    @property
    def origin_ns(self) -> int:
        """The earliest map time; 0 for an empty map."""
        return min((span.start_ns for span in self.spans), default=0)

    def text(self, stamp_ns: int | None) -> str:
        """A time in full, "-" for `None`."""
        return "-" if stamp_ns is None else self._format(stamp_ns, brief=False)

    def brief(self, stamp_ns: int | None) -> str:
        """A time for a table: without the date if the whole map lies within one day."""
        return "-" if stamp_ns is None else self._format(stamp_ns, brief=True)

    def span(self, low_ns: int | None, high_ns: int | None) -> str:
        """A time interval for a table."""
        if high_ns is None:
            return "-"
        return f"{'?' if low_ns is None else self.brief(low_ns)} .. {self.brief(high_ns)}"

    def between(self, low_ns: int | None, high_ns: int | None) -> str:
        """A time interval in words."""
        if low_ns is None:
            return f"before {self.text(high_ns)}"
        return f"between {self.text(low_ns)} and {self.text(high_ns)}"

    def parse(self, text: str) -> ParsedTime:
        """The map time of a written time. Raises `QueryError` if the text is not a time, or not one of this map."""
        return parse_time(text, self.spans)

    def parse_ns(self, text: str) -> int:
        """The stamp of a written time (see `parse`)."""
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
        """Whether all traversals with wall time lie within the same day."""
        with_wall_time = [span for span in self.spans if span.has_wall_time]
        ends_ns = [end_ns for span in with_wall_time for end_ns in (span.recording_start_ns, span.recording_end_ns)]
        return len({stamp_to_datetime(end_ns).date() for end_ns in ends_ns}) == 1


def clock_of(reader: MapReader) -> Clock:
    """The clock of a map."""
    return Clock(traversal_spans(reader.traversals))
