"""The times of questions: which states they select, and between which two time points changes are asked for.

Days are those of the recordings' own clocks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime, time, timedelta

from supermap_cli.errors import QueryError
from supermap_cli.language.times import (
    Ago,
    AtClock,
    AtEvent,
    Before,
    BetweenTimes,
    Earlier,
    First,
    InTraversal,
    Last,
    Moment,
    Now,
    OnDay,
    Since,
    Time,
    Within,
)
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredTraversal
from supermap_cli.query.answering.phrases import WEEKDAYS
from supermap_cli.query.clock import Clock
from supermap_cli.query.time_points import TimePoint, find_traversal, parse_time_point, traversal_end, traversal_list
from supermap_cli.query.time_selector import TimeSelector
from supermap_cli.query.traversal_spans import (
    SECOND_NS,
    TraversalSpan,
    checked_stamp,
    datetime_to_stamp,
    stamp_to_datetime,
)

PARTS_OF_DAY_H = {"morning": (5, 12), "afternoon": (12, 18), "evening": (18, 22), "night": (22, 29)}
"""Hours of the day, by the recordings' clocks; a night ends on the next day. Chosen."""


@dataclass(frozen=True)
class MomentSpan:
    """The interval [low_ns, high_ns] of map time that a moment covers, in words; `traversal` if it is one; `note` tells
    how it was understood; `event_of` is the id of the thing that an event happened to.
    """

    text: str
    low_ns: int
    high_ns: int
    traversal: StoredTraversal | None = None
    note: str | None = None
    event_of: str | None = None

    def end(self) -> TimePoint:
        """Its end as a time point."""
        if self.traversal is not None:
            return traversal_end(self.traversal)
        return TimePoint(self.text, self.high_ns, self.high_ns, note=self.note)


EventSpan = Callable[[AtEvent], MomentSpan]
"""When something happened to things: found by whoever can find things."""


@dataclass(frozen=True)
class QuestionTimes:
    """Understands the times of questions to one map."""

    reader: MapReader
    clock: Clock
    event_span: EventSpan

    def selector(  # noqa: PLR0911 - one case a kind of time
        self, asked: Time | None, *, past: bool
    ) -> TimeSelector:
        """The states that a time selects; without words for one: the current ones, or the last ones in the past tense.

        Raises `QueryError` for an unknown traversal or time, or a day on which nothing was recorded.
        """
        match asked:
            case None:
                return self.selector(Last() if past else Now(), past=past)
            case Now():
                return TimeSelector("now", "now", low_ns=self.reader.now_ns)
            case Earlier():
                return TimeSelector("earlier", "earlier", high_ns=self.earlier_ns)
            case First():
                return TimeSelector("first", "first")
            case Last():
                return TimeSelector("last", "last")
            case Before(moment):
                span = self.moment(moment)
                return TimeSelector("earlier", f"before {span.text}", high_ns=span.low_ns, note=span.note)
            case AtClock() | Ago():
                point = self.moment(asked)
                return TimeSelector("at", f"at {point.text}", point.low_ns, point.low_ns, note=point.note)
            case _:
                return self._during(asked)

    def _during(self, asked: Time) -> TimeSelector:
        """The states seen in a traversal or an interval."""
        span = self.interval(asked)
        if span.traversal is not None:
            traversal = span.traversal
            text = f"in {traversal.name}"
            return TimeSelector("traversal", text, traversal.start_ns, traversal.end_ns, traversal, span.note)
        return TimeSelector("during", span.text, span.low_ns, span.high_ns, note=span.note)

    def interval(self, asked: Time) -> MomentSpan:  # noqa: PLR0911 - one case a kind of time
        """The interval of map time that a time covers."""
        match asked:
            case Since(moment):
                span = self.moment(moment)
                return MomentSpan(f"since {span.text}", span.high_ns + 1, self.end_ns, note=span.note)
            case Before(moment):
                span = self.moment(moment)
                return MomentSpan(f"before {span.text}", self.clock.origin_ns, span.low_ns - 1, note=span.note)
            case BetweenTimes(first, second):
                one, other = sorted((self.moment(first), self.moment(second)), key=lambda span: span.low_ns)
                notes = "; ".join(note for note in (one.note, other.note) if note) or None
                return MomentSpan(f"between {one.text} and {other.text}", one.low_ns, other.high_ns, note=notes)
            case Within(seconds, from_start):
                return self._within(seconds, from_start=from_start)
            case Earlier():
                return MomentSpan("earlier", self.clock.origin_ns, self.earlier_ns - 1)
            case AtEvent():
                span = self.moment(asked)
                return replace(span, text=f"when {span.text}")
            case _:
                return self.moment(asked)

    def moment(self, moment: Moment) -> MomentSpan:  # noqa: PLR0911 - one case a kind of moment
        """The interval that a moment covers."""
        match moment:
            case InTraversal(name):
                traversal = self._traversal(name)
                return _span_of(traversal)
            case AtClock(written):
                point = parse_time_point(written, self.reader, self.clock)
                if point.traversal is not None:
                    return _span_of(point.traversal)
                return MomentSpan(point.text, point.at_ns, point.at_ns, note=point.note)
            case OnDay():
                return self._day(moment)
            case AtEvent():
                return self.event_span(moment)
            case Ago(seconds):
                at_ns = self.end_ns - round(min(seconds, 1e9) * SECOND_NS)
                note = f"counted back from the map's end, {self.clock.text(self.end_ns)}"
                return MomentSpan(self.clock.text(at_ns), at_ns, at_ns, note=note)
            case First():
                return _span_of(self._traversal("first"))
            case Last():
                return _span_of(self._traversal("last"))
            case Now():
                return MomentSpan("now", self.end_ns, self.end_ns)

    @property
    def end_ns(self) -> int:
        """The end of the map."""
        return max(self.reader.now_ns, *(traversal.end_ns for traversal in self.reader.traversals), 0)

    @property
    def earlier_ns(self) -> int:
        """The start of the latest traversal; with one traversal, its end."""
        starts = sorted(traversal.start_ns for traversal in self.reader.traversals)
        return starts[-1] if len(starts) > 1 else self.reader.now_ns

    def _traversal(self, name: str) -> StoredTraversal:
        if name == "previous" and len(self.reader.traversals) > 1:
            return self.reader.traversals[-2]
        return find_traversal(self.reader.traversals, name)

    def _within(self, seconds: float, *, from_start: bool) -> MomentSpan:
        """The last, or first, seconds of the map."""
        length_ns = round(min(seconds, 1e9) * SECOND_NS)
        start_ns = self.clock.origin_ns
        if from_start:
            return MomentSpan(f"in the first {_duration(seconds)}", start_ns, min(start_ns + length_ns, self.end_ns))
        low_ns = max(start_ns, self.end_ns - length_ns)
        note = f"counted back from the map's end, {self.clock.text(self.end_ns)}"
        return MomentSpan(f"in the last {_duration(seconds)}", low_ns, self.end_ns, note=note)

    def _day(self, asked: OnDay) -> MomentSpan:
        """The part of the map that was recorded on a day."""
        spans = [span for span in self.clock.spans if span.has_wall_time]
        if not spans:
            raise QueryError(
                f"the recordings carry no wall time, so nothing tells which of them were made on '{asked.day}'",
                cure=f"name a traversal: {traversal_list(self.reader.traversals)}",
            )
        day = _date_of(asked.day, spans)
        first_h, last_h = (0, 24) if asked.part is None else PARTS_OF_DAY_H[asked.part]
        midnight = datetime.combine(day, time(), tzinfo=UTC)
        low_ns, high_ns = (datetime_to_stamp(midnight + timedelta(hours=hour)) for hour in (first_h, last_h))
        found = [span for span in spans if span.recording_start_ns < high_ns and span.recording_end_ns >= low_ns]
        part = "" if asked.part is None else f", {asked.part} ({first_h}:00 to {last_h % 24}:00)"
        if not found:
            recorded = ", ".join(f"{span.name} on {_days_text(span)}" for span in spans)
            raise QueryError(f"nothing was recorded on {day:%A}, {day}{part}", cure=f"the map holds {recorded}")
        names = " and ".join(span.name for span in found)
        note = f"'{asked.day}' is {day:%A}, {day}{part}, by the recordings' own clock (UTC): {names}"
        whole = len(found) == 1 and found[0].recording_start_ns >= low_ns and found[0].recording_end_ns < high_ns
        if whole:
            return _span_of(self._traversal(found[0].name), note)
        starts = [max(span.recording_start_ns, low_ns) + span.shift_ns for span in found]
        ends = [min(span.recording_end_ns, high_ns - 1) + span.shift_ns for span in found]
        return MomentSpan(f"on {day:%A}, {day}{part}", min(starts), max(ends), note=note)


def _span_of(traversal: StoredTraversal, note: str | None = None) -> MomentSpan:
    end = traversal_end(traversal)
    return MomentSpan(traversal.name, traversal.start_ns, end.at_ns, traversal, note)


def _date_of(day: str, spans: list[TraversalSpan]) -> date:
    """The date of a day's name: a weekday is the latest one that was recorded, else the latest before the map's end."""
    newest = max(stamp_to_datetime(span.recording_end_ns).date() for span in spans)
    wanted = day.casefold()
    if wanted == "today":
        return newest
    if wanted == "yesterday":
        return newest - timedelta(days=1)
    if wanted in WEEKDAYS:
        weekday = WEEKDAYS.index(wanted)
        recorded = [day for span in spans for day in span.days() if day.weekday() == weekday]
        return max(recorded, default=newest - timedelta(days=(newest.weekday() - weekday) % 7))
    try:
        found = date.fromisoformat(wanted)
    except ValueError as error:
        raise QueryError(f"'{day}' is no day", cure="say 'on monday', 'yesterday', or '2026-01-05'") from error
    checked_stamp(datetime_to_stamp(datetime.combine(found, time(), tzinfo=UTC)), day)
    return found


def _days_text(span: TraversalSpan) -> str:
    days = span.days()
    return f"{days[0]}" if len(days) == 1 else f"{days[0]} to {days[-1]}"


def _duration(seconds: float) -> str:
    """A length of time as it is said."""
    for unit, length_s in (("hour", 3600.0), ("minute", 60.0)):
        if seconds >= length_s and math.isclose(seconds % length_s, 0.0):
            number = round(seconds / length_s)
            return unit if number == 1 else f"{number} {unit}s"
    return f"{seconds:g} seconds"
