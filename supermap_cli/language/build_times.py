"""Times and events: the values of those rules of the grammars."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast, get_args

from supermap_cli.language import questions as tree
from supermap_cli.language import times
from supermap_cli.language.build_things import Happening
from supermap_cli.language.forest import NoReading, Word
from supermap_cli.language.parts import Duration, maybe, of_type, only, words

SECONDS = {"SECOND": 1.0, "MINUTE": 60.0, "HOUR": 3600.0, "DAY": 86400.0, "WEEK": 604800.0}
_MOMENTS = get_args(times.Moment)


@dataclass(frozen=True)
class AtStart(times.InTraversal):
    """At the start of the map, until it is known what is asked of it."""


class BuildTimes:
    """Functions named like rules and aliases of the grammars; each takes the values of the rule's parts."""

    def now(self, _parts: list[Any]) -> times.Now:
        return times.Now()

    def earlier(self, _parts: list[Any]) -> times.Earlier:
        return times.Earlier()

    def first(self, _parts: list[Any]) -> times.First:
        return times.First()

    def at_start(self, _parts: list[Any]) -> AtStart:
        return AtStart("first")

    def last(self, _parts: list[Any]) -> times.Last:
        return times.Last()

    def before(self, parts: list[Any]) -> times.Before:
        return times.Before(_moment(parts))

    def since(self, parts: list[Any]) -> times.Since:
        moment = _moment(parts)
        if moment == times.InTraversal(
            "last"
        ):  # now is in the last one: "since the last visit" is since the one before
            moment = times.InTraversal("previous")
        return times.Since(moment)

    def between_times(self, parts: list[Any]) -> times.BetweenTimes:
        first, second = (part for part in parts if isinstance(part, _MOMENTS))
        return times.BetweenTimes(cast("times.Moment", first), cast("times.Moment", second))

    def within_last(self, parts: list[Any]) -> times.Within:
        return times.Within(only(parts, Duration).seconds)

    def within_first(self, parts: list[Any]) -> times.Within:
        return times.Within(only(parts, Duration).seconds, from_start=True)

    def ago(self, parts: list[Any]) -> times.Ago:
        return times.Ago(only(parts, Duration).seconds)

    def duration(self, parts: list[Any]) -> Duration:
        numbers = words(parts, "NUMBER")
        return Duration((float(numbers[0].value) if numbers else 1.0) * SECONDS[words(parts, *SECONDS)[0].kind])

    def clock_in(self, parts: list[Any]) -> times.AtClock:
        written = only(parts, times.AtClock).written
        if not written[:1].isdigit():
            raise NoReading
        return times.AtClock(f"{only(parts, times.InTraversal).name}@{written}")

    def seconds_into(self, parts: list[Any]) -> times.AtClock:
        seconds = only(parts, Duration).seconds
        return times.AtClock(f"{only(parts, times.InTraversal).name}+{seconds:g}s")

    def occurrence(self, parts: list[Any]) -> times.AtEvent:
        return times.AtEvent(only(parts, tree.Things), only(parts, Happening).event)

    def occurrence_seen(self, parts: list[Any]) -> times.AtEvent:
        return times.AtEvent(only(parts, tree.Things), "seen")

    def traversal(self, parts: list[Any]) -> times.InTraversal:
        word = only(parts, Word)
        names = {"LAST_ONE": "last", "PREVIOUS_ONE": "previous", "FIRST_ONE": "first"}
        if word.kind == "NUMBER" and not word.written.isdecimal():
            raise NoReading
        if word.kind in {"ORDINAL", "NUMBER"}:
            return times.InTraversal(f"{word.value:g}" if word.value != 1 or word.kind == "NUMBER" else "first")
        return times.InTraversal(names.get(word.kind, str(word.value)))

    def clock(self, parts: list[Any]) -> times.AtClock:
        return times.AtClock(str(only(parts, Word).value))

    def clock_seconds(self, parts: list[Any]) -> times.AtClock:
        return times.AtClock(f"{words(parts, 'NUMBER')[0].value:g} s")

    def clock_hour(self, parts: list[Any]) -> times.AtClock:
        hour = words(parts, "NUMBER")[0].value
        if hour != int(hour) or hour > 24:
            raise NoReading
        return times.AtClock(f"{int(hour):02d}:00")

    def noon(self, _parts: list[Any]) -> times.AtClock:
        return times.AtClock("12:00")

    def midnight(self, _parts: list[Any]) -> times.AtClock:
        return times.AtClock("00:00")

    def day(self, parts: list[Any]) -> times.OnDay:
        day = next(word for word in of_type(parts, Word) if word.kind != "DAYPART")
        part = words(parts, "DAYPART")
        named = {"TODAY": "today", "YESTERDAY": "yesterday"}.get(day.kind)
        name = named or str(day.value).removeprefix("last ")
        return times.OnDay(name, cast("Any", str(part[0].value)) if part else None)

    def this_part(self, parts: list[Any]) -> times.OnDay:
        written = str(only(parts, Word).value)
        part = "night" if written == "tonight" else written.rpartition(" ")[2]
        return times.OnDay("today", cast("Any", part))

    def last_night(self, _parts: list[Any]) -> times.OnDay:
        return times.OnDay("yesterday", "night")


def _moment(parts: list[Any]) -> times.Moment:
    found = [part for part in parts if isinstance(part, _MOMENTS)]
    if len(found) != 1 or maybe(parts, Duration) is not None:
        raise NoReading
    return cast("times.Moment", found[0])
