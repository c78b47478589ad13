"""The times of questions: moments, and the stretches of time before, after and between them.

They are read by the recordings' own clock; what each means on a map is for `query` to say.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from supermap_cli.language.questions import Things

Event = Literal["appeared", "disappeared", "moved", "changed", "returned", "seen"]


@dataclass(frozen=True)
class Now:
    """As of the end of the map."""


@dataclass(frozen=True)
class Earlier:
    """Before the latest traversal; with one traversal, before its end."""


@dataclass(frozen=True)
class First:
    """When a thing was first seen."""


@dataclass(frozen=True)
class Last:
    """When a thing was last seen, whether or not it still stands there."""


@dataclass(frozen=True)
class InTraversal:
    """A traversal by its name, its number, "first", "last" or "previous"."""

    name: str


@dataclass(frozen=True)
class AtClock:
    """A written time ("10:21", "2026-01-05T10:21:00Z", "12 s", "monday@10:21"), see `query.time_parsing`."""

    written: str


@dataclass(frozen=True)
class OnDay:
    """A day of the recordings' own clock: a weekday's name (the latest one), "today" (the day of the map's end),
    "yesterday", or a date (ISO 8601); and a part of it.
    """

    day: str
    part: Literal["morning", "afternoon", "evening", "night"] | None = None


@dataclass(frozen=True)
class AtEvent:
    """When something happened to a thing: "since the plant went"."""

    things: Things
    event: Event


@dataclass(frozen=True)
class Ago:
    """A moment `seconds` before the map's end: "five minutes ago"."""

    seconds: float


Moment = InTraversal | AtClock | OnDay | AtEvent | Ago | Now | First | Last


@dataclass(frozen=True)
class Before:
    """Before a moment: its beginning."""

    moment: Moment


@dataclass(frozen=True)
class Since:
    """After, or since, a moment: from its end ("since monday": from the end of monday's traversal) to now."""

    moment: Moment


@dataclass(frozen=True)
class BetweenTimes:
    """Between two moments."""

    first: Moment
    second: Moment


@dataclass(frozen=True)
class Within:
    """In the last `seconds` before the map's end; in the first ones after its start if `from_start`."""

    seconds: float
    from_start: bool = False


Time = (
    Now
    | Earlier
    | First
    | Last
    | InTraversal
    | AtClock
    | OnDay
    | AtEvent
    | Ago
    | Before
    | Since
    | BetweenTimes
    | Within
)
