"""Parses written times: "10:21", "2026-01-05T10:21:00Z", "12 s"; with a traversal "monday@10:21", "monday+12s".

A time is by the recordings' own clocks. Where several traversals have that time, the newest one is taken, with a note.
Seconds without a traversal count from the map's start.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, time

from supermap_cli.errors import QueryError
from supermap_cli.query.traversal_spans import (
    SECOND_NS,
    TraversalSpan,
    checked_stamp,
    datetime_to_stamp,
    stamp_to_datetime,
)

TRAVERSAL_TIME_SUFFIX = re.compile(r"@\d[\d:.tTzZ-]*s?|[+-]\d[\d.]*s?")
"""What may follow a traversal's name in a time: "@10:21", "@2026-01-05T10:21:00Z", "+12.5s"."""


@dataclass(frozen=True)
class ParsedTime:
    """A time in map time, and an optional note on how it was understood."""

    stamp_ns: int
    note: str | None = None


def parse_time(text: str, spans: Sequence[TraversalSpan]) -> ParsedTime:
    """The map time of a written time. Raises `QueryError` if the text is not a time, or not one of this map."""
    written = " ".join(text.split())
    try:
        named = _split_traversal(written, spans)
        if named is not None:
            parsed = ParsedTime(_time_in_span(*named, spans))
        else:
            parsed = _parse_wall_time(written, spans) if ":" in written else _parse_seconds(written, spans)
    except ValueError as error:
        raise QueryError(f"'{text}' is no time", cure=_format_hint(spans)) from error
    checked_stamp(parsed.stamp_ns, text)
    return parsed


def is_time_of_day(text: str) -> bool:
    """Whether a written time has no date."""
    return ":" in text and "T" not in text.upper()


def names_traversal(text: str, spans: Sequence[TraversalSpan]) -> bool:
    """Whether a written time is prefixed with a traversal."""
    return _split_traversal(text, spans) is not None


def _split_traversal(written: str, spans: Sequence[TraversalSpan]) -> tuple[TraversalSpan, str] | None:
    """The traversal (name, number, "first" or "last") that a time is prefixed with, and the rest of the text."""
    names = {str(span.number): span for span in spans}
    if spans:
        names |= {"first": spans[0], "last": spans[-1]}
    names |= {span.name.casefold(): span for span in spans}
    for name in sorted(names, key=len, reverse=True):
        if written.casefold().startswith(name) and TRAVERSAL_TIME_SUFFIX.fullmatch(written[len(name) :]):
            return names[name], written[len(name) :]
    return None


def _time_in_span(span: TraversalSpan, rest: str, spans: Sequence[TraversalSpan]) -> int:
    """The map time of "@10:21", "@2026-01-05T10:21:00Z" or "+12s" in one traversal."""
    if ":" not in rest:
        return span.start_ns + _parse_duration_ns(rest.removeprefix("@"))
    if not span.has_wall_time:
        raise QueryError(f"{span.name} has no wall time", cure=f"say 'at {span.name}+12s'")
    stamps_ns = _wall_time_stamps(rest[1:], span.days())
    inside_ns = [
        max(stamp_ns, span.recording_start_ns) for stamp_ns in stamps_ns if span.contains(stamp_ns, _precision_ns(rest))
    ]
    return _to_map_time(span, (inside_ns or stamps_ns)[0], spans)


def _parse_seconds(written: str, spans: Sequence[TraversalSpan]) -> ParsedTime:
    """Seconds from the map's start."""
    after_ns = _parse_duration_ns(written)
    if not spans:
        return ParsedTime(after_ns)
    stamp_ns = spans[0].start_ns + after_ns
    offset = f"{after_ns / 1e9:+g}s"
    others = [span.name for span in spans[1:] if 0 <= after_ns <= span.end_ns - span.start_ns]
    if not others:
        return ParsedTime(stamp_ns)
    return ParsedTime(
        stamp_ns, f"{written} counts from the map's start; of another traversal say '{others[-1]}{offset}'"
    )


def _parse_wall_time(written: str, spans: Sequence[TraversalSpan]) -> ParsedTime:
    """A time of day or a date: in the newest traversal that has it, else by the clock of the last one before it."""
    with_wall_time = [span for span in spans if span.has_wall_time]
    if not with_wall_time:
        _wall_time_stamps(written, [date(1970, 1, 1)])
        raise QueryError("the recordings carry no wall time", cure=_format_hint(spans))
    matches = [
        (span, max(recording_ns, span.recording_start_ns))
        for span in with_wall_time
        for recording_ns in _wall_time_stamps(written, span.days())
        if span.contains(recording_ns, _precision_ns(written))
    ]
    if matches:
        span, recording_ns = matches[-1]
        matching = list(dict.fromkeys(span for span, _ in matches))
        others = ", ".join(f"'{span.name}@{written}'" for span in matching[:-1])
        note = f"{written} was taken as that of {span.name}; say {others} for another" if others else None
        return ParsedTime(_to_map_time(span, recording_ns, spans), note)
    newest_day = max(stamp_to_datetime(span.recording_end_ns).date() for span in with_wall_time)
    (recording_ns,) = _wall_time_stamps(written, [newest_day])
    started = [span for span in with_wall_time if span.recording_start_ns <= recording_ns] or with_wall_time[:1]
    return ParsedTime(_to_map_time(started[-1], recording_ns, spans))


def _to_map_time(span: TraversalSpan, recording_ns: int, spans: Sequence[TraversalSpan]) -> int:
    """A recording time in map time, limited to before the start of the next traversal."""
    later = [other.start_ns for other in spans if other.number > span.number]
    return min([recording_ns + span.shift_ns, *(start_ns - 1 for start_ns in later[:1])])


def _wall_time_stamps(written: str, days: Sequence[date]) -> list[int]:
    """The stamps of a wall time; one per day if it has no date."""
    if not is_time_of_day(written):
        date_time = datetime.fromisoformat(written.upper().removesuffix("Z")).replace(tzinfo=UTC)
        return [checked_stamp(datetime_to_stamp(date_time), written)]
    of_day = time.fromisoformat(written.upper().removesuffix("Z").rjust(len("10:21"), "0")).replace(tzinfo=UTC)
    return [datetime_to_stamp(datetime.combine(day, of_day)) for day in days]


def _precision_ns(written: str) -> int:
    """The precision of a written time: a minute for "10:21", a second for "10:21:07"."""
    if "." in written:
        return 1
    return 60 * SECOND_NS if written.count(":") == 1 else SECOND_NS


def _parse_duration_ns(written: str) -> int:
    seconds = float(written.casefold().removesuffix("seconds").removesuffix("s"))
    if not abs(seconds) < 1e9:
        raise ValueError("not a number of seconds")
    return round(seconds * SECOND_NS)


def _format_hint(spans: Sequence[TraversalSpan]) -> str:
    name = spans[-1].name if spans else "monday"
    return (
        f"say 'at 10:21', 'at 2026-01-05T10:21:00Z' or 'at 12 s'; of one traversal 'at {name}@10:21' or 'at {name}+12s'"
    )
