"""Times as people write them: "10:21", "2026-01-05T10:21:00Z", "12 s"; of one traversal "monday@10:21", "monday+12s".

A time is one by the recordings' own clocks. Several traversals may have a 10:21, or clocks that overlap: the newest
one's is meant then, and that is noted. Seconds that name no traversal count from the map's start.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, time

from supermap_cli.errors import QueryError
from supermap_cli.query.traversal_spans import SECOND_NS, Stretch, moment_of_stamp, stamp_of_moment

OF_TRAVERSAL = re.compile(r"@\d[\d:.tTzZ-]*s?|[+-]\d[\d.]*s?")
"""What may follow a traversal's name in a time: "@10:21", "@2026-01-05T10:21:00Z", "+12.5s"."""


@dataclass(frozen=True)
class ReadTime:
    """A time that was written, in the map's time, and what there is to say about how it was understood."""

    stamp_ns: int
    note: str | None = None


def read_time(text: str, stretches: Sequence[Stretch]) -> ReadTime:
    """What a written time means in a map. Raises `QueryError` for what is no time, or none that the map has."""
    written = " ".join(text.split())
    try:
        named = _named(written, stretches)
        if named is not None:
            return ReadTime(_in_stretch(*named, stretches))
        return _wall_time(written, stretches) if ":" in written else _seconds(written, stretches)
    except ValueError as error:
        raise QueryError(f"'{text}' is no time", cure=_how_to_say(stretches)) from error


def is_time_of_day(text: str) -> bool:
    """Whether a time leaves its day open."""
    return ":" in text and "T" not in text.upper()


def names_traversal(text: str, stretches: Sequence[Stretch]) -> bool:
    """Whether a time is said of one traversal."""
    return _named(text, stretches) is not None


def _named(written: str, stretches: Sequence[Stretch]) -> tuple[Stretch, str] | None:
    """The traversal that a time is said of, by name, number, "first" or "last", and the rest of it."""
    names = {str(span.number): span for span in stretches}
    if stretches:
        names |= {"first": stretches[0], "last": stretches[-1]}
    names |= {span.name.casefold(): span for span in stretches}
    for name in sorted(names, key=len, reverse=True):
        if written.casefold().startswith(name) and OF_TRAVERSAL.fullmatch(written[len(name) :]):
            return names[name], written[len(name) :]
    return None


def _in_stretch(stretch: Stretch, rest: str, stretches: Sequence[Stretch]) -> int:
    """The stamp of "@10:21", "@2026-01-05T10:21:00Z" or "+12s" in one traversal."""
    if ":" not in rest:
        return stretch.start_ns + _nanoseconds(rest.removeprefix("@"))
    if not stretch.has_wall_time:
        raise QueryError(f"{stretch.name} has no wall time", cure=f"say 'at {stretch.name}+12s'")
    moments = _moments(rest[1:], stretch.days())
    inside = [max(stamp_ns, stretch.own_start_ns) for stamp_ns in moments if stretch.has(stamp_ns, _lasting_ns(rest))]
    return _in_map(stretch, (inside or moments)[0], stretches)


def _seconds(written: str, stretches: Sequence[Stretch]) -> ReadTime:
    """Seconds from the map's start."""
    after_ns = _nanoseconds(written)
    if not stretches:
        return ReadTime(after_ns)
    stamp_ns = stretches[0].start_ns + after_ns
    said = f"{after_ns / 1e9:+g}s"
    others = [span.name for span in stretches[1:] if 0 <= after_ns <= span.end_ns - span.start_ns]
    if not others:
        return ReadTime(stamp_ns)
    return ReadTime(stamp_ns, f"{written} counts from the map's start; of another traversal say '{others[-1]}{said}'")


def _wall_time(written: str, stretches: Sequence[Stretch]) -> ReadTime:
    """A time of day or a date: of the newest traversal that has it, else by the clock that was read last before it."""
    dated = [span for span in stretches if span.has_wall_time]
    if not dated:
        _moments(written, [date(1970, 1, 1)])
        raise QueryError("the recordings carry no wall time", cure=_how_to_say(stretches))
    found = [
        (stretch, max(own_ns, stretch.own_start_ns))
        for stretch in dated
        for own_ns in _moments(written, stretch.days())
        if stretch.has(own_ns, _lasting_ns(written))
    ]
    if found:
        stretch, own_ns = found[-1]
        fitting = list(dict.fromkeys(span for span, _ in found))
        others = ", ".join(f"'{span.name}@{written}'" for span in fitting[:-1])
        note = f"{written} was taken as that of {stretch.name}; say {others} for another" if others else None
        return ReadTime(_in_map(stretch, own_ns, stretches), note)
    newest_day = max(moment_of_stamp(span.own_end_ns).date() for span in dated)
    (own_ns,) = _moments(written, [newest_day])
    begun = [span for span in dated if span.own_start_ns <= own_ns] or dated[:1]
    return ReadTime(_in_map(begun[-1], own_ns, stretches))


def _in_map(stretch: Stretch, own_ns: int, stretches: Sequence[Stretch]) -> int:
    """A time by a traversal's clock in the map's time, of which it has no more after the next one has begun."""
    later = [span.start_ns for span in stretches if span.number > stretch.number]
    return min([own_ns + stretch.shift_ns, *(start_ns - 1 for start_ns in later[:1])])


def _moments(written: str, days: Sequence[date]) -> list[int]:
    """The stamps that a wall time stands for: on each of the days, if it leaves its day open."""
    if not is_time_of_day(written):
        return [stamp_of_moment(datetime.fromisoformat(written.upper().removesuffix("Z")).replace(tzinfo=UTC))]
    of_day = time.fromisoformat(written.upper().removesuffix("Z").rjust(len("10:21"), "0")).replace(tzinfo=UTC)
    return [stamp_of_moment(datetime.combine(day, of_day)) for day in days]


def _lasting_ns(written: str) -> int:
    """How much is meant: by "10:21" a minute, by "10:21:07" a second."""
    if "." in written:
        return 1
    return 60 * SECOND_NS if written.count(":") == 1 else SECOND_NS


def _nanoseconds(written: str) -> int:
    seconds = float(written.casefold().removesuffix("seconds").removesuffix("s"))
    if not abs(seconds) < 1e9:
        raise ValueError("not a number of seconds")
    return round(seconds * SECOND_NS)


def _how_to_say(stretches: Sequence[Stretch]) -> str:
    name = stretches[-1].name if stretches else "monday"
    return (
        f"say 'at 10:21', 'at 2026-01-05T10:21:00Z' or 'at 12 s'; of one traversal 'at {name}@10:21' or 'at {name}+12s'"
    )
