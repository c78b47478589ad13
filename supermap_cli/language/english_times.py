"""Times of questions as English phrases."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from supermap_cli.language import times

if TYPE_CHECKING:
    from supermap_cli.language.questions import Things

Phrase = Callable[["Things"], str]


def time_in_english(time: times.Time, phrase: Phrase) -> str:  # noqa: C901, PLR0911 - one case a kind of time
    """A time as it ends a question; `phrase` writes a noun phrase."""
    match time:
        case times.Now():
            return "now"
        case times.Earlier():
            return "earlier"
        case times.First():
            return "at first"
        case times.Last():
            return "last"
        case times.Before(moment):
            return f"before {_moment(moment, phrase)}"
        case times.Since(moment):
            return f"since {_moment(moment, phrase)}"
        case times.BetweenTimes(first, second):
            return f"between {_moment(first, phrase)} and {_moment(second, phrase)}"
        case times.Within(seconds, from_start):
            return f"in the {'first' if from_start else 'last'} {seconds:.10g} seconds"
        case times.InTraversal() | times.OnDay():
            return f"on {_moment(time, phrase)}"
        case times.AtClock():
            return f"at {_moment(time, phrase)}"
        case times.AtEvent():
            return f"when {_moment(time, phrase)}"
        case times.Ago():
            return _moment(time, phrase)


def _moment(moment: times.Moment, phrase: Phrase) -> str:  # noqa: PLR0911 - one case a kind
    match moment:
        case times.InTraversal(name):
            return _traversal(name)
        case times.AtClock(written):
            return written
        case times.OnDay(day, part):
            return _day(day, part)
        case times.AtEvent(things, event):
            return f"{phrase(things)} {'was seen' if event == 'seen' else event}"
        case times.Ago(seconds):
            return f"{seconds:.10g} seconds ago"
        case times.Now():
            return "now"
        case times.First():
            return "the beginning"
        case times.Last():
            return "the end"


def _traversal(name: str) -> str:
    if name in {"first", "last", "previous"}:
        return f"the {name} run"
    return f"run {name}" if name.isdecimal() else name


def _day(day: str, part: str | None) -> str:
    return day if part is None else f"{day} {part}"
