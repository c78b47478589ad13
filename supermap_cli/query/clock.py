"""Sensor time for people: as the recordings' own clocks have it, so that a frame can be found in its recording.

UTC where a recording carries wall time, else seconds from its start. The map's time goes forward in the order of
building; where a traversal's clock is behind that (`traversal.clock_shift_ns`), or another's shows the same, its times
are named after it: "tuesday@2026-01-05T10:21:07.3Z". So are times without a date, where there is more than one
traversal: "tuesday+12.3s". What is printed may be said in a question, and means the same there (`written_times`).
"""

from __future__ import annotations

from dataclasses import dataclass

from supermap_cli.memory.reading import MapReader
from supermap_cli.query.time_parsing import ReadTime, is_time_of_day, read_time
from supermap_cli.query.traversal_spans import Stretch, moment_of_stamp, stretch_at, stretches_of

__all__ = ["Clock", "clock_of", "is_time_of_day"]


@dataclass(frozen=True)
class Clock:
    """`stretches` are the map's traversals in the order of building."""

    stretches: tuple[Stretch, ...]

    @property
    def origin_ns(self) -> int:
        """The earliest time of the map."""
        return min((span.start_ns for span in self.stretches), default=0)

    def text(self, stamp_ns: int | None) -> str:
        """A time in words, "-" for none."""
        return "-" if stamp_ns is None else self._written(stamp_ns, brief=False)

    def brief(self, stamp_ns: int | None) -> str:
        """A time for a table: without the date, where the whole map is of one day."""
        return "-" if stamp_ns is None else self._written(stamp_ns, brief=True)

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

    def read(self, text: str) -> ReadTime:
        """What a written time means. Raises `QueryError` for what is no time, or none that the map has."""
        return read_time(text, self.stretches)

    def parse(self, text: str) -> int:
        """The stamp of a written time (see `read`)."""
        return self.read(text).stamp_ns

    def _written(self, stamp_ns: int, *, brief: bool) -> str:
        stretch = stretch_at(self.stretches, stamp_ns)
        own_ns = stamp_ns - stretch.shift_ns
        if not stretch.has_wall_time:
            seconds = (own_ns - stretch.own_start_ns) / 1e9
            return f"{seconds:.1f} s" if len(self.stretches) < 2 else f"{stretch.name}{seconds:+.1f}s"
        written = f"{moment_of_stamp(own_ns):%Y-%m-%dT%H:%M:%S}.{own_ns % 10**9 // 10**8}Z"
        if brief and self._of_one_day:
            written = written[11:]
        elif brief:
            written = f"{moment_of_stamp(own_ns):%Y-%m-%d %H:%M:%SZ}"
        named = stretch.shift_ns or any(span.has(own_ns) for span in self.stretches if span is not stretch)
        return f"{stretch.name}@{written}" if named else written

    @property
    def _of_one_day(self) -> bool:
        """Whether all that has a date is of the same one."""
        dated = [span for span in self.stretches if span.has_wall_time]
        ends_ns = [end_ns for span in dated for end_ns in (span.own_start_ns, span.own_end_ns)]
        return len({moment_of_stamp(end_ns).date() for end_ns in ends_ns}) == 1


def clock_of(reader: MapReader) -> Clock:
    """The clock of a map."""
    return Clock(stretches_of(reader.traversals))
